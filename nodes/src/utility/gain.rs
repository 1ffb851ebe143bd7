//! `gain`: a constant factor.

use crate::prelude::*;
use asperity_dsp::Ramp;

/// Multiplies a signal by a constant. A new factor is reached in a straight line: over 10 ms, or from one run
/// to the next where these are further apart.
pub struct Gain {
    gain: Ramp,
    audio: bool,
}

/// Place of the live parameter.
const GAIN: usize = 0;
/// Number of gain ramps that fit into a second.
const RAMPS_PER_SECOND: u32 = 100;

impl Node for Gain {
    fn descriptor() -> Descriptor {
        Descriptor::new("gain", "Multiplies audio or a control by a constant.")
            .input(like("in").doc("signal to multiply"))
            .output(like_out("out").doc("product"))
            .param(number("gain", 1.0, -1e6..=1e6, "").live().doc("Factor."))
            .param(text("unit", ""))
            .doc("Unit of the output, if the factor changes it; empty keeps the input's.")
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        let unit = config.params.text("unit");
        if !unit.is_empty() {
            ports.outputs[0].unit = UnitSpec::Is(Unit::from_symbol(unit));
        }
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let (audio, rate_hz) = match setup.input(0).map(|p| p.shape) {
            Some(Shape::Audio { rate_hz }) => (true, rate_hz),
            Some(Shape::Control { .. }) => (false, setup.tick_hz / setup.every.max(1)),
            _ => return Err(setup.params.node_error("`gain` multiplies audio or a control, not frames")),
        };
        Ok(Prepared::new(Self {
            gain: Ramp::new(setup.params.number("gain"), rate_hz / RAMPS_PER_SECOND),
            audio,
        }))
    }
}

impl Processor for Gain {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if self.audio {
            if self.gain.at_rest().is_some_and(|gain| gain >= 0.0) && tick.inputs.is_zero(0) {
                return Status::Quiet;
            }
            let samples = tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0));
            match self.gain.at_rest() {
                Some(gain) => samples.for_each(|(y, x)| *y = gain as f32 * x),
                None => samples.for_each(|(y, x)| *y = self.gain.step() as f32 * x),
            }
        } else {
            let gain = self.gain.step();
            for (y, x) in tick.outputs.control(0).iter_mut().zip(tick.inputs.control(0)) {
                *y = gain * x;
            }
        }
        Status::Continue
    }

    fn reset(&mut self) {
        self.gain.reset();
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        if index == GAIN {
            self.gain.set(value);
        }
    }

    /// The present factor. It goes on to this node's own.
    fn state(&mut self, state: &mut State<'_>) {
        self.gain.state(state);
    }
}
