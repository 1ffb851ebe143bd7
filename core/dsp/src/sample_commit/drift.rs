//! Control of the phase that all bins have in common.
//!
//! If every bin above 0 is rotated by one angle, only the magnitudes of the lowest bins change, where
//! positive and negative frequencies meet. The first frames leave this angle to chance, and the frozen
//! samples keep it. So passes rotate all bins a little along the slope of the squared error over this angle,
//! from bins 0 and 1.

use crate::{Complex, Float, float::phasor};
use asperity_state::State;

/// Rotation of a pass in rad for a slope over the energy, and its limit.
const GAIN: f64 = 13.0;
const MOST: f64 = 2e-3;

/// One of this many frames is evaluated.
pub(super) const EVERY: u64 = 4;

#[derive(Debug)]
pub(super) struct Drift<T> {
    /// `e^(-2 pi i j / n)` for each sample.
    wave: Vec<Complex<T>>,
    /// Weight of a new frame in the means.
    part: f64,
    /// Means over frames of half the negative slope and of the energy, in the unit of the frames.
    slope: f64,
    energy: f64,
}

impl<T: Float> Drift<T> {
    pub(super) fn new(n: usize, hop: usize) -> Self {
        Self {
            wave: (0..n).map(|j| phasor(-(j as f64) / n as f64)).collect(),
            part: (EVERY as f64 * hop as f64 / n as f64).min(1.0),
            slope: 0.0,
            energy: 0.0,
        }
    }

    pub(super) fn clear(&mut self) {
        (self.slope, self.energy) = (0.0, 0.0);
    }

    /// Evaluates a frame's samples and its wanted magnitudes (a quarter of the amplitudes), all divided
    /// by `scale`.
    ///
    /// With `R` the transform without a window, the Hann window has `2 X_0 = R_0 - Re R_1` and `4 X_1 =
    /// 2 R_1 - R_0 - R_2`. Where `R_1` and `R_2` are rotated and `R_0` is not, `2 dX_0 = Im R_1` and `4
    /// d|X_1| = R_0 Im X_1 / |X_1|`.
    pub(super) fn hear(&mut self, samples: &[T], magnitudes: &[T], scale: f64) {
        let &[m0, m1, ..] = magnitudes else { return };
        let (mut r0, mut r1, mut r2) = (T::zero(), Complex::<T>::default(), Complex::<T>::default());
        for (&x, &w) in samples.iter().zip(&self.wave) {
            r0 += x;
            r1 = r1 + w * x;
            r2 = r2 + w * w * x;
        }
        let n = samples.len() as f64;
        let (m0, m1, r0) = (n * m0.f64(), n * m1.f64(), r0.f64());
        let x0 = 0.5 * (r0 - r1.re.f64());
        let x1 = Complex::new(
            0.5 * r1.re.f64() - 0.25 * (r0 + r2.re.f64()),
            0.5 * r1.im.f64() - 0.25 * r2.im.f64(),
        );
        let size = asperity_numbers::size(x1).max(f64::MIN_POSITIVE);
        let slope =
            (m0 - x0.abs()) * x0.signum() * 0.5 * r1.im.f64() + (m1 - size) * 0.25 * r0 * x1.im / size;
        let energy = n * n * magnitudes.iter().map(|m| m.f64().powi(2)).sum::<f64>();
        self.slope += self.part * (slope * scale * scale - self.slope);
        self.energy += self.part * (energy * scale * scale - self.energy);
    }

    /// Rotation of the bins by a pass, in turns.
    pub(super) fn turns(&self) -> f64 {
        if self.energy <= 0.0 {
            return 0.0;
        }
        (GAIN * self.slope / self.energy).clamp(-MOST, MOST) / std::f64::consts::TAU
    }

    pub(super) fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.slope).keep(&mut self.energy);
        if state.restores() && !(self.slope.is_finite() && self.energy.is_finite()) {
            self.clear();
            state.refuse();
        }
    }
}
