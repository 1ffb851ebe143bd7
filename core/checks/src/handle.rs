//! A device that pushes back, perhaps with a hand on it, simulated exactly between changes of the force.

use std::collections::VecDeque;

use asperity_actuator::exponential;

/// A device along one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Device {
    /// Mass at the handle, m \[kg\], above 0.
    pub mass_kg: f64,
    /// Viscous damping of its own, b \[N s/m\].
    pub damping_ns_per_m: f64,
    /// Dry friction of its own, c \[N\].
    pub friction_n: f64,
}

/// A hand on a handle along one direction: a mass between two springs with dampers. Its grip holds the
/// handle, and its arm holds the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hand {
    /// Mass \[kg\].
    pub mass_kg: f64,
    /// Stiffness and damping between handle and mass \[N/m, N s/m\].
    pub grip: [f64; 2],
    /// Stiffness and damping between mass and where the hand wants to be \[N/m, N s/m\].
    pub arm: [f64; 2],
}

impl Hand {
    /// The hand of J. E. Speich, L. Shao and M. Goldfarb, "Modeling the human hand as it interacts with a
    /// telemanipulation system", Mechatronics 15, 2005, pp. 1127-1142: five parameters, for one translation
    /// below 30 Hz. M. J. Fu and M. C. Cavusoglu, "Human-arm-and-hand-dynamic model with variability
    /// analyses for a stylus-based haptic interface", IEEE Transactions on Systems, Man, and Cybernetics B
    /// 42, 2012, pp. 1633-1644, model a pen grip of the same order (third, from force to place), and find
    /// that people and grips differ widely. Cases therefore take it [`varied`](Self::varied), from half to
    /// twice of each parameter. That also covers errors in these figures, which were not compared with the
    /// print.
    pub(crate) const PEN: Self = Self { mass_kg: 1.46, grip: [375.0, 7.9], arm: [48.8, 4.5] };

    /// The hand with its mass, grip and arm multiplied by these factors.
    pub(crate) fn varied(self, [mass, grip, arm]: [f64; 3]) -> Self {
        Self {
            mass_kg: mass * self.mass_kg,
            grip: self.grip.map(|x| grip * x),
            arm: self.arm.map(|x| arm * x),
        }
    }
}

type Matrix = [[f64; 6]; 6];

/// Places of the state: handle (m, m/s), hand (m, m/s), force on the handle (N), and at last the place to
/// which the hand moves (m).
const X: usize = 0;
const V: usize = 1;
const XA: usize = 2;
const VA: usize = 3;
const U: usize = 4;

/// A handle that moves: the device, perhaps a hand on it, and the places of both.
///
/// The force is constant over a step, so the exponential of its matrix gives the exact motion: only dampers
/// take energy. Dry friction has the sign of the speed at the beginning of the step, and holds the handle
/// where it turns. That takes more than true friction, by less than the kinetic energy of one step's change
/// of speed.
#[derive(Clone, Debug)]
pub(crate) struct Handle {
    device: Device,
    hand: Option<Hand>,
    free: Matrix,
    /// While dry friction holds the handle.
    stuck: Matrix,
    state: [f64; 6],
}

impl Handle {
    /// A handle at rest at 0, for steps of `step_s`.
    pub(crate) fn new(device: Device, hand: Option<Hand>, step_s: f64) -> Self {
        let mut a = [[0.0; 6]; 6];
        let [k, b] = hand.map_or([0.0; 2], |h| h.grip);
        a[X][V] = 1.0;
        a[V] = [-k, -b - device.damping_ns_per_m, k, b, 1.0, 0.0].map(|x| x / device.mass_kg);
        if let Some(h) = hand {
            a[XA][VA] = 1.0;
            a[VA] = [k, b, -k - h.arm[0], -b - h.arm[1], 0.0, h.arm[0]].map(|x| x / h.mass_kg);
        }
        let by_step = |a: &Matrix| exponential(a.map(|row| row.map(|x| x * step_s)));
        let free = by_step(&a);
        (a[X], a[V]) = ([0.0; 6], [0.0; 6]);
        Self { device, hand, free, stuck: by_step(&a), state: [0.0; 6] }
    }

    /// Sets the place and speed of handle and hand. The hand moves to `wants_mm`.
    pub(crate) fn put(&mut self, x_mm: f64, v_mm_s: f64, wants_mm: f64) {
        let (x, v) = (1e-3 * x_mm, 1e-3 * v_mm_s);
        let hand = if self.hand.is_some() { [x, v] } else { [0.0; 2] };
        self.state = [x, v, hand[0], hand[1], 0.0, 1e-3 * wants_mm];
    }

    /// Place \[mm\].
    pub(crate) fn x_mm(&self) -> f64 {
        1e3 * self.state[X]
    }

    /// Speed \[mm/s\].
    pub(crate) fn v_mm_s(&self) -> f64 {
        1e3 * self.state[V]
    }

    /// Energy of the masses and of the hand's springs \[mJ\].
    pub(crate) fn energy_mj(&self) -> f64 {
        let [x, v, xa, va, _, r] = self.state;
        let hand = self.hand.map_or(0.0, |h| {
            h.mass_kg * va * va + h.grip[0] * (x - xa).powi(2) + h.arm[0] * (xa - r).powi(2)
        });
        0.5e3 * (self.device.mass_kg * v * v + hand)
    }

    /// Takes one step under a force.
    pub(crate) fn step(&mut self, force_n: f64) {
        let [x, v, xa, va, _, _] = self.state;
        let dry = self.device.friction_n;
        let sign = if dry == 0.0 {
            0.0
        } else if v != 0.0 {
            v.signum()
        } else {
            let [k, b] = self.hand.map_or([0.0; 2], |h| h.grip);
            let all = force_n + k * (xa - x) + b * va;
            if all.abs() <= dry {
                self.state[U] = 0.0;
                self.state = times(&self.stuck, &self.state);
                return;
            }
            all.signum()
        };
        self.state[U] = force_n - dry * sign;
        self.state = times(&self.free, &self.state);
        if self.state[V] * sign < 0.0 {
            self.state[V] = 0.0;
        }
    }
}

fn times(a: &Matrix, x: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|i| (0..6).map(|k| a[i][k] * x[k]).sum())
}

/// A handle in a loop with a force at a tick rate. Its place is read once a tick, to the nearest step of the
/// sensor. The force that follows is held for a tick, after a delay.
pub(crate) struct Loop {
    /// The handle.
    pub handle: Handle,
    /// Steps per tick.
    steps: usize,
    /// Delay of a force, in steps.
    late: usize,
    /// Step of the sensor \[mm\]; 0 for none.
    step_mm: f64,
    /// Forces of this tick and earlier ones, the newest first.
    forces: VecDeque<f64>,
}

impl Loop {
    /// A loop in which the handle takes `steps` steps a tick, and forces come `late` steps late.
    pub(crate) fn new(handle: Handle, steps: usize, late: usize, step_mm: f64) -> Self {
        let forces = vec![0.0; late.div_ceil(steps.max(1)) + 1].into();
        Self { handle, steps: steps.max(1), late, step_mm, forces }
    }

    /// Place of the handle as the sensor reads it \[mm\].
    pub(crate) fn seen_mm(&self) -> f64 {
        if self.step_mm > 0.0 {
            (self.handle.x_mm() / self.step_mm).round() * self.step_mm
        } else {
            self.handle.x_mm()
        }
    }

    /// Runs a tick. `force` answers the place that the sensor reads \[mm\] with a force \[N\], to which
    /// `beside_n` is added. `each` is called after every step.
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
            // The number of ticks since that force was set.
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

    const ARM: Device = Device { mass_kg: 0.1, damping_ns_per_m: 0.5, friction_n: 0.0 };

    #[test]
    fn handle_falls_as_the_closed_form_with_any_step() {
        // v = (F / b) (1 - e^(-b t / m)), x = (F / b) (t - (m / b) (1 - e^(-b t / m)))
        for steps in [1, 7, 1000] {
            let mut handle = Handle::new(ARM, None, 0.3 / f64::from(steps));
            (0..steps).for_each(|_| handle.step(0.2));
            let tau = 0.1 / 0.5;
            let gone = 1.0 - (-0.3_f64 / tau).exp();
            let (v, x) = (400.0 * gone, 400.0 * (0.3 - tau * gone));
            assert!((handle.v_mm_s() - v).abs() < 1e-9 && (handle.x_mm() - x).abs() < 1e-9);
        }
    }

    #[test]
    fn dry_friction_stops_and_holds_the_handle() {
        let device = Device { friction_n: 0.05, damping_ns_per_m: 0.0, ..ARM };
        let mut handle = Handle::new(device, None, 25e-6);
        handle.put(0.0, 40.0, 0.0);
        (0..10_000).for_each(|_| handle.step(0.0));
        // m v^2 / 2 = c x: 0.08 mJ over 0.05 N are 1.6 mm.
        assert!((handle.x_mm() - 1.6).abs() < 1e-6 && handle.v_mm_s() == 0.0, "{}", handle.x_mm());
        (0..1000).for_each(|_| handle.step(-0.049));
        assert!(handle.v_mm_s() == 0.0);
        handle.step(-0.051);
        assert!(handle.v_mm_s() < 0.0);
    }

    #[test]
    fn hand_moves_the_handle_and_only_loses_energy() {
        for varied in [[1.0; 3], [0.5, 2.0, 0.5], [2.0, 0.5, 2.0]] {
            let mut handle = Handle::new(ARM, Some(Hand::PEN.varied(varied)), 1e-4);
            handle.put(0.0, 0.0, 5.0);
            let mut energy = handle.energy_mj();
            for _ in 0..100_000 {
                handle.step(0.0);
                assert!(handle.energy_mj() <= energy * (1.0 + 1e-12) + 1e-18);
                energy = handle.energy_mj();
            }
            assert!((handle.x_mm() - 5.0).abs() < 1e-3, "{}", handle.x_mm());
        }
        // Held at rest by a push, both springs give way: F (1 / k + 1 / k').
        let mut handle = Handle::new(ARM, Some(Hand::PEN), 1e-4);
        (0..200_000).for_each(|_| handle.step(0.1));
        assert!((handle.x_mm() - 0.1e3 * (1.0 / 375.0 + 1.0 / 48.8)).abs() < 1e-6);
    }

    #[test]
    fn force_comes_after_its_delay_for_one_tick() {
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
    fn sensor_rounds_to_its_steps() {
        let device = Device { mass_kg: 1.0, damping_ns_per_m: 0.0, friction_n: 0.0 };
        let mut it = Loop::new(Handle::new(device, None, 0.1), 1, 0, 0.055);
        for (x, want) in [(0.027, 0.0), (0.028, 0.055), (-0.1, -0.11), (0.0, 0.0)] {
            it.handle.put(x, 0.0, 0.0);
            assert!((it.seen_mm() - want).abs() < 1e-12, "{x}");
        }
    }
}
