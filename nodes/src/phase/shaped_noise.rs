//! `shaped_noise`: magnitudes to a signal without phase retrieval.

use crate::prelude::*;
use asperity_dsp::Float;
use asperity_dsp::scatter::NOISE_RATIO;
use asperity_dsp::shaped_noise::{self, PATTERN_LEN, Pattern};

use super::{framing, kernel_error, seed_of};
use crate::precision::{in_precision, precision};

/// Noise, bumps and ridges through a filter that follows the magnitudes.
pub struct ShapedNoise<T = f32> {
    kernel: shaped_noise::ShapedNoise<T>,
    /// The numbers that the kernel's pattern was read from.
    pattern: Vec<f64>,
    bad: u64,
}

impl Node for ShapedNoise {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "shaped_noise",
            "Noise through a minimum-phase filter that follows the magnitudes. Adds ridges and bumps if \
             `position` is connected.",
        )
        .input(magnitude().doc("expected magnitudes of the signal"))
        .input(control("position", 3, MM).or(0.0))
        .doc("stylus position x, y, z; if unconnected, no ridges and no bumps")
        .input(control("pattern", PATTERN_LEN, ONE).or(0.0))
        .doc("ridges and bumps of the material, from `texture_network`; if unconnected, none")
        .input(control("statistics", 2, ONE).or(-1.0))
        .doc("statistics of the magnitudes, from `texture_network`; second value above 0: they are means")
        .output(signal_out())
        .param(seed().doc("Seed of its random numbers; left out, derived from the graph's seed."))
        .param(precision())
        .timing("latency minus half a window (early): a frame plays in its own tick; response lag 4 ms")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
    let framing = framing(setup)?;
    let tick_s = f64::from(setup.every) / f64::from(setup.tick_hz);
    let kernel =
        shaped_noise::ShapedNoise::new(framing, tick_s, seed_of(setup)).map_err(kernel_error(setup))?;
    let latency = Latency::samples(-(framing.fft_len as i64 / 2), framing.rate_hz);
    let two_ticks = (2.0 * f64::from(framing.rate_hz) * tick_s).ceil() as i64;
    let it = ShapedNoise::<T> { kernel, pattern: vec![0.0; PATTERN_LEN], bad: 0 };
    Ok(Prepared::new(it).latency(latency).tail(Latency::samples(two_ticks, framing.rate_hz)))
}

impl<T: Float> Processor for ShapedNoise<T> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.kernel.framing().rate_hz);
        if tick.inputs.connected(2) {
            let numbers = tick.inputs.control(2);
            if !numbers.iter().map(|x| x.to_bits()).eq(self.pattern.iter().map(|x| x.to_bits())) {
                self.pattern.copy_from_slice(numbers);
                self.kernel.set_pattern(Pattern::read(numbers));
            }
        }
        if let Some(frame) = tick.inputs.magnitude(0) {
            let means = tick.inputs.control(3).get(1).is_some_and(|x| *x > 0.0);
            self.bad +=
                self.kernel.push(frame.index, frame.bins, if means { NOISE_RATIO } else { 1.0 }) as u64;
        }
        let place = tick.inputs.connected(1).then(|| tick.inputs.control(1));
        let place = place.and_then(|p| Some([*p.first()?, *p.get(1)?]));
        self.kernel.emit(span.start, place, tick.outputs.audio(0));
        if self.kernel.is_silent() { Status::Quiet } else { Status::Continue }
    }

    fn reset(&mut self) {
        self.kernel.reset();
    }

    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.pattern);
        self.kernel.state(state);
        if state.failed() {
            self.pattern.fill(0.0);
        }
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("bad_magnitudes", self.bad)]
    }
}
