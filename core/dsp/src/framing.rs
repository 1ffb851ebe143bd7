//! Layout of the frames of a short-time Fourier transform in time and frequency.

use crate::{Refused, refuse};

/// Layout of a short-time Fourier transform at one sample rate: frame `n` covers samples `start(n) ..
/// start(n) + fft_len`. Bins are counted from 0 and are `rate_hz / fft_len` apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Framing {
    /// Samples a second.
    pub rate_hz: u32,
    /// Window and transform length N in samples; may be odd.
    pub fft_len: usize,
    /// Number of bins K in a frame, from bin 0; at most `fft_len / 2 + 1`. Bins above are zero.
    pub bins: usize,
    /// Frames a second, numerator.
    pub frame_num: u32,
    /// Frames a second, denominator.
    pub frame_den: u32,
}

/// Longest accepted transform in samples.
pub const MAX_FFT_LEN: usize = 1 << 20;

/// Longest accepted period of frame positions in samples. A table of this length is kept.
pub const MAX_PERIOD: u64 = 1 << 20;

impl Framing {
    /// Checks the layout.
    ///
    /// # Errors
    /// A rate, a length or a number of bins of 0; a transform longer than [`MAX_FFT_LEN`] or with fewer bins;
    /// more frames than samples; frame positions that repeat only after [`MAX_PERIOD`] samples, or after so
    /// many frames that adding up their windows would take seconds.
    pub fn check(&self) -> Result<(), Refused> {
        let parts = [self.rate_hz as usize, self.fft_len, self.bins];
        if parts.contains(&0) || self.frame_num == 0 || self.frame_den == 0 {
            return refuse("a rate, a length or a number of bins is 0");
        }
        if self.fft_len > MAX_FFT_LEN {
            return refuse(format!("the transform is longer than {MAX_FFT_LEN} samples"));
        }
        let most = self.fft_len / 2 + 1;
        if self.bins > most {
            return refuse(format!("a real transform of this length has {most} bins"));
        }
        let (period, frames) = self.period();
        if frames > period {
            return refuse("there are more frames a second than samples");
        }
        if period > MAX_PERIOD || frames.saturating_mul(self.fft_len as u64) > 1 << 31 {
            return refuse(format!("frame places repeat only after {period} samples, which is too many"));
        }
        Ok(())
    }

    /// First sample of frame `n`: `floor(n * rate_hz * frame_den / frame_num)`.
    pub fn start(&self, n: u64) -> u64 {
        let exact = u128::from(n) * u128::from(self.rate_hz) * u128::from(self.frame_den)
            / u128::from(self.frame_num.max(1));
        u64::try_from(exact).unwrap_or(u64::MAX)
    }

    /// Period of the frame positions as `(samples, frames)`: the hop as a reduced fraction.
    pub fn period(&self) -> (u64, u64) {
        let (a, b) = (u64::from(self.rate_hz) * u64::from(self.frame_den), u64::from(self.frame_num));
        let g = gcd(a, b).max(1);
        (a / g, b / g)
    }

    /// Factor from an amplitude to an unscaled DFT bin: `sum w / 2` of the Hann window.
    pub fn bin_scale(&self) -> f64 {
        self.fft_len as f64 / 4.0
    }
}

/// Greatest common divisor; of 0 and `b` it is `b`.
pub(crate) fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_start_at_whole_samples_and_never_drift() {
        let f = Framing { rate_hz: 44_100, fft_len: 4410, bins: 101, frame_num: 500, frame_den: 1 };
        assert_eq!(f.check(), Ok(()));
        assert_eq!(f.period(), (441, 5));
        assert_eq!([0, 1, 2, 3, 4, 5].map(|n| f.start(n)), [0, 88, 176, 264, 352, 441]);
        assert_eq!(f.start(5_000_000_000), 441_000_000_000);
    }

    #[test]
    fn impossible_framings_are_refused() {
        let f = Framing { rate_hz: 2500, fft_len: 250, bins: 101, frame_num: 500, frame_den: 1 };
        for (bad, why) in [
            (Framing { bins: 127, ..f }, "a real transform of this length has 126 bins"),
            (Framing { rate_hz: 0, ..f }, "is 0"),
            (Framing { fft_len: usize::MAX, ..f }, "longer than"),
            (Framing { rate_hz: 4_294_967_291, ..f }, "only after 4294967291 samples"),
        ] {
            assert!(bad.check().unwrap_err().0.contains(why), "{bad:?}");
        }
    }
}
