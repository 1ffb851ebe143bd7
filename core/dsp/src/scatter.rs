//! Adds to magnitudes the random scatter of a random signal's spectrum.
//!
//! A network answers expected magnitudes. Those of a random process scatter about them: Rayleigh distributed
//! for noise, Rice distributed where a steady line stands in noise. So each frame is multiplied by `|sqrt(1 -
//! q) e^(j theta_k) + sqrt(q) z_k|`.
//!
//! * `z` is the short-time spectrum of unit white noise through the same window at the same position, so
//!   neighbouring bins and frames are correlated as in a signal.
//! * `theta_k = 2 pi k t / N` is the phase of a line in the middle of bin k.
//! * `q` is the random part of the bin's power. It follows from the ratio of mean to root mean square
//!   magnitude, `ratio(q) = E |sqrt(1 - q) + sqrt(q) z|` (S. O. Rice, "Mathematical analysis of random
//!   noise", 1944): from 1 for a steady line to `sqrt(pi) / 2 = 0.886` for noise.
//!
//! Variance of a frame's power beyond the scatter of its bins, as from single events, becomes one more gain:
//! `g = exp(s y - s^2)`, with `E[g^2] = 1`. `y` is normal: white noise seen through the window's square.
//! Noise is indexed by sample from a seed, so skipping a frame changes no later one.

use crate::magnitude::{largest_of, take};
use crate::random::normal;
use crate::tape::Tape;
use crate::window::hann;
use crate::{Float, Framing, Refused, Stft};
use asperity_numbers::Elementary as _;
use asperity_numbers::unit_circle;
use std::sync::LazyLock;

/// Steps of the table of [`ratio`]s.
const STEPS: usize = 64;
/// Largest `s^2` of the common gain: a power whose variance is 20 times its squared mean.
const MOST_COMMON: f64 = 0.75;
/// Added to the seed for the noise of the common gain.
const COMMON: u64 = 0x636f_6d6d_6f6e;

/// Ratio of mean to root mean square magnitude of noise: `sqrt(pi) / 2`.
pub const NOISE_RATIO: f64 = 0.886_226_925_452_758;
/// The same in bin 0 and at Nyquist's frequency, which are real: `sqrt(2 / pi)`.
pub const REAL_NOISE_RATIO: f64 = 0.797_884_560_802_865_4;

/// [`ratio`] at 0, 1 / STEPS, .., 1.
static RATIOS: LazyLock<[f64; STEPS + 1]> =
    LazyLock::new(|| std::array::from_fn(|i| ratio(i as f64 / STEPS as f64)));

/// Statistics of a frame's magnitudes.
#[derive(Clone, Copy, Debug)]
pub struct Statistics<'a, P> {
    /// Ratio of mean to root mean square for each bin, 0 to 1. A missing one, or one below [`NOISE_RATIO`],
    /// is noise.
    pub ratio: &'a [P],
    /// Variance of a frame's power over its squared mean, if known.
    pub variance: Option<f64>,
    /// Whether the magnitudes are means. Otherwise they are root mean squares.
    pub means: bool,
}

/// Scatters frames of one layout.
#[derive(Debug)]
pub struct Scatter<T> {
    framing: Framing,
    stft: Stft<T>,
    /// The squared window, normalised so that its squares sum to 1.
    common: Vec<T>,
    noise: Line<T>,
    slow: Line<T>,
    magnitudes: Vec<T>,
    random: Vec<T>,
}

impl<T: Float> Scatter<T> {
    /// Makes the kernel for a layout.
    pub fn new(framing: Framing, seed: u64) -> Result<Self, Refused> {
        framing.check()?;
        let n = framing.fft_len;
        // Not in a tick.
        LazyLock::force(&RATIOS);
        let squares: Vec<f64> = hann::<f64>(n).into_iter().map(|w| w * w).collect();
        let norm = squares.iter().map(|w| w * w).sum::<f64>().sqrt().recip();
        Ok(Self {
            framing,
            stft: Stft::new(n),
            common: squares.into_iter().map(|w| T::of(w * norm)).collect(),
            noise: Line::new(seed, n),
            slow: Line::new(seed ^ COMMON, n),
            magnitudes: vec![T::zero(); framing.bins],
            random: vec![T::zero(); framing.bins],
        })
    }

    /// Scatters frame number `frame` by `strength`, 0 (not at all) to 1, into `out`, in the same unit.
    /// Returns the number of magnitudes that are NaN, infinite or negative; they count as 0, as missing ones.
    pub fn process<P: Float>(
        &mut self,
        frame: u64,
        magnitudes: &[P],
        known: Statistics<'_, P>,
        strength: f64,
        out: &mut [P],
    ) -> usize {
        // A scattered magnitude is at most a few times as large.
        let bad = take(magnitudes, largest_of::<P, T>() / 1024.0, &mut self.magnitudes);
        let strength = if strength.is_finite() { strength.clamp(0.0, 1.0) } else { 1.0 };
        let n = self.framing.fft_len;
        let start = self.framing.start(frame);
        for (bin, random) in self.random.iter_mut().enumerate() {
            let q = known.ratio.get(bin).map_or(1.0, |r| random_part(r.f64()));
            *random = T::of(q * strength * strength);
        }
        let gain = known.variance.map_or(1.0, |variance| self.gain(variance, strength, start, known.means));
        let unit = (n as f64 / 6.0).sqrt();
        let spectrum = self.stft.process(self.noise.at(start));
        out.fill(P::zero());
        // Phase in turns of a line in the middle of bin 1 since sample 0.
        let turned = (start % n as u64) as f64 / n as f64;
        let bins = self.magnitudes.iter().zip(&self.random).zip(spectrum).enumerate();
        for (out, (bin, ((m, q), z))) in
            out.iter_mut().zip(bins).filter(|(_, (_, ((m, _), _)))| **m > T::zero())
        {
            let (m, q) = (m.f64(), q.f64());
            let real = bin == 0 || 2 * bin == n;
            let (cos, sin) = unit_circle((bin as f64 * turned).fract());
            let (steady, loose) = ((1.0 - q).sqrt(), q.sqrt() * unit);
            let (re, im) = if real {
                (steady * cos.signum() + loose * z.re.f64(), 0.0)
            } else {
                (steady * cos + loose * z.re.f64(), steady * sin + loose * z.im.f64())
            };
            // A root mean square exceeds the mean by the ratio of this scatter.
            let level = if known.means { mean_level(q, real).recip() } else { 1.0 };
            *out = P::of(m * level * gain * re.hypotenuse(im));
        }
        bad
    }

    /// Gain common to all bins. Its mean square is 1, or its mean is 1 where magnitudes are means.
    fn gain(&mut self, variance: f64, strength: f64, start: u64, means: bool) -> f64 {
        if variance.is_nan() || variance <= 0.0 {
            return 1.0;
        }
        let own = self.own_variance();
        let square = (0.25 * ((1.0 + variance.min(1e6)) / (1.0 + own)).log_e()).clamp(0.0, MOST_COMMON);
        let s = square.sqrt() * strength;
        if s == 0.0 {
            return 1.0;
        }
        let seen = self.slow.at(start).iter().zip(&self.common);
        let y: f64 = seen.map(|(&u, &w)| (u * w).f64()).sum();
        (s * y - if means { 0.5 * s * s } else { s * s }).exp_e()
    }

    /// Variance of a frame's power over its squared mean from the scatter of its bins alone. White
    /// noise under a Hann window has correlations of 2/3 and 1/6 with the next two bins.
    fn own_variance(&self) -> f64 {
        let parts = self.magnitudes.iter().zip(&self.random).map(|(m, q)| (m.f64() * m.f64(), q.f64()));
        let powers = || parts.clone().map(|(power, q)| (power, power * (q * (2.0 - q)).sqrt()));
        let total: f64 = powers().map(|(power, _)| power).sum();
        if total <= 0.0 {
            return 0.0;
        }
        let (mut last, mut before, mut sum) = (0.0, 0.0, 0.0);
        for (_, p) in powers() {
            let p = p / total;
            sum += p * (p + 2.0 * (4.0 / 9.0 * last + before / 36.0));
            (before, last) = (last, p);
        }
        sum
    }
}

/// `E |sqrt(1 - q) + sqrt(q) z|` with z complex normal and `E |z|^2 = 1`: the mean of the Rice
/// distribution whose root mean square is 1.
pub fn ratio(q: f64) -> f64 {
    let q = q.clamp(0.0, 1.0);
    const ANGLES: usize = 16;
    const RADII: usize = 500;
    let (steady, loose) = ((1.0 - q).sqrt(), q.sqrt());
    let mut sum = 0.0;
    for i in 0..RADII {
        // Midpoints of equally likely parts of the Rayleigh distribution.
        let radius = loose * (-(1.0 - (i as f64 + 0.5) / RADII as f64).log_e()).sqrt();
        for k in 0..ANGLES {
            let (cos, sin) = unit_circle((k as f64 + 0.5) / ANGLES as f64);
            sum += (steady + radius * cos).hypotenuse(radius * sin);
        }
    }
    sum / (ANGLES * RADII) as f64
}

/// Random part of a bin's power for a ratio of mean to root mean square.
fn random_part(ratio: f64) -> f64 {
    if ratio.is_nan() || ratio <= NOISE_RATIO {
        return 1.0;
    }
    let after = RATIOS.partition_point(|r| *r > ratio);
    match (after.checked_sub(1).map(|i| RATIOS[i]), RATIOS.get(after)) {
        (Some(above), Some(below)) => (after as f64 - 1.0 + (above - ratio) / (above - below)) / STEPS as f64,
        (None, _) => 0.0,
        (_, None) => 1.0,
    }
}

/// Ratio of mean to root mean square for a random part.
fn mean_level(q: f64, real: bool) -> f64 {
    if real {
        // Between a steady line's and noise's; bins 0 and Nyquist carry next to nothing.
        return 1.0 + q * (REAL_NOISE_RATIO - 1.0);
    }
    let place = q * STEPS as f64;
    let at = (place as usize).min(STEPS - 1);
    let part = place - at as f64;
    RATIOS[at] + part * (RATIOS[at + 1] - RATIOS[at])
}

/// White noise of unit variance by sample, with a window of it held.
#[derive(Debug)]
struct Line<T> {
    seed: u64,
    samples: Tape<T>,
    /// Number of the sample behind the held ones; none before anything is held.
    next: Option<u64>,
}

impl<T: Float> Line<T> {
    fn new(seed: u64, len: usize) -> Self {
        Self { seed, samples: Tape::new(len), next: None }
    }

    /// The window's samples from `start` on.
    fn at(&mut self, start: u64) -> &[T] {
        let len = self.samples.len();
        let last = start.saturating_add(len as u64);
        let fresh = match self.next {
            Some(next) if next <= last => (last - next).min(len as u64),
            _ => len as u64,
        };
        self.samples.advance(fresh as usize);
        for (x, sample) in self.samples[len - fresh as usize..].iter_mut().zip(last - fresh..) {
            *x = T::of(normal(self.seed, sample));
        }
        self.next = Some(last);
        &self.samples
    }
}

#[cfg(test)]
#[path = "scatter_tests.rs"]
mod tests;
