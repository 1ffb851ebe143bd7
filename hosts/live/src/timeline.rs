//! Position of a hand at a tick's own time, from samples that come at any time.
//!
//! A tick reads the hand a little in the past, so that the samples around that time have arrived: positions
//! are interpolated between two samples, and held after the newest. The reading delay is fixed, or follows
//! the lateness of samples.

use std::collections::VecDeque;

use crate::sample::{Sample, SampleReader};

/// Longest reading delay that follows lateness [ns].
const MOST_DELAY_NS: u64 = 30_000_000;
/// Fastest change of the delay, as a share of time. It distorts speeds by as much.
const SLEW: f64 = 0.02;
/// Time constant with which a need for delay decays [s].
const FORGET_S: f64 = 3.0;
/// Samples kept: 30 ms at 17 kHz.
const KEPT: usize = 512;

/// State of the hand at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// x, y, z in mm.
    pub position: [f64; 3],
    /// As in [`Sample::force`].
    pub force: f64,
    /// Stroke number. A new number means that the hand did not move here from the last reading: it was put
    /// down anew, or comes back from a stall.
    pub stroke: u32,
    /// Age of the newest sample at the tick's time [ns]; 0 before any.
    pub age_ns: u64,
    /// Whether nothing came within the timeout, or nothing at all so far. The position is held.
    pub stalled: bool,
}

/// Counts and times of a source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// Samples so far.
    pub samples: u64,
    /// How often nothing came within the timeout.
    pub stalls: u64,
    /// Current reading delay [ns].
    pub delay_ns: u64,
}

/// Reads samples of a hand at the times of ticks. Tick thread; allocates only when it is made.
#[derive(Debug)]
pub struct Timeline {
    from: SampleReader,
    kept: VecDeque<Sample>,
    fixed: bool,
    timeout_ns: u64,
    /// Current delay, and the delay that samples need [ns].
    delay_ns: f64,
    need_ns: f64,
    /// Time of the newest sample as sent, and of the last arrival [ns].
    newest_ns: u64,
    arrived_ns: u64,
    /// Time of the last call, and the time it read [ns].
    last_ns: u64,
    read_ns: u64,
    broken: u32,
    stalled: bool,
    seen: Seen,
}

impl Timeline {
    /// Reads a source with a fixed delay [ns]; or else it follows the lateness of samples plus one sample's
    /// distance: the maximum of the last seconds, 30 ms at most. `timeout_ns`: longest silence of a live
    /// source; a source at rest repeats itself.
    pub fn new(from: SampleReader, delay_ns: Option<u64>, timeout_ns: u64) -> Self {
        let ns = delay_ns.unwrap_or(0) as f64;
        Self {
            from,
            kept: VecDeque::with_capacity(KEPT),
            fixed: delay_ns.is_some(),
            timeout_ns,
            delay_ns: ns,
            need_ns: ns,
            newest_ns: 0,
            arrived_ns: 0,
            last_ns: 0,
            read_ns: 0,
            broken: 0,
            stalled: true,
            seen: Seen::default(),
        }
    }

    /// The hand at a tick's time by [`now_ns`](crate::now_ns), from the samples so far. Takes all waiting
    /// samples. A time before that of the last call counts as the last.
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
        // None is newer than its arrival, or older than the one before it.
        sample.time_ns = sample.time_ns.min(sample.arrived_ns).max(self.newest_ns);
        if self.stalled && !first {
            self.broken = self.broken.wrapping_add(1);
        }
        self.stalled = false;
        self.arrived_ns = self.arrived_ns.max(sample.arrived_ns);
        sample.stroke = sample.stroke.wrapping_add(self.broken);
        self.need(&sample);
        self.newest_ns = sample.time_ns;
        sample.time_ns = sample.time_ns.max(self.read_ns);
        // The newest sample was held until now. The line to the next begins there, so that nothing jumps.
        if let Some(last) = self.kept.back_mut() {
            last.time_ns = last.time_ns.max(self.read_ns.min(sample.time_ns));
        }
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back(sample);
    }

    /// Notes the delay that this sample needs: until it arrived, the line to it was unknown.
    fn need(&mut self, sample: &Sample) {
        let Some(last) = self.kept.back().filter(|last| last.stroke == sample.stroke) else { return };
        // A hand at rest may repeat itself slowly.
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
        if self.fixed {
            return;
        }
        let most = SLEW * passed_ns;
        // No motion yet that a jump could distort.
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
