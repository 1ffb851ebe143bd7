//! Durations: histograms that can be filled on the tick thread.

use hdrhistogram::Histogram;

/// Longest duration that is distinguished \[ns\]: 10 s. Longer ones count as this.
pub const LONGEST_NS: u64 = 10_000_000_000;

/// A histogram of durations in nanoseconds.
///
/// Its size is fixed when it is made: about 14 KiB with 2 digits, 110 KiB with 3.
#[derive(Clone, Debug)]
pub struct Timing {
    histogram: Option<Histogram<u32>>,
}

/// Figures of a [`Timing`], in nanoseconds; all 0 where nothing was recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Number of durations.
    pub count: u64,
    /// Arithmetic mean.
    pub mean_ns: f64,
    /// Median.
    pub p50_ns: u64,
    /// 99th percentile.
    pub p99_ns: u64,
    /// 99.9th percentile.
    pub p999_ns: u64,
    /// Longest.
    pub max_ns: u64,
}

impl Timing {
    /// An empty histogram that tells durations apart to `digits` significant decimal digits, 1 to 5.
    pub fn new(digits: u8) -> Self {
        Self { histogram: Histogram::new_with_bounds(1, LONGEST_NS, digits.clamp(1, 5)).ok() }
    }

    /// Counts one duration. Does not allocate; takes a few nanoseconds.
    #[inline]
    pub fn record(&mut self, ns: u64) {
        if let Some(h) = &mut self.histogram {
            h.saturating_record(ns);
        }
    }

    /// Clears all durations. Does not allocate.
    pub fn reset(&mut self) {
        if let Some(h) = &mut self.histogram {
            h.reset();
        }
    }

    /// Quantile of the durations \[ns\], of a part from 0 to 1; 0 where nothing was recorded.
    pub fn quantile_ns(&self, part: f64) -> u64 {
        let filled = self.histogram.as_ref().filter(|h| !h.is_empty());
        filled.map_or(0, |h| h.value_at_quantile(part.clamp(0.0, 1.0)))
    }

    /// Figures so far.
    pub fn summary(&self) -> Summary {
        let of = |h: &Histogram<u32>| Summary {
            count: h.len(),
            mean_ns: h.mean(),
            p50_ns: h.value_at_quantile(0.5),
            p99_ns: h.value_at_quantile(0.99),
            p999_ns: h.value_at_quantile(0.999),
            max_ns: h.max(),
        };
        self.histogram.as_ref().filter(|h| !h.is_empty()).map(of).unwrap_or_default()
    }
}

/// Durations of whole ticks, and of each node's calls.
#[derive(Clone, Debug)]
pub struct Recorder {
    tick: Timing,
    nodes: Vec<Timing>,
}

impl Recorder {
    /// For `nodes` nodes, numbered from 0; 3 digits for ticks, 2 for nodes.
    pub fn new(nodes: usize) -> Self {
        Self { tick: Timing::new(3), nodes: vec![Timing::new(2); nodes] }
    }

    /// Counts one tick. Does not allocate.
    #[inline]
    pub fn tick(&mut self, ns: u64) {
        self.tick.record(ns);
    }

    /// Counts one call of a node; a number that is not one of the nodes' is ignored. Does not allocate.
    #[inline]
    pub fn node(&mut self, node: usize, ns: u64) {
        if let Some(t) = self.nodes.get_mut(node) {
            t.record(ns);
        }
    }

    /// Clears everything, for instance after warming up. Does not allocate.
    pub fn reset(&mut self) {
        self.tick.reset();
        self.nodes.iter_mut().for_each(Timing::reset);
    }

    /// Replaces the nodes. `from` has the old number of each new node; a node without one starts empty.
    pub fn renumber(&mut self, from: &[Option<usize>]) {
        let old = std::mem::take(&mut self.nodes);
        let of = |i: &Option<usize>| i.and_then(|i| old.get(i).cloned()).unwrap_or_else(|| Timing::new(2));
        self.nodes = from.iter().map(of).collect();
    }

    /// Figures of the ticks.
    pub fn tick_summary(&self) -> Summary {
        self.tick.summary()
    }

    /// Figures of a node's calls; none for a number that is not one of the nodes'.
    pub fn node_summary(&self, node: usize) -> Option<Summary> {
        self.nodes.get(node).map(Timing::summary)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_match_sorted_durations() {
        let mut t = Timing::new(3);
        // 1..=100_000 in a scrambled order.
        for i in 0..100_000u64 {
            t.record((i * 7919) % 100_000 + 1);
        }
        let s = t.summary();
        let near = |a: u64, b: u64| (a as f64 - b as f64).abs() <= 0.001 * b as f64;
        assert_eq!(s.count, 100_000);
        assert!(near(s.p50_ns, 50_000) && near(s.p99_ns, 99_000) && near(s.p999_ns, 99_900), "{s:?}");
        assert!(near(t.quantile_ns(0.25), 25_000) && near(t.quantile_ns(7.0), 100_000));
        assert_eq!(Timing::new(3).quantile_ns(0.5), 0);
        assert!(near(s.max_ns, 100_000) && (s.mean_ns - 50_000.5).abs() < 50.0, "{s:?}");
    }

    #[test]
    fn extremes_are_counted() {
        let mut r = Recorder::new(2);
        for ns in [0, 1, LONGEST_NS, u64::MAX] {
            r.tick(ns);
            r.node(1, ns);
            r.node(2, ns);
        }
        assert_eq!(r.tick_summary().count, 4);
        assert!(r.tick_summary().max_ns >= LONGEST_NS);
        assert_eq!(r.node_summary(0), Some(Summary::default()));
        assert_eq!(r.node_summary(1).map(|s| s.count), Some(4));
        assert_eq!(r.node_summary(2), None);
        r.reset();
        assert_eq!(r.tick_summary(), Summary::default());
    }
}
