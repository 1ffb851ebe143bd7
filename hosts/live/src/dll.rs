//! Time of every frame of a device, from the times of its callbacks.
//!
//! A callback comes late by whatever the machine was doing. A delay-locked loop of second order filters
//! that out (F. Adriaensen, "Using a DLL to filter time", Linux Audio Conference 2005). It predicts the
//! time of a callback; a part of the error goes into the slope until the next one, a smaller part into the
//! rate. Time is a continuous line over frames, so points spaced evenly in frames are spaced evenly in
//! time. The loop starts wide, to find the rate, and narrows to [`BANDWIDTH_HZ`].

use std::f64::consts::{SQRT_2, TAU};

/// Final bandwidth of the loop.
pub const BANDWIDTH_HZ: f64 = 0.1;
const WIDE_HZ: f64 = 2.0;
/// Callbacks within this share of the time they span belong to the wake-up before: a server calls in
/// bunches.
const BUNCH: f64 = 0.25;
/// A longer bunch comes from a server that runs as fast as it can [ns].
const LONGEST_BUNCH_NS: f64 = 0.25e9;
/// A callback later than this, and than 1.5 periods, is a gap [ns].
const GAP_NS: f64 = 4e6;
/// A larger error [ns] that callbacks in a row share is time lost or gained, not jitter. Larger errors pull
/// no harder either.
const OFFSET_NS: f64 = 1e6;
/// Least time [ns] and number of callbacks for that.
const OFFSET_FOR: (f64, u32) = (30e6, 4);
/// Until then, the loop has found neither rate nor position, and reports no loss [ns].
const SETTLING_NS: f64 = 0.5e9;
/// Least memory of the longest period and the largest earliness [ns].
const REMEMBERED_NS: f64 = 2e9;

/// Line of time over frames, as of the last callback. Plain data for other threads.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Line {
    /// Callbacks so far; with 0 the line is undefined.
    pub callbacks: u64,
    /// Frames of a wake-up: the maximum of the last seconds, without those that it asks for because it was
    /// late.
    pub period_frames: u64,
    /// Largest earliness of callbacks in the last seconds [ns], at most a period. Time that was called lost
    /// and came back does not count.
    pub early_ns: f64,
    first: f64,
    first_ns: f64,
    /// Nanoseconds a frame within the last block, with the correction.
    slope: f64,
    end: f64,
    end_ns: f64,
    /// Nanoseconds a frame, filtered.
    frame_ns: f64,
}

impl Line {
    /// Time of a frame by [`now_ns`](crate::now_ns). Predicted after the last block.
    pub fn time_ns(&self, position: f64) -> f64 {
        if position <= self.end {
            self.first_ns + (position - self.first) * self.slope
        } else {
            self.end_ns + (position - self.end) * self.frame_ns
        }
    }

    /// Frame at a time: the inverse of [`time_ns`](Self::time_ns).
    pub fn position(&self, time_ns: f64) -> f64 {
        if time_ns <= self.end_ns {
            self.first + (time_ns - self.first_ns) / self.slope
        } else {
            self.end + (time_ns - self.end_ns) / self.frame_ns
        }
    }

    /// Position of the next block: frames so far, including lost ones.
    pub fn end(&self) -> f64 {
        self.end
    }

    /// Nanoseconds a frame, filtered.
    pub fn frame_ns(&self) -> f64 {
        self.frame_ns
    }
}

/// Result of a callback.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heard {
    /// Position of its first frame.
    pub position: u64,
    /// Frames of time before it that were never asked for.
    pub lost: u64,
}

/// Maximum over the last [`REMEMBERED_NS`] to twice that.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Most {
    before: f64,
    now: f64,
    since_ns: f64,
}

impl Most {
    pub(crate) fn see(&mut self, value: f64, now_ns: f64) {
        if now_ns - self.since_ns > REMEMBERED_NS {
            *self = Self { before: self.now, now: 0.0, since_ns: now_ns };
        }
        self.now = self.now.max(value);
    }

    pub(crate) fn get(&self) -> f64 {
        self.before.max(self.now)
    }
}

/// A delay-locked loop over callbacks of any length.
#[derive(Clone, Debug, Default)]
pub struct Dll {
    nominal_ns: f64,
    line: Line,
    began_ns: f64,
    /// Time of the loop's last step, and frames since.
    moved_ns: f64,
    since: f64,
    /// Of these, frames that a punctual wake-up would have asked for earlier.
    late: f64,
    /// Time called lost, less what came back [ns].
    gone_ns: f64,
    period: Most,
    early: Most,
    /// Errors of one sign beyond [`OFFSET_NS`] in a row: since when, how many, the smallest.
    shared: (f64, u32, f64),
}

impl Dll {
    /// Loop for a device of a nominal rate.
    pub fn new(rate_hz: u32) -> Self {
        let nominal_ns = 1e9 / f64::from(rate_hz.max(1));
        let line = Line { slope: nominal_ns, frame_ns: nominal_ns, ..Line::default() };
        Self { nominal_ns, line, ..Self::default() }
    }

    /// Notes a callback for `frames`. A gap advances the position by the frames lost, and the loop restarts
    /// with its rate. A block of 0 frames is ignored.
    pub fn callback(&mut self, now_ns: u64, frames: u64) -> Heard {
        let now = now_ns as f64;
        if frames == 0 {
            return Heard { position: self.line.end as u64, lost: 0 };
        }
        let mut lost = 0.0;
        let span = self.since * self.nominal_ns;
        let bunched = now - self.moved_ns < BUNCH * span;
        if self.line.callbacks == 0 || (bunched && span > LONGEST_BUNCH_NS) {
            self.lock_anew(now);
        } else if !bunched {
            lost = self.step(now);
        }
        if lost > 0.0 {
            self.line.end += lost;
        }
        self.extend(now, frames as f64);
        Heard { position: self.line.first as u64, lost: lost as u64 }
    }

    /// The line as of the last callback.
    pub fn line(&self) -> &Line {
        &self.line
    }

    /// Whether the loop has run long enough to tell lost time from settling.
    pub fn settled(&self) -> bool {
        self.line.callbacks > 8 && self.moved_ns - self.began_ns > SETTLING_NS
    }

    /// Restarts at this callback; keeps the rate only.
    fn lock_anew(&mut self, now: f64) {
        self.line.end_ns = now;
        self.began_ns = now;
        self.gone_ns = 0.0;
        self.period = Most { since_ns: now, ..Most::default() };
        self.early = self.period;
        self.follow(now);
    }

    /// Goes on from a position that was just set, without a correction.
    fn follow(&mut self, now: f64) {
        self.line.slope = self.line.frame_ns;
        self.moved_ns = now;
        self.since = 0.0;
        self.late = 0.0;
        self.shared = (now, 0, 0.0);
    }

    /// Makes a step of the loop; returns the frames lost.
    fn step(&mut self, now: f64) -> f64 {
        let error = now - self.line.end_ns;
        let usual = if self.period.get() > 0.0 { self.period.get() } else { self.since };
        let gap = GAP_NS.max(1.5 * (usual * self.nominal_ns).min(now - self.moved_ns));
        if error.abs() > gap {
            // A device with a deeper buffer makes up for a late callback: time called lost comes back.
            if !self.settled() || -error > self.gone_ns + gap {
                self.lock_anew(now);
                return 0.0;
            }
            self.gone_ns = (self.gone_ns + error).max(0.0);
            self.line.end_ns = now;
            self.follow(now);
            self.late = (error / self.line.frame_ns).max(0.0);
            return self.late.round();
        }
        let w = TAU * (0.8e9 / (now - self.began_ns).max(1.0)).clamp(BANDWIDTH_HZ, WIDE_HZ);
        let spanned_s = self.since * self.nominal_ns * 1e-9;
        let longest_s = self.period.get().max(self.since) * self.nominal_ns * 1e-9;
        let w = w.min(0.3 / longest_s);
        let error_s = if self.settled() { error.clamp(-OFFSET_NS, OFFSET_NS) } else { error } * 1e-9;
        let rate = self.line.frame_ns / self.nominal_ns + w * w * spanned_s * error_s;
        self.line.frame_ns = self.nominal_ns * rate.clamp(0.95, 1.05);
        self.line.slope = self.line.frame_ns + self.nominal_ns * (SQRT_2 * w * error_s).clamp(-0.02, 0.02);
        self.early.see(-error - self.gone_ns, now);
        self.moved_ns = now;
        self.since = 0.0;
        self.late = (error / self.line.frame_ns).max(0.0);
        self.offset(now, error)
    }

    /// Detects an error that all callbacks share, which is no jitter; returns the frames lost.
    fn offset(&mut self, now: f64, error: f64) -> f64 {
        let (from, count, least) = &mut self.shared;
        if error.abs() < OFFSET_NS || error * *least < 0.0 || *count == 0 {
            let counts = error.abs() >= OFFSET_NS && self.settled();
            self.shared = (now, u32::from(counts), error);
            return 0.0;
        }
        *count += 1;
        if error.abs() < least.abs() {
            *least = error;
        }
        if now - *from < OFFSET_FOR.0 || *count < OFFSET_FOR.1 {
            return 0.0;
        }
        let shift = *least;
        self.shared = (now, 0, 0.0);
        self.gone_ns = (self.gone_ns + shift).max(0.0);
        self.line.end_ns += shift;
        self.line.slope = self.line.frame_ns;
        (shift / self.line.frame_ns).round().max(0.0)
    }

    fn extend(&mut self, now: f64, frames: f64) {
        self.since += frames;
        let passed = (now - self.moved_ns) / self.line.frame_ns;
        self.period.see(self.since - self.late - passed, now);
        let line = &mut self.line;
        line.callbacks += 1;
        (line.first, line.first_ns) = (line.end, line.end_ns);
        line.end += frames;
        line.end_ns += frames * line.slope;
        line.period_frames = self.period.get() as u64;
        line.early_ns = self.early.get().clamp(0.0, self.period.get() * line.frame_ns);
    }
}

#[cfg(test)]
#[path = "dll_tests.rs"]
mod tests;
