//! The last two seconds of a scope, as least and greatest values of short bins.

use std::collections::VecDeque;
use std::time::Duration;

use crate::held::HOLD;

/// Number of bins: two seconds at [`BINS_HZ`]. All scopes have as many, so that charts show the same time.
const BINS: usize = 2048;
const BINS_HZ: u64 = 1024;
/// A bin without a sample.
const EMPTY: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

/// One signal.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    bins: VecDeque<[f32; 2]>,
    /// Counts of all bins that were begun, and of all samples.
    begun: u64,
    samples: u64,
    rate_hz: u32,
    scale: Scale,
}

/// Range of a chart: 0 to `top`, or `-top` to `top` if signed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Scale {
    pub(crate) top: f32,
    pub(crate) signed: bool,
    pub(crate) since: Duration,
}

/// The content of a chart.
pub(crate) struct Window {
    /// Least and greatest of each column, oldest first; `None` where there is no sample.
    pub(crate) columns: Vec<Option<[f32; 2]>>,
    /// Its duration in seconds.
    pub(crate) seconds: f64,
}

impl Trace {
    pub(crate) fn new(rate_hz: u32) -> Self {
        Self { rate_hz: rate_hz.max(1), ..Self::default() }
    }

    /// Takes new samples. Values that are not finite leave a gap. Samples rarer than bins fill several bins.
    pub(crate) fn take(&mut self, samples: &[f32], time: Duration) {
        let rate = u64::from(self.rate_hz.max(1));
        let many = BINS * rate.div_ceil(BINS_HZ) as usize;
        let skipped = samples.len().saturating_sub(many);
        for &x in &samples[skipped..] {
            self.samples += 1;
            let wanted = (self.samples * BINS_HZ).div_ceil(rate);
            for _ in 0..(wanted - self.begun).min(BINS as u64) {
                if self.bins.len() == BINS {
                    self.bins.pop_front();
                }
                self.bins.push_back(EMPTY);
                self.merge(x);
            }
            self.begun = wanted;
            self.merge(x);
        }
        self.rescale(time);
    }

    fn merge(&mut self, x: f32) {
        if let Some(bin) = self.bins.back_mut().filter(|_| x.is_finite()) {
            *bin = [bin[0].min(x), bin[1].max(x)];
        }
    }

    /// Grows the scale at once. Shrinks it only after two thirds of it were empty for a while.
    fn rescale(&mut self, time: Duration) {
        let (least, peak) = (self.least(), self.peak());
        let mut wanted = nice(peak);
        let mut signed = least < -0.02 * wanted;
        if wanted <= 0.0 {
            (wanted, signed) = (1.0, self.scale.signed);
        }
        let fits = peak <= self.scale.top && (self.scale.signed || !signed);
        let tight = peak > self.scale.top / 3.0 && self.scale.signed == signed;
        if !fits || tight {
            self.scale.since = time;
        }
        if !fits {
            self.scale.signed |= signed;
            self.scale.top = self.scale.top.max(wanted);
        }
        if self.scale.top <= 0.0 || time.saturating_sub(self.scale.since) >= HOLD {
            self.scale = Scale { top: wanted, signed, since: time };
        }
    }

    fn least(&self) -> f32 {
        self.bins.iter().fold(f32::INFINITY, |least, bin| least.min(bin[0]))
    }

    /// Largest magnitude of the last two seconds.
    pub(crate) fn peak(&self) -> f32 {
        self.bins.iter().filter(|bin| bin[0] <= bin[1]).fold(0.0, |peak, bin| peak.max(-bin[0]).max(bin[1]))
    }

    pub(crate) fn scale(&self) -> Scale {
        self.scale
    }

    /// The newest samples on `columns` columns. A column keeps its bins while it moves, so its form stays.
    pub(crate) fn window(&self, columns: usize) -> Window {
        let each = (BINS / columns.max(1)).max(1) as u64;
        let newest = self.begun.div_ceil(each);
        let oldest = self.begun - self.bins.len() as u64;
        let mut out = vec![None; columns];
        for (index, &[least, most]) in (oldest..).zip(&self.bins) {
            let back = (newest - 1 - index / each) as usize;
            if back < columns && least <= most {
                let column: &mut Option<[f32; 2]> = &mut out[columns - 1 - back];
                *column = Some(column.map_or([least, most], |c| [c[0].min(least), c[1].max(most)]));
            }
        }
        Window { columns: out, seconds: (columns as u64 * each) as f64 / BINS_HZ as f64 }
    }
}

/// The next of 1, 2, 5 times a power of ten.
fn nice(x: f32) -> f32 {
    let x = f64::from(x);
    if x <= 1e-30 {
        return 0.0;
    }
    let decade = 10f64.powf(x.log10().floor());
    let step = [1.0, 2.0, 5.0].into_iter().find(|s| x <= s * decade * (1.0 + 1e-9)).unwrap_or(10.0);
    (step * decade) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn one_sample_of_two_seconds_is_seen() {
        let mut trace = Trace::new(48_000);
        let mut samples = vec![0.0; 90_000];
        samples[44_000] = 3.0;
        trace.take(&samples, ms(0));
        let seen = trace.window(60).columns.iter().flatten().filter(|c| c[1] == 3.0).count();
        assert_eq!(seen, 1);
        assert_eq!(trace.scale().top, 5.0);
    }

    #[test]
    fn columns_move_as_wholes() {
        let mut trace = Trace::new(1024);
        let samples: Vec<f32> = (0..2048).map(|i| i as f32).collect();
        trace.take(&samples, ms(0));
        let before = trace.window(128).columns;
        trace.take(&[2048.0; 16], ms(10));
        let after = trace.window(128).columns;
        assert_eq!(before[1..], after[..127]);
        assert_eq!(before[127], Some([2032.0, 2047.0]));
    }

    #[test]
    fn scale_grows_at_once_and_shrinks_late() {
        let mut trace = Trace::new(1024);
        let mut tops = Vec::new();
        for step in 0..100u64 {
            let x = if step == 10 { 40.0 } else { 0.9 };
            trace.take(&[x; 51], ms(50 * step));
            tops.push(trace.scale().top);
        }
        assert_eq!((tops[9], tops[10], tops[49]), (1.0, 50.0, 50.0));
        // The peak leaves the window after 2 s, and 2 s later the scale follows.
        assert_eq!((tops[88], tops[99]), (50.0, 1.0));
    }

    #[test]
    fn not_finite_samples_leave_a_gap_and_no_scale() {
        let mut trace = Trace::new(1024);
        trace.take(&[1.0, f32::NAN, f32::INFINITY, -1.5], ms(0));
        assert_eq!(trace.window(2048).columns[2044..], [Some([1.0, 1.0]), None, None, Some([-1.5, -1.5])]);
        assert_eq!((trace.scale().top, trace.scale().signed), (2.0, true));
    }

    #[test]
    fn signals_of_all_rates_show_the_same_time() {
        for rate in [1, 100, 500, 1000, 44_100, 48_000, 192_000] {
            let mut trace = Trace::new(rate);
            // Two seconds, in pieces; the second half is 1.
            let samples: Vec<f32> = (0..2 * rate).map(|k| if k < rate { 0.0 } else { 1.0 }).collect();
            samples.chunks(37).for_each(|piece| trace.take(piece, ms(0)));
            let window = trace.window(64);
            let (low, high) = window.columns.split_at(32);
            assert!(low.iter().all(|c| *c == Some([0.0; 2])), "{rate}");
            // The sample at the middle may begin within the last bin of the first half.
            assert!(high[1..].iter().all(|c| *c == Some([1.0; 2])), "{rate}");
            assert_eq!(window.seconds, 2.0);
        }
    }

    #[test]
    fn zero_columns_and_zero_rate_are_accepted() {
        let mut trace = Trace::new(0);
        trace.take(&[1.0; 3], ms(0));
        assert!(trace.window(0).columns.is_empty());
        assert_eq!(trace.window(100_000).columns.len(), 100_000);
    }
}
