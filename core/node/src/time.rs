//! Exact time: ticks, samples and frames are counted in integers, never summed in floating point.

use std::fmt;
use std::ops::{Add, Range};

use num_rational::Ratio;

/// First sample of a tick at a rate: floor(tick * rate / tick rate).
pub const fn first_sample(tick: u64, rate_hz: u32, tick_hz: u32) -> u64 {
    (tick as u128 * rate_hz as u128 / tick_hz as u128) as u64
}

/// Samples of a tick at a rate. May be empty if the rate is below the tick rate.
pub const fn samples(tick: u64, rate_hz: u32, tick_hz: u32) -> Range<u64> {
    first_sample(tick, rate_hz, tick_hz)..first_sample(tick + 1, rate_hz, tick_hz)
}

/// Most samples of any tick at a rate.
pub const fn max_samples(rate_hz: u32, tick_hz: u32) -> usize {
    rate_hz.div_ceil(tick_hz) as usize
}

/// Frames a second, as an exact ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FrameRate(Ratio<u32>);

impl FrameRate {
    /// `num / den` frames a second; `None` if one of them is 0.
    pub fn new(num: u32, den: u32) -> Option<Self> {
        (num > 0 && den > 0).then(|| Self(Ratio::new(num, den)))
    }

    /// Numerator in lowest terms.
    pub fn num(self) -> u32 {
        *self.0.numer()
    }

    /// Denominator in lowest terms.
    pub fn den(self) -> u32 {
        *self.0.denom()
    }

    /// First sample of a frame: floor(frame * rate / frame rate).
    pub fn first_sample(self, frame: u64, rate_hz: u32) -> u64 {
        (u128::from(frame) * u128::from(rate_hz) * u128::from(self.den()) / u128::from(self.num())) as u64
    }

    /// Frames a second as a number, for reports.
    pub fn hz(self) -> f64 {
        f64::from(self.num()) / f64::from(self.den())
    }
}

impl fmt::Display for FrameRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// Maps frames to ticks.
///
/// Frame n belongs to the tick in which it starts, so that none of its samples has been emitted before.
#[derive(Clone, Copy, Debug)]
pub struct FrameClock {
    tick_hz: u32,
    every: u32,
    rate: FrameRate,
}

impl FrameClock {
    /// Makes a clock for a node that runs every `every`-th tick. A higher frame rate is lowered to one
    /// frame a run; see [`rate`](Self::rate).
    pub fn new(tick_hz: u32, every: u32, wanted: FrameRate) -> Self {
        let most = FrameRate(Ratio::new(tick_hz.max(1), every.max(1)));
        Self { tick_hz, every: every.max(1), rate: wanted.min(most) }
    }

    /// Frames a second.
    pub fn rate(&self) -> FrameRate {
        self.rate
    }

    /// The frame that starts in this tick or, for a node that runs every k-th tick, before its next
    /// run.
    pub fn frame(&self, tick: u64) -> Option<u64> {
        let (num, den) = (u128::from(self.rate.num()), u128::from(self.rate.den()));
        let ticks_per = den * u128::from(self.tick_hz);
        let frame = (u128::from(tick) * num).div_ceil(ticks_per);
        (frame * ticks_per < (u128::from(tick) + u128::from(self.every)) * num).then_some(frame as u64)
    }
}

/// A signed exact duration. Positive is late, negative is early.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Latency(Ratio<i64>);

impl Default for Latency {
    fn default() -> Self {
        Self::ZERO
    }
}

impl Latency {
    /// No latency.
    pub const ZERO: Self = Self(Ratio::new_raw(0, 1));

    /// `samples` at a rate.
    pub fn samples(samples: i64, rate_hz: u32) -> Self {
        Self::ratio(samples, i64::from(rate_hz))
    }

    /// `num / den` seconds; a denominator of 0 counts as 1.
    pub fn ratio(num: i64, den: i64) -> Self {
        Self(Ratio::new(num, if den == 0 { 1 } else { den }))
    }

    /// Numerator and denominator, in seconds.
    pub fn as_ratio(self) -> (i64, i64) {
        (*self.0.numer(), *self.0.denom())
    }

    /// Milliseconds, for reports.
    pub fn ms(self) -> f64 {
        let (num, den) = self.as_ratio();
        num as f64 * 1e3 / den as f64
    }
}

impl Add for Latency {
    type Output = Self;

    /// The exact sum; rounded to the nanosecond if the exact one does not fit 64 bits.
    fn add(self, other: Self) -> Self {
        let exact = || {
            let ((a, b), (c, d)) = (self.as_ratio(), other.as_ratio());
            let num = a.checked_mul(d)?.checked_add(c.checked_mul(b)?)?;
            Some(Self(Ratio::new(num, b.checked_mul(d)?)))
        };
        exact().unwrap_or_else(|| Self::ratio(((self.ms() + other.ms()) * 1e6).round() as i64, 1_000_000_000))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_at_44100_are_88_or_89_samples_and_never_drift() {
        let lens: Vec<_> = (0..5).map(|k| samples(k, 44_100, 500)).map(|r| r.end - r.start).collect();
        assert_eq!(lens, [88, 88, 88, 88, 89]);
        assert_eq!(first_sample(500 * 86_400, 44_100, 500), 44_100 * 86_400);
        assert_eq!(max_samples(44_100, 500), 89);
        assert_eq!(max_samples(2_500, 4_000), 1);
    }

    #[test]
    fn every_frame_is_emitted_once_in_the_tick_it_starts_in() {
        for (tick_hz, every, wanted) in [
            (500, 1, (500, 1)),
            (700, 1, (500, 1)),
            (4000, 1, (500, 1)),
            (250, 1, (500, 1)),
            (500, 3, (500, 1)),
        ] {
            let clock = FrameClock::new(tick_hz, every, FrameRate::new(wanted.0, wanted.1).unwrap());
            let mut next = 0;
            for tick in (0..10_000).step_by(every as usize) {
                if let Some(n) = clock.frame(tick) {
                    assert_eq!(n, next, "{tick_hz} Hz, every {every}");
                    next += 1;
                    for rate in [2_500, 44_100, 48_000] {
                        let start = clock.rate().first_sample(n, rate);
                        assert!(start >= first_sample(tick, rate, tick_hz));
                        assert!(start <= first_sample(tick + u64::from(every), rate, tick_hz));
                    }
                }
            }
            let seconds = 10_000.0 / f64::from(tick_hz);
            assert!((next as f64 - seconds * clock.rate().hz()).abs() <= 1.0);
        }
    }

    #[test]
    fn latencies_add_exactly_and_do_not_overflow() {
        let a = Latency::samples(7, 2_500) + Latency::samples(1, 48_000);
        assert_eq!(a, Latency::ratio(7 * 48_000 + 2_500, 2_500 * 48_000));
        let big = Latency::ratio(1, 3_037_000_499) + Latency::ratio(1, 3_037_000_507);
        assert!((big.ms() - 2e3 / 3_037_000_500.0).abs() < 1e-6);
    }
}
