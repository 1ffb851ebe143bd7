//! Models of pieces, and one order for all.

use asperity_numbers::Elementary as _;
use std::f64::consts::TAU;

use asperity_diagnostics::Diagnostic;
use asperity_dsp::filter::Section;
use asperity_numbers::Random;

use super::super::Filter;
use super::blocks::{Blocks, Span};
use super::signal::filter;
use super::{Criterion, Order, Settings};

/// Seed of the noise that is put back.
const SEED: u64 = 6;
/// Least residual variance as a part of the mean square: below it is rounding.
const NOTHING: f64 = 1e-10;
/// Largest reflection coefficient. A signal without noise would give 1.
const REFLECTION: f64 = 1.0 - 1e-12;
/// Rounds to find the density below the high-pass. The first has no signal there.
const ROUNDS: usize = 2;
/// Largest part of the mean square to put back: beside a tone the density means nothing.
const MOST_PUT_BACK: f64 = 0.5;

/// Models of all orders of each piece.
pub(super) fn lattices(
    blocks: &Blocks,
    pieces: &[Span],
    settings: &Settings,
) -> Result<Vec<Lattice>, Diagnostic> {
    let missing = missing(blocks, settings)?;
    let density_at = TAU * 2.0 * settings.high_pass_hz / blocks.rate_hz;
    let lattice = |piece: &Span| {
        let signal = blocks.signal_of(piece);
        let start = piece.start * blocks.len;
        let missing = missing.get(start..start + signal.len()).unwrap_or_default();
        whole(signal, missing, density_at, settings.order.most())
    };
    Ok(pieces.iter().map(lattice).collect())
}

/// The order for all pieces, and the criterion by order minus its least value.
pub(super) fn order(lattices: &[Lattice], order: Order) -> (usize, Vec<(usize, f64)>) {
    let (most, by) = match order {
        Order::Given(order) => return (order, Vec::new()),
        Order::Best { most, by } => (most, by),
    };
    let sum = |p: usize| lattices.iter().map(|l| l.criterion(p, by)).sum::<f64>();
    let mut curve: Vec<(usize, f64)> = (1..=most).map(|p| (p, sum(p))).collect();
    let (best, least) = curve.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((1, 0.0));
    curve.iter_mut().for_each(|(_, value)| *value -= least);
    (best, curve)
}

/// Noise of power 1 a sample through the low-pass of the power that the high-pass takes: `|L|^2 + |H|^2 = 1`
/// for Butterworth filters of one corner. Empty without a high-pass.
fn missing(blocks: &Blocks, settings: &Settings) -> Result<Vec<f64>, Diagnostic> {
    if settings.high_pass_hz == 0.0 {
        return Ok(Vec::new());
    }
    let mut random = Random::new(SEED);
    let mut noise: Vec<f64> = (0..blocks.signal.len()).map(|_| random.normal()).collect();
    filter(&mut noise, Section::low_pass, blocks.rate_hz, settings.high_pass_hz)?;
    Ok(noise)
}

/// The lattice of a signal with the missing part put back. `w` is where the spectrum gives its density,
/// in radians a sample.
fn whole(signal: &[f64], missing: &[f64], w: f64, most: usize) -> Lattice {
    let mut lattice = Lattice::new(signal, most);
    if missing.is_empty() {
        return lattice;
    }
    let mean_square = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64;
    let (of_signal, of_missing) = (mean_square(signal), mean_square(missing));
    for _ in 0..ROUNDS {
        let filter = Filter::new(&lattice.coefficients(most), &[], lattice.residual(most).sqrt());
        let density = filter.power(w).min(MOST_PUT_BACK * of_signal / of_missing.max(f64::MIN_POSITIVE));
        if !density.is_finite() {
            break;
        }
        let scale = density.sqrt();
        let sum: Vec<f64> = signal.iter().zip(missing).map(|(x, m)| x + scale * m).collect();
        lattice = Lattice::new(&sum, most);
    }
    lattice
}

/// Reflection coefficients by Burg's method (J. P. Burg, "Maximum entropy spectral analysis", 1975): each
/// minimises the error of the forward and the backward predictor. None exceeds 1, so every order is stable.
pub(super) struct Lattice {
    samples: f64,
    reflections: Vec<f64>,
    /// Residual variances of orders 0, 1, ..
    residuals: Vec<f64>,
}

impl Lattice {
    pub(super) fn new(signal: &[f64], most: usize) -> Self {
        let samples = signal.len() as f64;
        let mean_square = signal.iter().map(|x| x * x).sum::<f64>() / samples.max(1.0);
        let (mut forward, mut backward) = (signal.to_vec(), signal.to_vec());
        let (mut reflections, mut residuals) = (Vec::with_capacity(most), vec![mean_square]);
        let mut variance = mean_square;
        for order in 1..=most.min(signal.len().saturating_sub(1)) {
            // The forward error at n with the backward error at n - 1.
            let (mut both, mut squares) = (0.0, 0.0);
            for (f, b) in forward[order..].iter().zip(&backward[order - 1..]) {
                both += f * b;
                squares += f * f + b * b;
            }
            let left = variance > NOTHING * mean_square && squares > 0.0;
            let k = if left { (-2.0 * both / squares).clamp(-REFLECTION, REFLECTION) } else { 0.0 };
            for n in (order..signal.len()).rev() {
                let (f, b) = (forward[n], backward[n - 1]);
                forward[n] = f + k * b;
                backward[n] = b + k * f;
            }
            variance = (variance * (1.0 - k * k)).max(NOTHING * mean_square);
            reflections.push(k);
            residuals.push(variance);
        }
        Self { samples, reflections, residuals }
    }

    /// Residual variance of an order; of order 0 it is the mean square.
    pub(super) fn residual(&self, order: usize) -> f64 {
        self.residuals.get(order).or(self.residuals.last()).copied().unwrap_or(0.0)
    }

    fn criterion(&self, order: usize, by: Criterion) -> f64 {
        let (n, k) = (self.samples, (order + 1) as f64);
        let penalty = match by {
            Criterion::Aicc => 2.0 * k * n / (n - k - 1.0),
            Criterion::Bic => k * n.log_e(),
        };
        n * self.residual(order).max(f64::MIN_POSITIVE).log_e() + penalty
    }

    /// Levinson's step up from each order to the next.
    pub(super) fn coefficients(&self, order: usize) -> Vec<f64> {
        let mut a: Vec<f64> = Vec::with_capacity(order);
        for &k in self.reflections.iter().take(order) {
            let lower = a.clone();
            a.iter_mut().zip(lower.iter().rev()).for_each(|(x, y)| *x += k * y);
            a.push(k);
        }
        a.resize(order, 0.0);
        a
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::is_stable;
    use super::*;

    #[test]
    fn each_reflection_minimises_burgs_error() {
        let mut random = Random::new(6);
        let mut signal = vec![0.0; 200];
        for n in 2..200 {
            signal[n] = 1.4 * signal[n - 1] - 0.8 * signal[n - 2] + random.normal();
        }
        let lattice = Lattice::new(&signal, 6);
        // Errors of the forward and backward predictors from the coefficients: Burg's criterion by
        // definition.
        let left = |a: &[f64]| -> f64 {
            let p = a.len();
            (p..signal.len())
                .map(|n| {
                    let f: f64 = signal[n] + (0..p).map(|i| a[i] * signal[n - 1 - i]).sum::<f64>();
                    let b: f64 = signal[n - p] + (0..p).map(|i| a[i] * signal[n - p + 1 + i]).sum::<f64>();
                    f * f + b * b
                })
                .sum()
        };
        for order in 1..=6 {
            let with = |k: f64| {
                let mut reflections = lattice.reflections.clone();
                reflections[order - 1] = k;
                Lattice { reflections, residuals: vec![], samples: 0.0 }.coefficients(order)
            };
            let k = lattice.reflections[order - 1];
            let least = left(&with(k));
            assert!(left(&with(k + 1e-3)) > least && left(&with(k - 1e-3)) > least, "order {order}");
            assert!(is_stable(&lattice.coefficients(order)));
        }
        assert!((lattice.residual(2) - 1.0).abs() < 0.25);
    }

    #[test]
    fn signals_without_noise_stay_finite() {
        let tone: Vec<f64> = (0..500).map(|n| (0.3 * f64::from(n)).sin()).collect();
        let ramp: Vec<f64> = (0..500).map(f64::from).collect();
        let click: Vec<f64> = (0..500).map(|n| f64::from(u8::from(n == 250))).collect();
        for signal in [tone, ramp, click, vec![0.0; 500], vec![3.0; 500], vec![1.0], vec![]] {
            let lattice = Lattice::new(&signal, 24);
            for order in [1, 7, 24] {
                let a = lattice.coefficients(order);
                assert!(a.len() == order && a.iter().all(|x| x.is_finite()));
                assert!(lattice.residual(order).is_finite());
            }
        }
    }
}
