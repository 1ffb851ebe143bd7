//! Driving a phase-retrieval node tick by tick, and the shipped vectors.

use std::path::PathBuf;

use asperity_accuracy::npy;
use asperity_accuracy::phase::{self, Score};
use asperity_dsp::{Framing, OverlapAdd};
use asperity_sdk::{
    Buffer, Complex, Config, FrameLayout, FrameRate, InputRef, Inputs, Latency, Node, Outputs, ParamValue,
    Params, PortType, Processor, Setup, Shape, Status, Tick, Unit, Wiring,
};

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

/// The signal that a node and overlap-add make of magnitudes of an unscaled DFT, without its latency.
fn invert<N: Node>(magnitudes: &[f32], rate_hz: u32, params: &[(&str, f64)]) -> Vec<f64> {
    let framing: Framing = phase::framing(rate_hz, 101);
    let mut rig = Rig::new::<N>(layout(rate_hz, 101), params);
    let mut ola = OverlapAdd::<f32>::new(framing).expect("a framing");
    let mut signal = Vec::new();
    let mut emit = |ola: &mut OverlapAdd<f32>, len: usize| {
        let mut out = vec![0.0; len];
        ola.emit(signal.len() as u64, &mut out);
        signal.extend(out);
    };
    let (late, per_second) = rig.latency().as_ratio();
    let late = late as usize * rate_hz as usize / per_second as usize;
    let silent_ticks = late.div_ceil(rate_hz as usize / 500);
    let frames = magnitudes.chunks_exact(101).map(Some).chain(std::iter::repeat_n(None, silent_ticks));
    for (n, frame) in frames.enumerate() {
        let amplitudes = frame.map(|f| amplitudes(f, rate_hz));
        if let Some(out) = rig.frame(amplitudes.as_deref()) {
            ola.add_frame(out.start, &out.bins).expect("in reach");
        }
        emit(&mut ola, (framing.start(n as u64 + 1) - framing.start(n as u64)) as usize);
    }
    emit(&mut ola, framing.fft_len);
    signal.split_off(late)
}

/// Spectral convergence in dB of what a node makes of a vector.
pub fn convergence<N: Node>(vector: &[f32], rate_hz: u32, params: &[(&str, f64)]) -> f64 {
    let y = invert::<N>(vector, rate_hz, params);
    let score = score(vector, rate_hz, &y);
    assert_eq!(score.nonfinite, 0);
    score.convergence_db
}
