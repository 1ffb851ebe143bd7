use std::f64::consts::{PI, TAU};
use std::ops::Range;

use asperity_dsp::{Complex, Stft};

use super::AccuracyError;

/// Frequency of the first bin in Hz.
pub const FIRST_HZ: f64 = 20.0;
/// From one bin to the next in Hz.
pub const STEP_HZ: f64 = 10.0;
/// Bins: 20, 30, .. 1000 Hz.
pub const BINS: usize = 99;
/// Length of a window in seconds.
pub const WINDOW_S: f64 = 0.1;
/// From one window to the next in seconds: a quarter of a window.
pub const HOP_S: f64 = 0.025;
/// Fewest frames that are compared: 0.5 s.
pub(super) const MIN_FRAMES: usize = 17;
/// Number of the first bin among those of the window, which begin at 0 Hz.
const FIRST: usize = 2;
/// Samples beyond this count as not finite: their squares would not be.
const MOST: f64 = 1e100;

/// Short-time powers of a signal, by Welch's method (IEEE Trans. Audio and Electroacoustics 15(2), 1967):
/// periodic Hann windows of 0.1 s, overlapped by three quarters. With the usual half the squared windows do
/// not add up to a constant. The level of pulses 50 ms apart, as phase retrieval makes them, then changed by
/// up to 0.7 dB under a shift of 20 ms.
///
/// A bin's power is `4 |sum w x|^2 / (3 (sum w)^2)` \[(m/s^2)^2\], that of both signs of frequency. So the
/// powers of all bins add up to the mean square. A sine of amplitude A on a bin has A^2 / 3 there and A^2 /
/// 12 in the bins beside. Powers of several axes are added.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrogram {
    bins: usize,
    powers: Vec<[f64; BINS]>,
}

impl Spectrogram {
    /// Of a signal with one axis or more \[m/s^2\]; the shortest axis counts.
    ///
    /// # Errors
    /// [`AccuracyError`]: a rate that is not 100 to 1e6 Hz, no axis, a sample that is not finite. A signal
    /// shorter than a window has no frames.
    pub fn new(axes: &[&[f64]], rate_hz: f64) -> Result<Self, AccuracyError> {
        let samples = check(axes, rate_hz)?;
        let bins = (0..BINS).take_while(|bin| bin_hz(*bin) < 0.5 * rate_hz).count();
        let mut transform = Transform::new(rate_hz, bins);
        let mut powers = Vec::new();
        loop {
            let from = (powers.len() as f64 * HOP_S * rate_hz).round() as usize;
            let to = from + transform.length();
            if to > samples {
                break;
            }
            let mut frame = [0.0; BINS];
            for axis in axes {
                transform.add(axis.get(from..to).unwrap_or_default(), &mut frame);
            }
            powers.push(frame);
        }
        Ok(Self { bins, powers })
    }

    /// Of known powers \[(m/s^2)^2\]: one array for every 0.025 s, of which the first `bins` are valid.
    pub fn from_powers(bins: usize, powers: Vec<[f64; BINS]>) -> Self {
        Self { bins: bins.min(BINS), powers }
    }

    /// Frames, 0.025 s apart.
    pub fn frames(&self) -> usize {
        self.powers.len()
    }

    /// Number of [`BINS`] below half the rate; the others are 0.
    pub fn bins(&self) -> usize {
        self.bins
    }

    /// Powers of a frame in (m/s^2)^2, bin by bin.
    pub fn frame(&self, number: usize) -> Option<&[f64; BINS]> {
        self.powers.get(number)
    }

    /// Mean powers over some frames \[(m/s^2)^2\]. Frames beyond the last do not count; the mean of none is
    /// 0.
    pub fn mean(&self, frames: Range<usize>) -> [f64; BINS] {
        let end = frames.end.min(self.powers.len());
        super::perceptual::mean(&self.powers[frames.start.min(end)..end])
    }
}

/// Samples that all axes of a signal have.
///
/// # Errors
/// A rate that is not 100 to 1e6 Hz, no axis, a sample that is not finite.
pub(super) fn check(axes: &[&[f64]], rate_hz: f64) -> Result<usize, AccuracyError> {
    if !(100.0..=1e6).contains(&rate_hz) {
        return Err(AccuracyError::Rate(rate_hz));
    }
    let bad = axes.iter().find_map(|axis| axis.iter().position(|x| x.is_nan() || x.abs() > MOST));
    match (axes.iter().map(|axis| axis.len()).min(), bad) {
        (None, _) => Err(AccuracyError::NoAxes),
        (_, Some(at)) => Err(AccuracyError::NotFinite(at)),
        (Some(samples), None) => Ok(samples),
    }
}

pub(super) fn bin_hz(bin: usize) -> f64 {
    FIRST_HZ + STEP_HZ * bin as f64
}

/// Transform at 20, 30, .. Hz.
enum Transform {
    /// Where a window has a whole number of samples.
    Fast { stft: Stft<f64>, samples: usize, bins: usize },
    /// For other rates: the window times e^(-i w t), bin by bin.
    Direct { kernels: Vec<Vec<Complex<f64>>>, samples: usize },
}

impl Transform {
    fn new(rate_hz: f64, bins: usize) -> Self {
        let samples = rate_hz * WINDOW_S;
        let whole = samples.round();
        if (samples - whole).abs() < 1e-6 {
            let samples = whole as usize;
            return Self::Fast { stft: Stft::new(samples), samples, bins };
        }
        let length = samples.ceil() as usize;
        let window: Vec<f64> = (0..length).map(|n| (PI * n as f64 / samples).sin().powi(2)).collect();
        let scale = 2.0 / window.iter().sum::<f64>();
        let kernel = |bin: usize| {
            let turn = TAU * (bin + FIRST) as f64 / samples;
            window.iter().enumerate().map(|(n, w)| Complex::from_polar(scale * w, -turn * n as f64)).collect()
        };
        Self::Direct { kernels: (0..bins).map(kernel).collect(), samples: length }
    }

    fn length(&self) -> usize {
        match self {
            Self::Fast { samples, .. } | Self::Direct { samples, .. } => *samples,
        }
    }

    fn add(&mut self, window: &[f64], powers: &mut [f64; BINS]) {
        match self {
            Self::Fast { stft, bins, .. } => {
                let found = stft.process(window).iter().skip(FIRST).take(*bins);
                powers.iter_mut().zip(found).for_each(|(power, c)| *power += c.norm_sqr() / 3.0);
            }
            Self::Direct { kernels, .. } => {
                for (power, kernel) in powers.iter_mut().zip(kernels) {
                    let sum: Complex<f64> = kernel.iter().zip(window).map(|(k, x)| k * x).sum();
                    *power += sum.norm_sqr() / 3.0;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{noise, sine};
    use super::*;

    #[test]
    fn sine_power_is_a_third_in_its_bin_and_a_twelfth_beside() {
        for rate in [1000.0, 1024.0, 2500.0, 4096.5, 10_000.0, 48_000.0] {
            let seen =
                Spectrogram::new(&[&sine(3.0, 120.0, rate, 1.01), &sine(4.0, 120.0, rate, 1.01)], rate)
                    .unwrap();
            assert_eq!(seen.frames(), 37, "{rate}");
            let near = if rate % 10.0 == 0.0 { 1e-9 } else { 0.05 };
            for frame in 0..37 {
                let p = seen.frame(frame).unwrap();
                assert!((p[10] - 25.0 / 3.0).abs() < near, "{rate}: {}", p[10]);
                assert!((p[9] - 25.0 / 12.0).abs() < near && (p[11] - 25.0 / 12.0).abs() < near);
                assert!(p[30] < 1e-4 && p[8] < 1e-4, "{rate}");
            }
            assert_eq!(seen.bins(), ((0.5 * rate - 20.0) / 10.0).ceil().min(99.0) as usize);
        }
    }

    #[test]
    fn powers_add_up_to_the_mean_square() {
        // White noise of variance 4 at 10 kHz: 99 bins of 10 Hz out of 5000 Hz.
        let seen = Spectrogram::new(&[&noise(5, 200_000, 2.0)], 10_000.0).unwrap();
        let sum: f64 = seen.mean(0..usize::MAX).iter().sum();
        assert!((sum / (4.0 * 990.0 / 5000.0) - 1.0).abs() < 0.03, "{sum}");
    }

    #[test]
    fn level_of_pulses_does_not_depend_on_their_shift() {
        // 4 ms of noise every 50 ms.
        let level = |shift: usize| {
            let mut x = noise(6, 25_000, 1.0);
            x.iter_mut().enumerate().filter(|(n, _)| (n + shift) % 125 >= 10).for_each(|(_, x)| *x = 0.0);
            let seen = Spectrogram::new(&[&x], 2500.0).unwrap();
            let share = x.iter().map(|x| x * x).sum::<f64>() / 25_000.0 * 990.0 / 1250.0;
            10.0 * (seen.mean(0..usize::MAX).iter().sum::<f64>() / share).log10()
        };
        let levels = [0, 25, 50, 75, 100].map(level);
        assert!(levels.iter().all(|db| db.abs() < 0.3), "{levels:?}");
        let (least, most) = levels.iter().fold((9.0, -9.0), |(a, b), l| (f64::min(a, *l), f64::max(b, *l)));
        assert!(most - least < 0.4, "{levels:?}");
    }

    #[test]
    fn invalid_signal_is_an_error() {
        let x = vec![0.0; 1000];
        for rate in [f64::NAN, 0.0, -1.0, 99.0, 1e7, f64::INFINITY] {
            assert!(matches!(Spectrogram::new(&[&x], rate), Err(AccuracyError::Rate(_))));
        }
        assert_eq!(Spectrogram::new(&[], 1000.0), Err(AccuracyError::NoAxes));
        for bad in [f64::NAN, f64::NEG_INFINITY, 1e200] {
            let mut y = x.clone();
            y[7] = bad;
            assert_eq!(Spectrogram::new(&[&x, &y], 1000.0), Err(AccuracyError::NotFinite(7)));
        }
        assert_eq!(Spectrogram::new(&[&x[..99]], 1000.0).unwrap().frames(), 0);
        assert_eq!(Spectrogram::new(&[&x, &x[..150]], 1000.0).unwrap().frames(), 3);
        assert_eq!(Spectrogram::new(&[&x], 1000.0).unwrap().mean(300..900), [0.0; BINS]);
    }
}
