//! Driving a phase-retrieval node, and the shipped vectors.

use std::path::PathBuf;
use std::sync::Arc;

use asperity_accuracy::npy;
use asperity_accuracy::phase::{self, Score};
use asperity_engine::{Engine, Options};
use asperity_node::{
    Buffer, Descriptor, FrameLayout, FrameRate, Latency, LayoutSpec, Node, NodeKind, Output, Prepared,
    Processor, Registry, ShapeSpec, Status, Tick, Unit,
};

use crate::graph;

/// Frames of 0.1 s, 500 a second, one a tick.
pub fn layout(rate_hz: u32, bins: u32) -> FrameLayout {
    let frame_rate = FrameRate::new(500, 1).expect("a rate");
    FrameLayout { rate_hz, length: rate_hz / 10, bins, frame_rate }
}

/// Name and rate of every vector.
pub const VECTORS: [(&str, u32); 9] = [
    ("sine_off_2500", 2500),
    ("chirp_2500", 2500),
    ("texture_2500", 2500),
    ("two25_2500", 2500),
    ("taps_2500", 2500),
    ("contact_2500", 2500),
    ("nnsmooth_2500", 2500),
    ("texture_48000", 48_000),
    ("amchirp_48000", 48_000),
];

/// A file of a vector: one that ships with the program, or one of the tests alone.
pub fn file(name: &str) -> PathBuf {
    let shipped = crate::graphs("phase").join(name);
    if shipped.exists() { shipped } else { crate::root().join("tests/data/phase").join(name) }
}

/// The values of a file, by its name without `.npy`.
pub fn data(name: &str) -> Vec<f64> {
    npy::read(file(&format!("{name}.npy"))).expect("an array").values.into_f64()
}

/// Published figures of a method, if there are any \[dB\]: spectral convergence, gain, and RMS of the
/// long-term spectrum.
pub fn published(vector: &str, method: &str) -> Option<[f64; 3]> {
    let all = crate::json(&file("sc.json"));
    let figure = |name: &str| all["sc"][vector][method][name].as_f64();
    Some([figure("SC_dB")?, figure("gain_dB")?, figure("LTAS_rms_dB")?])
}

/// Magnitudes of a vector, of an unscaled DFT, 101 a frame: from its file, or the transform of its signal.
pub fn vector(name: &str, rate_hz: u32) -> Vec<f32> {
    let all = if file(&format!("{name}.mag.npy")).exists() {
        data(&format!("{name}.mag"))
    } else {
        let signal = data(&format!("{name}.sig"));
        let framing = phase::framing(rate_hz, 101);
        let frames = (signal.len() - framing.fft_len) / (rate_hz as usize / 500) + 1;
        phase::magnitudes(&signal, &framing, frames)
    };
    all.into_iter().map(|x| x as f32).collect()
}

/// The same as amplitudes, which kernels take.
pub fn amplitudes(magnitudes: &[f32], rate_hz: u32) -> Vec<f32> {
    let scale = phase::framing(rate_hz, 101).bin_scale();
    magnitudes.iter().map(|&m| (f64::from(m) / scale) as f32).collect()
}

/// Scores a signal whose sample 0 is the first of frame 0.
pub fn score(magnitudes: &[f32], rate_hz: u32, signal: &[f64]) -> Score {
    phase::score(magnitudes, &phase::framing(rate_hz, 101), signal).expect("a score")
}

/// Plays frames, one a tick, some of which may be missing.
struct Given(FrameLayout, Arc<[Option<Vec<f32>>]>);

impl Processor for Given {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if let Some(Some(frame)) = self.1.get(tick.index as usize) {
            let start = self.0.frame_rate.first_sample(tick.index, self.0.rate_hz);
            tick.outputs.magnitude(0, tick.index, start).copy_from_slice(frame);
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// A kind that retrieves phase, named `KIND` or `KIND: PARAMS`, as node `phase` between frames of amplitudes
/// and the probe `end`. Answers the engine, which leaves NaN alone, and the latency of `phase` and of all.
pub fn engine(
    registry: &Registry,
    method: &str,
    layout: FrameLayout,
    frames: Vec<Option<Vec<f32>>>,
) -> (Engine, Latency, Latency) {
    let (kind, params) = method.split_once(": ").unwrap_or((method, ""));
    let frames: Arc<[_]> = frames.into();
    let output = Output::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Is(layout)), Unit::NONE);
    let given = Descriptor::new("given", "Plays frames.").output(output);
    let mut registry = registry.clone();
    registry.add(Arc::new(NodeKind::new(given, move |_| Ok(Prepared::new(Given(layout, frames.clone()))))));
    let descriptor = registry.get(kind).unwrap_or_else(|| panic!("no kind {kind}")).descriptor();
    let spectrum = descriptor.retrieval().unwrap_or_else(|| panic!("{kind} retrieves no phase")).spectrum;
    let end = if spectrum { "synthesis: overlap_add; phase -> synthesis -> end" } else { "phase -> end" };
    let lines = format!("given: given\nphase: {kind}({params})\nend: probe\ngiven -> phase\n{end}");
    let compiled = graph::compiled(&graph::of_lines(&lines), &registry);
    let schedule = &compiled.schedule;
    let late = schedule.nodes[schedule.index_of("phase").expect("a node")].latency;
    let all = schedule.latency();
    (Engine::new(compiled, Options { check_finite: false, ..Options::default() }), late, all)
}

/// The signal of a method for frames of amplitudes, without its latency; sample 0 is the first of frame 0.
pub fn heard(registry: &Registry, method: &str, layout: FrameLayout, frames: &[f32]) -> Vec<f64> {
    let frames: Vec<_> = frames.chunks(layout.bins as usize).map(|frame| Some(frame.to_vec())).collect();
    let last = frames.len() as u64 - 1;
    let wanted = layout.frame_rate.first_sample(last, layout.rate_hz) as usize + layout.length as usize;
    let (mut engine, _, latency) = engine(registry, method, layout, frames);
    let (num, den) = latency.as_ratio();
    let late = (num * i64::from(layout.rate_hz)).div_euclid(den);
    let end = engine.schedule().index_of("end").expect("a node");
    let mut signal = vec![0.0; usize::try_from(-late).unwrap_or(0)];
    let late = usize::try_from(late).unwrap_or(0);
    while signal.len() < wanted + late {
        engine.tick();
        let Some(Buffer::Audio { samples, len, .. }) = engine.input(end, 0) else { panic!("no audio") };
        signal.extend(samples[..*len].iter().map(|x| f64::from(*x)));
    }
    assert_eq!(engine.faults(), 0, "{method}");
    signal.truncate(wanted + late);
    signal.split_off(late)
}

/// Score of a built-in method on a vector.
pub fn scored(method: &str, name: &str, rate_hz: u32) -> Score {
    let magnitudes = vector(name, rate_hz);
    let frames = amplitudes(&magnitudes, rate_hz);
    let score =
        score(&magnitudes, rate_hz, &heard(&crate::registry(), method, layout(rate_hz, 101), &frames));
    assert_eq!(score.nonfinite, 0, "{method} on {name}");
    score
}

/// The method of a node type with these settings.
pub fn method<N: Node>(params: &[(&str, f64)]) -> String {
    let params: Vec<String> = params.iter().map(|(name, value)| format!("{name}: {value}")).collect();
    format!("{}: {}", N::descriptor().kind, params.join(", "))
}

/// Spectral convergence in dB of what a node makes of a vector.
pub fn convergence<N: Node>(vector: &[f32], rate_hz: u32, params: &[(&str, f64)]) -> f64 {
    let (registry, frames) = (crate::registry().with::<N>(), amplitudes(vector, rate_hz));
    let y = heard(&registry, &method::<N>(params), layout(rate_hz, 101), &frames);
    let score = score(vector, rate_hz, &y);
    assert_eq!(score.nonfinite, 0);
    score.convergence_db
}
