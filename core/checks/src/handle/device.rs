use super::exponential::{Matrix, exponential};

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

/// A hand on a handle along one direction: a mass that holds the handle by a spring and a damper, its grip, and is held by another pair, its arm.
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
    /// The hand of J. E. Speich, L. Shao and M. Goldfarb, "Modeling the human hand as it interacts with a telemanipulation system", Mechatronics 15,
    /// 2005, pp. 1127-1142: five parameters, for one translation below 30 Hz. M. J. Fu and M. C. Cavusoglu, "Human-arm-and-hand-dynamic model with
    /// variability analyses for a stylus-based haptic interface", IEEE Transactions on Systems, Man, and Cybernetics B 42, 2012, pp. 1633-1644, have a hand
    /// that holds a stylus like a pen of the same order (third, from force to place), and tell how widely people and grips differ. So a case takes it
    /// [`varied`](Self::varied), from half to twice of everything, which is also more than these figures may be off: they were not held against the print.
    pub(crate) const PEN: Self = Self { mass_kg: 1.46, grip: [375.0, 7.9], arm: [48.8, 4.5] };

    /// It, with another mass, grip and arm: times these.
    pub(crate) fn varied(self, [mass, grip, arm]: [f64; 3]) -> Self {
        Self {
            mass_kg: mass * self.mass_kg,
            grip: self.grip.map(|x| grip * x),
            arm: self.arm.map(|x| arm * x),
        }
    }
}

/// Places of the state: handle (m, m/s), hand (m, m/s), force on the handle (N); and last, where the hand wants to be (m).
const X: usize = 0;
const V: usize = 1;
const XA: usize = 2;
const VA: usize = 3;
const U: usize = 4;

/// A handle that moves: the device, the hand on it if there is one, and where both are.
///
/// Over a step in which the force does not change it goes by the exponential of its matrix, so that it makes no energy and takes none but by its dampers.
/// Dry friction has the sign of the speed at the beginning of the step and holds the handle where it turns: what that takes beyond the true
/// friction is less than the kinetic energy of one step's change of speed.
#[derive(Clone, Debug)]
pub(crate) struct Handle {
    device: Device,
    hand: Option<Hand>,
    free: Matrix<6>,
    /// While dry friction holds the handle.
    stuck: Matrix<6>,
    state: [f64; 6],
}

impl Handle {
    /// At rest at 0, for steps of `step_s`.
    pub(crate) fn new(device: Device, hand: Option<Hand>, step_s: f64) -> Self {
        let mut a = [[0.0; 6]; 6];
        let [k, b] = hand.map_or([0.0; 2], |h| h.grip);
        a[X][V] = 1.0;
        a[V] = [-k, -b - device.damping_ns_per_m, k, b, 1.0, 0.0].map(|x| x / device.mass_kg);
        if let Some(h) = hand {
            a[XA][VA] = 1.0;
            a[VA] = [k, b, -k - h.arm[0], -b - h.arm[1], 0.0, h.arm[0]].map(|x| x / h.mass_kg);
        }
        let by_step = |a: &Matrix<6>| exponential(&a.map(|row| row.map(|x| x * step_s)));
        let free = by_step(&a);
        (a[X], a[V]) = ([0.0; 6], [0.0; 6]);
        Self { device, hand, free, stuck: by_step(&a), state: [0.0; 6] }
    }

    /// Puts the handle and the hand somewhere, at a speed along the direction; the hand wants to be at `wants_mm`.
    pub(crate) fn put(&mut self, x_mm: f64, v_mm_s: f64, wants_mm: f64) {
        let (x, v) = (1e-3 * x_mm, 1e-3 * v_mm_s);
        let hand = if self.hand.is_some() { [x, v] } else { [0.0; 2] };
        self.state = [x, v, hand[0], hand[1], 0.0, 1e-3 * wants_mm];
    }

    /// Where it is \[mm\].
    pub(crate) fn x_mm(&self) -> f64 {
        1e3 * self.state[X]
    }

    /// How fast it is \[mm/s\].
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

    /// One step under this force.
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

fn times(a: &Matrix<6>, x: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|i| (0..6).map(|k| a[i][k] * x[k]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: Device = Device { mass_kg: 0.1, damping_ns_per_m: 0.5, friction_n: 0.0 };

    #[test]
    fn it_falls_as_the_closed_form_says_whatever_the_step() {
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
    fn dry_friction_stops_it_after_the_way_that_its_energy_is_worth_and_holds_it() {
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
    fn a_hand_takes_the_handle_where_it_wants_to_be_and_only_loses_energy() {
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
}
