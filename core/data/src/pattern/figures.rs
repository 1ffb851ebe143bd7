//! Kurtosis, modulation and repetition of a signal.

use super::stroke::RATE_HZ;
use asperity_fft as fft;
use num_complex::Complex64;

/// Band of the wave in Hz.
const BAND_HZ: (f64, f64) = (30.0, 1000.0);
/// Band of the modulation in Hz.
const MODULATION_HZ: (f64, f64) = (15.0, 25.0);
/// Slowest ripple of the envelope that may repeat, in Hz; and lags of a repetition in s.
const RIPPLE_HZ: f64 = 5.0;
const LAGS_S: (f64, f64) = (0.02, 0.2);

/// Statistics of a wave of 30 to 1000 Hz over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// `mean x^4 / (mean x^2)^2`: 3 for Gaussian noise, more for single bumps.
    pub kurtosis: f64,
    /// Rms of the envelope from 15 to 25 Hz over the envelope's mean. The envelope is the size of the
    /// analytic signal.
    pub modulation: f64,
    /// Largest autocorrelation of the envelope from 20 to 200 ms, 0 to 1, without ripples slower than 5 Hz.
    pub repetition: f64,
    /// The same for the wave.
    pub wave_repetition: f64,
}

impl Figures {
    /// Figures of samples at [`RATE_HZ`]. None for silence or fewer than two samples. The signal counts
    /// as periodic.
    pub fn of(samples: &[f64]) -> Option<Self> {
        if samples.len() < 2 {
            return None;
        }
        let mut bins = spectrum(samples);
        keep(&mut bins, samples.len(), BAND_HZ);
        let wave_repetition = repetition(&bins, samples.len());
        let wave = wave(&bins, samples.len());
        bins.iter_mut().for_each(|bin| *bin = Complex64::new(bin.im, -bin.re));
        let turned = self::wave(&bins, samples.len());
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / samples.len().max(1) as f64;
        let square = mean(&mut wave.iter().map(|x| x * x));
        if square.is_nan() || square <= 1e-12 {
            return None;
        }
        let envelope: Vec<f64> = wave.iter().zip(&turned).map(|(x, y)| x.hypot(*y)).collect();
        let middle = mean(&mut envelope.iter().copied());
        let mut ripple = spectrum(&envelope);
        keep(&mut ripple, samples.len(), (RIPPLE_HZ, f64::INFINITY));
        let repetition = repetition(&ripple, samples.len());
        keep(&mut ripple, samples.len(), MODULATION_HZ);
        let power = 2.0 * ripple.iter().map(Complex64::norm_sqr).sum::<f64>();
        Some(Self {
            kurtosis: mean(&mut wave.iter().map(|x| x.powi(4))) / (square * square),
            modulation: power.sqrt() / (middle * samples.len() as f64),
            repetition,
            wave_repetition,
        })
    }
}

/// Largest autocorrelation at the lags of a repetition, from half a spectrum of `length` samples.
fn repetition(bins: &[Complex64], length: usize) -> f64 {
    let powers: Vec<Complex64> = bins.iter().map(|bin| Complex64::new(bin.norm_sqr(), 0.0)).collect();
    let correlation = wave(&powers, length);
    let [from, to] = [LAGS_S.0, LAGS_S.1].map(|lag| (lag * RATE_HZ) as usize);
    let at = |lag: usize| correlation.get(lag).map_or(0.0, |r| r / correlation[0]);
    (from..=to).map(at).fold(0.0, f64::max)
}

/// Half a spectrum of samples, unscaled.
pub(super) fn spectrum(samples: &[f64]) -> Vec<Complex64> {
    fft::spectrum(samples.to_vec())
}

/// Samples of half a spectrum without its mean, over their number.
pub(super) fn wave(bins: &[Complex64], length: usize) -> Vec<f64> {
    let scaled = bins.iter().skip(1).map(|bin| bin / length as f64);
    fft::signal(std::iter::once(Complex64::default()).chain(scaled), length)
}

/// Silences everything outside a band.
pub(super) fn keep(bins: &mut [Complex64], length: usize, (first_hz, end_hz): (f64, f64)) {
    let seconds = length as f64 / RATE_HZ;
    for (k, bin) in bins.iter_mut().enumerate() {
        let hz = k as f64 / seconds;
        if hz < first_hz || hz >= end_hz {
            *bin = Complex64::default();
        }
    }
}
