//! Values of the last two seconds: short events stay long enough to be seen.

use std::time::Duration;

/// Time that a peak, or the rise of a count, stays visible.
pub(crate) const HOLD: Duration = Duration::from_secs(2);

/// A count and its recent rise. The first value is no rise.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Count {
    known: bool,
    pub(crate) now: u64,
    until: Duration,
}

impl Count {
    /// Takes the count at `time`. Returns whether it has risen.
    pub(crate) fn take(&mut self, count: u64, time: Duration) -> bool {
        let rises = self.known && count > self.now;
        if rises {
            self.until = time + HOLD;
        }
        (self.known, self.now) = (true, count);
        rises
    }

    /// Whether it rose within [`HOLD`].
    pub(crate) fn rose(&self, time: Duration) -> bool {
        time < self.until
    }
}

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Peak {
    pub(crate) value: f32,
    until: Duration,
}

impl Peak {
    /// Takes a peak. NaN counts as the largest.
    pub(crate) fn take(&mut self, peak: f32, time: Duration) {
        if peak.is_nan() || peak >= self.value || time >= self.until {
            *self = Self { value: peak, until: time + HOLD };
        }
    }
}

/// Bins of a trace, and bins a second.
const BINS: usize = 256;
const BINS_HZ: u64 = 128;

/// A signal as least and greatest values of short bins; `None` without a finite sample.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    bins: Vec<Option<[f32; 2]>>,
    /// Counts of all bins that were begun, and of all samples.
    begun: u64,
    samples: u64,
    rate_hz: u64,
}

impl Trace {
    pub(crate) fn new(rate_hz: u32) -> Self {
        Self { rate_hz: rate_hz.max(1).into(), ..Self::default() }
    }

    /// Takes new samples. Samples rarer than bins fill several bins.
    pub(crate) fn take(&mut self, samples: &[f32]) {
        for &x in samples {
            self.samples += 1;
            let begun = (self.samples * BINS_HZ).div_ceil(self.rate_hz);
            let new = ((begun - self.begun) as usize).min(BINS);
            if new > 0 {
                self.begun = begun;
                self.bins.extend(std::iter::repeat_n(None, new));
                self.bins.drain(..self.bins.len().saturating_sub(BINS));
            }
            for bin in self.bins.iter_mut().rev().take(new.max(1)).filter(|_| x.is_finite()) {
                *bin = Some(bin.map_or([x; 2], |[least, most]| [least.min(x), most.max(x)]));
            }
        }
    }

    pub(crate) fn peak(&self) -> f32 {
        self.bins.iter().flatten().fold(0.0, |peak, bin| peak.max(-bin[0]).max(bin[1]))
    }

    /// Range of a chart: from 0 or the negative of its top to the next of 1, 2, 5 times a power of ten.
    pub(crate) fn bounds(&self) -> [f64; 2] {
        let peak = f64::from(self.peak());
        let decade = 10f64.powf(peak.max(1e-30).log10().floor());
        let step = [1.0, 2.0, 5.0].into_iter().find(|s| peak <= s * decade * (1.0 + 1e-9)).unwrap_or(10.0);
        let top = if peak > 1e-30 { step * decade } else { 1.0 };
        let least = self.bins.iter().flatten().fold(f32::INFINITY, |least, bin| least.min(bin[0]));
        [if f64::from(least) < -0.02 * top { -top } else { 0.0 }, top]
    }

    /// The signal over seconds before now, in pieces without a gap.
    pub(crate) fn lines(&self) -> Vec<Vec<(f64, f64)>> {
        let at = |i: usize| (i as f64 - self.bins.len() as f64) / BINS_HZ as f64;
        let point = |(i, bin): (usize, &Option<[f32; 2]>)| bin.map(|bin| bin.map(|x| (at(i), x.into())));
        let points: Vec<Option<[(f64, f64); 2]>> = self.bins.iter().enumerate().map(point).collect();
        points.split(Option::is_none).map(|line| line.iter().flatten().flatten().copied().collect()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn rise_and_peak_stay_for_two_seconds() {
        let (mut count, mut peak) = (Count::default(), Peak::default());
        assert!(!count.take(1, ms(0)) && count.take(3, ms(100)) && !count.take(3, ms(200)));
        assert!(count.rose(ms(2099)) && !count.rose(ms(2100)));
        peak.take(0.9, ms(0));
        for (at, value) in [(1999, 0.9), (2000, 0.1)] {
            peak.take(0.1, ms(at));
            assert_eq!(peak.value, value);
        }
        peak.take(f32::NAN, ms(2010));
        peak.take(0.5, ms(2020));
        assert!(peak.value.is_nan());
    }

    #[test]
    fn one_sample_of_two_seconds_is_seen() {
        let mut trace = Trace::new(48_000);
        let mut samples = vec![0.0; 90_000];
        samples[44_000] = 3.0;
        trace.take(&samples);
        assert_eq!(trace.lines()[0].iter().filter(|(_, x)| *x == 3.0).count(), 1);
        assert_eq!(trace.bounds(), [0.0, 5.0]);
    }

    #[test]
    fn scale_follows_the_last_two_seconds() {
        let mut trace = Trace::new(1024);
        let mut tops = Vec::new();
        for step in 0..100 {
            trace.take(&[if step == 10 { 40.0 } else { 0.9 }; 51]);
            tops.push(trace.bounds()[1]);
        }
        assert_eq!((tops[9], tops[10], tops[49], tops[99]), (1.0, 50.0, 50.0, 1.0));
    }

    #[test]
    fn not_finite_samples_leave_a_gap_and_no_scale() {
        let mut trace = Trace::new(128);
        trace.take(&[1.0, f32::NAN, f32::INFINITY, -1.5]);
        let ends: Vec<_> = trace.lines().into_iter().filter(|line| !line.is_empty()).collect();
        assert_eq!(ends, [[(-4.0 / 128.0, 1.0); 2], [(-1.0 / 128.0, -1.5); 2]]);
        assert_eq!(trace.bounds(), [-2.0, 2.0]);
    }

    #[test]
    fn signals_of_all_rates_show_the_same_time() {
        for rate in [0, 1, 100, 500, 1000, 44_100, 48_000, 192_000] {
            let mut trace = Trace::new(rate);
            // Two seconds, in pieces; the second half is 1.
            let rate = rate.max(1);
            let samples: Vec<f32> = (0..2 * rate).map(|k| if k < rate { 0.0 } else { 1.0 }).collect();
            samples.chunks(37).for_each(|piece| trace.take(piece));
            let (low, high) = trace.bins.split_at(BINS / 2);
            assert!(low.iter().all(|bin| *bin == Some([0.0; 2])), "{rate}");
            // The sample at the middle may begin within the last bin of the first half.
            assert!(high[1..].iter().all(|bin| *bin == Some([1.0; 2])), "{rate}");
            assert_eq!(trace.bins.len(), BINS);
        }
    }
}
