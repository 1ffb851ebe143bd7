//! Transfer function of the actuator, and its fit to all recordings at once.

use asperity_numbers::{Elementary as _, polar, size};
use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use super::super::Drive;
use super::spectra::{Band, Spectra};

/// Number of figures of the actuator: k_f, m_a, k, c.
pub(super) const SHARED: usize = 4;
/// Number of figures of each recording: m_h and the latency.
pub(super) const OWN: usize = 2;
/// Number of figures that one recording depends on.
pub(super) const EACH: usize = SHARED + OWN;

/// Places in the fit's vector of the figures that recording `n` depends on.
pub(super) fn places(n: usize) -> [usize; EACH] {
    std::array::from_fn(|i| if i < SHARED { i } else { OWN * n + i })
}

/// Coil and amplifier: from a sample to a current.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coil {
    pub(super) drive: Drive,
    pub(super) resistance: f64,
    pub(super) inductance: f64,
    /// Time that a sample is held \[s\]; 0 behind a converter that smooths.
    pub(super) hold: f64,
}

impl Coil {
    /// Impedance R + L s of a coil under a voltage; 1 for a current.
    pub(super) fn impedance(&self, s: Complex64) -> Complex64 {
        match self.drive {
            Drive::Current => Complex64::from(1.0),
            Drive::Voltage => s * self.inductance + self.resistance,
        }
    }
}

/// Figures behind one recording's response, in SI units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Model {
    pub(super) coil: Coil,
    pub(super) force_factor: f64,
    pub(super) moving_mass: f64,
    pub(super) stiffness: f64,
    pub(super) damping: f64,
    pub(super) handle_mass: f64,
    pub(super) latency: f64,
    /// -1 if coil or accelerometer point the other way.
    pub(super) sign: f64,
}

impl Model {
    /// 1 / mu.
    pub(super) fn inverse_reduced_mass(&self) -> f64 {
        1.0 / self.moving_mass + 1.0 / self.handle_mass
    }

    pub(super) fn natural_rad_s(&self) -> f64 {
        (self.stiffness * self.inverse_reduced_mass()).sqrt()
    }

    pub(super) fn damping_ratio(&self) -> f64 {
        0.5 * self.damping * (self.inverse_reduced_mass() / self.stiffness).sqrt()
    }

    /// E, P and the denominator D = s^2 E + P / mu. For a current E = 1 and P = c s + k. For a voltage
    /// E = R + L s and P = (c s + k) E + k_f^2 s.
    fn parts(&self, s: Complex64) -> (Complex64, Complex64, Complex64) {
        let e = self.coil.impedance(s);
        let p = (s * self.damping + self.stiffness) * e + s * self.emf();
        (e, p, s * s * e + p * self.inverse_reduced_mass())
    }

    /// k_f^2 if the back-EMF acts, else 0.
    fn emf(&self) -> f64 {
        match self.coil.drive {
            Drive::Current => 0.0,
            Drive::Voltage => self.force_factor * self.force_factor,
        }
    }

    /// Effect of the hold on mover and coil, and the push on the handle, which is read at once.
    fn held(&self, hz: f64) -> (Complex64, f64) {
        let half = PI * hz * self.coil.hold;
        let push = match self.coil.drive {
            Drive::Current => -self.sign * self.force_factor / self.handle_mass,
            Drive::Voltage => 0.0,
        };
        let droop = if half > 0.0 { half.sine() / half } else { 1.0 };
        (polar(droop, -half), push)
    }

    /// Acceleration of the handle per ampere or volt, without latency.
    pub(super) fn response(&self, hz: f64) -> Complex64 {
        Self { latency: 0.0, ..*self }.gradient(hz).0
    }

    /// The response with latency, and its derivatives by ln k_f, ln m_a, ln k, ln c, ln m_h and the latency.
    pub(super) fn gradient(&self, hz: f64) -> (Complex64, [Complex64; EACH]) {
        let s = Complex64::new(0.0, TAU * hz);
        let (e, p, d) = self.parts(s);
        let late = polar(1.0, -TAU * hz * self.latency);
        let (hold, push) = self.held(hz);
        let moved = -s * s / d * (self.sign * self.force_factor / self.handle_mass) * hold * late;
        let pushed = (Complex64::from(1.0) - hold) * push * late;
        let u = self.inverse_reduced_mass();
        let one = Complex64::from(1.0);
        let by = [
            (one - s / d * (2.0 * u * self.emf())) * moved + pushed,
            p / d / self.moving_mass * moved,
            -e / d * (u * self.stiffness) * moved,
            -s * e / d * (u * self.damping) * moved,
            (p / d / self.handle_mass - 1.0) * moved - pushed,
            -s * (moved + pushed),
        ];
        (moved + pushed, by)
    }
}

/// Standard deviation of the logarithm of an unknown figure.
const UNKNOWN: f64 = 5.0;
/// Ranges of k_f, m_a, k and c, as in a profile.
const RANGES: [(f64, f64); SHARED] = [(0.01, 100.0), (5e-5, 1.0), (1.0, 1e6), (1e-4, 100.0)];
const ITERATIONS: usize = 60;

/// Prior of a value: a normal distribution of its logarithm.
#[derive(Clone, Copy, Debug)]
pub(super) struct Belief {
    pub(super) value: f64,
    /// Standard deviation of the logarithm.
    pub(super) spread: f64,
}

/// One recording with first estimates, ready to fit.
pub(super) struct Run {
    pub(super) spectra: Spectra,
    pub(super) handle_mass: Belief,
    /// Acceleration per ampere at high frequencies \[m/s^2 per A\].
    gain: f64,
    natural_rad_s: f64,
    damping_ratio: f64,
    latency: f64,
    sign: f64,
}

/// The figures and their uncertainty.
pub(super) struct Fitted {
    pub(super) models: Vec<Model>,
    /// Covariance of ln k_f, ln m_a, ln k, ln c and each recording's ln m_h and latency.
    pub(super) covariance: Vec<Vec<f64>>,
    at: Vec<f64>,
}

fn shape(coil: Coil, natural: f64, zeta: f64, hz: f64) -> Complex64 {
    let s = Complex64::new(0.0, TAU * hz);
    -s * s / (s * s + s * (2.0 * zeta * natural) + natural * natural) / coil.impedance(s)
}

impl Run {
    /// Finds resonance, damping and gain, the best of a grid by magnitude, then the latency that fits them
    /// best. Settles the bands of `spectra`.
    pub(super) fn new(mut spectra: Spectra, handle_mass: Belief, coil: Coil) -> Self {
        let (latency, _) = spectra.latency(|_| Complex64::from(1.0));
        spectra.settle(latency);
        let shape = |natural, zeta, hz| shape(coil, natural, zeta, hz);
        let (natural_rad_s, damping_ratio, gain) = grid(&spectra.bands, shape, spectra.band_hz());
        let (latency, same) = spectra.latency(|hz| shape(natural_rad_s, damping_ratio, hz));
        spectra.settle(latency);
        let sign = if same { 1.0 } else { -1.0 };
        Self { spectra, handle_mass, gain, natural_rad_s, damping_ratio, latency, sign }
    }
}

fn grid(
    bands: &[Band],
    shape: impl Fn(f64, f64, f64) -> Complex64,
    (from, to): (f64, f64),
) -> (f64, f64, f64) {
    let (low, high) = (from.max(3.0), to.min(1500.0).max(from.max(3.0) * 2.0));
    let mut best = (f64::INFINITY, (TAU * low, 0.1, 1.0));
    for i in 0..160 {
        let natural = TAU * low * (high / low).power(f64::from(i) / 159.0);
        for j in 0..24 {
            let zeta = 0.004 * 500f64.power(f64::from(j) / 23.0);
            let (mut sums, mut weight) = ([0.0; 2], 0.0);
            for band in bands.iter().filter(|b| b.response.norm_sqr() > 0.0) {
                let w = band.coherence / (1.02 - band.coherence);
                let off = (size(band.response) / size(shape(natural, zeta, band.hz))).log_e();
                sums = [sums[0] + w * off, sums[1] + w * off * off];
                weight += w;
            }
            let mean = sums[0] / weight.max(1e-9);
            let cost = sums[1] - weight * mean * mean;
            if cost < best.0 {
                best = (cost, (natural, zeta, mean.exp_e()));
            }
        }
    }
    best.1
}

/// All figures: ln k_f, ln m_a, ln k, ln c, then ln m_h and the latency of each recording.
type Point = Vec<f64>;

/// The model of a recording.
fn model(p: &Point, run: &Run, n: usize, coil: Coil) -> Model {
    Model {
        coil,
        force_factor: p[0].exp_e(),
        moving_mass: p[1].exp_e(),
        stiffness: p[2].exp_e(),
        damping: p[3].exp_e(),
        handle_mass: p[SHARED + OWN * n].exp_e(),
        latency: p[SHARED + OWN * n + 1],
        sign: run.sign,
    }
}

/// Start of the fit: means over the recordings, and the moving mass that two of them give, or the
/// believed one.
fn first_guess(runs: &[Run], coil: Coil, moving_mass: Belief) -> Point {
    let mean = |f: &dyn Fn(&Run) -> f64| runs.iter().map(f).sum::<f64>() / runs.len() as f64;
    let force_factor = mean(&|r| r.gain * r.handle_mass.value);
    let square = |r: &Run| r.natural_rad_s * r.natural_rad_s;
    let inverse = |r: &Run| 1.0 / r.handle_mass.value;
    let (light, heavy) = runs.iter().fold((&runs[0], &runs[0]), |(l, h), r| {
        (if inverse(r) > inverse(l) { r } else { l }, if inverse(r) < inverse(h) { r } else { h })
    });
    let k = (square(light) - square(heavy)) / (inverse(light) - inverse(heavy));
    let m = k / (square(heavy) - k * inverse(heavy));
    let likely = moving_mass.value / 5.0..moving_mass.value * 5.0;
    let moving = if likely.contains(&m) { m } else { moving_mass.value };
    let stiffness = mean(&|r| square(r) / (1.0 / moving + inverse(r)));
    let damping = mean(&|r| {
        let u = 1.0 / moving + inverse(r);
        let all = 2.0 * r.damping_ratio * r.natural_rad_s / u;
        let emf =
            if coil.drive == Drive::Voltage { force_factor * force_factor / coil.resistance } else { 0.0 };
        (all - emf).max(0.1 * all)
    });
    let mut point = Point::with_capacity(SHARED + OWN * runs.len());
    let shared = [force_factor, moving, stiffness, damping].into_iter().zip(RANGES);
    point.extend(shared.map(|(x, (least, most))| x.clamp(least, most).log_e()));
    runs.iter().for_each(|r| point.extend([r.handle_mass.value.log_e(), r.latency]));
    point
}

/// The cost, which is the sum of 2 |r|^2 / noise and the priors, with half its gradient and its normal
/// matrix.
type Normal = (f64, Vec<f64>, Vec<Vec<f64>>);

/// The cost at a point. `beliefs` are the mean and standard deviation of each figure, `noise` is a factor on
/// each recording's noise.
fn normal(at: &Point, runs: &[Run], coil: Coil, beliefs: &[(f64, f64)], noise: &[f64]) -> Normal {
    let (mut cost, mut gradient) = (0.0, vec![0.0; at.len()]);
    let mut matrix = vec![gradient.clone(); at.len()];
    for (n, run) in runs.iter().enumerate() {
        let place = places(n);
        let (own, slope, square) = one(&run.spectra, &model(at, run, n, coil), noise[n]);
        cost += own;
        for i in 0..EACH {
            gradient[place[i]] += slope[i];
            for j in 0..EACH {
                matrix[place[i]][place[j]] += square[i][j];
            }
        }
    }
    for (i, (value, spread)) in beliefs.iter().enumerate() {
        let off = (value - at[i]) / spread;
        cost += off * off;
        gradient[i] += off / spread;
        matrix[i][i] += 1.0 / (spread * spread);
    }
    (cost, gradient, matrix)
}

/// The same of one recording, without priors.
fn one(spectra: &Spectra, model: &Model, noise: f64) -> (f64, [f64; EACH], [[f64; EACH]; EACH]) {
    let (mut cost, mut slope, mut square) = (0.0, [0.0; EACH], [[0.0; EACH]; EACH]);
    for band in &spectra.bands {
        let weight = 2.0 * spectra.independent / (band.noise * noise);
        for n in band.bins.0..band.bins.1 {
            let (h, by) = model.gradient(spectra.hz(n));
            let x = spectra.drive[n];
            let r = spectra.acceleration[n] - h * x;
            let by = by.map(|b| b * x);
            cost += weight * r.norm_sqr();
            for i in 0..EACH {
                slope[i] += weight * (by[i].conj() * r).re;
                for j in 0..=i {
                    square[i][j] += weight * (by[i].conj() * by[j]).re;
                }
            }
        }
    }
    let whole = std::array::from_fn(|i| std::array::from_fn(|j| square[i.max(j)][i.min(j)]));
    (cost, slope, whole)
}

/// Fits all recordings by the Levenberg-Marquardt method (D. Marquardt, "An algorithm for least-squares
/// estimation of nonlinear parameters", SIAM J. Appl. Math. 11, 1963), each bin weighted by the noise
/// of its band.
///
/// `noise` is a factor on each recording's noise; it widens the covariance.
pub(super) fn fit(runs: &[Run], coil: Coil, moving_mass: Belief, noise: &[f64]) -> Fitted {
    let mut at = first_guess(runs, coil, moving_mass);
    let mut beliefs: Vec<(f64, f64)> = at.iter().map(|x| (*x, UNKNOWN)).collect();
    beliefs[1] = (moving_mass.value.log_e(), moving_mass.spread);
    for (n, run) in runs.iter().enumerate() {
        beliefs[SHARED + OWN * n] = (run.handle_mass.value.log_e(), run.handle_mass.spread);
    }
    let normal = |at: &Point| normal(at, runs, coil, &beliefs, noise);
    let (mut cost, mut gradient, mut matrix) = normal(&at);
    let mut lambda = 1e-3;
    for _ in 0..ITERATIONS {
        let mut damped = matrix.clone();
        damped.iter_mut().enumerate().for_each(|(i, row)| row[i] *= 1.0 + lambda);
        let Some(step) = solve(&damped, &gradient) else { break };
        let mut next = at.clone();
        for (i, (x, by)) in next.iter_mut().zip(&step).enumerate() {
            *x += if i >= SHARED && (i - SHARED) % OWN == 1 { *by } else { by.clamp(-1.0, 1.0) };
        }
        for (x, (least, most)) in next.iter_mut().zip(RANGES) {
            *x = x.clamp(least.log_e(), most.log_e());
        }
        let there = normal(&next);
        if there.0 < cost {
            let settled = cost - there.0 < 1e-9 * cost;
            (at, lambda, (cost, gradient, matrix)) = (next, (lambda * 0.2).max(1e-12), there);
            if settled {
                break;
            }
        } else if lambda > 1e10 {
            break;
        } else {
            lambda *= 5.0;
        }
    }
    let models = runs.iter().enumerate().map(|(n, run)| model(&at, run, n, coil)).collect();
    Fitted { models, covariance: inverse(&matrix), at }
}

impl Fitted {
    /// Adds the change in another fit, whose assumption is one standard deviation off.
    pub(super) fn widen(&mut self, other: &Self) {
        let off: Vec<f64> = self.at.iter().zip(&other.at).map(|(a, b)| b - a).collect();
        for (row, a) in self.covariance.iter_mut().zip(&off) {
            row.iter_mut().zip(&off).for_each(|(x, b)| *x += a * b);
        }
    }
}

/// Solves a symmetric positive definite system by Cholesky's method on the scaled matrix.
fn solve(matrix: &[Vec<f64>], right: &[f64]) -> Option<Vec<f64>> {
    let len = right.len();
    let scale: Vec<f64> = (0..len).map(|i| 1.0 / matrix[i][i].sqrt()).collect();
    let mut l = vec![vec![0.0; len]; len];
    for i in 0..len {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let rest = matrix[i][j] * scale[i] * scale[j] - sum;
            l[i][j] = if i == j { Some(rest.sqrt()).filter(|x| *x > 0.0)? } else { rest / l[j][j] };
        }
    }
    let mut x: Vec<f64> = right.iter().zip(&scale).map(|(r, s)| r * s).collect();
    for i in 0..len {
        let sum: f64 = (0..i).map(|k| l[i][k] * x[k]).sum();
        x[i] = (x[i] - sum) / l[i][i];
    }
    for i in (0..len).rev() {
        let sum: f64 = (i + 1..len).map(|k| l[k][i] * x[k]).sum();
        x[i] = (x[i] - sum) / l[i][i];
    }
    x.iter_mut().zip(&scale).for_each(|(x, s)| *x *= s);
    x.iter().all(|x| x.is_finite()).then_some(x)
}

/// The inverse, or infinite variances if there is none.
fn inverse(matrix: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let len = matrix.len();
    let unit = |i: usize| (0..len).map(|j| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
    (0..len)
        .map(|i| solve(matrix, &unit(i)).unwrap_or_else(|| unit(i).iter().map(|x| x * 1e6).collect()))
        .collect()
}
