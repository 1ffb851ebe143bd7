//! Driving a phase-retrieval node tick by tick, and the shipped vectors.

use std::path::PathBuf;
use std::sync::Arc;

use asperity_accuracy::npy;
use asperity_accuracy::phase::{self, Score};
use asperity_engine::{Engine, Options};
use asperity_graph::Compiled;
use asperity_node::{NodeKind, Registry};
use asperity_sdk::{
    Buffer, Complex, Config, Descriptor, FrameLayout, FrameRate, InputRef, Inputs, Latency, LayoutSpec, Node,
    Output, Outputs, ParamValue, Params, PortType, Prepared, Processor, Setup, Shape, ShapeSpec, Status,
    Tick, Unit, Wiring,
};

use crate::graph;

/// Frames of 0.1 s, 500 a second, one a tick.
pub fn layout(rate_hz: u32, bins: u32) -> FrameLayout {
    let frame_rate = FrameRate::new(500, 1).expect("a rate");
    FrameLayout { rate_hz, length: rate_hz / 10, bins, frame_rate }
}

/// A frame that came out.
pub struct Out {
    pub start: u64,
    pub bins: Vec<Complex<f32>>,
}

/// A node between two buffers.
pub struct Rig {
    node: Box<dyn Processor>,
    latency: Latency,
    layout: FrameLayout,
    buffers: [Buffer; 2],
    tick: u64,
}

impl Rig {
    pub fn new<N: Node>(layout: FrameLayout, params: &[(&str, f64)]) -> Self {
        assert!(N::descriptor().check().is_ok(), "the descriptor keeps its rules");
        let mut all = Params::new(None);
        for p in N::descriptor().params {
            let value = params.iter().find(|(name, _)| *name == p.name).map(|(_, v)| *v);
            let value = match (value, &p.default) {
                (Some(v), Some(ParamValue::Number(_))) => Some(ParamValue::Number(v)),
                (Some(v), _) => Some(ParamValue::Integer(v as i64)),
                (None, default) => default.clone(),
            };
            all.insert(p.name.to_string(), value, None);
        }
        let port = |shape| PortType { shape, unit: Unit::METRE_PER_SECOND_SQUARED, limited: false };
        let (from, to) = (port(Shape::Magnitude(layout)), port(Shape::Spectrum(layout)));
        let buffers = [Buffer::new(&from, 500), Buffer::new(&to, 500)];
        let wiring = |port| [Wiring { port: Some(port), connected: true }];
        let (inputs, outputs) = (wiring(from), wiring(to));
        let config =
            Config { id: "node", params: &all, tick_hz: 500, every: 1, audio_hz: layout.rate_hz, seed: 7 };
        let setup = Setup { config, inputs: &inputs, outputs: &outputs, closes_cycle: false };
        let node = N::prepare(&setup).unwrap_or_else(|_| panic!("it prepares"));
        Self { node: node.processor, latency: node.latency, layout, buffers, tick: 0 }
    }

    /// One tick, with the frame that belongs to it or without; what came out, checked to be finite and in its
    /// place.
    pub fn frame(&mut self, bins: Option<&[f32]>) -> Option<Out> {
        let place = (self.tick, self.layout.frame_rate.first_sample(self.tick, self.layout.rate_hz));
        let [input, output] = &mut self.buffers;
        if let Buffer::Magnitude { bins: to, frame, .. } = input {
            *frame = bins.map(|_| place);
            bins.iter().for_each(|bins| to.copy_from_slice(bins));
        }
        if let Buffer::Spectrum { frame, .. } = output {
            *frame = None;
        }
        let map = [InputRef { buffer: 0, connected: true }];
        let mut tick = Tick {
            index: self.tick,
            tick_hz: 500,
            inputs: Inputs::new(std::slice::from_ref(input), &[], 1, &map),
            outputs: Outputs::new(std::slice::from_mut(output)),
        };
        let status = self.node.run(&mut tick).expect("no fault");
        self.tick += 1;
        let Buffer::Spectrum { bins, frame: Some(frame), .. } = output else { return None };
        assert_eq!(status, Status::Continue, "a frame came");
        assert_eq!(*frame, place, "frames stand in their slots");
        assert!(bins.iter().all(|c| c.re.is_finite() && c.im.is_finite()), "{place:?} is finite");
        Some(Out { start: place.1, bins: bins.to_vec() })
    }

    pub fn latency(&self) -> Latency {
        self.latency
    }
}

/// Magnitudes of a unit sinusoid at `freq` bins: the lobe of a Hann window.
pub fn tone(freq: f64, bins: usize) -> Vec<f32> {
    (0..bins).map(|k| asperity_dsp::window::hann_lobe(k as f64 - freq).abs() as f32).collect()
}

/// A pseudo-random number in [0, 1) for two indices.
pub fn noise(n: u64, k: u64) -> f32 {
    asperity_sdk::random::uniform(n, k) as f32
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

/// Plays frames, one a tick from tick `first` on.
struct Given {
    first: u64,
    layout: FrameLayout,
    frames: Arc<[f32]>,
}

impl Processor for Given {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let (n, bins) = (tick.index, self.layout.bins as usize);
        let at = (n - self.first) as usize * bins;
        if let Some(frame) = self.frames.get(at..at + bins) {
            let start = self.layout.frame_rate.first_sample(n, self.layout.rate_hz);
            tick.outputs.magnitude(0, n, start).copy_from_slice(frame);
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// A kind that retrieves phase, named `KIND` or `KIND: PARAMS`, as node `phase` between frames of amplitudes
/// from tick `first` on and the probe `end`.
pub fn compiled(
    registry: &Registry,
    method: &str,
    layout: FrameLayout,
    first: u64,
    frames: &[f32],
) -> Compiled {
    let (kind, params) = method.split_once(": ").unwrap_or((method, ""));
    let frames: Arc<[f32]> = frames.into();
    let output = Output::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Is(layout)), Unit::NONE);
    let given = Descriptor::new("given", "Plays frames.").output(output);
    let prepare = move |_: &Setup<'_>| Ok(Prepared::new(Given { first, layout, frames: frames.clone() }));
    let mut registry = registry.clone();
    registry.add(Arc::new(NodeKind::new(given, prepare)));
    let descriptor = registry.get(kind).unwrap_or_else(|| panic!("no kind {kind}")).descriptor();
    let spectrum = descriptor.retrieval().unwrap_or_else(|| panic!("{kind} retrieves no phase")).spectrum;
    let end = match spectrum {
        true => "synthesis: overlap_add\nphase -> synthesis\nsynthesis -> end",
        false => "phase -> end",
    };
    let lines = format!("given: given\nphase: {kind}({params})\nend: probe\ngiven -> phase\n{end}");
    graph::compiled(&graph::of_lines(&lines), &registry)
}

/// The signal of a method for frames of amplitudes, without its latency; sample 0 is the first of frame
/// `first`.
pub fn heard(registry: &Registry, method: &str, layout: FrameLayout, first: u64, frames: &[f32]) -> Vec<f64> {
    let compiled = compiled(registry, method, layout, first, frames);
    let (num, den) = compiled.schedule.latency().as_ratio();
    let late = (num * i64::from(layout.rate_hz)).div_euclid(den);
    let mut engine = Engine::new(compiled, Options::default());
    let end = engine.schedule().index_of("end").expect("a node");
    engine.skip(first);
    let start = |n: u64| layout.frame_rate.first_sample(n, layout.rate_hz);
    let last = first + (frames.len() / layout.bins as usize) as u64 - 1;
    let wanted = (start(last) - start(first)) as usize + layout.length as usize;
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
        score(&magnitudes, rate_hz, &heard(&crate::registry(), method, layout(rate_hz, 101), 0, &frames));
    assert_eq!(score.nonfinite, 0, "{method} on {name}");
    score
}

/// The signal that a node makes of magnitudes of an unscaled DFT, without its latency.
fn invert<N: Node>(magnitudes: &[f32], rate_hz: u32, params: &[(&str, f64)]) -> Vec<f64> {
    let params: Vec<String> = params.iter().map(|(name, value)| format!("{name}: {value}")).collect();
    let method = format!("{}: {}", N::descriptor().kind, params.join(", "));
    let frames = amplitudes(magnitudes, rate_hz);
    heard(&crate::registry().with::<N>(), &method, layout(rate_hz, 101), 0, &frames)
}

/// Spectral convergence in dB of what a node makes of a vector.
pub fn convergence<N: Node>(vector: &[f32], rate_hz: u32, params: &[(&str, f64)]) -> f64 {
    let y = invert::<N>(vector, rate_hz, params);
    let score = score(vector, rate_hz, &y);
    assert_eq!(score.nonfinite, 0);
    score.convergence_db
}
