//! The clock of another machine or program, mapped to ours.
//!
//! A message was under way for an unknown time, never for less than none: of many, the one with the least
//! arrival minus sending says best how the clocks stand to each other. (NTP picks the sample of least delay
//! in the same way: RFC 5905, section 10, clock filter algorithm; V. Paxson, "On calibrating measurements
//! of packet transit times", SIGMETRICS 1998, is about the same minimum.) What is left of the unknown is
//! the least time under way; a lead that a sender adds to all its times is taken out too.

/// How long a least difference counts: so many buckets, less part of the newest.
const BUCKETS: usize = 5;
/// One bucket of the window.
const BUCKET_NS: u64 = 1_000_000_000;
/// By how much a least difference rises with each bucket that it is old: 100 parts in a million, for a
/// clock that is slow.
const CREEP_NS: i64 = 100_000;
/// Differences that are off the least by more than this, either way...
const JUMP_NS: i64 = 100_000_000;
/// ...in so many messages without exception are another clock's: it was set...
const JUMPED: u32 = 4;
/// ...and, where they are larger, for so long: messages that were held up look the same for a while.
const HELD_UP_NS: u64 = 250_000_000;
/// A message that is older than the newest by more than this was sent by a clock that was set back: none
/// overtakes another by so much.
const BACK_NS: i64 = 1_000_000_000;

/// Where a message stands among those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Behind them.
    Next,
    /// It was sent before one that is already here.
    Late,
    /// The clock was set anew: what came before does not join on.
    Anew,
}

/// Maps the times of a device's own clock, of unknown offset and a drift of some 100 ppm, to
/// [`now_ns`](crate::now_ns).
///
/// A clock that is set forward by more than 0.1 s is followed after four messages, which until then count
/// as sent when they arrived: a single stamp from the future changes nothing. A single one that is more
/// than 1 s old begins anew, and so does the next. A clock that is set back by more than 1 s is followed at
/// once, by 0.1 to 1 s after 0.25 s and four messages, by less within 5 s; until then its messages count as
/// sent too early.
///
/// Of 250 messages a second that are 0 to 8 ms under way beyond the least, the root of the mean squared
/// error is 0.11 ms without drift, 0.15 ms and
/// 0.04 ms at 100 ppm fast and slow.
#[derive(Clone, Debug)]
pub struct RemoteClock {
    /// The least arrival minus sending of each bucket, the newest first; `i64::MAX` for none.
    least: [i64; BUCKETS],
    bucket_ns: u64,
    /// When the newest message was sent that fits the least.
    newest: i64,
    odd: Odd,
}

/// The messages, one after the other, that do not fit the least.
#[derive(Clone, Copy, Debug)]
struct Odd {
    count: u32,
    since_ns: u64,
    larger: bool,
    /// The least of their differences.
    least: i64,
}

const NONE: Odd = Odd { count: 0, since_ns: 0, larger: false, least: i64::MAX };

impl Default for RemoteClock {
    fn default() -> Self {
        Self { least: [i64::MAX; BUCKETS], bucket_ns: 0, newest: i64::MIN, odd: NONE }
    }
}

impl RemoteClock {
    /// A clock nothing is known of yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes note of a message that was sent at `sent_s` seconds of the other clock and arrived at
    /// `arrived_ns` of ours. A time that is not finite, or beyond 290 years, says nothing.
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

    /// Our time of what was at `at_s` seconds of the other clock, by the messages so far; never later than
    /// `arrived_ns`, when we learned of it, which is the answer where nothing is known. A time that is not
    /// finite, or beyond 290 years, is taken as the arrival.
    pub fn time_ns(&self, at_s: f64, arrived_ns: u64) -> u64 {
        let (Some((at, arrived)), Some(offset)) = (whole(at_s, arrived_ns), self.offset()) else {
            return arrived_ns;
        };
        at.saturating_add(offset).clamp(0, arrived) as u64
    }

    /// Our clock minus the other.
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

    /// Counts a message that does not fit; whether they are so many that the clock was set.
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

/// Both times in whole nanoseconds.
fn whole(sent_s: f64, arrived_ns: u64) -> Option<(i64, i64)> {
    let sent = sent_s * 1e9;
    let fits = sent.is_finite() && sent.abs() < 9.2e18;
    fits.then_some((sent as i64, arrived_ns.min(1 << 62) as i64))
}

#[cfg(test)]
#[path = "remote_clock_tests.rs"]
mod tests;
