//! The clock of another machine or program, mapped to ours.
//!
//! The time that a message was under way is unknown, but never negative. Of many messages, the one with the
//! least arrival minus sending tells the offset of the clocks best. (NTP picks the sample of least delay in
//! the same way: RFC 5905, section 10, clock filter algorithm. V. Paxson, "On calibrating measurements of
//! packet transit times", SIGMETRICS 1998, uses the same minimum.) The error left is the least time under
//! way. A lead that a sender adds to all times is removed too.

/// Buckets of the window in which a least difference counts, less part of the newest.
const BUCKETS: usize = 5;
/// Length of a bucket [ns].
const BUCKET_NS: u64 = 1_000_000_000;
/// Rise of a least difference with each bucket of age [ns]: 100 ppm, for a slow clock.
const CREEP_NS: i64 = 100_000;
/// Differences further from the least than this, either way [ns], ...
const JUMP_NS: i64 = 100_000_000;
/// ... in so many messages in a row belong to a clock that was set, ...
const JUMPED: u32 = 4;
/// ... if larger ones last this long [ns]: delayed messages look the same for a while.
const HELD_UP_NS: u64 = 250_000_000;
/// A message older than the newest by more than this [ns] comes from a clock that was set back: none is
/// overtaken by so much.
const BACK_NS: i64 = 1_000_000_000;

/// Order of a message among those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// After them.
    Next,
    /// Sent before one that has already arrived.
    Late,
    /// The clock was set: earlier messages do not join on.
    Anew,
}

/// Maps the times of a device's clock, of unknown offset and a drift of about 100 ppm, to
/// [`now_ns`](crate::now_ns).
///
/// - A clock set forward by more than 0.1 s is followed after four messages. Until then they count as sent
///   when they arrived, so a single time stamp from the future changes nothing.
/// - A single message more than 1 s old restarts the mapping, and so does the next.
/// - A clock set back by more than 1 s is followed at once; by 0.1 to 1 s after 0.25 s and four messages;
///   by less within 5 s. Until then its messages count as sent too early.
#[derive(Clone, Debug)]
pub struct RemoteClock {
    /// The least arrival minus sending of each bucket, the newest first; `i64::MAX` for none.
    least: [i64; BUCKETS],
    bucket_ns: u64,
    /// Sending time of the newest message that fits the least.
    newest: i64,
    odd: Odd,
}

/// Messages in a row that do not fit the least.
#[derive(Clone, Copy, Debug)]
struct Odd {
    count: u32,
    since_ns: u64,
    larger: bool,
    least: i64,
}

const NONE: Odd = Odd { count: 0, since_ns: 0, larger: false, least: i64::MAX };

impl Default for RemoteClock {
    fn default() -> Self {
        Self { least: [i64::MAX; BUCKETS], bucket_ns: 0, newest: i64::MIN, odd: NONE }
    }
}

impl RemoteClock {
    /// An unknown clock.
    pub fn new() -> Self {
        Self::default()
    }

    /// Notes a message sent at `sent_s` seconds of the other clock, arrived at `arrived_ns` of ours. A time
    /// that is not finite, or beyond 290 years, is ignored.
    pub fn hear(&mut self, sent_s: f64, arrived_ns: u64) -> Order {
        let Some((sent, arrived)) = whole(sent_s, arrived_ns) else { return Order::Next };
        let Some(difference) = arrived.checked_sub(sent) else { return Order::Next };
        self.turn(arrived_ns);
        let Some(offset) = self.offset() else {
            self.begin(difference, sent);
            return Order::Next;
        };
        if self.newest.saturating_sub(sent) > BACK_NS {
            self.begin(difference, sent);
            return Order::Anew;
        }
        let late = sent < self.newest;
        let by = difference.saturating_sub(offset);
        if by.saturating_abs() > JUMP_NS {
            if self.odd(by > 0, difference, arrived_ns) {
                self.begin(self.odd.least, sent);
                return Order::Anew;
            }
        } else {
            self.odd = NONE;
            self.least[0] = self.least[0].min(difference);
            self.newest = self.newest.max(sent);
        }
        if late { Order::Late } else { Order::Next }
    }

    /// Our time of `at_s` seconds of the other clock, by the messages so far: never later than its arrival,
    /// which is also the result if nothing is known, or if the time is not finite or beyond 290 years.
    pub fn time_ns(&self, at_s: f64, arrived_ns: u64) -> u64 {
        let (Some((at, arrived)), Some(offset)) = (whole(at_s, arrived_ns), self.offset()) else {
            return arrived_ns;
        };
        at.saturating_add(offset).clamp(0, arrived) as u64
    }

    fn offset(&self) -> Option<i64> {
        let known = self.least.iter().zip(0_i64..).filter(|(least, _)| **least < i64::MAX);
        known.map(|(least, age)| least.saturating_add(age * CREEP_NS)).min()
    }

    fn begin(&mut self, difference: i64, sent: i64) {
        self.least = [i64::MAX; BUCKETS];
        self.least[0] = difference;
        self.newest = sent;
        self.odd = NONE;
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

    /// Counts a message that does not fit. True if there are so many that the clock was set.
    fn odd(&mut self, larger: bool, difference: i64, arrived_ns: u64) -> bool {
        if self.odd.count == 0 || self.odd.larger != larger {
            self.odd = Odd { since_ns: arrived_ns, larger, ..NONE };
        }
        self.odd.count += 1;
        self.odd.least = self.odd.least.min(difference);
        let long = !larger || arrived_ns.saturating_sub(self.odd.since_ns) >= HELD_UP_NS;
        long && self.odd.count >= JUMPED
    }
}

fn whole(sent_s: f64, arrived_ns: u64) -> Option<(i64, i64)> {
    let sent = sent_s * 1e9;
    let fits = sent.is_finite() && sent.abs() < 9.2e18;
    fits.then_some((sent as i64, arrived_ns.min(1 << 62) as i64))
}

#[cfg(test)]
#[path = "remote_clock_tests.rs"]
mod tests;
