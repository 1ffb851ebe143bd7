//! The low-pass from which a resampler takes its taps, as a function of continuous time.

use asperity_numbers::{Elementary as _, polar, size as size_of};

use crate::Complex;
use asperity_fft::Transform;
use std::f64::consts::PI;

/// Attenuation in dB at the stop band's edge and beyond, for which the length is designed.
const ATTENUATION_DB: f64 = 88.0;

/// Grid points per sample of the lower rate for a minimum-phase response.
const GRID: usize = 32;

/// Impulse response of a low-pass with its half-amplitude point at half the lower rate.
///
/// Time is in samples of the lower rate, and the integral over time is 1.
pub(super) enum Prototype {
    /// `sinc(t)` under a Kaiser window, even about 0: on `[-half, half]`.
    Linear { half: f64 },
    /// The same magnitude response with all its zeros inside the unit circle: on `[0, len]`, `GRID`
    /// points a sample.
    Minimum { grid: Vec<f64> },
}

/// Number of taps per sample of the lower rate, even: J. F. Kaiser's estimate for a transition of `1 -
/// 2 passband` (A. Oppenheim, R. Schafer, "Discrete-Time Signal Processing", 3rd ed., eq. 7.76).
pub(super) fn length(passband: f64) -> usize {
    let width = 1.0 - 2.0 * passband;
    // 14.36 is 2.285 x 2 pi.
    let taps = (ATTENUATION_DB - 7.95) / (14.36 * width);
    2 * (taps / 2.0).ceil() as usize
}

/// `kaiser(t / half) sinc(t)`, the window as in Oppenheim and Schafer, eq. 7.72 and 7.75.
fn windowed_sinc(t: f64, half: f64) -> f64 {
    let x = 1.0 - (t / half).powi(2);
    if x < 0.0 {
        return 0.0;
    }
    let beta = 0.1102 * (ATTENUATION_DB - 8.7);
    let sinc = if t.abs() < 1e-9 { 1.0 } else { (PI * t).sine() / (PI * t) };
    sinc * bessel_i0(beta * x.sqrt()) / bessel_i0(beta)
}

/// Modified Bessel function of the first kind, order 0, by its power series.
fn bessel_i0(x: f64) -> f64 {
    let q = x * x / 4.0;
    let (mut term, mut sum, mut k) = (1.0, 1.0, 1.0);
    while term > 1e-17 * sum {
        term *= q / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

impl Prototype {
    pub(super) fn linear(passband: f64) -> Self {
        Self::Linear { half: length(passband) as f64 / 2.0 }
    }

    /// Computes the minimum-phase response by the real cepstrum (Oppenheim and Schafer, section 13.7).
    pub(super) fn minimum(passband: f64) -> Self {
        let len = length(passband);
        let count = len * GRID + 1;
        // The longer the transform, the less the cepstrum wraps around.
        let size = (32 * count).next_power_of_two();
        let mut transform = Transform::<f64>::new(size);
        for (i, h) in transform.time.iter_mut().take(count).enumerate() {
            *h = windowed_sinc(i as f64 / GRID as f64 - len as f64 / 2.0, len as f64 / 2.0) / GRID as f64;
        }
        transform.forward();
        // Zeros in the stop band have no logarithm, so there is a floor at -130 dB.
        for x in &mut transform.bins {
            *x = Complex::new(size_of(*x).max(10f64.power(-130.0 / 20.0)).log_e(), 0.0);
        }
        transform.inverse();
        let fold = |i: usize| {
            if i == 0 || i == size / 2 {
                1.0
            } else if i < size / 2 {
                2.0
            } else {
                0.0
            }
        };
        for (i, c) in transform.time.iter_mut().enumerate() {
            *c *= fold(i) / size as f64;
        }
        transform.forward();
        for x in &mut transform.bins {
            *x = polar(x.re.exp_e(), x.im);
        }
        transform.inverse();
        let mut time = transform.time;
        time.truncate(count);
        let sum: f64 = time.iter().sum();
        Self::Minimum { grid: time.into_iter().map(|h| h * GRID as f64 / sum).collect() }
    }

    /// Impulse response at `t` samples of the lower rate.
    pub(super) fn at(&self, t: f64) -> f64 {
        match self {
            Self::Linear { half } => windowed_sinc(t, *half),
            Self::Minimum { grid } => {
                let place = t * GRID as f64;
                if place < 0.0 || place > (grid.len() - 1) as f64 {
                    return 0.0;
                }
                // Lagrange interpolation through six points: the response's band is a 27th of the grid's.
                let base = place.floor();
                let x = place - base;
                let mut sum = 0.0;
                for i in -2i32..=3 {
                    let Some(h) = (base as usize).checked_add_signed(i as isize).and_then(|k| grid.get(k))
                    else {
                        continue;
                    };
                    let others = (-2i32..=3).filter(|&j| j != i);
                    sum += h * others.map(|j| (x - f64::from(j)) / f64::from(i - j)).product::<f64>();
                }
                sum
            }
        }
    }

    /// Group delay in samples of the lower rate at `freq` in cycles a sample.
    pub(super) fn group_delay(&self, freq: f64) -> f64 {
        match self {
            Self::Linear { .. } => 0.0,
            Self::Minimum { grid } => {
                let (mut sum, mut moment) = (Complex::<f64>::default(), Complex::<f64>::default());
                for (i, h) in grid.iter().enumerate() {
                    let t = i as f64 / GRID as f64;
                    let x = polar(*h, -2.0 * PI * freq * t);
                    sum += x;
                    moment += x * t;
                }
                (moment / sum).re
            }
        }
    }
}
