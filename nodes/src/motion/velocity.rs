//! `velocity`: how fast the stylus moves along the surface.

use crate::since::Since;
use asperity_dsp::filter::{Biquad, Section};
use asperity_node::{
    Descriptor, Diagnostic, Fact, Input, Node, Output, Param, Resume, Setup, ShapeSpec, State, Status, Tick,
    Unit,
};

/// A stylus that stands still, and whose filtered velocity is below this, has none: what follows asks no more of those that answer the
/// same to the same. At 20 Hz it is there 0.22 s after 300 mm/s, where to the end of the tail it would be 0.85 s.
const STILL_MM_S: f64 = 1e-6;

/// Finite differences and a second-order Butterworth low-pass, both in f64.
///
/// Over ticks that were lost, or in which the place was not to be trusted, the velocity is the mean of what came to pass: while there is no place it is held
/// (and marked), and the one that comes then is no jump of a single tick. The low-pass goes on as if that mean had lasted all the while.
pub struct Velocity {
    /// Runs a second.
    rate_hz: f64,
    /// Corner of the low-pass; 0 for none.
    cutoff_hz: f64,
    filters: [Biquad; 3],
    /// Position of the last run that had one, and when that was.
    before: Option<[f64; 3]>,
    since: Since,
    stroke: f64,
    velocity: [f64; 3],
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
        .input(
            Input::new("stroke", ShapeSpec::Control(1), Unit::NONE)
                .or(0.0)
                .doc("another number: the stylus was put down elsewhere, and what lies between is no motion"),
        )
        .output(Output::new("velocity", ShapeSpec::Control(2), Unit::MILLIMETRE_PER_SECOND).doc("vx, vy"))
        .output(
            Output::new("speed", ShapeSpec::Control(1), Unit::MILLIMETRE_PER_SECOND)
                .doc("planar speed, at least 0"),
        )
        .output(Output::new("spatial", ShapeSpec::Control(3), Unit::MILLIMETRE_PER_SECOND).doc("vx, vy, vz"))
        .output(
            Output::new("unfiltered", ShapeSpec::Control(3), Unit::MILLIMETRE_PER_SECOND)
                .doc("vx, vy, vz by the difference alone, for forces, which a low-pass would make unstable"),
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
        let cutoff_hz = setup.params.number("cutoff_hz");
        let rate_hz = f64::from(setup.tick_hz) / f64::from(setup.every);
        let filter = if cutoff_hz > 0.0 {
            Section::butterworth_low_pass(cutoff_hz).bilinear(rate_hz, cutoff_hz)
        } else {
            Biquad::new([1.0, 0.0, 0.0], [0.0; 2])
        };
        let filter = filter.map_err(|e| {
            let help = format!("below {} Hz, half of how often this node runs; or 0 for none", rate_hz / 2.0);
            setup.params.error("cutoff_hz", e.to_string()).help(help)
        })?;
        Ok(Self {
            rate_hz,
            cutoff_hz,
            filters: [filter; 3],
            before: None,
            since: Since::new(setup.every),
            stroke: 0.0,
            velocity: [0.0; 3],
        })
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if !tick.inputs.valid(0) {
            return Status::Continue;
        }
        let position = tick.inputs.control(0);
        let stroke = tick.inputs.value(1);
        if stroke != self.stroke {
            self.reset();
            self.stroke = stroke;
        }
        let now = [position[0], position[1], position[2]];
        let before = self.before.replace(now).unwrap_or(now);
        let runs = self.since.runs(tick.index);
        let unfiltered: [f64; 3] =
            std::array::from_fn(|i| (now[i] - before[i]) * (self.rate_hz / runs as f64));
        let mut v = unfiltered;
        for (v, filter) in v.iter_mut().zip(&mut self.filters) {
            let still = *v == 0.0;
            filter.hold(*v, runs - 1);
            *v = filter.step(*v);
            filter.settle();
            if still {
                filter.settle_below(STILL_MM_S);
            }
        }
        self.velocity = v;
        tick.outputs.control(0).copy_from_slice(&v[..2]);
        tick.outputs.set(1, v[0].hypot(v[1]));
        tick.outputs.control(2).copy_from_slice(&v);
        tick.outputs.control(3).copy_from_slice(&unfiltered);
        Status::Continue
    }

    fn reset(&mut self) {
        self.before = None;
        self.since.reset();
        self.stroke = 0.0;
        self.velocity = [0.0; 3];
        self.filters.iter_mut().for_each(Biquad::reset);
    }

    /// Where the stylus was and how fast. A filter of another corner goes on from that velocity as if it had been
    /// constant.
    fn state(&mut self, state: &mut State<'_>) {
        let mut made_for = [self.cutoff_hz, self.rate_hz];
        state.keep(&mut made_for).keep(&mut self.before);
        self.since.state(state);
        state.keep(&mut self.stroke).keep(&mut self.velocity);
        self.filters.iter_mut().for_each(|f| f.state(state));
        if state.restores() && made_for != [self.cutoff_hz, self.rate_hz] {
            self.filters.iter_mut().zip(self.velocity).for_each(|(f, v)| f.reset_to(v));
        }
    }

    fn facts(&self) -> Vec<Fact> {
        let lag = self.filters[0].dc_group_delay() / self.rate_hz;
        vec![Fact::number("response_lag", lag * 1e3, "ms")]
    }
}

#[cfg(test)]
#[path = "velocity_tests.rs"]
mod tests;
