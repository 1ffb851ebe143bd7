use std::collections::VecDeque;

use super::device::Handle;

/// A handle, and something that answers places with forces at a tick rate: places are read once a tick, to the nearest step of the sensor, and the force
/// that follows is held for a tick, from some time later on.
pub(crate) struct Loop {
    /// The handle.
    pub handle: Handle,
    /// Steps a tick.
    steps: usize,
    /// How many steps a force is late.
    late: usize,
    /// Step of the sensor \[mm\]; 0 for none.
    step_mm: f64,
    /// The force of this tick and of those before, the newest first.
    forces: VecDeque<f64>,
}

impl Loop {
    /// A loop of a handle that takes `steps` steps a tick; forces come `late` steps late.
    pub(crate) fn new(handle: Handle, steps: usize, late: usize, step_mm: f64) -> Self {
        let forces = vec![0.0; late.div_ceil(steps.max(1)) + 1].into();
        Self { handle, steps: steps.max(1), late, step_mm, forces }
    }

    /// Where the sensor sees the handle \[mm\].
    pub(crate) fn seen_mm(&self) -> f64 {
        if self.step_mm > 0.0 {
            (self.handle.x_mm() / self.step_mm).round() * self.step_mm
        } else {
            self.handle.x_mm()
        }
    }

    /// One tick: `force` answers the place that is seen \[mm\] with a force \[N\]; another, constant, is there beside it. `each` is shown the handle after every step.
    pub(crate) fn tick(
        &mut self,
        force: impl FnOnce(f64) -> f64,
        beside_n: f64,
        mut each: impl FnMut(&Handle),
    ) {
        let force = force(self.seen_mm());
        self.forces.rotate_right(1);
        if let Some(newest) = self.forces.front_mut() {
            *newest = force;
        }
        for step in 0..self.steps {
            // Of the tick in which that moment lay.
            let ago = (self.late + self.steps - 1 - step) / self.steps;
            let force = self.forces.get(ago).copied().unwrap_or(0.0);
            self.handle.step(force + beside_n);
            each(&self.handle);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::handle::{Device, Handle};

    #[test]
    fn a_force_comes_when_it_is_told_to_and_lasts_a_tick() {
        // A push of 1 N in the first tick alone, seen by the speed that it has made of 1 kg.
        for (steps, late, want) in [
            (4, 0, [0.25, 0.5, 0.75, 1.0, 1.0, 1.0, 1.0, 1.0]),
            (4, 2, [0.0, 0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 1.0]),
            (4, 4, [0.0, 0.0, 0.0, 0.0, 0.25, 0.5, 0.75, 1.0]),
            (4, 5, [0.0, 0.0, 0.0, 0.0, 0.0, 0.25, 0.5, 0.75]),
        ] {
            let device = Device { mass_kg: 1.0, damping_ns_per_m: 0.0, friction_n: 0.0 };
            let mut it = Loop::new(Handle::new(device, None, 0.25), steps, late, 0.0);
            let mut speeds = Vec::new();
            for tick in 0..2 {
                it.tick(|_| if tick == 0 { 1.0 } else { 0.0 }, 0.0, |h| speeds.push(1e-3 * h.v_mm_s()));
            }
            assert!(speeds.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-12), "{late}: {speeds:?}");
        }
    }

    #[test]
    fn the_sensor_rounds_to_its_steps() {
        let device = Device { mass_kg: 1.0, damping_ns_per_m: 0.0, friction_n: 0.0 };
        let mut it = Loop::new(Handle::new(device, None, 0.1), 1, 0, 0.055);
        for (x, want) in [(0.027, 0.0), (0.028, 0.055), (-0.1, -0.11), (0.0, 0.0)] {
            it.handle.put(x, 0.0, 0.0);
            assert!((it.seen_mm() - want).abs() < 1e-12, "{x}");
        }
    }
}
