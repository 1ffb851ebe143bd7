use asperity_node::{Buffer, FactValue, FrameLayout, FrameRate, ParamValue, Shape, Status, random};
use asperity_texture::{Model, Range};

use crate::bench::Alone;

const MODELS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/models/surfaces/");

/// Forces, velocities and a material.
type Asked = ([f64; 10], [f64; 20], f64);

/// The network with two materials.
fn network(precision: &str, executor: &str) -> Alone {
    let file = |name: &str| ParamValue::File(format!("{MODELS}{name}").into());
    let text = |text: &str| ParamValue::Text(text.into());
    let set = [
        ("model", file("texture.onnx")),
        ("library", file("materials.ron")),
        ("material", text("canvas")),
        ("materials", ParamValue::Texts(vec!["oak".into()])),
        ("precision", text(precision)),
        ("executor", text(executor)),
    ];
    let frame_rate = FrameRate::new(500, 1).unwrap();
    let frames = Shape::Magnitude(FrameLayout { rate_hz: 2500, length: 250, bins: 101, frame_rate });
    let control = |count| Shape::Control { count };
    let outputs = [frames, frames, control(2), control(asperity_dsp::shaped_noise::PATTERN_LEN)];
    let inputs = [10, 20, 1].map(control);
    Alone::new("texture_network", &set, (500, 1, 48_000), &inputs, &outputs).unwrap()
}

/// The bits of the output frame of a tick.
fn ask(it: &mut Alone, tick: u64, (force, velocity, material): &Asked) -> Vec<u32> {
    let inputs = [&force[..], &velocity[..], &[*material]];
    inputs.iter().enumerate().for_each(|(input, values)| it.give(input, values, true));
    assert_eq!(it.tick(tick).0, Status::Continue);
    let Buffer::Magnitude { bins, frame, .. } = &it.outputs[0] else { panic!("a frame") };
    assert_eq!(*frame, Some((tick, 5 * tick)));
    bins.iter().map(|x| x.to_bits()).collect()
}

fn count(it: &mut Alone, name: &str) -> u64 {
    match it.node().facts().iter().find(|f| f.name == name).map(|f| &f.value) {
        Some(FactValue::Count(n)) => *n,
        other => panic!("{name}: {other:?}"),
    }
}

/// Motions that stand still now and then. From one to the next they differ in one bit, in the sign of a zero,
/// or in values that are out of range or not a number.
fn script() -> Vec<Asked> {
    let mut asked: Asked = ([1.0; 10], [0.0; 20], 0.0);
    let unit = |k: u64| random::uniform(7, k);
    let mut script = Vec::new();
    for k in 0..400_u64 {
        let at = (unit(6 * k) * 10.0) as usize;
        match (unit(6 * k + 1) * 12.0) as u32 {
            0 => asked.0[at] = 3.0 * unit(6 * k + 2),
            1 => asked.1[at] = 200.0 * unit(6 * k + 2) - 100.0,
            // The next f32.
            2 => asked.0[9] = f64::from(f32::from_bits((asked.0[9] as f32).to_bits() + 1)),
            3 => asked.1[at + 10] = -asked.1[at + 10],
            4 => asked.2 = 1.0 - asked.2.clamp(0.0, 1.0),
            // No other material, and less than an f32 can say.
            5 => asked.2 += 0.2,
            6 => asked.1[at] *= 1.0 + 1e-12,
            7 => asked.0[at] = [f64::NAN, f64::INFINITY, 35.0, -1.0, 36.0][at / 2],
            8 => asked.1[at] = [f64::NAN, f64::NEG_INFINITY, 1e200, 1e-300, 5000.0][at / 2],
            _ => {}
        }
        script.push(asked);
    }
    script
}

#[test]
fn repeated_input_gives_the_networks_own_output() {
    asperity_texture::run_graphs_by(asperity_tract::compile);
    for (precision, executor) in [("f32", "auto"), ("int8", "auto"), ("f64", "auto"), ("f32", "tract")] {
        let [mut it, mut fresh] = [0, 1].map(|_| network(precision, executor));
        let range = Range::new(Model::load(format!("{MODELS}texture.onnx")).unwrap().trained());
        let mut held: Vec<Vec<u32>> = Vec::new();
        for (k, asked) in script().iter().enumerate() {
            if k == 200 {
                it.node().reset();
                held.push(Vec::new());
            }
            fresh.node().reset();
            let tick = k as u64;
            assert_eq!(
                ask(&mut it, tick, asked),
                ask(&mut fresh, tick, asked),
                "{precision} {executor}, frame {k}: {asked:?}"
            );
            // What the network is given, and which material.
            let (mut force, mut velocity) = ([0.0; 10], [0.0; 20]);
            range.forces(&asked.0, &mut force);
            range.velocities(&asked.1, &mut velocity);
            let material = [asked.2.round().min(1.0) as f32];
            held.push(force.iter().chain(&velocity).chain(&material).map(|x| x.to_bits()).collect());
        }
        let changes = held.windows(2).filter(|pair| pair[0] != pair[1] && !pair[1].is_empty()).count() as u64;
        assert_eq!(count(&mut it, "runs"), 1 + changes, "{precision} {executor}");
        assert_eq!(count(&mut it, "runs") + count(&mut it, "reused"), 400);
        assert!((80..320).contains(&count(&mut it, "reused")), "{}", count(&mut it, "reused"));
        assert_eq!((count(&mut fresh, "runs"), count(&mut fresh, "reused")), (400, 0));
        for name in ["force_out_of_range", "velocity_out_of_range", "bad_magnitudes"] {
            assert_eq!(count(&mut it, name), count(&mut fresh, name), "{name}");
        }
    }
}
