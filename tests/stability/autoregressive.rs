//! Textures of autoregressive models.

use std::path::PathBuf;
use std::sync::Arc;

use asperity_autoregressive::{Filter, Texture};
use asperity_checks::{Subject, Verdict, wrap};
use asperity_diagnostics::ron;
use asperity_node::{Fault, Setup, Source, Status, random};

use crate::{case, fails, graph, holds, scene as shipped, subject};

const KIND: &str = "autoregressive";

/// The kind with something done to what it puts out, by the number of the tick.
fn after(
    subject: &Subject<'static>,
    change: impl Fn(u64, &mut [f32]) + Send + Sync + Clone + 'static,
) -> Subject<'static> {
    let kind = subject.kind(KIND).expect("the kind");
    subject.clone().with(wrap::after(kind, move |tick| {
        let index = tick.index;
        change(index, tick.outputs.audio(0));
    }))
}

/// The first texture of a node that is being made.
fn first(setup: &Setup<'_>) -> Arc<Texture> {
    let text = setup.params.texts("models").first().cloned().unwrap_or_default();
    let value = ron::parse(&Source::new(PathBuf::new(), text.as_str())).expect("a text");
    let Ok(asperity_scene::Texture::Autoregressive { model, .. }) = asperity_scene::Texture::parse(&value)
    else {
        panic!("a texture")
    };
    Arc::new(Texture::read(model).expect("a texture"))
}

/// The recursion over the signal's own past, as it stands in papers, in the place of the kind: eight samples
/// of 8 kHz hold one of 1 kHz. `filter` answers the filter at a place.
fn recursion(filter: fn(&Texture, f64, f64) -> Filter) -> Subject<'static> {
    let subject = subject(None);
    let kind = subject.kind(KIND).expect("the kind");
    let make = move |setup: &Setup<'_>| -> wrap::Process {
        let texture = first(setup);
        let mut past: Vec<f64> = vec![0.0; 64];
        let mut number = 0_u64;
        Box::new(move |_, tick| {
            let filter = filter(&texture, tick.inputs.value(1), tick.inputs.value(2));
            for samples in tick.outputs.audio(0).chunks_mut(8) {
                // Noise of deviation 1, near enough to normal.
                let unit = |i: u64| random::bits(3, 12 * number + i) as f64 / u64::MAX as f64;
                let noise = (0..12).map(unit).sum::<f64>() - 6.0;
                number += 1;
                let back: f64 = filter.ar().iter().zip(&past).map(|(a, x)| a * x).sum();
                past.rotate_right(1);
                past[0] = filter.deviation * filter.gain * noise - back;
                samples.fill(past[0] as f32);
            }
            if past[0].is_finite() { Ok(Status::Continue) } else { Err(Fault::NotFinite) }
        })
    };
    subject.with(wrap::wrap(kind, Arc::new(make)))
}

/// A mixture of coefficients: what papers warn of.
fn by_coefficients(texture: &Texture, speed: f64, force: f64) -> Filter {
    let blend = texture.triangles().at(speed, force);
    let corners =
        || blend.models.iter().zip(blend.weights).filter_map(|(m, w)| Some((texture.models().get(*m)?, w)));
    let order = texture.models()[0].ar.len();
    let ar: Vec<f64> = (0..order).map(|i| corners().map(|(m, w)| w * m.ar[i]).sum()).collect();
    let variance: f64 = corners().map(|(m, w)| w * m.variance).sum();
    Filter::new(&ar, &[], variance.sqrt())
}

#[test]
fn unstable_edges() {
    holds("unstable_edges", &subject(None));
    fails("unstable_edges", &recursion(by_coefficients), "of the edge the level is");
}

#[test]
fn poles_at_0_999() {
    let subject = subject(None);
    holds("poles_at_0_999", &subject);
    // Something of the signal stays for ever.
    let lasting = after(&subject, |_, out| out.iter_mut().for_each(|x| *x += 1e-12));
    fails("poles_at_0_999", &lasting, "not silent");
    let loud = after(&subject, |_, out| out.iter_mut().for_each(|x| *x *= 1.3));
    fails("poles_at_0_999", &loud, "the level is");
}

#[test]
fn zero_variance() {
    let subject = subject(None);
    holds("zero_variance", &subject);
    let hum = after(&subject, |tick, out| out.iter_mut().for_each(|x| *x += 1e-9 * (tick % 2) as f32));
    fails("zero_variance", &hum, "at a model without variance");
}

/// As the kind did before: each filter on the way is stable, and the walk is not.
#[test]
fn fast_walks() {
    holds("fast_walks", &subject(None));
    fails("fast_walks", &recursion(|texture, speed, force| texture.at(speed, force)), "times a second: ");
}

#[test]
fn every_vertex() {
    let subject = subject(None);
    holds("every_vertex", &subject);
    // A level that creeps: 2 dB in a quarter of a minute.
    let creeps = after(&subject, |tick, out| {
        let gain = 1.0 + (tick as f32 / 30_000.0).min(1.0);
        out.iter_mut().for_each(|x| *x *= gain);
    });
    fails("every_vertex", &creeps, "third");
}

#[test]
fn own_models() {
    let every = shipped("every_effect.ron");
    let with_models = subject(Some(&every));
    holds("own_models", &with_models);
    let kind = with_models.kind(KIND).expect("the kind");
    let loud = wrap::after(kind, |tick| tick.outputs.audio(0).iter_mut().for_each(|x| *x *= 2.0));
    fails("own_models", &with_models.clone().with(loud), "the level is");
    let without = graph("texture.ron");
    assert_eq!(case("own_models").run(&subject(Some(&without))).verdict, Verdict::NotApplicable);
}
