//! A wave in the band that counts, its envelope, and how alike both are to themselves a little later.

use std::ops::RangeInclusive;

use asperity_dsp::{Complex, Stft, random};
use asperity_fft as fft;

use super::super::SILENCE_M_S2;

/// Samples a second at which every wave is looked at, about: the band ends far below half of it.
const INNER_HZ: f64 = 8000.0;
/// Squarings of a matrix in the search of its principal axis: the power method with 2^40 steps.
const SQUARINGS: usize = 40;

/// From the first bins of half a spectrum, each times a factor, to `length` samples. Missing bins are 0.
fn inverse(bins: &[Complex<f64>], factor: Complex<f64>, length: usize) -> Vec<f64> {
    fft::signal(bins.iter().map(|bin| factor * bin), length)
}

/// The first bin of a signal of some seconds that lies at or above a frequency.
fn bin_of(hz: f64, seconds: f64) -> usize {
    (hz * seconds - 1e-9).ceil().max(0.0) as usize
}

/// Half a spectrum of a signal of some seconds: only the bins of a band, the others are 0.
pub(super) struct Band {
    bins: Vec<Complex<f64>>,
    seconds: f64,
}

impl Band {
    /// The principal axis of some axes of the same length, from `first_hz` (included) to `end_hz` (not
    /// included).
    pub(super) fn new(axes: &[&[f64]], rate_hz: f64, first_hz: f64, end_hz: f64) -> Self {
        let length = axes.iter().map(|axis| axis.len()).min().unwrap_or(0);
        let seconds = length as f64 / rate_hz;
        let (first, end) = (bin_of(first_hz, seconds), bin_of(end_hz.min(0.5 * rate_hz), seconds));
        // Fourth powers of what is large or small must not be infinite or 0.
        let peak = axes.iter().flat_map(|axis| axis.iter()).fold(0.0, |peak: f64, x| peak.max(x.abs()));
        let scale = if peak > 0.0 { peak } else { 1.0 };
        let spectra: Vec<Vec<Complex<f64>>> = axes
            .iter()
            .map(|axis| {
                let scaled: Vec<f64> = axis.iter().take(length).map(|x| x / scale).collect();
                let mut bins = fft::spectrum(scaled);
                bins.truncate(end);
                bins.iter_mut().take(first).for_each(|bin| *bin = Complex::default());
                bins
            })
            .collect();
        let direction = principal(&spectra);
        let bins = (0..end).map(|k| {
            let parts = spectra.iter().zip(&direction).filter_map(|(bins, part)| Some(bins.get(k)? * *part));
            parts.sum::<Complex<f64>>() * (scale / length.max(1) as f64)
        });
        Self { bins: bins.collect(), seconds }
    }

    /// Root mean square from `first_hz` (included) to `end_hz` (not included).
    pub(super) fn rms(&self, first_hz: f64, end_hz: f64) -> f64 {
        let (first, end) = (bin_of(first_hz, self.seconds), bin_of(end_hz, self.seconds));
        let bins = self.bins.get(first..end.min(self.bins.len())).unwrap_or_default();
        (2.0 * bins.iter().map(Complex::norm_sqr).sum::<f64>()).sqrt()
    }

    /// So many samples of it, evenly spaced.
    pub(super) fn samples(&self, length: usize) -> Vec<f64> {
        inverse(&self.bins, Complex::new(1.0, 0.0), length)
    }

    /// Gaussian noise of so many seconds with powers that are known `step_hz` apart, from 0 Hz on, and
    /// interpolated. Its root mean square is 1 on average.
    pub(super) fn noise(powers: &[f64], step_hz: f64, within: (f64, f64), seconds: f64, seed: u64) -> Self {
        let (first, end) = (bin_of(within.0, seconds), bin_of(within.1, seconds));
        let power = |k: usize| {
            let place = k as f64 / (seconds * step_hz);
            let (below, part) = (place.floor() as usize, place.fract());
            let at = |place: usize| powers.get(place).copied().unwrap_or(0.0);
            (1.0 - part) * at(below) + part * at(below + 1)
        };
        // A normal number of two parts has a mean square of 2, and so has a sine of two bins of 1.
        let whole: f64 = (first..end).map(|k| 4.0 * power(k)).sum();
        let bin = |k: usize| {
            if k < first || whole <= 0.0 {
                return Complex::default();
            }
            // Box and Muller 1958.
            let [u, v] = [0, 1].map(|column| random::uniform(seed, k as u64, column));
            let normal = Complex::from_polar((-2.0 * (1.0 - u).ln()).sqrt(), std::f64::consts::TAU * v);
            normal * (power(k) / whole).sqrt()
        };
        Self { bins: (0..end).map(bin).collect(), seconds }
    }
}

/// The direction in which spectra of axes have most power, as a unit vector.
fn principal(spectra: &[Vec<Complex<f64>>]) -> Vec<f64> {
    let count = spectra.len();
    let product = |a: &[Complex<f64>], b: &[Complex<f64>]| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a * b.conj()).re).sum()
    };
    let mut matrix: Vec<f64> =
        spectra.iter().flat_map(|a| spectra.iter().map(move |b| product(a, b))).collect();
    for _ in 0..SQUARINGS {
        let trace: f64 = matrix.iter().step_by(count + 1).sum();
        if trace <= 0.0 {
            break;
        }
        let element = |at: usize| -> f64 {
            let (row, column) = (at / count, at % count);
            (0..count).map(|k| matrix[row * count + k] * matrix[k * count + column]).sum::<f64>()
                / (trace * trace)
        };
        matrix = (0..count * count).map(element).collect();
    }
    // Every row is now the axis, times its own part of it: the longest says it best.
    let size = |row: &[f64]| row.iter().map(|x| x * x).sum::<f64>().sqrt();
    let longest = matrix.chunks(count.max(1)).reduce(|a, b| if size(b) > size(a) { b } else { a });
    match longest {
        Some(row) if size(row) > 0.0 => row.iter().map(|x| x / size(row)).collect(),
        _ => (0..count).map(|axis| if axis == 0 { 1.0 } else { 0.0 }).collect(),
    }
}

/// A wave within a band, and its envelope, at about 8 kHz whatever rate it came with.
pub(super) struct Wave {
    pub(super) rate_hz: f64,
    pub(super) samples: Vec<f64>,
    /// Size of the analytic signal (D. Gabor, "Theory of communication", J. IEE 93(26), 1946), the Hilbert
    /// envelope.
    pub(super) envelope: Vec<f64>,
}

impl Wave {
    pub(super) fn new(band: &Band) -> Self {
        let length = (band.seconds * INNER_HZ).round().max(2.0) as usize;
        let samples = band.samples(length);
        // Each frequency a quarter of a turn later: the Hilbert transform.
        let turned = inverse(&band.bins, Complex::new(0.0, -1.0), length);
        let envelope = samples.iter().zip(&turned).map(|(x, y)| x.hypot(*y)).collect();
        Self { rate_hz: length as f64 / band.seconds, samples, envelope }
    }

    pub(super) fn rms(&self) -> f64 {
        (self.samples.iter().map(|x| x * x).sum::<f64>() / self.samples.len() as f64).sqrt()
    }

    /// Welch's spectrum from 0 Hz on, of Hann windows of 0.1 s, overlapped by three quarters; and its step
    /// in Hz.
    pub(super) fn spectrum(&self) -> (Vec<f64>, f64) {
        let window = (0.1 * self.rate_hz).round() as usize;
        let mut stft = Stft::<f64>::new(window);
        let mut powers = vec![0.0; window / 2 + 1];
        for frame in self.samples.windows(window).step_by((window / 4).max(1)) {
            powers.iter_mut().zip(stft.process(frame)).for_each(|(power, c)| *power += c.norm_sqr());
        }
        (powers, self.rate_hz / window as f64)
    }

    pub(super) fn is_silent(&self) -> bool {
        self.rms() < SILENCE_M_S2
    }

    /// The envelope's spectrum over its mean, without frequencies below a limit.
    pub(super) fn ripple(&self, first_hz: f64) -> Band {
        let mean = self.envelope.iter().sum::<f64>() / self.envelope.len() as f64;
        let mut band = Band::new(&[&self.envelope], self.rate_hz, first_hz, f64::INFINITY);
        band.bins.iter_mut().for_each(|bin| *bin /= mean);
        band
    }

    /// Lags in samples that lie within some seconds.
    pub(super) fn lags(&self, seconds: RangeInclusive<f64>) -> RangeInclusive<usize> {
        let place = |s: f64| s * self.rate_hz;
        (place(*seconds.start()) - 1e-6).ceil() as usize..=(place(*seconds.end()) + 1e-6).floor() as usize
    }
}

/// The lag at which samples are most alike to themselves, and how much. None without lags.
pub(super) fn most_alike(samples: &[f64], lags: RangeInclusive<usize>) -> Option<(usize, f64)> {
    likeness(samples, lags).into_iter().reduce(|a, b| if b.1 > a.1 { b } else { a })
}

/// How alike samples are to themselves after each lag: their inner product with themselves so much later,
/// over the geometric mean of the energies of both parts, -1 to 1.
pub(super) fn likeness(samples: &[f64], lags: RangeInclusive<usize>) -> Vec<(usize, f64)> {
    let last = (*lags.end()).min(samples.len().saturating_sub(1));
    // Squares of squares of what is large or small must not be infinite or 0.
    let peak = samples.iter().fold(f64::MIN_POSITIVE, |peak: f64, x| peak.max(x.abs()));
    let mut padded: Vec<f64> = samples.iter().map(|x| x / peak).collect();
    // Zeros keep the end from being compared with the beginning.
    padded.resize((samples.len() + last).next_power_of_two(), 0.0);
    let powers: Vec<Complex<f64>> =
        fft::spectrum(padded.clone()).iter().map(|c| c.norm_sqr().into()).collect();
    let products = inverse(&powers, Complex::new(1.0 / padded.len() as f64, 0.0), padded.len());
    let mut sums = vec![0.0];
    sums.extend(padded.iter().take(samples.len()).scan(0.0, |sum, x| {
        *sum += x * x;
        Some(*sum)
    }));
    let whole = sums[samples.len()];
    let alike = |lag: usize| {
        let energies = sums[samples.len() - lag].sqrt() * (whole - sums[lag]).max(0.0).sqrt();
        let value = if energies > 0.0 { products[lag] / energies } else { 0.0 };
        (lag, value.clamp(-1.0, 1.0))
    };
    (*lags.start()..=last).map(alike).collect()
}
