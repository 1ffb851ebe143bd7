//! Runs on a device's thread: fills its blocks, takes recorded ones. Never allocates, locks or waits.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};

use cpal::{InputCallbackInfo, OutputCallbackInfo};

use crate::block::frames_ns;
use crate::bounded::hush_alsa;
use crate::format::DeviceSample;
use crate::{Block, Capture, Captured, Process, now_ns};

/// Largest piece in samples; longer calls are filled in several pieces.
const SCRATCH: usize = 1 << 16;
/// Calls whose length is remembered.
const RECENT: usize = 32;
/// An ended stream fades out within 1 / this of a second.
const FADE_HZ: u32 = 100;
/// A longer time between two calls is a break in the sound, if it is also more than 3 periods [ns].
const GAP_NS: u64 = 50_000_000;

/// Counts of one side of a stream.
#[derive(Default)]
pub(crate) struct Counts {
    pub(crate) rate_hz: u32,
    pub(crate) calls: AtomicU64,
    pub(crate) xruns: AtomicU64,
    pub(crate) errors: AtomicU64,
    /// Time of the last call; 0 before the first.
    pub(crate) last_ns: AtomicU64,
    /// Latency that the host last reported [ns].
    pub(crate) latency_ns: AtomicU64,
    /// Whether the stream has ended and must be silent.
    pub(crate) over: AtomicBool,
    /// When the last sample of an ended stream is heard; 0 until its last block is filled.
    pub(crate) faded_ns: AtomicU64,
    /// How the process or capture panicked.
    pub(crate) panic: OnceLock<String>,
    recent: [AtomicU32; RECENT],
}

impl Counts {
    pub(crate) fn new(rate_hz: u32) -> Self {
        Self { rate_hz, ..Self::default() }
    }

    /// Lengths of the last calls [frames], without 0, in ascending order.
    pub(crate) fn recent(&self) -> Vec<u32> {
        let all = self.recent.iter().map(|frames| frames.load(Relaxed));
        let mut recent: Vec<u32> = all.filter(|frames| *frames > 0).collect();
        recent.sort_unstable();
        recent
    }

    /// Counts a call. Whether the device was silent before it.
    pub(crate) fn called(&self, now: u64, frames: usize, latency_ns: u64) -> bool {
        let before = self.last_ns.swap(now, Relaxed);
        let call = self.calls.fetch_add(1, Relaxed);
        self.latency_ns.store(latency_ns, Relaxed);
        let place = |call: u64| &self.recent[call as usize % RECENT];
        let last = u64::from(place(call.wrapping_sub(1)).load(Relaxed)).max(frames as u64);
        place(call).store(frames.min(u32::MAX as usize) as u32, Relaxed);
        before > 0 && now.saturating_sub(before) > GAP_NS.max(frames_ns(3 * last, self.rate_hz))
    }
}

/// Common part of both directions.
struct Line {
    counts: Arc<Counts>,
    /// Device channel (from 0) of each channel of the block.
    map: Vec<usize>,
    width: usize,
    /// Buffer for one piece of a block.
    scratch: Vec<f32>,
    /// Whether ALSA's library may print on this thread.
    loud: bool,
}

impl Line {
    fn new(counts: Arc<Counts>, channels: &[u16], width: u16) -> Self {
        let map: Vec<usize> = channels.iter().map(|channel| usize::from(channel.max(&1) - 1)).collect();
        let scratch = vec![0.0; SCRATCH / map.len().max(1) * map.len().max(1)];
        Self { counts, map, width: usize::from(width.max(1)), scratch, loud: true }
    }

    /// Begins a call. Whether the device was silent before it.
    fn begin(&mut self, now: u64, samples: usize, latency_ns: u64) -> bool {
        if std::mem::take(&mut self.loud) {
            hush_alsa();
        }
        self.counts.called(now, samples / self.width, latency_ns)
    }

    fn over(&self) -> bool {
        self.counts.over.load(Relaxed) || self.counts.panic.get().is_some()
    }

    /// Samples of the device in a piece.
    fn piece(&self) -> usize {
        self.scratch.len() / self.map.len().max(1) * self.width
    }
}

/// Runs the process or capture. False if it panicked.
fn runs(counts: &Counts, call: impl FnOnce()) -> bool {
    let Err(panic) = catch_unwind(AssertUnwindSafe(call)) else { return true };
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    let _ = counts.panic.set(text.unwrap_or("no message").to_owned());
    // Dropping it could run any code.
    std::mem::forget(panic);
    false
}

/// Fills a device's output.
pub(crate) struct Filler {
    line: Line,
    process: Box<dyn Process>,
    /// Last frame played, channels as in the block.
    last: Vec<f32>,
    /// Frames of the fade to silence: all, and those still to come.
    fade: (u32, u32),
}

impl Filler {
    pub(crate) fn new(counts: Arc<Counts>, channels: &[u16], width: u16, process: Box<dyn Process>) -> Self {
        let frames = (counts.rate_hz / FADE_HZ).max(1);
        let last = vec![0.0; channels.len()];
        Self { line: Line::new(counts, channels, width), process, last, fade: (frames, frames) }
    }

    pub(crate) fn fill<T: DeviceSample>(&mut self, data: &mut [T], info: &OutputCallbackInfo) {
        let now_ns = now_ns();
        let stamp = info.timestamp();
        let ahead = stamp.playback.saturating_duration_since(stamp.callback).as_nanos() as u64;
        data.fill(T::EQUILIBRIUM);
        if self.line.begin(now_ns, data.len(), ahead) {
            // The fade must not begin with a step.
            self.last.fill(0.0);
        }
        if self.line.over() {
            return self.fade_out(data, now_ns + ahead);
        }
        let (width, channels, size) = (self.line.width, self.line.map.len(), self.line.piece());
        let whole = data.len() / width * width;
        for start in (0..whole).step_by(size.max(1)) {
            let piece = &mut data[start..whole.min(start + size)];
            let output = &mut self.line.scratch[..piece.len() / width * channels];
            output.fill(0.0);
            let mut block = Block { output, channels, now_ns };
            if !runs(&self.line.counts, || self.process.process(&mut block)) {
                let passed = frames_ns((start / width) as u64, self.line.counts.rate_hz);
                return self.fade_out(&mut data[start..], now_ns + ahead + passed);
            }
            for (frame, made) in piece.chunks_exact_mut(width).zip(self.line.scratch.chunks_exact(channels)) {
                for (to, from) in self.line.map.iter().zip(made) {
                    frame[*to] = T::from_unit(*from);
                }
            }
            if let Some(frame) = piece.chunks_exact(width).next_back() {
                for (last, from) in self.last.iter_mut().zip(&self.line.map) {
                    *last = frame[*from].to_unit();
                }
            }
        }
    }

    /// Fades the last frame to silence, a half period of a cosine; `heard_ns` is when the data is heard.
    fn fade_out<T: DeviceSample>(&mut self, data: &mut [T], heard_ns: u64) {
        let (all, left) = &mut self.fade;
        let mut frames = 0;
        for frame in data.chunks_exact_mut(self.line.width) {
            frames += 1;
            *left = left.saturating_sub(1);
            let gain = 0.5 - 0.5 * (std::f32::consts::PI * *left as f32 / *all as f32).cos();
            for (to, last) in self.line.map.iter().zip(&self.last) {
                frame[*to] = T::from_unit(last * gain);
            }
            if *left == 0 {
                break;
            }
        }
        let counts = &self.line.counts;
        if *left == 0 && counts.faded_ns.load(Relaxed) == 0 {
            counts.faded_ns.store(heard_ns + frames_ns(frames, counts.rate_hz), Relaxed);
        }
    }
}

/// Takes a device's recording.
pub(crate) struct Gatherer {
    line: Line,
    capture: Box<dyn Capture>,
}

impl Gatherer {
    pub(crate) fn new(counts: Arc<Counts>, channels: &[u16], width: u16, capture: Box<dyn Capture>) -> Self {
        Self { line: Line::new(counts, channels, width), capture }
    }

    pub(crate) fn gather<T: DeviceSample>(&mut self, data: &[T], info: &InputCallbackInfo) {
        let now_ns = now_ns();
        let stamp = info.timestamp();
        let behind = stamp.callback.saturating_duration_since(stamp.capture).as_nanos() as u64;
        self.line.begin(now_ns, data.len(), behind);
        let (width, channels) = (self.line.width, self.line.map.len());
        let whole = data.len() / width * width;
        for piece in data[..whole].chunks(self.line.piece()) {
            if self.line.over() {
                return;
            }
            let taken = &mut self.line.scratch[..piece.len() / width * channels];
            for (frame, taken) in piece.chunks_exact(width).zip(taken.chunks_exact_mut(channels)) {
                for (from, to) in self.line.map.iter().zip(taken) {
                    *to = frame[*from].to_unit();
                }
            }
            let input = &self.line.scratch[..piece.len() / width * channels];
            runs(&self.line.counts, || self.capture.capture(&Captured { input, channels, now_ns }));
        }
    }
}

#[cfg(test)]
mod tests {
    use assert_no_alloc::{AllocDisabler, assert_no_alloc, violation_count};
    use cpal::{InputStreamTimestamp, OutputStreamTimestamp, StreamInstant};

    use super::*;

    #[global_allocator]
    static ALLOCATOR: AllocDisabler = AllocDisabler;

    struct Half;

    impl Process for Half {
        fn process(&mut self, block: &mut Block<'_>) {
            block.output.fill(0.5);
        }
    }

    impl Capture for Half {
        fn capture(&mut self, block: &Captured<'_>) {
            assert!(block.input.iter().all(|sample| *sample == 0.5));
        }
    }

    fn played() -> OutputCallbackInfo {
        let stamp = StreamInstant::from_nanos(1);
        OutputCallbackInfo::new(OutputStreamTimestamp { callback: stamp, playback: stamp })
    }

    #[test]
    fn callback_of_any_length_never_allocates() {
        assert_no_alloc(|| drop(std::hint::black_box(vec![1_u8; 64])));
        let seen = violation_count();
        assert!(seen > 0, "the instrument must see an allocation");
        let counts = Arc::new(Counts::new(48_000));
        let mut filler = Filler::new(counts.clone(), &[3, 1], 4, Box::new(Half));
        let mut gatherer = Gatherer::new(counts.clone(), &[1, 3], 4, Box::new(Half));
        let stamp = StreamInstant::from_nanos(1);
        let recorded = InputCallbackInfo::new(InputStreamTimestamp { callback: stamp, capture: stamp });
        let mut data = vec![cpal::I24::new_unchecked(0); 4 * 100_000];
        now_ns();
        for frames in [64, 0, 1, 100_000, 441] {
            // As if the last call had been a day ago.
            counts.last_ns.store(1, Relaxed);
            while now_ns() < GAP_NS + 10_000_000 {
                std::thread::yield_now();
            }
            let data = &mut data[..4 * frames];
            assert_no_alloc(|| filler.fill(data, &played()));
            assert_no_alloc(|| gatherer.gather(data, &recorded));
            assert!(data.chunks(4).all(|frame| frame[0].to_unit() == 0.5 && frame[1].inner() == 0));
        }
        assert_eq!(violation_count(), seen);
    }

    #[test]
    fn ended_stream_fades_and_stays_silent() {
        let counts = Arc::new(Counts::new(48_000));
        let mut filler = Filler::new(counts.clone(), &[2], 2, Box::new(Half));
        let mut heard = Vec::new();
        for call in 0..12 {
            let mut data = [0.0_f32; 2 * 64];
            counts.over.store(call > 1, Relaxed);
            // No gap, however busy the machine is.
            counts.last_ns.store(0, Relaxed);
            filler.fill(&mut data, &played());
            assert_eq!(counts.faded_ns.load(Relaxed) > 0, call >= 9, "call {call}");
            assert!(data.iter().step_by(2).all(|sample| *sample == 0.0));
            heard.extend(data.iter().skip(1).step_by(2).copied());
        }
        assert!(heard[..128].iter().all(|sample| *sample == 0.5));
        let steepest = 0.5 * std::f32::consts::FRAC_PI_2 / 480.0 * 1.01;
        assert!(heard.windows(2).all(|pair| (0.0..steepest).contains(&(pair[0] - pair[1]))));
        assert!((heard[128 + 239] - 0.25).abs() < 1e-6);
        assert!(heard[128 + 479..].iter().all(|sample| *sample == 0.0));
    }

    #[test]
    fn gap_is_longer_than_3_periods_and_50_ms() {
        let counts = Counts::new(48_000);
        // 4800 frames are 100 ms.
        for (ms, frames, gap) in [
            (1000, 64, false),
            (1049, 64, false),
            (1100, 64, true),
            (1390, 4800, false),
            (1680, 64, false),
            (1740, 64, true),
        ] {
            assert_eq!(counts.called(ms * 1_000_000, frames, 0), gap, "at {ms} ms");
        }
    }
}
