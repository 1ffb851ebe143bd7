//! `actuator_inverse`: from the wanted acceleration to the coil's current or voltage.

use crate::prelude::*;
use asperity_actuator::{Drive, Inverse, InverseModel, InverseSettings};

/// Regularised feed-forward inverse of a voice coil on a handle.
pub struct ActuatorInverse {
    inverse: Inverse,
    natural_hz: f64,
}

impl Node for ActuatorInverse {
    fn descriptor() -> Descriptor {
        let [profile, handle] = super::profile_params();
        let s = InverseSettings::default();
        Descriptor::new(
            "actuator_inverse",
            "Feed-forward inverse of a voice coil on a handle: turns acceleration into current or voltage.",
        )
        .role(Role::ActuatorInverse)
        .input(Input::new(
            "acceleration",
            ShapeSpec::Audio(RateSpec::Of('r')),
            Unit::METRE_PER_SECOND_SQUARED,
        ))
        .doc("wanted acceleration of the handle")
        .output(Output::new("drive", ShapeSpec::Audio(RateSpec::Of('r')), Unit::AMPERE))
        .doc("current or voltage of the coil")
        .param(profile)
        .param(handle)
        .param(choice("drive", &["current", "voltage"]).doc("Output of the amplifier: current or voltage."))
        .param(number("corner_hz", s.corner_hz, 5.0..=60.0, "Hz"))
        .doc("Corner of the high-pass that inverse and actuator form together.")
        .param(number("corner_damping", s.corner_damping, 0.3..=2.0, ""))
        .doc("Damping ratio of that high-pass.")
        .param(choice("model", &["full", "no_inductance", "no_emf", "mass"]).doc(
            "Model of the actuator that is inverted. `full`: the whole model. `no_inductance`: without \
             the coil's inductance. `no_emf`: the coil as a resistance only. `mass`: a constant factor, \
             right above resonance; it does not use `corner_hz` and `corner_damping`. With `drive: \
             current` the first three are the same.",
        ))
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        if config.params.text("drive") == "voltage" {
            ports.outputs[0].unit = UnitSpec::Is(Unit::VOLT);
        }
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let dynamics = super::dynamics(setup)?;
        let drive = if p.text("drive") == "voltage" { Drive::Voltage } else { Drive::Current };
        let model = match p.text("model") {
            "no_inductance" => InverseModel::NoInductance,
            "no_emf" => InverseModel::NoEmf,
            "mass" => InverseModel::Mass,
            _ => InverseModel::Full,
        };
        let (corner_hz, corner_damping) = (p.number("corner_hz"), p.number("corner_damping"));
        let settings = InverseSettings { corner_hz, corner_damping, model };
        let inverse = Inverse::new(&dynamics, drive, f64::from(setup.input_rate(0)), settings)
            .map_err(|e| p.node_error(e.to_string()))?;
        let it = Self { inverse, natural_hz: dynamics.natural_hz() };
        Ok(Prepared::new(it).files(super::files(setup)))
    }
}

impl Processor for ActuatorInverse {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if self.inverse.rests() && tick.inputs.is_zero(0) {
            return Status::Quiet;
        }
        self.inverse.process(tick.inputs.audio(0), tick.outputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.inverse.reset();
    }

    /// State of the filter. Another actuator, handle, corner or model continues from it; another `drive`
    /// starts anew.
    fn state(&mut self, state: &mut State<'_>) {
        self.inverse.state(state);
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![
            Fact::number("resonance", self.natural_hz, "Hz"),
            Fact::count("ignored_samples", self.inverse.ignored()),
        ]
    }
}
