//! The minimum-jerk movement from rest to rest.
//!
//! T. Flash, N. Hogan, "The coordination of arm movements: an experimentally confirmed mathematical
//! model", J. Neuroscience 5(7), 1985. The movement with the least squared jerk over a distance in a
//! given time is a straight line travelled as 10 s^3 - 15 s^4 + 6 s^5.

/// Travelled part of the way, 0 to 1, at the part `s` of the time. `s` is clamped to 0..=1.
pub fn minimum_jerk(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// Integral of [`minimum_jerk`] from 0 to `s`: the way if the *speed* rises so. It is 1/2 at `s` = 1.
pub(super) fn minimum_jerk_ramp_integral(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s.powi(4) * (2.5 + s * (s - 3.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_at_rest_with_no_acceleration() {
        assert_eq!(minimum_jerk(0.0), 0.0);
        assert_eq!(minimum_jerk(1.0), 1.0);
        assert_eq!(minimum_jerk(-3.0), 0.0);
        assert_eq!(minimum_jerk(7.0), 1.0);
        // Near an end the way grows as 10 h^3: without speed and acceleration.
        let h = 1e-4;
        assert!((minimum_jerk(h) / (10.0 * h.powi(3)) - 1.0).abs() < 1e-3);
        assert!(((1.0 - minimum_jerk(1.0 - h)) / (10.0 * h.powi(3)) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn integral_is_the_antiderivative() {
        let h = 1e-5;
        for i in 1..100 {
            let s = f64::from(i) / 100.0;
            let slope = (minimum_jerk_ramp_integral(s + h) - minimum_jerk_ramp_integral(s - h)) / (2.0 * h);
            assert!((slope - minimum_jerk(s)).abs() < 1e-7);
        }
        assert_eq!(minimum_jerk_ramp_integral(1.0), 0.5);
    }

    /// Polynomial bumps that keep the ends at rest only raise the integral of squared jerk.
    #[test]
    fn no_neighbour_has_less_jerk() {
        let cost = |e: f64| -> f64 {
            let f = |s: f64| minimum_jerk(s) + e * (s * (1.0 - s)).powi(3);
            let (n, h) = (2000, 1e-3);
            (2..n - 2)
                .map(|i| {
                    let s = (f64::from(i) + 0.5) / f64::from(n);
                    let (a, b) = (s.max(2.0 * h), h);
                    let a = a.min(1.0 - 2.0 * h);
                    let jerk = (f(a + 2.0 * b) - 2.0 * f(a + b) + 2.0 * f(a - b) - f(a - 2.0 * b))
                        / (2.0 * b.powi(3));
                    jerk * jerk / f64::from(n)
                })
                .sum()
        };
        let least = cost(0.0);
        // Exact: the third derivative is 60 - 360 s + 360 s^2 with a mean square of 720.
        assert!((least / 720.0 - 1.0).abs() < 0.02, "{least}");
        for e in [-2.0, -0.5, 0.5, 2.0] {
            assert!(cost(e) > least, "{e}");
        }
    }
}
