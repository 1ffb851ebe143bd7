//! What the device records, on its way to the tick thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering::*};

use asperity_audio::{Capture, Captured};
use asperity_node::time::max_samples;
use ringbuf::traits::{Consumer, Observer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

use crate::dll::Most;

opaque_debug!(MicWriter, MicReader);

/// Seconds of samples that may wait for the tick thread.
const ROOM_S: f64 = 1.0;

/// Figures that both ends keep.
#[derive(Debug, Default)]
struct Shared {
    /// Frames of the longest block of the last seconds; half the room at most.
    block: AtomicUsize,
    /// Frames that found no room.
    lost: AtomicU64,
    /// Frames that were wanted and not there.
    missing: AtomicU64,
    /// Bits of the level that is waited for; 0 for none.
    wanted: AtomicU32,
    /// When it was heard; 0 for not yet.
    heard_ns: AtomicU64,
}

/// Looks on while a device records: waits for something to be heard at the first recorded channel, and
/// knows of gaps.
#[derive(Clone, Debug)]
pub struct Listener(Arc<Shared>);

impl Listener {
    /// Frames that were recorded and lost, and frames that were not there when a tick wanted them.
    pub fn gaps(&self) -> u64 {
        self.0.lost.load(Relaxed) + self.0.missing.load(Relaxed)
    }

    /// Waits for the first sample whose size is above `level`, which is more than 0.
    pub fn listen(&self, level: f32) {
        self.0.heard_ns.store(0, Relaxed);
        self.0.wanted.store(level.abs().to_bits(), Release);
    }

    /// When it was there: the time of the call that brought it and its place in the block, by
    /// [`now_ns`](crate::now_ns); and how long before it was at the device's input, as far as the device
    /// says. None while it was not.
    pub fn heard_ns(&self) -> Option<u64> {
        Some(self.0.heard_ns.load(Acquire)).filter(|ns| *ns > 0)
    }
}

/// Where a device puts what it records.
pub struct MicWriter {
    to: HeapProd<f32>,
    channels: usize,
    rate_hz: u32,
    longest: Most,
    shared: Arc<Shared>,
}

/// Where the tick thread takes it: as far behind as the longest block of the last seconds is long, so that
/// every tick finds its samples. What is behind by more is dropped, so that it stays that far behind.
pub struct MicReader {
    from: HeapCons<f32>,
    channels: usize,
    /// This tick's frames, interleaved.
    scratch: Vec<f32>,
    flowing: bool,
    /// Whether a tick has found its frames.
    begun: bool,
    shared: Arc<Shared>,
}

/// A way from a device to a tick thread, for `channels` that are recorded at a rate, in a run of so many
/// ticks a second.
pub fn mic(channels: usize, rate_hz: u32, tick_hz: u32) -> (MicWriter, MicReader) {
    let room = (f64::from(rate_hz) * ROOM_S) as usize;
    let (to, from) = HeapRb::new(room.max(1) * channels.max(1)).split();
    let shared = Arc::new(Shared::default());
    let scratch = vec![0.0; max_samples(rate_hz, tick_hz) * channels];
    (
        MicWriter { to, channels, rate_hz, longest: Most::default(), shared: shared.clone() },
        MicReader { from, channels, scratch, flowing: false, begun: false, shared },
    )
}

impl MicWriter {
    /// Waits for something to be heard, beside what is recorded.
    pub fn listener(&self) -> Listener {
        Listener(self.shared.clone())
    }

    /// Looks for what is waited for.
    fn look(&self, block: &Captured<'_>, wide: usize) {
        let wanted = f32::from_bits(self.shared.wanted.load(Acquire));
        if wanted == 0.0 {
            return;
        }
        let at =
            block.input.chunks_exact(wide).position(|frame| frame.first().is_some_and(|x| x.abs() > wanted));
        if let Some(at) = at {
            self.shared.wanted.store(0, Relaxed);
            let ns = at as u64 * 1_000_000_000 / u64::from(self.rate_hz.max(1));
            self.shared.heard_ns.store(block.now_ns + ns, Release);
        }
    }
}

impl Capture for MicWriter {
    fn capture(&mut self, block: &Captured<'_>) {
        let wide = block.channels.max(1);
        self.look(block, wide);
        let frames = block.input.len() / wide;
        self.longest.see(frames as f64, block.now_ns as f64);
        // A tick that waited for more than there is room for would wait for ever.
        let half = self.to.capacity().get() / self.channels.max(1) / 2;
        self.shared.block.store((self.longest.get() as usize).min(half), Relaxed);
        let room = self.to.vacant_len() / self.channels.max(1);
        let taken = frames.min(room);
        self.shared.lost.fetch_add((frames - taken) as u64, Relaxed);
        for frame in block.input.chunks_exact(wide).take(taken) {
            // Whole frames only, so that the channels stay apart.
            let samples = (0..self.channels).map(|c| frame.get(c).copied().unwrap_or(0.0));
            self.to.push_iter(samples);
        }
    }
}

impl MicReader {
    /// Takes the frames of the next tick. False where they are not there: it then waits until a block and a
    /// tick are.
    pub(super) fn advance(&mut self, frames: usize) -> bool {
        let wide = self.channels.max(1);
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
        // A block may come just before a tick or just after it; what waits beyond that would only be late.
        let most = 2 * (behind + frames);
        if there > most {
            let late = there - behind - frames;
            self.from.skip(late * wide);
            // What was there before the first tick was never to be heard.
            if self.begun {
                self.shared.lost.fetch_add(late as u64, Relaxed);
            }
        }
        self.begun = true;
        let got = self.from.pop_slice(&mut self.scratch[..wanted]);
        self.scratch[got..].fill(0.0);
        true
    }

    /// A channel's samples of this tick.
    pub(super) fn read(&self, channel: usize, samples: &mut [f32]) {
        let frames = self.scratch.chunks_exact(self.channels.max(1));
        for (y, frame) in samples.iter_mut().zip(frames) {
            *y = frame.get(channel).copied().unwrap_or(0.0);
        }
    }

    /// Frames that go by without a tick.
    pub(super) fn skip(&mut self, frames: usize) {
        self.from.skip(frames * self.channels.max(1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(to: &mut MicWriter, from: usize, frames: usize) {
        let input: Vec<f32> = (from..from + frames).flat_map(|n| [n as f32, -(n as f32)]).collect();
        to.capture(&Captured { input: &input, channels: 2, now_ns: 0, behind_ns: 0 });
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
            to.capture(&Captured { input: &input, channels: 2, now_ns: tick * 2_000_000, behind_ns: 0 });
            flowing = reader.advance(96);
            assert!(flowing || tick > 1, "the room is not too small for what is waited for");
        }
        let (at, _) = first(&reader);
        assert!(flowing && at >= 4_990, "the block of tick {at} at tick 4999");
    }
}
