//! A texture network that goes wrong.

use asperity_checks::{Effort, Subject};
use asperity_graph::GraphFile;
use asperity_node::{Buffer, Fault};
use asperity_texture::Library;

use crate::{broken, called, effort, fails, graph, holds, holds_on, sounding, subject};

/// Shipped graphs that are looked at where there is time.
const SHIPPED: [&str; 4] = ["heravi2024.ron", "heravi2024_500hz.ron", "voltage_amplifier.ron", "live.ron"];
/// Those of them that are recommended: the paper's own chains pulse.
const RECOMMENDED: [&str; 3] = ["heravi2024_scatter.ron", "voltage_amplifier.ron", "live.ron"];

/// A case holds for the graph of a learned texture, for one of every effect, and for others where there is
/// time.
fn holds_for(name: &str, others: &[&str]) {
    holds_on(name, &["texture.ron", "scenes/every_effect.ron"].map(graph));
    if effort() == Effort::Long {
        for file in others {
            holds(name, &subject(Some(&graph(file))));
        }
    }
}

/// The learned texture with a limiter that is none: what comes in goes out, up to a size.
fn without_limiter(graph: &GraphFile, most: f32) -> Subject<'_> {
    broken(&subject(Some(graph)), "limiter", move |(): &mut (), tick| {
        let given = tick.inputs.audio(0);
        tick.outputs.audio(0).iter_mut().zip(given).for_each(|(y, x)| *y = x.clamp(-most, most));
    })
}

#[test]
fn network_not_finite() {
    holds_for("network_not_finite", &SHIPPED);
    // Phase retrieval that never gets over a frame of zeros, which is what the engine puts in the place of
    // a bad one.
    let graph = graph("texture.ron");
    let mutant = broken(&subject(Some(&graph)), "shaped_noise", |hurt: &mut bool, tick| {
        let frame = tick.inputs.magnitude(0).filter(|_| tick.index > 450);
        *hurt |= frame.is_some_and(|f| f.bins.iter().all(|m| *m == 0.0));
        if *hurt {
            tick.outputs.audio(0).iter_mut().for_each(|x| *x *= 0.5);
        }
    });
    fails("network_not_finite", &mutant, "the level is");
}

#[test]
fn network_huge() {
    holds_for("network_huge", &SHIPPED);
    let graph = graph("texture.ron");
    fails("network_huge", &without_limiter(&graph, 1e6), "the limiter's bound");
}

#[test]
fn network_negative() {
    holds_for("network_negative", &SHIPPED);
    // Phase retrieval that takes a negative magnitude for a mistake.
    let graph = graph("texture.ron");
    let mutant = called(&subject(Some(&graph)), "shaped_noise", |_| {
        Box::new(|node, tick| match tick.inputs.magnitude(0) {
            Some(frame) if frame.bins.iter().any(|m| *m < 0.0) => Err(Fault::Failed(3)),
            _ => node.run(tick),
        })
    });
    fails("network_negative", &mutant, "node `phase` fails");
}

#[test]
fn network_denormal() {
    holds_for("network_denormal", &SHIPPED);
    // A gain that lets nothing end.
    let graph = graph("texture.ron");
    let mutant = sounding(&subject(Some(&graph)), "gain", |y, _| {
        y.iter_mut().filter(|x| x.abs() < 1e-7).for_each(|x| *x = f32::from_bits(77));
    });
    fails("network_denormal", &mutant, "denormal numbers in the outputs of other nodes");
}

#[test]
fn network_alternates() {
    holds_for("network_alternates", &SHIPPED);
    let graph = graph("texture.ron");
    fails("network_alternates", &without_limiter(&graph, 0.5), "a step of");
}

#[test]
fn network_out_of_range() {
    holds_for("network_out_of_range", &SHIPPED);
    // A network that grows with the third power of the force.
    let graph = graph("texture.ron");
    let mutant = broken(&subject(Some(&graph)), "texture_network", |(): &mut (), tick| {
        let force = tick.inputs.control(0).iter().fold(0.0_f64, |m, f| m.max(f.abs()));
        if let Some(Buffer::Magnitude { bins, frame: Some(_), .. }) = tick.outputs.buffers().first_mut() {
            bins.iter_mut().for_each(|m| *m *= force.powi(3) as f32);
        }
    });
    fails("network_out_of_range", &mutant, "a magnitude of");
}

#[test]
fn network_steady() {
    holds_for("network_steady", &RECOMMENDED);
    // Phase retrieval of magnitudes that stand still: the signal that agrees best with them repeats.
    let mut pulsing = graph("texture.ron");
    let phase = pulsing.nodes.iter_mut().find(|node| node.id == "phase").expect("the node");
    (phase.kind, phase.params) = ("sample_commit".into(), Vec::new());
    pulsing.wires.retain(|wire| wire.to.node != "phase" || wire.from.port.is_none());
    fails("network_steady", &subject(Some(&pulsing)), "more repetition than of noise");
    // What repeats with place must not pulse either: a library of gratings alone.
    let library = Library::read(harness::graphs("models/surfaces/materials.ron")).expect("the library");
    let mut gratings = library.materials().to_vec();
    gratings.retain(|m| m.family.as_deref() == Some("grating"));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("materials.ron");
    std::fs::write(&path, Library::new(&path, None, gratings.clone()).to_ron()).expect("written");
    for set in
        [format!("texture.library={}", path.display()), format!("texture.material={}", gratings[0].name)]
    {
        pulsing.set(&set, "test").expect("a parameter");
    }
    fails("network_steady", &subject(Some(&pulsing)), "mm/s alike");
}
