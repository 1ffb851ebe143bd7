//! The inverse against the equations of motion and a simulated actuator.

use super::super::testing::{hapcoil, lock_in};
use super::super::{Drive, Plant};
use super::*;
use std::f64::consts::PI;

const RATE: f64 = 48_000.0;

fn inverse(grams: f64, drive: Drive, rate: f64) -> Inverse {
    Inverse::new(&hapcoil(grams), drive, rate, InverseSettings::default()).unwrap()
}

/// A/A* of the default inverse and a simulated actuator at `hz`, by a sine of 1 m/s^2.
fn pair(drive: Drive, hz: f64, handle: impl FnMut(f64) -> f64) -> Complex64 {
    pair_of(inverse(100.0, drive, RATE), hz, RATE, handle)
}

/// A/A* of any inverse, measured from one second to two.
fn pair_of(mut inverse: Inverse, hz: f64, rate: f64, mut handle: impl FnMut(f64) -> f64) -> Complex64 {
    let second = rate as usize;
    let wanted: Vec<f32> = (0..2 * second).map(|n| (TAU * hz * n as f64 / rate).sin() as f32).collect();
    let mut driven = vec![0.0; wanted.len()];
    for (x, y) in wanted.chunks(89).zip(driven.chunks_mut(89)) {
        inverse.process(x, y);
    }
    let felt: Vec<f64> = driven.iter().map(|u| handle(f64::from(*u))).collect();
    lock_in(&felt[second..], hz, rate)
}

/// In closed form from 1 Hz, where the actuator pushes nothing, to far above its band. Also for actuators
/// whose mass, spring and damping are 20 % off.
#[test]
fn pair_answers_as_its_filters_in_closed_form() {
    let d = hapcoil(100.0);
    for drive in [Drive::Current, Drive::Voltage] {
        for corner in 0..9 {
            let by = |bit: u32| if corner == 8 { 1.0 } else { 0.8 + 0.4 * f64::from(corner >> bit & 1) };
            let other = Dynamics {
                moving_mass: d.moving_mass * by(0),
                stiffness: d.stiffness * by(1),
                damping: d.damping * by(2),
                ..d
            };
            let all = [1.0, 5.0, 20.0, 40.0, 65.0, 90.0, 400.0, 1000.0, 8000.0, 20_000.0, 23_999.0];
            for hz in all.into_iter().filter(|hz| corner == 8 || (20.0..=400.0).contains(hz)) {
                let mut plant = Plant::new(&other, drive, RATE);
                let got = pair(drive, hz, |u| plant.step(u).acceleration);
                let stated = stated_inverse(&d, drive, hz) * stated_plant(&other, drive, hz);
                // Flat where it is meant to be.
                let db = 20.0 * got.norm().log10();
                assert!(corner != 8 || !(40.0..=1000.0).contains(&hz) || db.abs() < 0.3, "{hz} Hz: {db} dB");
                // f32 rounds away 10^-5 of what is asked at most.
                let off = (got - stated).norm();
                assert!(off <= 1e-3 * stated.norm() + 1e-5, "{drive:?} {corner} {hz} Hz: {got} {stated}");
            }
        }
    }
}

#[test]
fn block_length_does_not_matter_and_nan_passes_over() {
    let x: Vec<f32> = (0..500)
        .map(|n| {
            if n == 100 {
                f32::NAN
            } else if n == 200 {
                f32::INFINITY
            } else {
                (n as f32 * 0.3).sin()
            }
        })
        .collect();
    let (mut a, mut b) = (inverse(100.0, Drive::Voltage, RATE), inverse(100.0, Drive::Voltage, RATE));
    let (mut whole, mut parts) = (vec![0.0; 500], vec![0.0; 500]);
    a.process(&x, &mut whole);
    for n in 0..500 {
        b.process(&x[n..n], &mut []);
        b.process(&x[n..=n], &mut parts[n..=n]);
    }
    assert_eq!(whole, parts);
    assert!(whole.iter().all(|y| y.is_finite()));
    assert_eq!(a.ignored(), 2);
    b.process(&[f32::MAX; 96], &mut parts[..96]);
    assert!(parts.iter().all(|y| y.is_finite()));
}

#[test]
fn settings_and_rates_that_do_not_fit_are_refused() {
    let d = hapcoil(100.0);
    let make = |rate, corner_hz| {
        Inverse::new(&d, Drive::Current, rate, InverseSettings { corner_hz, ..Default::default() })
    };
    assert!(make(48_000.0, 20.0).is_ok());
    for (rate, corner) in
        [(0.0, 20.0), (f64::NAN, 20.0), (500.0, 20.0), (48_000.0, 1.0), (48_000.0, f64::NAN)]
    {
        assert!(make(rate, corner).is_err(), "{rate} {corner}");
    }
}

#[test]
fn each_model_shows_exactly_what_it_leaves_out() {
    use InverseModel::{Full, Mass, NoEmf, NoInductance};
    // So high that half a sample is a thousandth of a turn at 1 kHz.
    let rate = 480_000.0;
    let d = hapcoil(100.0);
    for drive in [Drive::Current, Drive::Voltage] {
        for model in [Full, NoInductance, NoEmf, Mass] {
            let settings = InverseSettings { model, ..InverseSettings::default() };
            let inverse = Inverse::new(&d, drive, rate, settings).unwrap();
            for hz in [25.0, 65.0, 200.0, 1000.0] {
                let s = Complex64::new(0.0, TAU * hz);
                let wc = TAU * 20.0;
                let corner = s * s / (s * s + s * (2.0 * FRAC_1_SQRT_2 * wc) + wc * wc);
                // Newton's law for mover and handle, without any section or formula of the inverse.
                let mu = d.moving_mass * d.handle_mass / (d.moving_mass + d.handle_mass);
                let resonance = s * s * mu / (s * s * mu + s * d.damping + d.stiffness);
                let emf = s * d.force_factor * d.force_factor / (s * s * mu + s * d.damping + d.stiffness);
                let coil = s * d.inductance + emf + d.resistance;
                let want = match (model, drive) {
                    (Mass, Drive::Current) => resonance,
                    (Mass, Drive::Voltage) => resonance * d.resistance / coil,
                    (_, Drive::Current) => corner,
                    (NoEmf, _) => corner * d.resistance / coil,
                    (NoInductance, _) => corner * (emf + d.resistance) / coil,
                    (Full, _) => corner / (s / (TAU * 10_000.0) + 1.0),
                };
                let mut plant = Plant::new(&d, drive, rate);
                let got = pair_of(inverse.clone(), hz, rate, |u| plant.step(u).acceleration);
                assert!((got / want - 1.0).norm() < 0.01, "{model:?} {drive:?} {hz} Hz: {got} {want}");
                // The stated response is the actual one.
                let stated = inverse.response(hz) * d.acceleration_per_current().response(hz)
                    / if drive == Drive::Voltage { coil } else { Complex64::new(1.0, 0.0) };
                assert!((stated / want - 1.0).norm() < 0.001, "{model:?} {drive:?} {hz} Hz: {stated} {want}");
            }
        }
    }
}

#[test]
fn inverse_goes_on_from_another_model_not_another_drive() {
    use InverseModel::{Full, Mass, NoEmf, NoInductance};
    let make = |drive, model| {
        let settings = InverseSettings { model, ..InverseSettings::default() };
        Inverse::new(&hapcoil(100.0), drive, RATE, settings).unwrap()
    };
    let wave: Vec<f32> = (0..4800).map(|n| (n as f32 * 0.01).sin()).collect();
    let ring = |inverse: &mut Inverse| {
        let mut y = vec![0.0; wave.len()];
        inverse.process(&wave, &mut y);
        y
    };
    let mut bytes = vec![0; State::measure(|s| make(Drive::Voltage, Full).state(s))];
    for from in [Full, NoInductance, NoEmf, Mass] {
        let mut old = make(Drive::Voltage, from);
        ring(&mut old);
        State::save(&mut bytes, |s| old.state(s)).unwrap();
        for to in [Full, NoInductance, NoEmf, Mass] {
            let mut new = make(Drive::Voltage, to);
            assert!(State::restore(&bytes, |s| new.state(s)), "{from:?} {to:?}");
            // A section that never runs must be at rest.
            let mut silence = vec![0.0; 480_000];
            new.process(&vec![0.0; silence.len()], &mut silence);
            assert!(new.rests(), "{from:?} {to:?}");
        }
        let mut same = make(Drive::Voltage, from);
        assert!(State::restore(&bytes, |s| same.state(s)));
        assert_eq!(ring(&mut same), ring(&mut old), "{from:?}");
        assert!(!State::restore(&bytes, |s| make(Drive::Current, from).state(s)), "{from:?}");
    }
}

#[test]
fn huge_acceleration_decays_like_a_large_one() {
    for drive in [Drive::Current, Drive::Voltage] {
        let mut inv = inverse(100.0, drive, RATE);
        let mut u = vec![0.0; 4800];
        inv.process(&[1e30; 4800], &mut u);
        assert!(u.iter().all(|u| u.is_finite()));
        let mut rest = vec![0.0; 24_000];
        inv.process(&[0.0; 24_000], &mut rest);
        // exp(-w_c zeta_c t) at 20 Hz is 309 dB in 0.4 s.
        assert!(rest[19_200..].iter().all(|u| u.abs() < 1e-6), "{drive:?} {}", rest[19_200]);
    }
}

/// Drive per acceleration of the inverse of `d` \[A or V per m/s^2\], by the bilinear transform that is
/// exact at the resonance w: `s = j c tan(pi f / rate)`, `c = w / tan(w / 2 rate)`.
fn stated_inverse(d: &Dynamics, drive: Drive, hz: f64) -> Complex64 {
    let w = d.natural_rad_s();
    let c = w / (w / 2.0 / RATE).tan();
    let s = Complex64::new(0.0, c * (PI * hz / RATE).tan());
    let (mu, wc) = (d.reduced_mass(), TAU * 20.0);
    let corner = s * s + s * (2.0 * FRAC_1_SQRT_2 * wc) + wc * wc;
    let current =
        -(d.handle_mass / d.force_factor) * (s * s + s * (d.damping / mu) + d.stiffness / mu) / corner;
    match drive {
        Drive::Current => current,
        Drive::Voltage => {
            let emf = -(d.force_factor * d.handle_mass / mu) * s / corner;
            let roof = s / (TAU * (RATE / 4.0).min(10_000.0)) + 1.0;
            ((s * d.inductance + d.resistance) * current + emf) / roof
        }
    }
}

/// Acceleration per drive of the actuator \[m/s^2 per A or V\]; the drive is held from sample to sample.
///
/// By partial fractions: the hold makes `r (e^(p T) - 1) / p / (z - e^(p T))` of a part `r / (s - p)`.
fn stated_plant(d: &Dynamics, drive: Drive, hz: f64) -> Complex64 {
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
    let z = Complex64::from_polar(1.0, TAU * hz / RATE);
    let parts = roots(&den).into_iter().map(|p| {
        let held = (p / RATE).exp();
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
