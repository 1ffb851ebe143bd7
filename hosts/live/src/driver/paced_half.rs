//! The device's end of the paced driver.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering::*};

use asperity_audio::{Block, Process};
use asperity_engine::Flushed;
use ringbuf::HeapCons;
use ringbuf::traits::{Consumer, Observer};

use super::Controls;
use crate::dll::{Dll, Line};
use crate::ramp::Ramp;

/// What both ends know of the stream, in frames.
#[derive(Debug)]
pub(super) struct Stream {
    /// The device's position at which the stream begins; `u64::MAX` before the thread has chosen it.
    pub(super) begin: AtomicU64,
    /// Frames of time that went by without the stream, less those that the device's end has dropped for it.
    pub(super) owed: AtomicI64,
    /// Of these, frames that the thread left out.
    pub(super) skipped: AtomicI64,
}

impl Stream {
    pub(super) fn new() -> Self {
        Self { begin: AtomicU64::new(u64::MAX), owed: AtomicI64::new(0), skipped: AtomicI64::new(0) }
    }
}

/// What the device calls: takes samples from the ring, and tells the thread the device's time.
///
/// Position in the stream is position in time. What was missing when it was to be played, or went by in a gap, is owed: as
/// many frames are dropped, or left out by the thread, before anything is played again. So no latency is ever added.
pub struct PacedHalf {
    pub(super) controls: Arc<Controls>,
    pub(super) stream: Arc<Stream>,
    pub(super) ring: HeapCons<f32>,
    pub(super) lines: triple_buffer::Input<Line>,
    pub(super) dll: Dll,
    pub(super) ramp: Ramp,
    pub(super) channels: usize,
    /// Frames that went by without the stream, less those dropped; the thread's skips not taken off.
    pub(super) owed: i64,
    pub(super) began: bool,
}

/// Stack that is brought in at the first callback.
const STACK: usize = 32_768;

impl Process for PacedHalf {
    fn process(&mut self, block: &mut Block<'_>) {
        let _flushed = Flushed::new();
        if block.channels != self.channels {
            self.controls.fail();
            return;
        }
        // Ticks run on another thread, but one that is late here is heard all the same.
        self.controls.ask_for_device::<STACK>();
        let frames = block.frames();
        let heard = self.dll.callback(block.now_ns, frames as u64);
        self.lines.write(*self.dll.line());
        self.controls.heard(block.now_ns, frames, self.dll.line());
        self.controls.steer(&mut self.ramp);
        if heard.lost > 0 {
            self.controls.meters().xruns.add(1);
            if self.began {
                self.ramp.broken();
                self.owe(heard.lost);
            }
        }
        let silent = self.silent_before_begin(heard.position, frames as u64);
        let (before, rest) = block.output.split_at_mut(silent as usize * self.channels);
        self.ramp.starve(before);
        let over = self.controls.down() || self.controls.failed();
        let got = if over { 0 } else { self.take(rest) };
        let (played, missing) = rest.split_at_mut(got);
        self.ramp.play(played);
        self.ramp.starve(missing);
        if !missing.is_empty() && !over {
            self.controls.meters().underruns.add(1);
            self.owe((missing.len() / self.channels) as u64);
        }
        self.controls.hold(block.output, self.channels);
        self.controls.note(&self.ramp, block.output);
    }
}

impl PacedHalf {
    /// Frames of this block that lie before the stream.
    fn silent_before_begin(&mut self, position: u64, frames: u64) -> u64 {
        if self.began {
            return 0;
        }
        let begin = self.stream.begin.load(Acquire);
        let silent = begin.saturating_sub(position).min(frames);
        if silent < frames {
            self.began = true;
            let late = position.saturating_sub(begin);
            if late > 0 {
                self.owe(late);
            }
        }
        silent
    }

    fn owe(&mut self, frames: u64) {
        self.controls.meters().lost_samples.add(frames);
        self.owed += frames as i64;
        self.stream.owed.store(self.owed, Release);
    }

    /// Drops what is owed and fills what it can; returns how many values it filled.
    fn take(&mut self, out: &mut [f32]) -> usize {
        if self.began {
            let there = (self.ring.occupied_len() / self.channels) as i64;
            let owed = self.owed - self.stream.skipped.load(Acquire);
            let drop = owed.min(there).max(0);
            if drop > 0 {
                self.owed -= drop;
                // Told before it is done: the thread, which looks at the ring first, then never thinks that more is owed than is.
                self.stream.owed.store(self.owed, Release);
                self.ring.skip(drop as usize * self.channels);
            }
            // What the thread may have pushed since is owed too.
            if owed > drop {
                return 0;
            }
        }
        // Whole frames are pushed, and the room is whole frames.
        self.ring.pop_slice(out)
    }
}

impl std::fmt::Debug for PacedHalf {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PacedHalf").field("line", self.dll.line()).finish_non_exhaustive()
    }
}
