//! What a device calls.

use std::sync::LazyLock;
use std::time::Instant;

/// A block that a device wants filled. Audio thread.
#[derive(Debug)]
pub struct Block<'a> {
    /// Interleaved samples, `channels` a frame, full scale 1; arrives zeroed. Only the channels that were
    /// asked for: the device's others stay silent. Any length, 0 included.
    pub output: &'a mut [f32],
    /// Samples a frame, at least 1.
    pub channels: usize,
    /// When the call began, by [`now_ns`].
    pub now_ns: u64,
    /// Nanoseconds from then until the first frame is heard, as the host says; 0 where it does not say.
    pub ahead_ns: u64,
}

impl Block<'_> {
    /// Frames that are wanted.
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
    /// Nanoseconds before then at which the first frame was at the input, as the host says; 0 where it does
    /// not say.
    pub behind_ns: u64,
}

/// What a device calls to have a block filled: on its own thread, which must not wait, allocate or panic. A
/// panic is caught; the device plays silence from then on and the stream counts as lost.
pub trait Process: Send {
    /// Fills a block.
    fn process(&mut self, block: &mut Block<'_>);
}

/// What a device calls with what it recorded: on its own thread, which must not wait, allocate or panic.
pub trait Capture: Send {
    /// Takes a block.
    fn capture(&mut self, block: &Captured<'_>);
}

static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Nanoseconds on the clock of this program: monotonic, from about its start on. Every time of a block, of
/// an input sample and of a tick is on this clock.
pub fn now_ns() -> u64 {
    // A day at most 2^47: the cast does not lose anything for five centuries.
    BEGAN.elapsed().as_nanos() as u64 + 1
}
