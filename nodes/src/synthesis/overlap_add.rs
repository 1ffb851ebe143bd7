//! `overlap_add`: spectra to a signal.

use crate::phase::{framing, kernel_error, too_rare};
use crate::prelude::*;
use asperity_dsp::{Float, Framing, overlap_add};

use crate::precision::{in_precision, precision};

/// Inverse FFT and weighted overlap-add, gain-exact for any hop.
pub struct OverlapAdd<T = f32> {
    kernel: overlap_add::OverlapAdd<T>,
    framing: Framing,
    started: bool,
    refused: u64,
}

impl Node for OverlapAdd {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "overlap_add",
            "Turns spectra into samples: inverse FFT and overlap-add with Hann windows, unit gain at any \
             hop.",
        )
        .role(Role::OverlapAdd)
        .input(Input::new("spectrum", ShapeSpec::Spectrum(LayoutSpec::Of('l')), Unit::NONE).unit_of('u'))
        .doc("spectra with phases")
        .output(signal_out())
        .param(precision())
        .timing("no latency: frame n covers samples from its start; response lag half a window")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
    let framing = framing(setup)?;
    let Framing { rate_hz, fft_len, frame_num, frame_den, .. } = framing;
    // At longer hops the sum of windows comes near 0, and the division by it explodes.
    if u64::from(frame_num) * (fft_len as u64) < 2 * u64::from(rate_hz) * u64::from(frame_den) {
        return Err(too_rare(setup));
    }
    let kernel = overlap_add::OverlapAdd::new(framing).map_err(kernel_error(setup))?;
    let tail = Latency::samples(fft_len as i64, rate_hz);
    Ok(Prepared::new(OverlapAdd::<T> { kernel, framing, started: false, refused: 0 }).tail(tail))
}

impl<T: Float> Processor for OverlapAdd<T> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.framing.rate_hz);
        if !self.started {
            self.kernel.reset(span.start);
            self.started = true;
        }
        if let Some(frame) = tick.inputs.spectrum(0) {
            self.refused += u64::from(self.kernel.add_frame(frame.start, frame.bins).is_err());
        }
        self.kernel.emit(span.start, tick.outputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.started = false;
    }

    fn state(&mut self, state: &mut State<'_>) {
        self.kernel.state(state);
        state.keep(&mut self.started);
    }

    fn facts(&mut self) -> Vec<Fact> {
        let lag = self.framing.fft_len as f64 * 500.0 / f64::from(self.framing.rate_hz);
        vec![Fact::number("response_lag", lag, "ms"), Fact::count("refused_frames", self.refused)]
    }
}
