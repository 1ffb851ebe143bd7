//! `velocity`: how fast the stylus moves along the surface.

use asperity_numbers::Elementary as _;
use std::f64::consts::{SQRT_2, TAU};

use crate::prelude::*;
use crate::since::Since;
use asperity_dsp::low_pass::{LowPass, corner, opened_hz};

/// Filtered velocity below which a stylus that stands still counts as at rest. A network can then repeat its
/// last output. At 20 Hz this is reached 0.22 s after 300 mm/s; the tail would end after 0.85 s.
const STILL_MM_S: f64 = 1e-6;

/// Finite differences and a second-order Butterworth low-pass, both in f64.
///
/// The low-pass may open with its own speed, in space: see [`opened_hz`].
///
/// While the position is invalid, the velocity is held (and marked). After such a gap, or after lost ticks,
/// the velocity is the mean over the gap. So the next position is no jump of a single tick. The low-pass goes
/// on as if that mean had lasted all the while.
pub struct Velocity {
    /// Runs a second.
    rate_hz: f64,
    /// Corner of the low-pass at rest; 0 for none.
    cutoff_hz: f64,
    /// Corner of the low-pass for fast motion, for every mm/s.
    cutoff_hz_per_mm_s: f64,
    filters: [LowPass; 3],
    /// Position of the last run that had one, and the time since.
    before: Option<[f64; 3]>,
    since: Since,
    stroke: f64,
    velocity: [f64; 3],
}

impl Node for Velocity {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "velocity",
            "Computes velocity and speed from position: finite difference, then a second-order low-pass.",
        )
        .role(Role::Velocity)
        .input(control("position", 3, MM).doc("stylus position x, y, z; z points up"))
        .input(control("stroke", 1, ONE).or(0.0))
        .doc("counts strokes; when it changes, the jump to the new position is no motion")
        .output(control_out("velocity", 2, MM_S).doc("vx, vy after the low-pass"))
        .output(control_out("speed", 1, MM_S).doc("length of `velocity`"))
        .output(control_out("spatial", 3, MM_S).doc("vx, vy, vz after the low-pass"))
        .output(control_out("unfiltered", 3, MM_S))
        .doc("vx, vy, vz without the low-pass; use it for forces, which a low-pass makes unstable")
        .param(number("cutoff_hz", 20.0, 0.0..=1000.0, "Hz"))
        .doc("Corner of the low-pass (Butterworth) at rest; 0 turns it off.")
        .param(number("cutoff_hz_per_mm_s", 0.0, 0.0..=10.0, "Hz per mm/s").doc(
            "Rise of the corner with speed. It stops at a tenth of the tick rate. So the output is calm \
             at rest and prompt in motion.",
        ))
        .timing("no latency; response lag 11 ms at a corner of 20 Hz, 6 ms at 40 Hz")
        .resumes(Resume::Never)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let cutoff_hz = setup.params.number("cutoff_hz");
        let rate_hz = f64::from(setup.tick_hz) / f64::from(setup.every);
        if cutoff_hz >= rate_hz / 2.0 {
            let message = format!("{cutoff_hz} Hz is not between 0 and half the rate of {rate_hz} Hz");
            let help = format!("below {} Hz, half of how often this node runs; or 0 for none", rate_hz / 2.0);
            return Err(setup.params.error("cutoff_hz", message).help(help));
        }
        Ok(Prepared::new(Self {
            rate_hz,
            cutoff_hz,
            cutoff_hz_per_mm_s: setup.params.number("cutoff_hz_per_mm_s"),
            filters: [LowPass::default(); 3],
            before: None,
            since: Since::new(setup.every),
            stroke: 0.0,
            velocity: [0.0; 3],
        }))
    }
}

impl Processor for Velocity {
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
        if self.cutoff_hz > 0.0 {
            let at = corner(self.cutoff_hz_now(), self.rate_hz);
            for (v, filter) in v.iter_mut().zip(&mut self.filters) {
                let still = *v == 0.0;
                filter.hold(*v, at, runs - 1);
                *v = filter.step(*v, at);
                filter.settle();
                if still {
                    filter.settle_below(STILL_MM_S);
                }
            }
        }
        self.velocity = v;
        tick.outputs.control(0).copy_from_slice(&v[..2]);
        tick.outputs.set(1, v[0].hypotenuse(v[1]));
        tick.outputs.control(2).copy_from_slice(&v);
        tick.outputs.control(3).copy_from_slice(&unfiltered);
        Status::Continue
    }

    fn reset(&mut self) {
        self.before = None;
        self.since.reset();
        self.stroke = 0.0;
        self.velocity = [0.0; 3];
        self.filters = Default::default();
    }

    /// Last position and velocity of the stylus.
    fn state(&mut self, state: &mut State<'_>) {
        let mut low_pass = self.cutoff_hz > 0.0;
        state.keep(&mut low_pass).keep(&mut self.before);
        self.since.state(state);
        state.keep(&mut self.stroke).keep(&mut self.velocity);
        self.filters.iter_mut().for_each(|f| f.state(state));
        // A filter that the state lacks continues from the velocity as if it had been constant.
        if state.restores() && !low_pass {
            self.filters.iter_mut().zip(self.velocity).for_each(|(f, v)| f.reset_to(v));
        }
    }

    fn facts(&mut self) -> Vec<Fact> {
        // The group delay of a second-order Butterworth low-pass at 0 Hz is sqrt(2) / w.
        let lag_s = if self.cutoff_hz > 0.0 { SQRT_2 / (TAU * self.cutoff_hz_now()) } else { 0.0 };
        vec![Fact::number("response_lag", lag_s * 1e3, "ms")]
    }
}

impl Velocity {
    fn cutoff_hz_now(&self) -> f64 {
        let [x, y, z] = self.velocity;
        opened_hz(self.cutoff_hz, self.cutoff_hz_per_mm_s, x.hypotenuse(y).hypotenuse(z), self.rate_hz)
    }
}

#[cfg(test)]
#[path = "velocity_tests.rs"]
mod tests;
