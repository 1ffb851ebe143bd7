//! The hand's position without the steps of its sensor.

use asperity_numbers::Elementary as _;
use asperity_state::State;

/// Corner of the tracking filter in Hz. At 500 positions a second it reduces a sensor's steps of 0.055
/// mm to 0.005 mm.
const CORNER_HZ: f64 = 20.0;
/// A position farther from the expected one is no motion: the stylus was put down elsewhere. In mm; for
/// long ticks, the way of one tick at a speed in mm/s.
const JUMP_MM: f64 = 5.0;
const JUMP_MM_S: f64 = 2500.0;

/// Tracks position and velocity: an alpha-beta filter, critically damped (P. R. Kalata, IEEE Trans. AES
/// 20(2), 1984). It follows a steady motion without lag.
#[derive(Clone, Debug, Default)]
pub(super) struct Place {
    alpha: f64,
    beta: f64,
    tick_s: f64,
    at: [f64; 2],
    velocity: [f64; 2],
    /// Number of positions seen, up to 2.
    known: u8,
}

impl Place {
    pub(super) fn new(tick_s: f64) -> Self {
        let root = (-std::f64::consts::TAU * CORNER_HZ * tick_s).exp_e();
        Self { alpha: 1.0 - root * root, beta: (1.0 - root) * (1.0 - root), tick_s, ..Self::default() }
    }

    pub(super) fn reset(&mut self) {
        (self.at, self.velocity, self.known) = ([0.0; 2], [0.0; 2], 0);
    }

    /// Takes the position of a tick in mm and returns the way since the last one. None if there was
    /// none, or the stylus was put down elsewhere.
    pub(super) fn step(&mut self, place: [f64; 2]) -> Option<[f64; 2]> {
        if !place.iter().all(|x| x.abs() < 1e9) {
            return Some([0.0; 2]);
        }
        let expected: [f64; 2] = std::array::from_fn(|i| self.at[i] + self.velocity[i] * self.tick_s);
        let off: [f64; 2] = std::array::from_fn(|i| place[i] - expected[i]);
        if self.known == 0 || off[0].hypotenuse(off[1]) > JUMP_MM.max(JUMP_MM_S * self.tick_s) {
            (self.at, self.velocity, self.known) = (place, [0.0; 2], 1);
            return None;
        }
        let before = self.at;
        if self.known == 1 {
            self.velocity = std::array::from_fn(|i| (place[i] - before[i]) / self.tick_s);
            (self.at, self.known) = (place, 2);
        } else {
            for i in 0..2 {
                self.at[i] = expected[i] + self.alpha * off[i];
                self.velocity[i] += self.beta * off[i] / self.tick_s;
            }
        }
        Some(std::array::from_fn(|i| self.at[i] - before[i]))
    }

    pub(super) fn at(&self) -> [f64; 2] {
        self.at
    }

    pub(super) fn velocity(&self) -> [f64; 2] {
        self.velocity
    }

    pub(super) fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.at).keep(&mut self.velocity).keep(&mut self.known);
        state.require(self.at.iter().chain(&self.velocity).all(|x| x.abs() < 1e12) && self.known <= 2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steady_motion_is_followed_without_lag() {
        let mut place = Place::new(0.002);
        for tick in 0..500 {
            let x = 0.2 * f64::from(tick);
            place.step([(x / 0.055).round() * 0.055, -x]);
        }
        let [x, y] = place.at();
        assert!((x - 0.2 * 499.0).abs() < 0.02 && (y + 0.2 * 499.0).abs() < 1e-6, "{x} {y}");
        assert!((place.velocity()[0] - 100.0).abs() < 2.0 && (place.velocity()[1] + 100.0).abs() < 1e-6);
    }

    #[test]
    fn stylus_put_down_elsewhere_is_no_motion() {
        let mut place = Place::new(0.002);
        for tick in 0..100 {
            place.step([0.2 * f64::from(tick), 0.0]);
        }
        assert_eq!(place.step([500.0, 30.0]), None);
        assert_eq!((place.at(), place.velocity()), ([500.0, 30.0], [0.0; 2]));
        assert_eq!(place.step([f64::NAN, 0.0]), Some([0.0; 2]));
        assert_eq!(place.at(), [500.0, 30.0]);
    }

    #[test]
    fn fast_hand_at_long_ticks_moves() {
        let mut place = Place::new(0.02);
        place.step([0.0; 2]);
        for tick in 1..20 {
            let way = place.step([20.0 * f64::from(tick), 0.0]).unwrap();
            assert!((way[0] - 20.0).abs() < 1e-9, "{way:?}");
        }
    }
}
