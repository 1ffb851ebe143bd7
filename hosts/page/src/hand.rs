//! The hand on the pages: which page has it, and its strokes as samples.

use std::sync::Arc;

use asperity_live::{RemoteClock, Sample, SampleWriter, now_ns};
use parking_lot::Mutex;
use tokio::sync::watch;

use crate::map::Map;
use crate::wire::Stroke;

/// A step of the scene's height from one sample to the next that is no motion \[mm\]: the hand is put down
/// on another surface.
const STEP_MM: f64 = 3.0;

/// Message to a page: whose hand it is.
pub(crate) fn whose(holder: Option<u64>, page: u64) -> &'static str {
    match holder {
        Some(holder) if holder == page => r#"{"hand":["yours"]}"#,
        Some(_) => r#"{"hand":["theirs"]}"#,
        None => r#"{"hand":["free"]}"#,
    }
}

/// The one hand. The page that touched last has it. It exists while the graph has a pointer.
#[derive(Debug)]
pub(crate) struct Hand {
    state: Mutex<State>,
    holder: watch::Sender<Option<u64>>,
}

#[derive(Debug)]
struct State {
    /// `None` while the graph has no pointer.
    to: Option<SampleWriter>,
    last: Sample,
    /// The scene under the hand, and the number of scenes so far.
    map: Option<Arc<Map>>,
    maps: u64,
}

#[derive(Debug, Default)]
pub(crate) struct Pen {
    clock: RemoteClock,
    /// Touch of its last sample. A page that lost the hand gets it back with a new touch.
    number: Option<u32>,
}

impl Hand {
    pub(crate) fn new(to: Option<SampleWriter>) -> Self {
        Self {
            state: Mutex::new(State { to, last: Sample::default(), map: None, maps: 0 }),
            holder: watch::Sender::new(None),
        }
    }

    /// Writes to `to` from now on; the stroke continues. Without a writer no page has the hand.
    pub(crate) fn set_writer(&self, to: Option<SampleWriter>) {
        let gone = to.is_none();
        let old = std::mem::replace(&mut self.state.lock().to, to);
        drop(old);
        if gone {
            self.holder.send_if_modified(|holder| holder.take().is_some());
        }
    }

    /// Moves over this scene from now on.
    pub(crate) fn set_map(&self, map: Option<Arc<Map>>) {
        let mut state = self.state.lock();
        state.maps += 1;
        state.map = map;
    }

    pub(crate) fn map(&self) -> Option<Arc<Map>> {
        self.state.lock().map.clone()
    }

    /// The number of the scene; 0 for none.
    pub(crate) fn maps(&self) -> u64 {
        let state = self.state.lock();
        if state.map.is_some() { state.maps } else { 0 }
    }

    pub(crate) fn is_there(&self) -> bool {
        self.state.lock().to.is_some()
    }

    pub(crate) fn holder(&self) -> watch::Receiver<Option<u64>> {
        self.holder.subscribe()
    }

    /// Takes samples of a page. A new touch takes the hand. Other samples of a page without it are ignored.
    pub(crate) fn moved(&self, page: u64, pen: &mut Pen, sent_ms: f64, strokes: &[Stroke]) {
        let arrived_ns = now_ns();
        // A sample is older than its message: the clocks are compared by the message.
        pen.clock.hear(sent_ms / 1e3, arrived_ns);
        let mut state = self.state.lock();
        if state.to.is_none() {
            return;
        }
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
            let at = [stroke.x_mm, stroke.y_mm];
            let height_mm = state.map.as_ref().map_or(0.0, |map| map.height_mm(at));
            let steps = (height_mm - state.last.position[2]).abs() > STEP_MM;
            let sample = Sample {
                time_ns: pen.clock.time_ns(stroke.at_ms / 1e3, arrived_ns),
                arrived_ns,
                position: [at[0], at[1], height_mm],
                force: stroke.pressure,
                stroke: state.last.stroke.wrapping_add(u32::from(begins || takes || steps)),
            };
            state.put(sample);
        }
    }

    /// Lifts the hand of a page that lets it go, or that has gone.
    pub(crate) fn free(&self, page: u64) {
        if *self.holder.borrow() != Some(page) {
            return;
        }
        let mut state = self.state.lock();
        let now = now_ns();
        let lifted = Sample { time_ns: now, arrived_ns: now, force: 0.0, ..state.last };
        state.put(lifted);
        self.holder.send_replace(None);
    }
}

impl State {
    /// Writes a sample. Times are made to increase and not to lie in the future.
    fn put(&mut self, mut sample: Sample) {
        sample.time_ns = sample.time_ns.min(sample.arrived_ns).max(self.last.time_ns + 1);
        self.last = sample;
        let Some(to) = &mut self.to else { return };
        // A graph that takes no samples loses them.
        to.send(sample);
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
    fn newest_touch_takes_the_hand() {
        let (to, mut from) = samples();
        let hand = Hand::new(Some(to));
        let (mut a, mut b) = (Pen::default(), Pen::default());
        hand.moved(1, &mut a, 10.0, &[at(9.0, 1.0, 0.5, 1), at(10.0, 2.0, 0.5, 1)]);
        hand.moved(2, &mut b, 500.0, &[at(500.0, 30.0, 0.0, 1)]);
        assert_eq!(*hand.holder().borrow(), Some(1), "hovering takes nothing");
        hand.moved(2, &mut b, 501.0, &[at(501.0, 31.0, 0.5, 1)]);
        hand.moved(1, &mut a, 11.0, &[at(11.0, 3.0, 0.5, 1)]);
        assert_eq!(*hand.holder().borrow(), Some(2));
        hand.moved(1, &mut a, 12.0, &[at(12.0, 4.0, 0.5, 2)]);
        hand.free(2);
        hand.free(1);
        assert_eq!(*hand.holder().borrow(), None);
        let all: Vec<Sample> = std::iter::from_fn(|| from.take()).collect();
        let told: Vec<_> = all.iter().map(|s| (s.position[0], s.force, s.stroke)).collect();
        assert_eq!(told, [(1.0, 0.5, 1), (2.0, 0.5, 1), (31.0, 0.5, 2), (4.0, 0.5, 3), (4.0, 0.0, 3)]);
        assert!(all.is_sorted_by(|a, b| a.time_ns < b.time_ns));
        assert!(all.iter().all(|s| s.time_ns <= s.arrived_ns));
    }

    #[test]
    fn hand_follows_the_height_and_a_step_is_no_motion() {
        let map = crate::map::tests::map(
            "\"ramp\": (shape: rectangle(size_mm: (100, 100)), turn_deg: (0, -45, 0), \
                effects: (stiffness: (stiffness_n_per_mm: 1))), \
             \"block\": (shape: box(size_mm: (20, 20, 20)), place_mm: (20, 0, 30), \
                effects: (stiffness: (stiffness_n_per_mm: 1)))",
        );
        let (to, mut from) = samples();
        let hand = Hand::new(Some(to));
        hand.set_map(Some(Arc::new(map)));
        let mut pen = Pen::default();
        let way: Vec<Stroke> = (0..4).map(|i| at(f64::from(i), 8.0 + f64::from(i), 0.5, 1)).collect();
        hand.moved(1, &mut pen, 4.0, &way);
        let all: Vec<Sample> = std::iter::from_fn(|| from.take()).collect();
        let told: Vec<_> = all.iter().map(|s| (s.position[2].round(), s.stroke)).collect();
        assert_eq!(told, [(8.0, 1), (9.0, 1), (40.0, 2), (40.0, 2)]);
    }
}
