//! What the inverse and an actuator answer to a sine, in closed form.

use std::f64::consts::{PI, TAU};

use asperity_actuator::{Drive, Dynamics};
use asperity_dsp::filter::Complex64;

/// Corner \[Hz\] and damping ratio of the inverse's high-pass: its defaults.
pub(super) const CORNER: (f64, f64) = (20.0, std::f64::consts::FRAC_1_SQRT_2);

/// Drive per acceleration \[A or V per m/s^2\] of the inverse of `d`, transformed bilinearly so as to be exact at the resonance w:
/// `s = j c tan(pi f / rate)`, `c = w / tan(w / 2 rate)`.
pub(super) fn inverse(d: &Dynamics, drive: Drive, hz: f64, rate_hz: f64) -> Complex64 {
    let w = d.natural_rad_s();
    let c = w / (w / 2.0 / rate_hz).tan();
    let s = Complex64::new(0.0, c * (PI * hz / rate_hz).tan());
    let (mu, wc) = (d.reduced_mass(), TAU * CORNER.0);
    let corner = s * s + s * (2.0 * CORNER.1 * wc) + wc * wc;
    let current =
        -(d.handle_mass / d.force_factor) * (s * s + s * (d.damping / mu) + d.stiffness / mu) / corner;
    match drive {
        Drive::Current => current,
        Drive::Voltage => {
            let emf = -(d.force_factor * d.handle_mass / mu) * s / corner;
            let roof = s / (TAU * (rate_hz / 4.0).min(10_000.0)) + 1.0;
            ((s * d.inductance + d.resistance) * current + emf) / roof
        }
    }
}

/// Acceleration per drive \[m/s^2 per A or V\] of the actuator under a drive that is held from sample to sample.
///
/// By partial fractions: a part `r / (s - p)` of the transfer function is `r (e^(p T) - 1) / p / (z - e^(p T))` then.
pub(super) fn plant(d: &Dynamics, drive: Drive, hz: f64, rate_hz: f64) -> Complex64 {
    let (mu, push) = (d.reduced_mass(), d.force_factor / d.handle_mass);
    let (b, ww) = (d.damping / mu, d.stiffness / mu);
    // A/u = direct + part / den, highest power first; den is monic.
    let (direct, part, den) = match drive {
        Drive::Current => (-push, vec![push * b, push * ww], vec![1.0, b, ww]),
        Drive::Voltage => {
            let (r, l) = (d.resistance, d.inductance);
            let brake = d.force_factor * d.force_factor / mu;
            (0.0, vec![-push / l, 0.0, 0.0], vec![1.0, r / l + b, r * b / l + ww + brake / l, r * ww / l])
        }
    };
    let derivative: Vec<f64> =
        den.iter().zip((1..den.len()).rev()).map(|(a, power)| a * power as f64).collect();
    let z = Complex64::from_polar(1.0, TAU * hz / rate_hz);
    let parts = roots(&den).into_iter().map(|p| {
        let held = (p / rate_hz).exp();
        at(&part, p) / at(&derivative, p) * (held - 1.0) / p / (z - held)
    });
    parts.sum::<Complex64>() + direct
}

fn at(polynomial: &[f64], s: Complex64) -> Complex64 {
    polynomial.iter().fold(Complex64::new(0.0, 0.0), |sum, a| sum * s + *a)
}

/// The roots of a monic polynomial, all at once (K. Weierstrass 1891, E. Durand 1960, I. Kerner 1966).
fn roots(monic: &[f64]) -> Vec<Complex64> {
    let degree = monic.len() - 1;
    // A circle around all of them (Fujiwara).
    let radius = monic.iter().enumerate().skip(1).map(|(k, a)| 2.0 * a.abs().powf(1.0 / k as f64));
    let radius = radius.fold(0.0, f64::max);
    let start = |k: usize| Complex64::from_polar(radius, TAU * k as f64 / degree as f64 + 0.4);
    let mut all: Vec<Complex64> = (0..degree).map(start).collect();
    for _ in 0..500 {
        for k in 0..degree {
            let others = (0..degree).filter(|i| *i != k).map(|i| all[k] - all[i]);
            let step = at(monic, all[k]) / others.product::<Complex64>();
            all[k] -= step;
        }
    }
    all
}

/// Amplitude and phase, against a sine, of what of `y` is at `hz`, over whole periods.
pub(super) fn lock_in(y: &[f64], first: u64, hz: f64, rate_hz: f64) -> Complex64 {
    // The phase by the remainder, which is exact for whole numbers.
    let turn = |n: u64| (hz * n as f64) % rate_hz / rate_hz;
    let sum: Complex64 = y.iter().zip(first..).map(|(y, n)| Complex64::from_polar(*y, -TAU * turn(n))).sum();
    sum * Complex64::new(0.0, 2.0 / y.len().max(1) as f64)
}
