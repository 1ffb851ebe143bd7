//! Compares each node in double precision with the same node in single precision.

use super::*;
use asperity_dsp::{Complex, Stft};
use asperity_engine::{Engine, Options};
use asperity_graph::{GraphFile, compile};
use asperity_node::{
    Buffer, Descriptor, FrameLayout, FrameRate, LayoutSpec, Node, Output, Processor, ShapeSpec, Source,
    Status, Tick, Unit,
};
use std::f64::consts::TAU;

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

/// Amplitudes of a frame's bins.
fn magnitudes(stft: &mut Stft<f64>, frame: u64, x: impl Fn(u64) -> f64) -> Vec<f64> {
    let from = frame * 5;
    let cut: Vec<f64> = (from..from + N as u64).map(x).collect();
    stft.process(&cut).iter().take(BINS).map(|c| c.norm()).collect()
}

/// Plays the magnitudes of [`signal`].
struct Given(Stft<f64>);

impl Node for Given {
    fn descriptor() -> Descriptor {
        let frame_rate = FrameRate::new(500, 1).unwrap();
        let layout = FrameLayout { rate_hz: RATE, length: N as u32, bins: BINS as u32, frame_rate };
        let shape = ShapeSpec::Magnitude(LayoutSpec::Is(layout));
        Descriptor::new("given", "Plays frames.").output(Output::new("magnitude", shape, Unit::NONE))
    }
    fn prepare(_: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self(Stft::new(N))))
    }
}

impl Processor for Given {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let mags = magnitudes(&mut self.0, tick.index, signal);
        let out = tick.outputs.magnitude(0, tick.index, tick.index * 5);
        out.iter_mut().zip(mags).for_each(|(to, m)| *to = m as f32);
        Status::Continue
    }
}

/// Output of the node `it` over all ticks, where `before` stands between it and the frames.
fn run(before: &[&str], kind: &str, settings: &str, precision: &str) -> Vec<Complex<f64>> {
    let mut nodes = String::from("\"given\": (kind: \"given\")");
    let mut wires = String::new();
    let mut last = "given";
    for node in before {
        nodes += &format!(", \"{node}\": (kind: \"{node}\")");
        wires += &format!("(\"{last}\", \"{node}\"), ");
        last = node;
    }
    let text = format!(
        "Graph(version: 1, tick_hz: 500, audio_hz: 48000, nodes: {{{nodes}, \"it\": (kind: \"{kind}\", \
         params: ({settings} precision: \"{precision}\")), \"probe\": (kind: \"probe\")}}, \
         wires: [{wires}(\"{last}\", \"it\"), (\"it\", \"probe\")])"
    );
    let graph = GraphFile::parse(&Source::new("precision.ron", text)).unwrap();
    let compiled = compile(&graph, &crate::registry().with::<Given>(), Default::default()).unwrap();
    let mut engine = Engine::new(compiled, Options::default());
    let it = engine.schedule().index_of("it").unwrap();
    let mut all = Vec::new();
    for _ in 0..FRAMES {
        engine.tick();
        match engine.output(it, 0).unwrap() {
            Buffer::Audio { samples, len, .. } => {
                all.extend(samples[..*len].iter().map(|&y| Complex::new(f64::from(y), 0.0)));
            }
            Buffer::Spectrum { bins, .. } => {
                all.extend(bins.iter().map(|c| Complex::new(f64::from(c.re), f64::from(c.im))));
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(engine.faults(), 0);
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
    (&[], "oscillator_bank", "partials: \"tracked\",", 8.0),
    (&[], "sample_commit", "", 50_000.0),
    (&[], "sample_commit", "emission: 0,", 8000.0),
    (&["random_phase"], "overlap_add", "", 12.0),
    (&["phase_vocoder", "overlap_add"], "resample", "", 6.0),
    (&["phase_vocoder", "overlap_add"], "resample", "phase: \"minimum\",", 6.0),
];

#[test]
fn double_and_single_differ_by_rounding_only() {
    for (before, kind, settings, most) in NODES {
        let both = ["f32", "f64"].map(|precision| run(before, kind, settings, precision));
        let top = peak(&both[0]);
        assert!(top > 0.1, "{kind} {settings} is all but silent: {top}");
        let roundings = apart(&both) / (top * EPS);
        // If they were nearer, the same precision would have run twice.
        assert!((0.5..most).contains(&roundings), "{kind} {settings} is {roundings} roundings apart");
    }
}
