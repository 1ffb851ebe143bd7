//! Compares each node in double precision with the same node in single precision.

use asperity_dsp::{Complex, Stft};
use asperity_node::{Buffer, FrameLayout, FrameRate, ParamValue, Shape};
use std::f64::consts::TAU;

use crate::bench::Alone;

const RATE: u32 = 2500;
const N: usize = 250;
const BINS: usize = 101;
const FRAMES: u64 = 400;

/// Half the distance from 1 to the next f32: the largest relative rounding of one operation.
const EPS: f64 = 1.0 / (1 << 24) as f64;

/// A chirp over noise of many sines, rms about 1 each.
fn signal(i: u64) -> f64 {
    let t = i as f64 / f64::from(RATE);
    let sine = |k: u32| (TAU * (f64::from(k * k % 97) * 9.7 * t) + f64::from(k * k)).sin();
    (TAU * (90.0 + 100.0 * t) * t).sin() + (1..60).map(sine).sum::<f64>() / 30f64.sqrt()
}

/// A node of these parameters, with the signals that its kind takes and gives.
fn node(kind: &str, set: &[(&str, ParamValue)]) -> Alone {
    let frame_rate = FrameRate::new(500, 1).unwrap();
    let layout = FrameLayout { rate_hz: RATE, length: N as u32, bins: BINS as u32, frame_rate };
    let (magnitude, spectrum) = (Shape::Magnitude(layout), Shape::Spectrum(layout));
    let audio = |rate_hz| Shape::Audio { rate_hz };
    let (takes, gives) = match kind {
        "overlap_add" => (spectrum, audio(RATE)),
        "resample" => (audio(RATE), audio(48_000)),
        "oscillator_bank" | "sample_commit" => (magnitude, audio(RATE)),
        _ => (magnitude, spectrum),
    };
    Alone::new(kind, set, (500, 1, 48_000), &[takes], &[gives]).unwrap()
}

/// Output of a node over all ticks, where `before` stands between it and the magnitudes of [`signal`].
fn run(before: &[&str], kind: &str, set: &[(&str, ParamValue)]) -> Vec<Complex<f64>> {
    let mut nodes: Vec<Alone> = before.iter().map(|kind| node(kind, &[])).collect();
    nodes.push(node(kind, set));
    let mut stft = Stft::<f64>::new(N);
    let mut all = Vec::new();
    for tick in 0..FRAMES {
        let cut: Vec<f64> = (tick * 5..tick * 5 + N as u64).map(signal).collect();
        let bins = stft.process(&cut).iter().take(BINS).map(|c| c.norm() as f32).collect();
        let mut signal = Buffer::Magnitude { bins, frame: Some((tick, tick * 5)), valid: true };
        for node in &mut nodes {
            node.inputs[0] = signal;
            node.tick(tick);
            signal = node.outputs[0].clone();
        }
        match signal {
            Buffer::Audio { samples, len, .. } => {
                all.extend(samples[..len].iter().map(|y| Complex::new(f64::from(*y), 0.0)));
            }
            Buffer::Spectrum { bins, .. } => {
                all.extend(bins.iter().map(|c| Complex::new(f64::from(c.re), f64::from(c.im))));
            }
            other => panic!("{other:?}"),
        }
    }
    all
}

/// The largest difference between values in order.
fn apart([single, double]: &[Vec<Complex<f64>>; 2]) -> f64 {
    assert_eq!(single.len(), double.len());
    single.iter().zip(double).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// The largest value.
fn peak(values: &[Complex<f64>]) -> f64 {
    values.iter().map(|y| y.norm()).fold(0.0, f64::max)
}

/// Nodes before a node, the node, its parameters, and the largest difference between the precisions, in
/// roundings of the largest value. This limit is two to four times the difference found. It is up to nine
/// times where a method works on its own earlier output: there an early rounding grows.
const NODES: [(&[&str], &str, &str, f64); 10] = [
    (&[], "phase_vocoder", "", 4.0),
    (&[], "random_phase", "", 4.0),
    (&[], "spsi", "", 30.0),
    (&[], "oscillator_bank", "", 8.0),
    (&[], "oscillator_bank", "tracked", 8.0),
    (&[], "sample_commit", "", 50_000.0),
    (&[], "sample_commit", "emission 0", 8000.0),
    (&["random_phase"], "overlap_add", "", 12.0),
    (&["phase_vocoder", "overlap_add"], "resample", "", 6.0),
    (&["phase_vocoder", "overlap_add"], "resample", "minimum", 6.0),
];

#[test]
fn double_and_single_differ_by_rounding_only() {
    for (before, kind, settings, most) in NODES {
        let both = ["f32", "f64"].map(|precision| {
            let text = |text: &str| ParamValue::Text(text.into());
            let mut set = vec![("precision", text(precision))];
            match settings {
                "tracked" => set.push(("partials", text(settings))),
                "minimum" => set.push(("phase", text(settings))),
                "emission 0" => set.push(("emission", ParamValue::Integer(0))),
                _ => {}
            }
            run(before, kind, &set)
        });
        let top = peak(&both[0]);
        assert!(top > 0.1, "{kind} {settings} is all but silent: {top}");
        let roundings = apart(&both) / (top * EPS);
        // If they were nearer, the same precision would have run twice.
        assert!((0.5..most).contains(&roundings), "{kind} {settings} is {roundings} roundings apart");
    }
}
