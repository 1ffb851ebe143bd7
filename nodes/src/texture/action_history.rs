//! `action_history`: the last forces and velocities, as the texture network reads them.

use crate::prelude::*;

/// Samples force and velocity at a rate of its own and keeps the last ones.
///
/// Sample j is taken at time j / rate, between two ticks by linear interpolation, so that the history means
/// the same whatever the tick rate. It starts with zeros and never sleeps.
pub struct ActionHistory {
    points: usize,
    rate_hz: u64,
    tick_hz: u64,
    every: u64,
    next: u64,
    /// Force, vx, vy of the last tick.
    before: Option<[f64; 3]>,
    /// Oldest first.
    history: Vec<[f64; 3]>,
}

impl Node for ActionHistory {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "action_history",
            "Keeps the last forces and velocities, oldest first, at the model's own rate.",
        )
        .input(control("force", 1, N).doc("normal force"))
        .input(control("velocity", 2, MM_S).doc("vx, vy along the surface"))
        .output(control_out("force", 10, N).doc("last forces, oldest first; zeros at the start"))
        .output(
            control_out("velocity", 20, MM_S).doc("last vx, then last vy, oldest first; zeros at the start"),
        )
        .param(integer("points", 10, 1..=1000).doc("Number of samples that are kept."))
        .param(integer("rate_hz", 500, 1..=4000).unit("Hz").doc("Sampling rate of the history."))
        .resumes(Resume::Never)
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        let points = config.params.integer("points") as usize;
        ports.outputs[0].shape = ShapeSpec::Control(points);
        ports.outputs[1].shape = ShapeSpec::Control(2 * points);
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let points = setup.params.integer("points") as usize;
        Ok(Prepared::new(Self {
            points,
            rate_hz: setup.params.integer("rate_hz") as u64,
            tick_hz: u64::from(setup.tick_hz),
            every: u64::from(setup.every),
            next: 0,
            before: None,
            history: vec![[0.0; 3]; points],
        }))
    }
}

impl Processor for ActionHistory {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let v = tick.inputs.control(1);
        let now = [tick.inputs.value(0), v[0], v[1]];
        let before = self.before.replace(now).unwrap_or(now);
        // Sample j is due when j / rate <= tick / tick_hz; more than `points` of them push each other out.
        let due = tick.index * self.rate_hz / self.tick_hz + 1;
        self.next = self.next.clamp(due.saturating_sub(self.points as u64), due);
        while self.next < due {
            let late = (tick.index * self.rate_hz - self.next * self.tick_hz) as f64;
            let part = (late / (self.every * self.rate_hz) as f64).min(1.0);
            self.history.rotate_left(1);
            for (slot, (b, n)) in self.history[self.points - 1].iter_mut().zip(before.iter().zip(&now)) {
                *slot = n + (b - n) * part;
            }
            self.next += 1;
        }
        for (y, h) in tick.outputs.control(0).iter_mut().zip(&self.history) {
            *y = h[0];
        }
        let velocity = tick.outputs.control(1);
        for (i, h) in self.history.iter().enumerate() {
            velocity[i] = h[1];
            velocity[self.points + i] = h[2];
        }
        Status::Continue
    }

    fn reset(&mut self) {
        (self.next, self.before) = (0, None);
        self.history.fill([0.0; 3]);
    }

    /// The samples so far. At another rate they stand for those of the new one until it has taken its own;
    /// another number of points starts anew.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.next).keep(&mut self.before).keep(&mut self.history);
    }
}
