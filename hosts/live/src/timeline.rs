//! Where a hand was at a tick's own time, from samples that come when they come.
//!
//! A tick reads the hand a little in its past, so that the samples around that time have arrived and
//! nothing is made up: between two samples on a line, after the newest one held. How far in the past is
//! given, or follows how late samples come.

use std::collections::VecDeque;

use crate::sample::{Sample, SampleReader};

/// No reading delay is longer.
pub const MOST_DELAY_NS: u64 = 30_000_000;
/// Time-out of a source that declares none.
pub const TIMEOUT_NS: u64 = 50_000_000;
/// How fast the delay moves, as a part of time: it falsifies speeds by as much.
const SLEW: f64 = 0.02;
/// A need for delay is forgotten with this time constant.
const FORGET_S: f64 = 3.0;
/// Samples that are kept: 30 ms at 17 kHz.
const KEPT: usize = 512;

/// How far behind a tick's time the hand is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delay {
    /// Always this far, in nanoseconds.
    Fixed(u64),
    /// As far as samples come late, and one sample's distance: the most of it in the last seconds, 30 ms at
    /// most.
    Auto,
}

/// What is known of the hand at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// x, y, z in mm.
    pub position: [f64; 3],
    /// As in [`Sample::force`].
    pub force: f64,
    /// Another number means that the hand did not move from the last reading to here: it was put down anew,
    /// or comes back from a stall.
    pub stroke: u32,
    /// From the time of the newest sample to the tick's; 0 before any.
    pub age_ns: u64,
    /// Whether nothing came within the time-out, or nothing at all so far. The position is held.
    pub stalled: bool,
}

/// Counts and times of a source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// Samples so far.
    pub samples: u64,
    /// How often nothing came within the time-out.
    pub stalls: u64,
    /// Samples with a time before that of the sample before them; taken as of the same time.
    pub disordered: u64,
    /// Samples with a time after their arrival; taken as of their arrival.
    pub from_the_future: u64,
    /// Samples that arrived when their time had been read already.
    pub too_late: u64,
    /// The reading delay as it is now.
    pub delay_ns: u64,
}

/// Reads samples of a hand at the times of ticks. Tick thread; allocates only when it is made.
#[derive(Debug)]
pub struct Timeline {
    from: SampleReader,
    kept: VecDeque<Sample>,
    delay: Delay,
    timeout_ns: u64,
    /// The delay now, and what samples need, in nanoseconds.
    delay_ns: f64,
    need_ns: f64,
    /// Time of the newest sample as it was sent in, and when something last came.
    newest_ns: u64,
    arrived_ns: u64,
    /// Time of the last call, and the time that was read.
    last_ns: u64,
    read_ns: u64,
    /// Strokes that a stall ended.
    broken: u32,
    stalled: bool,
    seen: Seen,
}

impl Timeline {
    /// Reads a source. `timeout_ns`: how long it may say nothing; a source at rest says so by repeating
    /// itself.
    pub fn new(from: SampleReader, delay: Delay, timeout_ns: u64) -> Self {
        let fixed = if let Delay::Fixed(ns) = delay { ns as f64 } else { 0.0 };
        Self {
            from,
            kept: VecDeque::with_capacity(KEPT),
            delay,
            timeout_ns,
            delay_ns: fixed,
            need_ns: fixed,
            newest_ns: 0,
            arrived_ns: 0,
            last_ns: 0,
            read_ns: 0,
            broken: 0,
            stalled: true,
            seen: Seen::default(),
        }
    }

    /// The hand at a tick's time by [`now_ns`](crate::now_ns), as far as samples have come. Times must not
    /// go back; one that does is taken as the last. Takes all samples that wait.
    pub fn at(&mut self, time_ns: u64) -> Reading {
        let time_ns = time_ns.max(self.last_ns);
        let passed = (time_ns - self.last_ns) as f64;
        if self.last_ns > 0 {
            self.need_ns *= (-passed * 1e-9 / FORGET_S).exp();
        }
        while let Some(sample) = self.from.take() {
            self.push(sample);
        }
        self.last_ns = time_ns;
        self.watch(time_ns);
        self.slew(passed);
        self.read_ns = self.read_ns.max(time_ns.saturating_sub(self.delay_ns as u64));
        self.read(time_ns)
    }

    /// Counts so far.
    pub fn seen(&self) -> Seen {
        Seen { delay_ns: self.delay_ns as u64, ..self.seen }
    }

    fn push(&mut self, mut sample: Sample) {
        let first = self.seen.samples == 0;
        self.seen.samples += 1;
        if sample.time_ns > sample.arrived_ns {
            self.seen.from_the_future += 1;
            sample.time_ns = sample.arrived_ns;
        }
        if sample.time_ns < self.newest_ns {
            self.seen.disordered += 1;
            sample.time_ns = self.newest_ns;
        }
        if self.stalled && !first {
            self.broken = self.broken.wrapping_add(1);
        }
        self.stalled = false;
        self.arrived_ns = self.arrived_ns.max(sample.arrived_ns);
        sample.stroke = sample.stroke.wrapping_add(self.broken);
        self.need(&sample);
        self.newest_ns = sample.time_ns;
        if sample.time_ns < self.read_ns {
            self.seen.too_late += 1;
            sample.time_ns = self.read_ns;
        }
        // The newest one was held until now; the way to the next begins where it was held last, so that
        // nothing jumps.
        if let Some(last) = self.kept.back_mut() {
            last.time_ns = last.time_ns.max(self.read_ns.min(sample.time_ns));
        }
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back(sample);
    }

    /// Takes note of how far behind this sample would have to be read: until it had arrived, the way to it
    /// was not known.
    fn need(&mut self, sample: &Sample) {
        let Some(last) = self.kept.back().filter(|last| last.stroke == sample.stroke) else { return };
        // A hand at rest repeats itself as slowly as it likes.
        if last.position != sample.position || last.force != sample.force {
            let need = sample.arrived_ns.saturating_sub(self.newest_ns).min(MOST_DELAY_NS);
            self.need_ns = self.need_ns.max(need as f64);
        }
    }

    fn watch(&mut self, time_ns: u64) {
        if !self.stalled && time_ns > self.arrived_ns.saturating_add(self.timeout_ns) {
            self.stalled = true;
            self.seen.stalls += 1;
        }
    }

    fn slew(&mut self, passed_ns: f64) {
        if self.delay != Delay::Auto {
            return;
        }
        let most = SLEW * passed_ns;
        // Nothing has moved yet that a jump could falsify.
        let most = if self.seen.samples <= 2 { f64::INFINITY } else { most };
        self.delay_ns += (self.need_ns - self.delay_ns).clamp(-most, most);
    }

    fn read(&mut self, time_ns: u64) -> Reading {
        while self.kept.get(1).is_some_and(|next| next.time_ns <= self.read_ns) {
            self.kept.pop_front();
        }
        let Some(here) = self.kept.front() else { return Reading { stalled: true, ..Reading::default() } };
        let part = match self.kept.get(1) {
            Some(next) if next.stroke == here.stroke && self.read_ns > here.time_ns => {
                (self.read_ns - here.time_ns) as f64 / (next.time_ns - here.time_ns) as f64
            }
            _ => 0.0,
        };
        let next = self.kept.get(1).unwrap_or(here);
        let between = |a: f64, b: f64| a + (b - a) * part;
        Reading {
            position: std::array::from_fn(|i| between(here.position[i], next.position[i])),
            force: between(here.force, next.force),
            stroke: here.stroke,
            age_ns: time_ns.saturating_sub(self.newest_ns),
            stalled: self.stalled,
        }
    }
}

#[cfg(test)]
#[path = "timeline_tests.rs"]
mod tests;
