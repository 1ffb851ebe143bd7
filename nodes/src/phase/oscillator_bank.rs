//! `oscillator_bank`: magnitudes straight to a signal.

use crate::prelude::*;
use asperity_dsp::{Float, Framing, Partials, oscillator_bank};

use super::{framing, kernel_error, seed_of};
use crate::precision::{in_precision, precision};

/// Oscillators whose amplitudes follow the magnitudes within a hop.
pub struct OscillatorBank<T = f32> {
    kernel: oscillator_bank::OscillatorBank<T>,
    framing: Framing,
    /// Time from one frame to the next.
    hop: Latency,
    started: bool,
    bad: u64,
}

impl Node for OscillatorBank {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "oscillator_bank",
            "Phase retrieval by oscillators whose amplitudes follow the magnitudes within one hop. Needs \
             no overlap-add.",
        )
        .input(magnitude().doc("magnitudes to reach one hop later"))
        .output(signal_out())
        .param(choice("partials", &["noise", "tracked"]).doc(
            "Oscillators to use. `noise`: one noisy oscillator per bin, for smooth magnitudes. `tracked`: \
             one phase-continuous sinusoid per peak.",
        ))
        .param(seed().doc("Seed of its random numbers; left out, derived from the graph's seed."))
        .param(precision())
        .timing("latency minus half a window plus one hop (early); response lag one hop")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
    let partials = match setup.params.text("partials") {
        "tracked" => Partials::Tracked,
        _ => Partials::Noise,
    };
    let framing = framing(setup)?;
    let kernel = oscillator_bank::OscillatorBank::new(framing, partials, seed_of(setup))
        .map_err(kernel_error(setup))?;
    let hop = Latency::ratio(i64::from(framing.frame_den), i64::from(framing.frame_num));
    let early = Latency::ratio(-(framing.fft_len as i64), 2 * i64::from(framing.rate_hz));
    let it = OscillatorBank::<T> { kernel, framing, hop, started: false, bad: 0 };
    Ok(Prepared::new(it).latency(early + hop).tail(hop))
}

impl<T: Float> Processor for OscillatorBank<T> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.framing.rate_hz);
        if !self.started {
            self.kernel.reset(span.start);
            self.started = true;
        }
        let frame = tick.inputs.magnitude(0);
        if let Some(frame) = frame {
            self.bad += self.kernel.add_frame(frame.index, frame.start, frame.bins) as u64;
        }
        match (self.kernel.emit(span.start, tick.outputs.audio(0)), frame) {
            (true, _) => Status::Continue,
            (false, Some(_)) => Status::Quiet,
            (false, None) => Status::Asleep,
        }
    }

    fn reset(&mut self) {
        self.started = false;
    }

    /// Phases and amplitudes of the oscillators, whatever the seed. Other partials start anew.
    fn state(&mut self, state: &mut State<'_>) {
        self.kernel.state(state);
        state.keep(&mut self.started);
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::number("response_lag", self.hop.ms(), "ms"), Fact::count("bad_magnitudes", self.bad)]
    }
}
