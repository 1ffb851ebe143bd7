//! The hand on a page: whose it is, and how what it does becomes samples.

use std::sync::atomic::Ordering::Relaxed;

use asperity_live::{Sample, SampleWriter, now_ns};
use parking_lot::Mutex;
use tokio::sync::watch;

use crate::server::Counters;
use crate::wire::Stroke;

/// How long the least delay of a message is remembered, twice.
const WINDOW_NS: u64 = 5_000_000_000;

/// The one hand, which the page that touched last has.
#[derive(Debug)]
pub(crate) struct Hand {
    state: Mutex<State>,
    holder: watch::Sender<Option<u64>>,
}

#[derive(Debug)]
struct State {
    to: SampleWriter,
    /// The newest sample.
    last: Sample,
}

/// What the server knows of one page's hand.
#[derive(Debug, Default)]
pub(crate) struct Pen {
    clock: Clock,
    /// The touch that its last sample belonged to. A page that lost the hand gets it with another touch.
    number: Option<u32>,
}

impl Hand {
    /// A hand that writes here.
    pub(crate) fn new(to: SampleWriter) -> Self {
        Self { state: Mutex::new(State { to, last: Sample::default() }), holder: watch::Sender::new(None) }
    }

    /// Tells which page has the hand.
    pub(crate) fn holder(&self) -> watch::Receiver<Option<u64>> {
        self.holder.subscribe()
    }

    /// Takes what a page sent. A touch that begins takes the hand; what else comes from a page without it is nothing.
    pub(crate) fn moved(
        &self,
        page: u64,
        pen: &mut Pen,
        sent_ms: f64,
        strokes: &[Stroke],
        counts: &Counters,
    ) {
        let arrived_ns = now_ns();
        pen.clock.heard(sent_ms, arrived_ns);
        let mut state = self.state.lock();
        for stroke in strokes {
            let begins = pen.number != Some(stroke.number);
            let takes = *self.holder.borrow() != Some(page);
            if takes {
                if !begins || stroke.pressure == 0.0 {
                    continue;
                }
                self.holder.send_replace(Some(page));
            }
            pen.number = Some(stroke.number);
            let sample = Sample {
                time_ns: pen.clock.here(stroke.at_ms),
                arrived_ns,
                position: [stroke.x_mm, stroke.y_mm, 0.0],
                force: stroke.pressure,
                stroke: state.last.stroke.wrapping_add(u32::from(begins || takes)),
            };
            state.put(sample, counts);
        }
    }

    /// Lifts the hand of a page that lets it go, or that is gone.
    pub(crate) fn free(&self, page: u64, counts: &Counters) {
        if *self.holder.borrow() != Some(page) {
            return;
        }
        let mut state = self.state.lock();
        let now = now_ns();
        let lifted = Sample { time_ns: now, arrived_ns: now, force: 0.0, ..state.last };
        state.put(lifted, counts);
        self.holder.send_replace(None);
    }
}

impl State {
    /// Times are increasing and not in the future, whatever the page says.
    fn put(&mut self, mut sample: Sample, counts: &Counters) {
        sample.time_ns = sample.time_ns.min(sample.arrived_ns).max(self.last.time_ns + 1);
        self.last = sample;
        let count = if self.to.send(sample) { &counts.samples } else { &counts.lost };
        count.fetch_add(1, Relaxed);
    }
}

/// A browser's clock as seen from here: the least delay of the last messages is taken for no delay.
#[derive(Debug, Default)]
struct Clock {
    /// Least of arrival less sending in this window and the one before, in ns.
    least: [Option<f64>; 2],
    since_ns: u64,
}

impl Clock {
    fn heard(&mut self, sent_ms: f64, arrived_ns: u64) {
        if arrived_ns - self.since_ns.min(arrived_ns) > WINDOW_NS {
            self.since_ns = arrived_ns;
            self.least = [None, self.least[0]];
        }
        let delay = arrived_ns as f64 - sent_ms * 1e6;
        self.least[0] = Some(self.least[0].map_or(delay, |least| least.min(delay)));
    }

    fn here(&self, at_ms: f64) -> u64 {
        let least = self.least.into_iter().flatten().fold(f64::INFINITY, f64::min);
        (at_ms * 1e6 + least) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_live::samples;

    fn at(at_ms: f64, x_mm: f64, pressure: f64, number: u32) -> Stroke {
        Stroke { at_ms, x_mm, y_mm: 0.0, pressure, number }
    }

    #[test]
    fn the_newest_touch_takes_the_hand_and_the_rest_of_an_older_one_is_nothing() {
        let (to, mut from) = samples();
        let (hand, counts) = (Hand::new(to), Counters::default());
        let (mut a, mut b) = (Pen::default(), Pen::default());
        hand.moved(1, &mut a, 10.0, &[at(9.0, 1.0, 0.5, 1), at(10.0, 2.0, 0.5, 1)], &counts);
        hand.moved(2, &mut b, 500.0, &[at(500.0, 30.0, 0.0, 1)], &counts);
        assert_eq!(*hand.holder().borrow(), Some(1), "hovering takes nothing");
        hand.moved(2, &mut b, 501.0, &[at(501.0, 31.0, 0.5, 1)], &counts);
        hand.moved(1, &mut a, 11.0, &[at(11.0, 3.0, 0.5, 1)], &counts);
        assert_eq!(*hand.holder().borrow(), Some(2));
        hand.moved(1, &mut a, 12.0, &[at(12.0, 4.0, 0.5, 2)], &counts);
        hand.free(2, &counts);
        hand.free(1, &counts);
        assert_eq!(*hand.holder().borrow(), None);
        let all: Vec<Sample> = std::iter::from_fn(|| from.take()).collect();
        let told: Vec<_> = all.iter().map(|s| (s.position[0], s.force, s.stroke)).collect();
        assert_eq!(told, [(1.0, 0.5, 1), (2.0, 0.5, 1), (31.0, 0.5, 2), (4.0, 0.5, 3), (4.0, 0.0, 3)]);
        assert!(all.is_sorted_by(|a, b| a.time_ns < b.time_ns));
        assert!(all.iter().all(|s| s.time_ns <= s.arrived_ns));
    }

    #[test]
    fn a_message_that_was_held_up_does_not_move_the_times_of_its_samples() {
        let mut clock = Clock::default();
        let mut worst = 0.0f64;
        for i in 0..4000u32 {
            let sent_ms = f64::from(i) * 4.0;
            let held_up_ms = if i % 10 == 3 { 30.0 } else { 0.2 };
            clock.heard(sent_ms, (7e9 + (sent_ms + held_up_ms) * 1e6) as u64);
            worst = worst.max((clock.here(sent_ms) as f64 - 7e9 - sent_ms * 1e6).abs());
        }
        assert!(worst < 0.3e6, "{worst} ns");
    }
}
