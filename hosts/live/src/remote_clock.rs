//! The clock of another machine or program, mapped to ours.
//!
//! A message was under way for an unknown time, never for less than none: of many, the one with the least arrival minus
//! sending says best how the clocks stand to each other. (NTP picks the sample of least delay in the same way: RFC 5905, section
//! 10, clock filter algorithm.) What is left of the unknown is the least time under way.

/// How long a least difference counts: so long, and less of it than one bucket's more.
const BUCKETS: usize = 10;
/// One bucket of the window.
const BUCKET_NS: u64 = 1_000_000_000;
/// Differences that are larger than the least by more than this...
const JUMP_NS: i64 = 100_000_000;
/// ...without exception for this long and this many messages are another clock's: it was set back.
const JUMPED: (u64, u32) = (250_000_000, 4);

/// Maps the times of a device's own clock, of unknown offset and a drift of some 100 ppm, to [`now_ns`](crate::now_ns).
///
/// A clock that is set forward is followed at once, one that is set back by more than 0.1 s after 0.25 s and four messages; until
/// then its messages count as sent too early. A drift of 100 ppm costs up to 1 ms over the window of 10 s.
#[derive(Clone, Debug)]
pub struct RemoteClock {
    /// The least arrival minus sending of each bucket, the newest first; `i64::MAX` for none.
    least: [i64; BUCKETS],
    bucket_ns: u64,
    /// Since when, and how many, no message was near the least; and the least of those.
    far: (u64, u32, i64),
}

impl Default for RemoteClock {
    fn default() -> Self {
        Self { least: [i64::MAX; BUCKETS], bucket_ns: 0, far: (0, 0, i64::MAX) }
    }
}

impl RemoteClock {
    /// A clock nothing is known of yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Our time of a message that was sent at `sent_s` seconds of the other clock and arrived at `arrived_ns` of ours; never later than that. A
    /// time that is not finite, or beyond 290 years, is taken as the arrival.
    pub fn map(&mut self, sent_s: f64, arrived_ns: u64) -> u64 {
        let sent = sent_s * 1e9;
        if sent.is_nan() || sent.abs() >= 9.2e18 {
            return arrived_ns;
        }
        let (sent, arrived) = (sent as i64, arrived_ns.min(1 << 62) as i64);
        let Some(difference) = arrived.checked_sub(sent) else { return arrived_ns };
        self.turn(arrived_ns);
        self.watch(difference, arrived_ns);
        self.least[0] = self.least[0].min(difference);
        let least = self.least.iter().copied().min().unwrap_or(difference);
        sent.saturating_add(least).clamp(0, arrived) as u64
    }

    fn turn(&mut self, arrived_ns: u64) {
        let buckets = arrived_ns.saturating_sub(self.bucket_ns) / BUCKET_NS;
        if buckets > 0 {
            let by = (buckets as usize).min(BUCKETS);
            self.least.rotate_right(by);
            self.least[..by].fill(i64::MAX);
            self.bucket_ns += buckets * BUCKET_NS;
        }
    }

    fn watch(&mut self, difference: i64, arrived_ns: u64) {
        let least = self.least.iter().copied().min().unwrap_or(i64::MAX);
        if difference.saturating_sub(JUMP_NS) <= least {
            self.far = (arrived_ns, 0, i64::MAX);
            return;
        }
        let (since, count, smallest) = &mut self.far;
        *count += 1;
        *smallest = difference.min(*smallest);
        if arrived_ns.saturating_sub(*since) >= JUMPED.0 && *count >= JUMPED.1 {
            self.least = [i64::MAX; BUCKETS];
            self.least[0] = *smallest;
            self.far = (arrived_ns, 0, i64::MAX);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_node::random::uniform;

    const MS: f64 = 1e6;

    /// Messages at 100 Hz over a way of 2 ms and up to 20 ms more; the error of each mapped time in ms.
    fn errors(
        clock: &mut RemoteClock,
        ours_s: std::ops::Range<u64>,
        theirs: impl Fn(f64) -> f64,
    ) -> Vec<f64> {
        (ours_s.start * 100..ours_s.end * 100)
            .map(|i| {
                let sent = i as f64 * 10.0 * MS;
                let arrived = sent + 2.0 * MS + 20.0 * MS * uniform(1, i).powi(3);
                (clock.map(theirs(sent * 1e-9), arrived as u64) as f64 - sent) / MS
            })
            .collect()
    }

    #[test]
    fn a_clock_of_any_offset_and_drift_is_followed_but_for_the_shortest_way() {
        // An offset as of a browser, of an OSC time tag (seconds since 1900), and a clock that runs backwards of ours in sign.
        for (offset, ppm) in [(0.0, 0.0), (12.3, 100.0), (3.9e9, -100.0), (-5000.0, 50.0)] {
            let mut clock = RemoteClock::new();
            let errors = errors(&mut clock, 1..60, |t| offset + t * (1.0 + ppm * 1e-6));
            for e in &errors[200..] {
                assert!((0.9..3.2).contains(e), "{e} ms at {offset} {ppm}");
            }
        }
    }

    #[test]
    fn a_clock_that_is_set_is_followed_again() {
        for jump in [1000.0, -1000.0, -0.5] {
            let mut clock = RemoteClock::new();
            errors(&mut clock, 1..20, |t| t);
            let after = errors(&mut clock, 20..30, |t| t + jump);
            let from = if jump > 0.0 { 10 } else { 40 };
            assert!(after[from..].iter().all(|e| (0.0..4.5).contains(e)), "{jump}: {after:?}");
        }
    }

    #[test]
    fn one_message_that_was_long_under_way_changes_nothing_and_nonsense_is_its_arrival() {
        let mut clock = RemoteClock::new();
        errors(&mut clock, 1..5, |t| t);
        assert!(clock.map(5.0, 7_000_000_000) < 5_003_000_000);
        for nonsense in [f64::NAN, f64::INFINITY, 1e300, -1e300, 9.3e9] {
            assert_eq!(clock.map(nonsense, 8_000_000_000), 8_000_000_000);
        }
        let after = errors(&mut clock, 8..10, |t| t);
        assert!(after.iter().all(|e| (0.0..3.2).contains(e)));
    }
}
