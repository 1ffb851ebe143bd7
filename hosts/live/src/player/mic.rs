//! Queue of recorded samples from the device to the tick thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering::*};

use asperity_audio::{Capture, Captured};
use asperity_node::time::max_samples;
use ringbuf::traits::{Consumer, Observer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

use crate::dll::Most;

opaque_debug!(MicWriter, MicReader);

/// Room of the queue [s].
const ROOM_S: f64 = 1.0;

#[derive(Debug, Default)]
struct Shared {
    /// Frames of the longest recent block, at most half the room.
    block: AtomicUsize,
    lost: AtomicU64,
    /// Frames missing when a tick needed them.
    missing: AtomicU64,
    /// Bits of the level to wait for; 0 for none.
    wanted: AtomicU32,
    /// Time at which it was heard; 0 for not yet.
    heard_ns: AtomicU64,
}

/// Watches a recording: waits for a sound on the first recorded channel, and counts gaps.
#[derive(Clone, Debug)]
pub struct Listener(Arc<Shared>);

impl Listener {
    /// Recorded frames that were lost, and frames missing when a tick needed them.
    pub fn gaps(&self) -> u64 {
        self.0.lost.load(Relaxed) + self.0.missing.load(Relaxed)
    }

    /// Waits for the first sample whose absolute value exceeds `level` (above 0).
    pub fn listen(&self, level: f32) {
        self.0.heard_ns.store(0, Relaxed);
        self.0.wanted.store(level.abs().to_bits(), Release);
    }

    /// Time of that sample at the device, by [`now_ns`](crate::now_ns): that of the call plus its place in
    /// the block. The host's input latency is not taken off. `None` until it came.
    pub fn heard_ns(&self) -> Option<u64> {
        Some(self.0.heard_ns.load(Acquire)).filter(|ns| *ns > 0)
    }
}

/// Side of the device.
pub struct MicWriter {
    to: HeapProd<f32>,
    channels: usize,
    rate_hz: u32,
    longest: Most,
    shared: Arc<Shared>,
}

/// Side of the tick thread. It reads as far behind as the longest recent block is long, so that every tick
/// finds its samples. Samples further behind are dropped, so that the delay stays.
pub struct MicReader {
    from: HeapCons<f32>,
    channels: usize,
    /// This tick's frames, interleaved.
    scratch: Vec<f32>,
    flowing: bool,
    /// Whether any tick has found its frames.
    begun: bool,
    shared: Arc<Shared>,
}

/// Queue for recorded `channels` at a rate, in a run of `tick_hz` ticks a second.
pub fn mic(channels: usize, rate_hz: u32, tick_hz: u32) -> (MicWriter, MicReader) {
    let channels = channels.max(1);
    let room = (f64::from(rate_hz) * ROOM_S) as usize;
    let (to, from) = HeapRb::new(room.max(1) * channels).split();
    let shared = Arc::new(Shared::default());
    let scratch = vec![0.0; max_samples(rate_hz, tick_hz) * channels];
    (
        MicWriter { to, channels, rate_hz, longest: Most::default(), shared: shared.clone() },
        MicReader { from, channels, scratch, flowing: false, begun: false, shared },
    )
}

impl MicWriter {
    /// Watches the recording.
    pub fn listener(&self) -> Listener {
        Listener(self.shared.clone())
    }

    /// Looks for the level to wait for.
    fn look(&self, block: &Captured<'_>) {
        let wanted = f32::from_bits(self.shared.wanted.load(Acquire));
        let mut first = block.input.iter().step_by(self.channels);
        if wanted > 0.0
            && let Some(at) = first.position(|x| x.abs() > wanted)
        {
            self.shared.wanted.store(0, Relaxed);
            let ns = at as u64 * 1_000_000_000 / u64::from(self.rate_hz.max(1));
            self.shared.heard_ns.store(block.now_ns + ns, Release);
        }
    }
}

impl Capture for MicWriter {
    fn capture(&mut self, block: &Captured<'_>) {
        if block.channels != self.channels {
            return;
        }
        self.look(block);
        let frames = block.input.len() / self.channels;
        self.longest.see(frames as f64, block.now_ns as f64);
        // A tick must not wait for more than the room.
        let half = self.to.capacity().get() / self.channels / 2;
        self.shared.block.store((self.longest.get() as usize).min(half), Relaxed);
        let taken = frames.min(self.to.vacant_len() / self.channels);
        self.shared.lost.fetch_add((frames - taken) as u64, Relaxed);
        self.to.push_slice(&block.input[..taken * self.channels]);
    }
}

impl MicReader {
    /// Takes the frames of the next tick. False if they are missing: then it waits for a block and a tick
    /// of frames.
    pub(super) fn advance(&mut self, frames: usize) -> bool {
        let wide = self.channels;
        let wanted = (frames * wide).min(self.scratch.len());
        let there = self.from.occupied_len() / wide;
        let behind = self.shared.block.load(Relaxed);
        let enough = if self.flowing { frames } else { frames + behind.max(1) };
        if there < enough {
            self.scratch.fill(0.0);
            if self.begun {
                self.shared.missing.fetch_add(frames as u64, Relaxed);
            }
            self.flowing = false;
            return false;
        }
        self.flowing = true;
        // A block may come just before or after a tick. Frames beyond that only add delay.
        let most = 2 * (behind + frames);
        if there > most {
            let late = there - behind - frames;
            self.from.skip(late * wide);
            // Frames before the first tick are no loss.
            if self.begun {
                self.shared.lost.fetch_add(late as u64, Relaxed);
            }
        }
        self.begun = true;
        let got = self.from.pop_slice(&mut self.scratch[..wanted]);
        self.scratch[got..].fill(0.0);
        true
    }

    pub(super) fn read(&self, channel: usize, samples: &mut [f32]) {
        let frames = self.scratch.chunks_exact(self.channels);
        for (y, frame) in samples.iter_mut().zip(frames) {
            *y = frame.get(channel).copied().unwrap_or(0.0);
        }
    }

    pub(super) fn skip(&mut self, frames: usize) {
        self.from.skip(frames * self.channels);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(to: &mut MicWriter, from: usize, frames: usize) {
        let input: Vec<f32> = (from..from + frames).flat_map(|n| [n as f32, -(n as f32)]).collect();
        to.capture(&Captured { input: &input, channels: 2, now_ns: 0 });
    }

    fn first(from: &MicReader) -> (usize, f32) {
        let (mut left, mut right) = ([0.0], [0.0]);
        from.read(0, &mut left);
        from.read(1, &mut right);
        (left[0] as usize, right[0])
    }

    /// Ticks of 96 frames against blocks of 441 of a clock that is off by `ppm`, as far as f32 counts: the
    /// longest delay, and what was counted.
    fn drift(ppm: i64) -> (usize, u64, u64) {
        let (mut to, mut reader) = mic(2, 48_000, 500);
        let (mut recorded, mut longest, mut gone, mut next) = (0, 0, 0, None);
        for tick in 0..150_000_i64 {
            let due = (96 * tick + 96 * tick * ppm / 1_000_000) as usize;
            while recorded + 441 <= due {
                record(&mut to, recorded, 441);
                recorded += 441;
            }
            if reader.advance(96) {
                let (at, right) = first(&reader);
                assert_eq!(right, -(at as f32), "channels stay apart");
                gone += next.map_or(0, |next| at - next) as u64;
                next = Some(at + 96);
                longest = longest.max(recorded - at);
            }
        }
        (longest, gone, to.listener().gaps())
    }

    #[test]
    fn clock_drift_keeps_the_delay_and_counts_gaps() {
        assert_eq!((drift(0).1, drift(0).2), (0, 0));
        for ppm in [100, -100, 1000, -1000] {
            let (longest, gone, counted) = drift(ppm);
            assert!(longest <= 2 * (441 + 96) + 96, "{ppm} ppm: {longest} frames behind");
            // Faster: frames are dropped. Slower: ticks find none, until a block and a tick are there.
            assert!(if ppm > 0 { gone == counted && counted > 0 } else { gone == 0 && counted > 0 });
            let each = 150_000 * 96 * ppm.unsigned_abs() / 1_000_000;
            assert!(counted <= 2 * each + 2000, "{ppm} ppm: {counted} of {each}");
        }
    }

    #[test]
    fn recording_before_first_tick_is_no_loss() {
        let (mut to, mut reader) = mic(2, 48_000, 500);
        let listener = to.listener();
        (0..40).for_each(|n| record(&mut to, 441 * n, 441));
        assert!(reader.advance(96));
        assert_eq!((first(&reader).0, listener.gaps()), (441 * 40 - 441 - 96, 0));
        let more = (0..20).filter(|_| reader.advance(96)).count();
        // Of 537 frames that were left behind, one tick of 96 had been read.
        assert_eq!((more, listener.gaps()), (4, 16 * 96));
        // A second of room: more than that finds none.
        record(&mut to, 0, 100_000);
        assert!(listener.gaps() > 16 * 96 + 51_000);
    }

    #[test]
    fn recording_flows_again_after_one_long_block() {
        let (mut to, mut reader) = mic(2, 48_000, 500);
        record(&mut to, 0, 47_950);
        let mut flowing = false;
        // Ten seconds of ticks, with blocks as long as one.
        for tick in 1..5_000_u64 {
            let input = [tick as f32; 2 * 96];
            to.capture(&Captured { input: &input, channels: 2, now_ns: tick * 2_000_000 });
            flowing = reader.advance(96);
            assert!(flowing || tick > 1, "the room is not too small for what is waited for");
        }
        let (at, _) = first(&reader);
        assert!(flowing && at >= 4_990, "the block of tick {at} at tick 4999");
    }
}
