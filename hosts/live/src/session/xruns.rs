//! Xruns that two observers may see.

/// A change after this much quiet is a new gap [ns].
const QUIET_NS: u64 = 300_000_000;

/// Xruns of all streams of a run. The loop over callback times sees a gap, and some hosts report one, most
/// often the same.
/// Between two quiet times the larger of both counts is taken, so that a gap that both see counts once.
#[derive(Debug, Default)]
pub(super) struct Xruns {
    /// Xruns before the last quiet time.
    before: u64,
    /// Counts of loop and host at that time, and at the last look.
    then: [u64; 2],
    last: [u64; 2],
    /// Time of the last change.
    changed_ns: u64,
}

impl Xruns {
    /// All xruns so far. `seen`: by the loops of all streams. `reported`: by the host of the open stream.
    pub(super) fn count(&mut self, seen: u64, reported: u64, now_ns: u64) -> u64 {
        if [seen, reported] != self.last {
            if now_ns.saturating_sub(self.changed_ns) > QUIET_NS {
                (self.before, self.then) = (self.total(), self.last);
            }
            (self.last, self.changed_ns) = ([seen, reported], now_ns);
        }
        self.total()
    }

    /// The open stream closes; the count of the next stream's host starts at 0.
    pub(super) fn close(&mut self, seen: u64, reported: u64, now_ns: u64) {
        self.before = self.count(seen, reported, now_ns);
        self.last = [seen, 0];
        self.then = self.last;
    }

    fn total(&self) -> u64 {
        let [seen, reported] = [0, 1].map(|i| self.last[i].saturating_sub(self.then[i]));
        self.before + seen.max(reported)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gap_seen_by_host_and_loop_counts_once() {
        let ms = |ms: u64| 5_000_000_000 + ms * 1_000_000;
        let mut xruns = Xruns::default();
        assert_eq!(xruns.count(0, 0, ms(0)), 0);
        // In one look, and in two.
        assert_eq!(xruns.count(1, 1, ms(20)), 1);
        assert_eq!((xruns.count(1, 2, ms(1000)), xruns.count(2, 2, ms(1020))), (2, 2));
        // One that the host alone knows of, after one that the loop alone saw.
        assert_eq!((xruns.count(3, 2, ms(2000)), xruns.count(3, 2, ms(2500))), (3, 3));
        assert_eq!(xruns.count(3, 3, ms(2600)), 4);
        xruns.close(4, 4, ms(2620));
        assert_eq!(xruns.count(4, 0, ms(2640)), 5);
        // The stream after it: one gap that both know of, one that only the host does.
        assert_eq!((xruns.count(5, 2, ms(2660)), xruns.count(5, 2, ms(9000))), (7, 7));
    }
}
