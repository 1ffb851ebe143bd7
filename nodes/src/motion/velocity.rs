//! `velocity`: how fast the stylus moves along the surface.

use asperity_dsp::filter::{Biquad, Section};
use asperity_node::{
    Descriptor, Diagnostic, Fact, Input, Node, Output, Param, Resume, Setup, ShapeSpec, Status, Tick, Unit,
};

/// Finite differences of x and y and a second-order Butterworth low-pass, both in f64.
pub struct Velocity {
    /// Runs a second.
    rate_hz: f64,
    filters: Option<[Biquad; 2]>,
    before: Option<[f64; 2]>,
}

impl Node for Velocity {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "velocity",
            "Velocity and speed along the surface: finite difference and a second-order low-pass.",
        )
        .input(
            Input::new("position", ShapeSpec::Control(3), Unit::MILLIMETRE)
                .doc("x, y, z of the stylus, z up"),
        )
        .output(Output::new("velocity", ShapeSpec::Control(2), Unit::MILLIMETRE_PER_SECOND).doc("vx, vy"))
        .output(
            Output::new("speed", ShapeSpec::Control(1), Unit::MILLIMETRE_PER_SECOND)
                .doc("planar speed, at least 0"),
        )
        .param(
            Param::number(
                "cutoff_hz",
                20.0,
                0.0..=1000.0,
                "Corner of the low-pass (Butterworth); 0 for none.",
            )
            .unit("Hz"),
        )
        .timing("no latency; at 20 Hz a change of speed shows 11 ms late")
        .resumes(Resume::Never)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        let cutoff = setup.params.number("cutoff_hz");
        let rate_hz = f64::from(setup.tick_hz) / f64::from(setup.every);
        let filters = if cutoff > 0.0 {
            let section = Section::butterworth_low_pass(cutoff).bilinear(rate_hz, cutoff).map_err(|e| {
                let help =
                    format!("below {} Hz, half of how often this node runs; or 0 for none", rate_hz / 2.0);
                setup.params.error("cutoff_hz", e.to_string()).help(help)
            })?;
            Some([section; 2])
        } else {
            None
        };
        Ok(Self { rate_hz, filters, before: None })
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let position = tick.inputs.control(0);
        let now = [position[0], position[1]];
        let before = self.before.replace(now).unwrap_or(now);
        let mut v = [(now[0] - before[0]) * self.rate_hz, (now[1] - before[1]) * self.rate_hz];
        if let Some([x, y]) = &mut self.filters {
            v = [x.step(v[0]), y.step(v[1])];
            x.settle();
            y.settle();
        }
        tick.outputs.control(0).copy_from_slice(&v);
        tick.outputs.set(1, v[0].hypot(v[1]));
        Status::Continue
    }

    fn reset(&mut self) {
        self.before = None;
        self.filters.iter_mut().flatten().for_each(Biquad::reset);
    }

    fn facts(&self) -> Vec<Fact> {
        let lag = self.filters.map_or(0.0, |[x, _]| x.dc_group_delay() / self.rate_hz);
        vec![Fact::number("response_lag", lag * 1e3, "ms")]
    }
}
