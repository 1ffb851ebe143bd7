//! `audio_out`: the way to the actuator.

use crate::prelude::*;

/// Time in which the output fades when its input becomes invalid, in seconds.
const FADE_S: f32 = 0.01;

/// The sound card's entry in a graph: turns amperes or volts into samples of a device.
///
/// Samples stay within full scale whatever comes in. While the input is invalid, they fade to zero. The
/// settings of the card and the amplifier do not change while it runs: the limits before it would no longer
/// be those of the coil.
pub struct AudioOut {
    scale: f32,
    step: f32,
    gain: f32,
    clipped: u64,
}

impl Node for AudioOut {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "audio_out",
            "Plays a limited current or voltage through the sound card, or writes it to the WAV file of \
             `render`.",
        )
        .role(Role::AudioOutput)
        .input(drive(RateSpec::Graph).limited().doc("current or voltage of the coil, from a limiter"))
        .output(Output::new("samples", ShapeSpec::Audio(RateSpec::Graph), Unit::FULL_SCALE))
        .doc("samples that the device plays")
        .param(number("volts_at_full_scale", 1.0, 1e-3..=100.0, "V"))
        .doc("Peak voltage of the sound card's output at full scale.")
        .param(number("amps_per_volt", 1.0, 1e-3..=100.0, "A/V"))
        .doc("Gain of a current amplifier behind the card (for an input in A).")
        .param(number("volts_per_volt", 1.0, 1e-3..=1000.0, ""))
        .doc("Gain of a voltage amplifier behind the card (for an input in V).")
        .sink()
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let current = setup.input(0).is_some_and(|port| port.unit == Unit::AMPERE);
        let amplifier = p.number(if current { "amps_per_volt" } else { "volts_per_volt" });
        let scale = 1.0 / (amplifier * p.number("volts_at_full_scale"));
        let step = 1.0 / (FADE_S * setup.audio_hz as f32);
        Ok(Prepared::new(Self { scale: scale as f32, step, gain: 1.0, clipped: 0 }))
    }
}

impl Processor for AudioOut {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let trusted = tick.inputs.valid(0);
        if trusted && self.gain >= 1.0 && tick.inputs.is_zero(0) {
            return Status::Quiet;
        }
        let step = if trusted { self.step } else { -self.step };
        let mut clipped = 0;
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
            self.gain = (self.gain + step).clamp(0.0, 1.0);
            let wanted = self.scale * self.gain * x;
            *y = wanted.clamp(-1.0, 1.0);
            clipped += u64::from(*y != wanted);
        }
        self.clipped += clipped;
        Status::Continue
    }

    fn reset(&mut self) {
        self.gain = 1.0;
    }

    /// Level of the fade.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.gain);
        state.require((0.0..=1.0).contains(&self.gain));
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("clipped_samples", self.clipped)]
    }
}
