//! `limiter`: the limits that no input to the coil may exceed.

use crate::prelude::*;
use asperity_actuator::{self, Drive, LimiterSettings};

/// The last stage before a device: finite, peak, slew, coil heat, stroke, DC. It cannot be left out.
///
/// While its input is invalid, it fades to zero.
///
/// The settings that protect the coil do not change while it runs. Only the DC corner and the release of the
/// gain do.
pub struct Limiter {
    limiter: asperity_actuator::Limiter,
    /// Part of the input that is played: at the end of the last tick, and of the next.
    strength: [f32; 2],
    /// The attenuated input.
    attenuated: Vec<f32>,
}

/// Places of the live parameters.
const DC_CORNER_HZ: usize = 2;
const RELEASE_MS: usize = 4;

impl Node for Limiter {
    fn descriptor() -> Descriptor {
        let [profile, handle] = super::profile_params();
        let s = LimiterSettings::default();
        Descriptor::new(
            "limiter",
            "Keeps current or voltage within the actuator's limits: peak, slew rate, heat, stroke, DC.",
        )
        .role(Role::Limiter)
        .input(drive(RateSpec::Of('r')).doc("wanted current or voltage"))
        .output(audio_out("out").limited().doc("limited current or voltage"))
        .param(profile)
        .param(handle)
        .param(number("dc_corner_hz", s.dc_corner_hz, 0.5..=20.0, "Hz").live())
        .doc("Corner of the high-pass that removes DC.")
        .param(number("slew_hz", s.slew_hz, 500.0..=20_000.0, "Hz"))
        .doc("Highest frequency at which a full-scale sine is not limited in slew rate.")
        .param(number("release_ms", s.release_s * 1e3, 10.0..=5000.0, "ms").live())
        .doc("Time in which the gain recovers after limiting.")
        .resumes(Resume::Never)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let volts = setup.input(0).is_some_and(|port| port.unit == Unit::VOLT);
        let settings = LimiterSettings {
            dc_corner_hz: p.number("dc_corner_hz"),
            slew_hz: p.number("slew_hz"),
            release_s: p.number("release_ms") * 1e-3,
            ..LimiterSettings::default()
        };
        let drive = if volts { Drive::Voltage } else { Drive::Current };
        let rate_hz = f64::from(setup.input_rate(0));
        let limiter = asperity_actuator::Limiter::new(&super::dynamics(setup)?, drive, rate_hz, settings)
            .map_err(|e| p.node_error(e.to_string()))?;
        let guard = limiter.guard();
        let attenuated = vec![0.0; time::max_samples(setup.input_rate(0), setup.tick_hz)];
        let it = Prepared::new(Self { limiter, strength: [1.0; 2], attenuated }).files(super::files(setup));
        Ok(it.guard(move || Box::new(guard.clone())))
    }
}

impl Processor for Limiter {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.limiter.set_muted(!tick.inputs.valid(0));
        let asked = tick.inputs.audio(0).len();
        let [from, to] = self.strength;
        self.strength[0] = to;
        if self.limiter.rests() && tick.inputs.is_zero(0) && tick.outputs.audio(0).len() == asked {
            self.limiter.rest(asked);
            return Status::Quiet;
        }
        if [from, to] == [1.0; 2] {
            self.limiter.process(tick.inputs.audio(0), tick.outputs.audio(0));
            return Status::Continue;
        }
        let step = (to - from) / asked.max(1) as f32;
        for (i, (y, x)) in self.attenuated.iter_mut().zip(tick.inputs.audio(0)).enumerate() {
            *y = x * (from + step * (i + 1) as f32);
        }
        self.limiter.process(&self.attenuated[..asked], tick.outputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.limiter.reset();
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        match index {
            DC_CORNER_HZ => self.limiter.set_dc_corner(value),
            RELEASE_MS => self.limiter.set_release(value * 1e-3),
            _ => {}
        }
    }

    /// Signal so far, gain, strength, and the coil's position and temperature. A limiter with other settings,
    /// or for another actuator, continues from this state within its own limits.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.strength[0]);
        state.require((0.0..=1.0).contains(&self.strength[0]));
        self.limiter.state(state);
    }

    fn warm(&mut self, heat: f64) {
        self.limiter.warm(heat);
    }

    fn attenuate(&mut self, strength: f32) {
        self.strength[1] = strength;
    }

    fn facts(&mut self) -> Vec<Fact> {
        let (r, limits) = (self.limiter.report(), self.limiter.limits());
        let unit = if self.limiter.drive() == Drive::Voltage { "V" } else { "A" };
        let count = |name, n| Fact::count(name, n);
        let number = |name, x, unit| Fact::number(name, x, unit);
        vec![
            count("limited_not_finite", r.not_finite),
            count("limited_peak", r.peak),
            count("limited_slew", r.slew),
            count("limited_rms", r.rms),
            count("limited_stroke", r.stroke),
            count("limited_muted", r.muted),
            count("reduced", r.reduced),
            number("largest_reduction", r.largest_reduction_db(), "dB"),
            number("limit", limits.peak, unit),
            number("limit_step", limits.slew_per_sample, unit),
            number("largest", r.largest, unit),
            number("largest_rms_current", r.largest_rms_current, "A"),
            number("largest_displacement", r.largest_displacement * 1e3, "mm"),
        ]
    }
}
