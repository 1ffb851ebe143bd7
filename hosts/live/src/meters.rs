//! Times and counts of a run: written on real-time threads, read by others.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::view::TimingView;

/// Bins an octave: a bin is 4.4 % wide.
const PART: usize = 16;
/// Octaves of the histogram: times from 2^36 ns (a minute) fall into the last bin.
const OCTAVES: usize = 36;
/// Octaves that a person sees: from 2^9 ns (0.5 us) to 2^26 ns (67 ms).
const SHOWN: std::ops::Range<usize> = 9..27;

/// Histogram of nanoseconds in bins of fixed ratio. One thread writes, others read, nobody waits.
#[derive(Debug)]
pub struct Histogram {
    bins: [AtomicU64; OCTAVES * PART],
    max: AtomicU64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { bins: [const { AtomicU64::new(0) }; OCTAVES * PART], max: AtomicU64::new(0) }
    }
}

/// With one writer, no read-modify-write is needed.
pub(crate) fn add(to: &AtomicU64, n: u64) {
    to.store(to.load(Relaxed).wrapping_add(n), Relaxed);
}

impl Histogram {
    /// Counts a time. The writer only.
    pub fn record(&self, ns: u64) {
        let bin = ((ns.max(1) as f64).log2() * PART as f64) as usize;
        add(&self.bins[bin.min(self.bins.len() - 1)], 1);
        self.max.store(self.max_ns().max(ns), Relaxed);
    }

    /// Number of times.
    pub fn count(&self) -> u64 {
        self.bins.iter().map(|b| b.load(Relaxed)).sum()
    }

    /// Longest time, exact.
    pub fn max_ns(&self) -> u64 {
        self.max.load(Relaxed)
    }

    /// Quantile `q` (0 to 1), within 2.2 %; 0 for none.
    pub fn quantile_ns(&self, q: f64) -> u64 {
        let rank = ((self.count() as f64 * q).ceil() as u64).max(1);
        let mut seen = 0;
        let bin = self.bins.iter().position(|bin| {
            seen += bin.load(Relaxed);
            seen >= rank
        });
        bin.map_or(0, |bin| (((bin as f64 + 0.5) / PART as f64).exp2().round() as u64).min(self.max_ns()))
    }

    /// p50, p99, p99.9 and the maximum, in microseconds.
    pub fn figures_us(&self) -> [f64; 4] {
        let all = [self.quantile_ns(0.5), self.quantile_ns(0.99), self.quantile_ns(0.999), self.max_ns()];
        all.map(|ns| ns as f64 / 1e3)
    }

    /// Counts by octave; the first and the last of [`SHOWN`] hold the times beyond them.
    fn octaves(&self) -> Vec<u64> {
        let mut counts = vec![0; SHOWN.len() + 1];
        for (octave, bins) in self.bins.chunks(PART).enumerate() {
            let at = (octave + 1).clamp(SHOWN.start, SHOWN.end) - SHOWN.start;
            counts[at] += bins.iter().map(|bin| bin.load(Relaxed)).sum::<u64>();
        }
        counts
    }
}

/// Times of a tick, by [`now_ns`](crate::now_ns).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// Its number.
    pub tick: u64,
    /// Due time.
    pub due_ns: u64,
    /// Start.
    pub woke_ns: u64,
    /// End, when its samples were complete.
    pub done_ns: u64,
}

/// A counter of rare events. Any thread.
#[derive(Debug, Default)]
pub struct Count(AtomicU64);

impl Count {
    /// Counts `n` more.
    pub fn add(&self, n: u64) {
        self.0.fetch_add(n, Relaxed);
    }

    /// So far.
    pub fn get(&self) -> u64 {
        self.0.load(Relaxed)
    }
}

/// Times and counts of a run.
#[derive(Debug, Default)]
pub struct Meters {
    tick_ns: u64,
    /// Wake-up lateness of ticks.
    pub late: Histogram,
    /// Computing time of ticks.
    pub compute: Histogram,
    /// Time from the due time of a deadline miss to the end of the next tick in time.
    pub recovery: Histogram,
    /// Due time of the first deadline miss of the current series, plus 1; 0 for none.
    behind_since: AtomicU64,
    /// Number of the last tick, plus 1.
    next: AtomicU64,
    /// Deadline misses: ticks that ended more than a tick after they were due.
    pub misses: Count,
    /// Deadline misses of ticks that took less than a tick to compute: they woke too late.
    pub woke_late: Count,
    /// Callbacks that found too few samples.
    pub underruns: Count,
    /// Samples of each channel that were never played because their time passed.
    pub lost_samples: Count,
    /// Ticks skipped because they were too late.
    pub skipped_ticks: Count,
    /// Ticks that ran at once because they were a tick or more late.
    pub caught_up_ticks: Count,
    /// Gaps between callbacks that the loop over their times saw. The stream counts the host's reports.
    pub xruns: Count,
    /// How often the device was lost.
    pub losses: Count,
}

impl Meters {
    /// Meters for a tick rate. Large: keep it behind a pointer.
    pub fn new(tick_hz: u32) -> Self {
        Self { tick_ns: 1_000_000_000 / u64::from(tick_hz.max(1)), ..Self::default() }
    }

    /// Records a tick. The tick thread only.
    pub fn record(&self, tick: Record) {
        let computed = tick.done_ns.saturating_sub(tick.woke_ns);
        self.late.record(tick.woke_ns.saturating_sub(tick.due_ns));
        self.compute.record(computed);
        self.next.store(tick.tick + 1, Relaxed);
        let since = self.behind_since.load(Relaxed);
        if tick.done_ns > tick.due_ns + self.tick_ns {
            self.misses.add(1);
            if computed <= self.tick_ns {
                self.woke_late.add(1);
            }
            if since == 0 {
                self.behind_since.store(tick.due_ns + 1, Relaxed);
            }
        } else if since > 0 {
            self.recovery.record(tick.done_ns.saturating_sub(since - 1));
            self.behind_since.store(0, Relaxed);
        }
    }

    /// Number of the tick after the last one that ran.
    pub fn next_tick(&self) -> u64 {
        self.next.load(Relaxed)
    }

    /// All times for a person. Allocates. Any thread but one that ticks.
    pub fn timing(&self) -> TimingView {
        TimingView {
            deadline_us: self.tick_ns as f64 / 1e3,
            misses: self.misses.get(),
            woke_late: self.woke_late.get(),
            late_us: self.late.figures_us(),
            compute_us: self.compute.figures_us(),
            recovery_us: self.recovery.figures_us(),
            edges_us: SHOWN.map(|octave| (1_u64 << octave) as f64 / 1e3).collect(),
            late_counts: self.late.octaves(),
            compute_counts: self.compute.octaves(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_node::random::uniform;

    #[test]
    fn quantiles_are_within_5_percent_of_sorted_times() {
        let histogram = Histogram::default();
        let mut times: Vec<u64> = (0..50_000).map(|i| (10.0_f64.powf(uniform(1, i) * 9.0)) as u64).collect();
        times.iter().for_each(|t| histogram.record(*t));
        times.sort_unstable();
        for q in [0.001, 0.1, 0.5, 0.9, 0.99, 0.999] {
            let want = times[(times.len() as f64 * q).ceil() as usize - 1] as f64;
            let got = histogram.quantile_ns(q) as f64;
            assert!((got / want - 1.0).abs() < 0.05, "{q}: {got} of {want}");
        }
        assert_eq!((histogram.max_ns(), histogram.count()), (*times.last().unwrap(), 50_000));
        histogram.record(u64::MAX);
        histogram.record(0);
        assert_eq!((histogram.max_ns(), histogram.count()), (u64::MAX, 50_002));
        assert_eq!(Histogram::default().figures_us(), [0.0; 4]);
    }

    #[test]
    fn miss_is_late_waking_or_long_computing() {
        let meters = Meters::new(500);
        let tick = |due_ns, woke_ns, done_ns| Record { tick: 6, due_ns, woke_ns, done_ns };
        meters.record(tick(0, 10_000, 2_000_000));
        assert_eq!((meters.misses.get(), meters.woke_late.get()), (0, 0));
        meters.record(tick(0, 1_900_000, 2_000_001));
        assert_eq!((meters.misses.get(), meters.woke_late.get()), (1, 1));
        meters.record(tick(5_000_000, 4_000_000, 7_500_000));
        assert_eq!((meters.misses.get(), meters.woke_late.get()), (2, 1));
        // The first of the two was due at 0; the next in time is there at 8.5 ms.
        assert_eq!(meters.recovery.count(), 0);
        meters.record(tick(7_000_000, 7_100_000, 8_500_000));
        meters.record(tick(9_000_000, 9_100_000, 9_200_000));
        assert_eq!((meters.recovery.count(), meters.recovery.max_ns()), (1, 8_500_000));
        let view = meters.timing();
        assert_eq!((view.misses, view.woke_late, meters.next_tick(), view.deadline_us), (2, 1, 7, 2000.0));
        assert_eq!(view.late_counts.len(), view.edges_us.len() + 1);
        assert_eq!((view.late_counts.iter().sum::<u64>(), view.recovery_us[3]), (5, 8_500.0));
        // 1.9 ms lies between the edges 1.05 and 2.1 ms.
        let at = view.edges_us.iter().position(|e| *e > 1900.0).unwrap();
        assert_eq!((view.late_counts[at], view.late_us[3]), (1, 1900.0));
    }
}
