//! Frequency response with coherence, noise and latency from two signals, and the distortion of a sweep.

use asperity_diagnostics::Diagnostic;
use asperity_fft as fft;
use asperity_numbers::{Elementary as _, polar};
use std::f64::consts::TAU;

use num_complex::Complex64;

use super::{NO_DRIVE, Recording, raised_cosine};

/// Bands per octave.
const BANDS: f64 = 24.0;
/// Least bins in a band.
const LEAST_BINS: usize = 9;
/// A band is excited if its power per bin is above this part of the strongest band's.
const EXCITED: f64 = 1e-4;
/// Range of latencies \[s\].
const LATENCY: (f64, f64) = (-0.005, 0.5);

/// A band of neighbouring bins. `response` has the latency removed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Band {
    pub(super) hz: f64,
    /// First bin and end, counted in [`Spectra::drive`].
    pub(super) bins: (usize, usize),
    pub(super) response: Complex64,
    /// Noise power in a bin of the acceleration.
    pub(super) noise: f64,
    pub(super) coherence: f64,
}

/// Both signals in the frequency domain, within the used band.
pub(super) struct Spectra {
    pub(super) drive: Vec<Complex64>,
    pub(super) acceleration: Vec<Complex64>,
    /// Number of the first bin in the full transform.
    first: usize,
    pub(super) bin_hz: f64,
    len: usize,
    /// Samples over transform length: the part of bins that are independent.
    pub(super) independent: f64,
    /// Power of the acceleration in all bins above the lowest used one.
    pub(super) whole_power: f64,
    pub(super) bands: Vec<Band>,
}

impl Spectra {
    /// Transforms a recording. [`Spectra::settle`] makes the bands.
    pub(super) fn new(recording: &Recording<'_>, band_hz: (f64, f64)) -> Result<Self, Diagnostic> {
        let count = recording.drive.len().min(recording.acceleration.len());
        let rate = recording.rate_hz;
        let len = fast_len(count);
        let bin_hz = rate / len as f64;
        let drive = transform(&recording.drive[..count], 0.0, len);
        let heard = &recording.acceleration[..count];
        // An accelerometer also measures gravity.
        let mean = heard.iter().map(|x| f64::from(*x)).sum::<f64>() / count as f64;
        let acceleration = transform(heard, mean, len);
        let lowest = (band_hz.0 / bin_hz).ceil().max(1.0) as usize;
        let highest = ((band_hz.1.min(0.45 * rate) / bin_hz) as usize).min(drive.len() - 1);
        let power = |x: &[Complex64]| x.iter().map(Complex64::norm_sqr).sum::<f64>();
        let whole_power = power(acceleration.get(lowest..).unwrap_or_default());
        let bands = split(lowest, highest + 1);
        let per_bin = |&(a, b): &(usize, usize)| power(&drive[a..b]) / (b - a) as f64;
        let strongest = bands.iter().map(per_bin).fold(0.0, f64::max);
        let excited = |b: &&(usize, usize)| per_bin(b) > EXCITED * strongest;
        let (Some(from), Some(to)) = (bands.iter().find(excited), bands.iter().rev().find(excited)) else {
            return Err(Diagnostic::new(NO_DRIVE));
        };
        let (first, last) = (from.0, to.1);
        if last - first < 20 * LEAST_BINS {
            return Err(Diagnostic::new(format!(
                "the drive excites only {:.1} to {:.1} Hz; a sweep over the resonance is needed",
                first as f64 * bin_hz,
                last as f64 * bin_hz
            )));
        }
        Ok(Self {
            drive: drive[first..last].to_vec(),
            acceleration: acceleration[first..last].to_vec(),
            first,
            bin_hz,
            len,
            independent: count as f64 / len as f64,
            whole_power,
            bands: Vec::new(),
        })
    }

    /// Frequency of used bin `n` \[Hz\].
    pub(super) fn hz(&self, n: usize) -> f64 {
        (self.first + n) as f64 * self.bin_hz
    }

    /// The used band \[Hz\].
    pub(super) fn band_hz(&self) -> (f64, f64) {
        (self.hz(0), self.hz(self.drive.len() - 1))
    }

    /// The latency at which the drive, through `shape`, fits the acceleration best, and whether the
    /// sign is the same.
    pub(super) fn latency(&self, shape: impl Fn(f64) -> Complex64) -> (f64, bool) {
        let mut spectrum = vec![Complex64::default(); self.len / 2 + 1];
        let weight = self.weights();
        for (n, (x, y)) in self.drive.iter().zip(&self.acceleration).enumerate() {
            spectrum[self.first + n] = y * (x * shape(self.hz(n))).conj() * weight[n];
        }
        let signal = fft::signal(spectrum, self.len);
        let rate = self.bin_hz * self.len as f64;
        let lags = (LATENCY.0 * rate) as i64..=((LATENCY.1 * rate) as i64).min(self.len as i64 / 2);
        let at = |lag: i64| signal[lag.rem_euclid(self.len as i64) as usize];
        let best = lags.max_by(|a, b| at(*a).abs().total_cmp(&at(*b).abs())).unwrap_or(0);
        (best as f64 / rate, at(best) >= 0.0)
    }

    /// 1 over the noise power, or over the drive's power while the noise is unknown.
    fn weights(&self) -> Vec<f64> {
        let mut weights: Vec<f64> = self.drive.iter().map(|x| 1.0 / (x.norm_sqr() + 1e-30)).collect();
        for band in &self.bands {
            weights[band.bins.0..band.bins.1].fill(1.0 / (band.noise + 1e-30));
        }
        weights
    }

    /// Finds response, noise and coherence in every band, with `latency` removed.
    ///
    /// In each band the response is a straight line over frequency, fitted by least squares. The
    /// residual is noise (the local polynomial method of first order: R. Pintelon, J. Schoukens, G.
    /// Vandersteen, K. Barbe, "Estimation of nonparametric noise and FRF models for multivariable
    /// systems", Mech. Syst. Signal Process. 24, 2010).
    pub(super) fn settle(&mut self, latency: f64) {
        let mut bands = Vec::new();
        for bins in split(self.first, self.first + self.drive.len()) {
            let bins = (bins.0 - self.first, bins.1 - self.first);
            let hz = 0.5 * (self.hz(bins.0) + self.hz(bins.1 - 1));
            let mut sums = Line::default();
            for n in bins.0..bins.1 {
                let y = self.acceleration[n] * polar(1.0, TAU * self.hz(n) * latency);
                sums.add(self.drive[n], y, (self.hz(n) - hz) / (self.bin_hz * (bins.1 - bins.0) as f64));
            }
            let (response, noise, coherence) = sums.solve(bins.1 - bins.0);
            bands.push(Band { hz, bins, response, noise, coherence });
        }
        // Without noise, rounding is left.
        let floor = 1e-12 * self.whole_power / self.len as f64;
        bands.iter_mut().for_each(|b| b.noise = b.noise.max(floor));
        self.bands = bands;
    }
}

/// Sums for y = (a + b t) x.
#[derive(Default)]
struct Line {
    xx: [f64; 3],
    xy: [Complex64; 2],
    yy: f64,
}

impl Line {
    fn add(&mut self, x: Complex64, y: Complex64, t: f64) {
        let (power, cross) = (x.norm_sqr(), y * x.conj());
        self.xx = [self.xx[0] + power, self.xx[1] + power * t, self.xx[2] + power * t * t];
        self.xy = [self.xy[0] + cross, self.xy[1] + cross * t];
        self.yy += y.norm_sqr();
    }

    /// a, the residual per bin, and the part of y's power that x explains.
    fn solve(&self, count: usize) -> (Complex64, f64, f64) {
        let [s0, s1, s2] = self.xx;
        let det = s0 * s2 - s1 * s1;
        if !(det > 1e-6 * s0 * s0 && self.yy > 0.0) {
            return (Complex64::default(), self.yy / count as f64, 0.0);
        }
        let a = (self.xy[0] * s2 - self.xy[1] * s1) / det;
        let b = (self.xy[1] * s0 - self.xy[0] * s1) / det;
        let explained = (a.conj() * self.xy[0] + b.conj() * self.xy[1]).re;
        let noise = (self.yy - explained).max(0.0) / (count - 2) as f64;
        // Chance explains two bins' worth of noise.
        (a, noise, (1.0 - noise * count as f64 / self.yy).clamp(0.0, 1.0))
    }
}

/// Bins `first..end` in bands of equal ratio, none shorter than [`LEAST_BINS`].
fn split(first: usize, end: usize) -> Vec<(usize, usize)> {
    let mut bands = Vec::new();
    let mut from = first;
    while from + LEAST_BINS <= end {
        let to = ((from as f64 * (1.0 / BANDS).exp_2()).round() as usize).max(from + LEAST_BINS);
        let to = if to + LEAST_BINS > end { end } else { to };
        bands.push((from, to));
        from = to;
    }
    bands
}

/// Spectrum of `samples` minus `offset`, zero-padded to `len`.
fn transform(samples: &[f32], offset: f64, len: usize) -> Vec<Complex64> {
    let mut padded = vec![0.0; len];
    padded.iter_mut().zip(samples).for_each(|(to, x)| *to = f64::from(*x) - offset);
    fft::spectrum(padded)
}

/// The least even 2^a 3^b 5^c that is at least `count`.
fn fast_len(count: usize) -> usize {
    let without = |mut n: usize, factor: usize| {
        while n.is_multiple_of(factor) {
            n /= factor;
        }
        n
    };
    let even = (count.max(2).next_multiple_of(2)..).step_by(2);
    let smooth = |n: &usize| [2, 3, 5].into_iter().fold(*n, without) == 1;
    even.into_iter().find(smooth).unwrap_or(count)
}

/// Harmonics from the second to this one.
const HARMONICS: u32 = 5;
/// A response begins this long before its time \[s\].
const EARLY: f64 = 0.004;

/// Amplitude of the second to fifth harmonics over that of the linear response, up to `highest_hz`.
///
/// An exponential sweep's acceleration divided by the drive's spectrum is the impulse response. The
/// k-th harmonic's stands L ln(k) before it (Farina 2000). The time before the highest harmonic tells
/// the noise, which is subtracted.
pub(super) fn distortion(recording: &Recording<'_>, highest_hz: f64, latency: f64) -> Option<f64> {
    let constant = recording.sweep_time_constant_s?;
    let rate = recording.rate_hz;
    let count = recording.drive.len().min(recording.acceleration.len());
    let len = fast_len(count);
    let drive = transform(&recording.drive[..count], 0.0, len);
    let mut response = transform(&recording.acceleration[..count], 0.0, len);
    let strongest = drive.iter().map(Complex64::norm_sqr).fold(0.0, f64::max);
    for (n, (y, x)) in response.iter_mut().zip(&drive).enumerate() {
        let hz = n as f64 * rate / len as f64;
        // A soft edge makes the impulse short.
        let edge = raised_cosine((highest_hz - hz).max(0.0), 0.2 * highest_hz);
        *y = *y * x.conj() * edge / (x.norm_sqr() + 1e-5 * strongest);
    }
    response[0] = Complex64::default();
    if let Some(last) = response.last_mut() {
        *last = Complex64::default();
    }
    let impulse = fft::signal(response, len);
    let lead = |k: u32| constant * f64::from(k).log_e();
    let length = (lead(HARMONICS + 1) - lead(HARMONICS)).min(0.2);
    let energy = |from: f64| {
        let first = ((from - EARLY) * rate).round() as i64;
        let all = first..first + (length * rate) as i64;
        all.map(|n| impulse[n.rem_euclid(len as i64) as usize].powi(2)).sum::<f64>()
    };
    if length * rate < 8.0 || lead(HARMONICS + 3) > 0.5 * len as f64 / rate {
        return None;
    }
    let noise = energy(latency - lead(HARMONICS + 2)).min(energy(latency - lead(HARMONICS + 3)));
    let harmonics: f64 = (2..=HARMONICS).map(|k| (energy(latency - lead(k)) - noise).max(0.0)).sum();
    let linear = energy(latency);
    (linear > 0.0).then(|| (harmonics / linear).sqrt())
}
