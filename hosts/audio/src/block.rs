//! Blocks that a device plays or records, and the traits that it calls.

use std::sync::LazyLock;
use std::time::Instant;

/// A block for a device to play. Audio thread.
#[derive(Debug)]
pub struct Block<'a> {
    /// Interleaved samples, `channels` a frame, full scale 1; zeroed. Only the requested channels: the
    /// others stay silent. Any length, also 0.
    pub output: &'a mut [f32],
    /// Samples a frame, at least 1.
    pub channels: usize,
    /// When the call began, by [`now_ns`].
    pub now_ns: u64,
}

impl Block<'_> {
    /// Frames of the block.
    pub fn frames(&self) -> usize {
        self.output.len() / self.channels.max(1)
    }
}

/// A block that a device recorded. Audio thread.
#[derive(Debug)]
pub struct Captured<'a> {
    /// Interleaved samples, `channels` a frame, full scale 1. Any length.
    pub input: &'a [f32],
    /// Samples a frame, at least 1.
    pub channels: usize,
    /// When the call began, by [`now_ns`].
    pub now_ns: u64,
}

/// Fills blocks. The device calls it on its own thread, which must not wait, allocate or panic. After a
/// panic the device plays silence and the stream counts as lost.
pub trait Process: Send {
    /// Fills a block.
    fn process(&mut self, block: &mut Block<'_>);
}

/// Takes recorded blocks. The device calls it on its own thread, which must not wait, allocate or panic.
pub trait Capture: Send {
    /// Takes a block.
    fn capture(&mut self, block: &Captured<'_>);
}

/// Duration of frames [ns].
pub(crate) fn frames_ns(frames: u64, rate_hz: u32) -> u64 {
    frames * 1_000_000_000 / u64::from(rate_hz.max(1))
}

static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Monotonic time of this program [ns], from about its start. All times of blocks, input samples and ticks
/// are on this clock.
pub fn now_ns() -> u64 {
    // A day is less than 2^47 ns: the cast is exact for five centuries.
    BEGAN.elapsed().as_nanos() as u64 + 1
}
