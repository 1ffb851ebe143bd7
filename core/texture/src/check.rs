//! Compares a packed network with tract: inputs and error.

use asperity_numbers::Random;

use crate::Range;
use crate::signature::{FORCE_LEN, SPEED_LEN};

/// Force and velocity histories for one comparison.
#[derive(Clone, Debug)]
pub(crate) struct Probe {
    pub(crate) force: [f32; FORCE_LEN],
    pub(crate) speed: [f32; SPEED_LEN],
}

impl Probe {
    /// The probe as a network with this range gets it.
    pub(crate) fn held(&self, range: &Range) -> Self {
        let mut held = self.clone();
        range.forces(&self.force.map(f64::from), &mut held.force);
        range.velocities(&self.speed.map(f64::from), &mut held.speed);
        held
    }
}

fn even(force: f32, speed: f32) -> Probe {
    Probe { force: [force; FORCE_LEN], speed: [speed; SPEED_LEN] }
}

/// A random history within these forces, and speeds up to this one.
fn drawn(random: &mut Random, [low, high]: [f32; 2], speed: f32) -> Probe {
    Probe {
        force: std::array::from_fn(|_| (high - low) * unit(random) + low),
        speed: std::array::from_fn(|_| 2.0 * speed * unit(random) - speed),
    }
}

/// Probes within a stylus' range: rest, a steady stroke, and random histories (N, mm/s).
pub(crate) fn ordinary() -> Vec<Probe> {
    let mut random = Random::new(0x9e37_79b9_7f4a_7c15);
    let mut probes = vec![even(0.0, 0.0), even(1.0, 100.0), even(0.0, -300.0), even(3.3, 0.0)];
    probes.extend((0..8).map(|_| drawn(&mut random, [0.0, 3.3], 200.0)));
    probes
}

/// Other motions of a hand: random histories and even motions, in turn.
pub(crate) fn motions(count: usize) -> Vec<Probe> {
    let mut random = Random::new(0xbf58_476d_1ce4_e5b9);
    let motion = |i: usize| -> Probe {
        if i.is_multiple_of(2) {
            return drawn(&mut random, [0.0, 3.3], 200.0);
        }
        let mut line = |low: f32, high: f32| {
            let mut end = || low + (high - low) * unit(&mut random);
            let (from, to) = (end(), end());
            // Little happens within 20 ms.
            move |k: usize| from + 0.1 * (to - from) * k as f32 / FORCE_LEN as f32
        };
        let (force, x, y) = (line(0.0, 3.3), line(-200.0, 200.0), line(-200.0, 200.0));
        Probe {
            force: std::array::from_fn(force),
            speed: std::array::from_fn(|k| if k < FORCE_LEN { x(k) } else { y(k - FORCE_LEN) }),
        }
    };
    (0..count).map(motion).collect()
}

/// Probes a hundred times beyond the range; for a network that knows its range, at its ends. They have
/// their own full scale, so as not to hide errors of the others.
pub(crate) fn large() -> Vec<Probe> {
    let mut random = Random::new(0xd1b5_4a32_d192_ed03);
    let mut probes = vec![even(300.0, 30_000.0), even(-300.0, -30_000.0)];
    probes.extend((0..2).map(|_| drawn(&mut random, [-300.0, 300.0], 30_000.0)));
    probes
}

/// Largest difference as a part of full scale: the largest magnitude of `reference`. Infinite if only
/// one is finite, or if all of `reference` is zero and `found` is not.
pub(crate) fn error_of_full_scale(reference: &[f32], found: &[f32]) -> f64 {
    let full_scale = reference.iter().filter(|x| x.is_finite()).fold(0f64, |m, &x| m.max(f64::from(x).abs()));
    let worst =
        reference.iter().zip(found).fold(0f64, |worst, (&r, &f)| match (r.is_finite(), f.is_finite()) {
            (true, true) => worst.max((f64::from(r) - f64::from(f)).abs()),
            (false, false) => worst,
            _ => f64::INFINITY,
        });
    if reference.len() != found.len() {
        f64::INFINITY
    } else if worst == 0.0 {
        0.0
    } else {
        worst / full_scale
    }
}

/// Uniform in [0, 1).
fn unit(random: &mut Random) -> f32 {
    (random.bits() >> 40) as f32 / (1u64 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_a_share_of_full_scale() {
        assert_eq!(error_of_full_scale(&[0.0, -4.0], &[0.0, -4.0]), 0.0);
        assert_eq!(error_of_full_scale(&[0.0, -4.0], &[1.0, -4.0]), 0.25);
        assert_eq!(error_of_full_scale(&[0.0, 0.0], &[0.0, 0.0]), 0.0);
        assert_eq!(error_of_full_scale(&[0.0, 0.0], &[0.0, 0.1]), f64::INFINITY);
        assert_eq!(error_of_full_scale(&[1.0, f32::NAN], &[1.0, f32::NAN]), 0.0);
        assert_eq!(error_of_full_scale(&[1.0, 1.0], &[1.0, f32::NAN]), f64::INFINITY);
        assert_eq!(error_of_full_scale(&[1.0], &[1.0, 1.0]), f64::INFINITY);
    }
}
