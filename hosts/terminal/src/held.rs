//! Short events, held long enough to be seen.

use std::time::Duration;

/// Time that a peak, or the rise of a count, stays visible.
pub(crate) const HOLD: Duration = Duration::from_secs(2);

/// A count and its recent rise. The first value is no rise.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Count {
    known: bool,
    pub(crate) now: u64,
    rise: u64,
    until: Duration,
}

impl Count {
    /// Takes the count at `time`. Returns whether it has risen.
    pub(crate) fn take(&mut self, count: u64, time: Duration) -> bool {
        let by = if self.known { count.saturating_sub(self.now) } else { 0 };
        self.known = true;
        self.rise = self.risen(time).saturating_add(by);
        self.now = count;
        if by > 0 {
            self.until = time + HOLD;
        }
        by > 0
    }

    /// The recent rise; 0 once nothing was added for [`HOLD`].
    pub(crate) fn risen(&self, time: Duration) -> u64 {
        if time < self.until { self.rise } else { 0 }
    }
}

/// The largest recent value.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Peak {
    value: f32,
    until: Duration,
}

impl Peak {
    /// Takes a peak. NaN counts as the largest.
    pub(crate) fn take(&mut self, peak: f32, time: Duration) {
        let more = peak.is_nan() || (peak >= self.value);
        if more || time >= self.until {
            *self = Self { value: peak, until: time + HOLD };
        }
    }

    /// The largest value of the last [`HOLD`].
    pub(crate) fn value(&self) -> f32 {
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn rise_of_one_view_stays_for_two_seconds() {
        let mut count = Count::default();
        assert!(!count.take(0, ms(0)));
        assert!(count.take(3, ms(100)));
        assert!(!count.take(3, ms(200)));
        assert_eq!((count.risen(ms(2099)), count.risen(ms(2100))), (3, 0));
        assert!(count.take(4, ms(2000)));
        assert_eq!((count.risen(ms(3999)), count.risen(ms(4000))), (4, 0));
    }

    #[test]
    fn peak_stays_for_two_seconds_and_then_follows() {
        let mut peak = Peak::default();
        peak.take(0.9, ms(0));
        peak.take(0.1, ms(1999));
        assert_eq!(peak.value(), 0.9);
        peak.take(0.1, ms(2000));
        assert_eq!(peak.value(), 0.1);
        peak.take(f32::NAN, ms(2010));
        peak.take(0.5, ms(2020));
        assert!(peak.value().is_nan());
    }
}
