//! `impulse`: a click at an event.

use crate::prelude::*;

/// A short rectangle at each rise of a control through a threshold. It begins with the first sample of the
/// tick.
pub struct Impulse {
    threshold: f64,
    amplitude: f32,
    /// Samples of the rectangle.
    length: u64,
    above: bool,
    /// Samples of it that are still to come.
    left: u64,
    rate: u32,
}

impl Node for Impulse {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "impulse",
            "Emits a click when a control rises above a threshold, for example to measure latency.",
        )
        .input(control("trigger", 1, ONE).unit_of('t').wakes().doc("control that triggers the click"))
        .output(super::output().doc("click"))
        .param(number("threshold", 0.5, -1e9..=1e9, ""))
        .doc("A click starts when `trigger` rises above this value.")
        .param(number("amplitude", 0.1, -1000.0..=1000.0, ""))
        .doc("Amplitude of the click, in the output's unit.")
        .param(number("length_ms", 1.0, 0.01..=1000.0, "ms").doc("Duration of the click."))
        .param(super::unit_param())
    }

    fn ports(config: &Config<'_>, ports: Ports) -> Result<Ports, Diagnostic> {
        Ok(super::with_unit(config, ports))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let (p, rate) = (setup.params, setup.audio_hz);
        let length = (p.number("length_ms") * 1e-3 * f64::from(rate)).round().max(1.0) as u64;
        let it = Self {
            threshold: p.number("threshold"),
            amplitude: p.number("amplitude") as f32,
            length,
            above: false,
            left: 0,
            rate,
        };
        Ok(Prepared::new(it).tail(Latency::samples(length as i64, rate)))
    }
}

impl Processor for Impulse {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let above = tick.inputs.valid(0) && tick.inputs.value(0) > self.threshold;
        if above && !self.above {
            self.left = self.length;
        }
        self.above = above;
        if self.left == 0 {
            return Status::Quiet;
        }
        let span = tick.samples(self.rate);
        let now = self.left.min(span.end - span.start);
        tick.outputs.audio(0)[..now as usize].fill(self.amplitude);
        self.left -= now;
        Status::Continue
    }

    fn reset(&mut self) {
        (self.above, self.left) = (false, 0);
    }

    /// Whether the trigger was above the threshold, and how many samples of a click are left.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.above).keep(&mut self.left);
        state.require(self.left <= self.length);
    }
}
