//! `sample_commit`: magnitudes straight to a signal, by iteration over the samples that are not emitted yet.

use crate::prelude::*;
use asperity_dsp::Float;
use asperity_dsp::sample_commit::{self, MAX_WORK, Settings};

use super::{framing, kernel_error, seed_of, too_rare};
use crate::precision::{in_precision, precision};

/// Iterative phase retrieval that freezes samples, not frames.
pub struct SampleCommit<T = f32> {
    kernel: sample_commit::SampleCommit<T>,
    settings: Settings,
    bad: u64,
    refused: u64,
}

/// Usual distance inside the newest window at which samples are emitted, in windows.
const EARLY: f64 = 0.4;

impl Node for SampleCommit {
    fn descriptor() -> Descriptor {
        let s = Settings::default();
        let most = MAX_WORK as i64;
        Descriptor::new(
            "sample_commit",
            "Iterative phase retrieval that fixes samples as they are emitted and refines all later ones.",
        )
        .input(magnitude().doc("magnitudes that the signal should have"))
        .output(signal_out())
        .param(integer("frames", s.frames as i64, 1..=most).live())
        .doc("Frames that a pass works on: the newest, and others that reach beyond the emitted samples.")
        .param(integer("passes", s.passes as i64, 1..=most).live().doc("Passes per incoming frame."))
        .param(number("momentum", s.momentum, 0.0..=0.99, "").live().doc(
            "Momentum from one pass to the next. With 2 frames of 50 per pass at most 0.36 takes effect, \
             with 5 all of it.",
        ))
        .param(integer("emission", i64::from(s.emission), -1000..=1000).optional().doc(
            "Place of the emitted samples, in hops from the start of the newest frame. Negative: inside \
             its window, so earlier and less exact. Positive: with look-ahead. Left out: two fifths of a \
             window inside, -20 at 50 frames per window.",
        ))
        .param(seed().doc("Seed of its random numbers; left out, derived from the graph's seed."))
        .param(precision())
        .timing("latency `emission` times the hop (negative is early); response lag half a window more")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
    let framing = framing(setup)?;
    let params = setup.params;
    let frames_hz = f64::from(framing.frame_num) / f64::from(framing.frame_den);
    let window = framing.fft_len as f64 * frames_hz / f64::from(framing.rate_hz);
    let early = || -(EARLY * window).round() as i64;
    let settings = Settings {
        frames: params.integer("frames") as usize,
        passes: params.integer("passes") as usize,
        momentum: params.number("momentum"),
        emission: params.get_integer("emission").unwrap_or_else(early) as i32,
    };
    if framing.start(2) > framing.fft_len as u64 {
        return Err(too_rare(setup));
    }
    settings.delay(&framing).map_err(|e| {
        params.error("emission", format!("{} frames: {e}", settings.emission)).help(format!(
            "a window is {window:.1} frames here, {frames_hz:.1} a second: {:.0} is two fifths of one inside \
             it, as when `emission` is left out",
            -(EARLY * window).round()
        ))
    })?;
    let kernel = sample_commit::SampleCommit::new(framing, settings, seed_of(setup));
    let kernel = kernel.map_err(kernel_error(setup))?;
    let samples = |n| Latency::samples(n, framing.rate_hz);
    let (latency, tail) = (samples(kernel.delay()), samples(framing.fft_len as i64 + kernel.delay()));
    let it = SampleCommit::<T> { kernel, settings, bad: 0, refused: 0 };
    Ok(Prepared::new(it).latency(latency).tail(tail))
}

impl<T: Float> Processor for SampleCommit<T> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.kernel.framing().rate_hz);
        self.kernel.seek(span.start);
        let frame = tick.inputs.magnitude(0);
        if let Some(frame) = frame {
            match self.kernel.push(frame.index, frame.bins) {
                Ok(bad) => self.bad += bad as u64,
                Err(_) => self.refused += 1,
            }
        }
        let silent = self.kernel.is_silent();
        self.kernel.emit(span.start, tick.outputs.audio(0));
        match (silent, self.kernel.is_fresh()) {
            (false, _) => Status::Continue,
            (true, false) => Status::Quiet,
            (true, true) => Status::Asleep,
        }
    }

    fn reset(&mut self) {
        self.kernel.reset(0);
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        match index {
            0 => self.settings.frames = (value as usize).max(1),
            1 => self.settings.passes = (value as usize).max(1),
            2 => self.settings.momentum = value,
            _ => {}
        }
        // The kernel refuses only values out of the parameters' ranges. They change nothing.
        if self.kernel.set_work(self.settings).is_err() {
            self.settings = self.kernel.settings();
        }
    }

    fn state(&mut self, state: &mut State<'_>) {
        self.kernel.state(state);
    }

    fn facts(&mut self) -> Vec<Fact> {
        let f = self.kernel.framing();
        let lag = (f.fft_len as f64 / 2.0 + self.kernel.delay() as f64) * 1e3 / f64::from(f.rate_hz);
        vec![
            Fact::number("response_lag", lag, "ms"),
            Fact::count("bad_magnitudes", self.bad),
            Fact::count("refused_frames", self.refused),
        ]
    }
}
