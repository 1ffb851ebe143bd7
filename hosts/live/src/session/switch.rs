//! A process that plays silence until it is given another one, and measures the device's wake-ups
//! meanwhile.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::*};

use asperity_audio::{Block, Process};
use ringbuf::traits::{Consumer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

use crate::dll::{BUNCH, LONGEST_BUNCH_NS};

/// Process that a device calls from its start on.
pub(super) struct Switch {
    from: HeapCons<Box<dyn Process>>,
    process: Option<Box<dyn Process>>,
    wakes: Wakes,
    heard: Arc<Heard>,
}

/// Gives the device its process, once.
pub(super) struct Give {
    to: HeapProd<Box<dyn Process>>,
    heard: Arc<Heard>,
}

/// Measurements so far.
#[derive(Debug, Default)]
struct Heard {
    /// Rate of the device; 0 until it is known, and before that nothing is measured.
    rate_hz: AtomicU32,
    wakes: AtomicU32,
    period_frames: AtomicU32,
}

/// A switch and its control.
pub(super) fn switch() -> (Give, Switch) {
    let (to, from) = HeapRb::new(1).split();
    let heard = Arc::new(Heard::default());
    let switch = Switch { from, process: None, wakes: Wakes::default(), heard: heard.clone() };
    (Give { to, heard }, switch)
}

impl Give {
    /// Measures a device of this rate from now on.
    pub(super) fn listen(&self, rate_hz: u32) {
        self.heard.rate_hz.store(rate_hz, Relaxed);
    }

    /// Finished wake-ups, and frames a wake-up (all calls of a bunch together); 0 for none.
    pub(super) fn heard(&self) -> (u64, u32) {
        let heard = &self.heard;
        (u64::from(heard.wakes.load(Acquire)), heard.period_frames.load(Relaxed))
    }

    pub(super) fn give(&mut self, process: Box<dyn Process>) {
        // There is room, since this is called once.
        let _ = self.to.try_push(process);
    }
}

impl Process for Switch {
    fn process(&mut self, block: &mut Block<'_>) {
        if self.process.is_none() {
            self.process = self.from.try_pop();
        }
        if let Some(process) = &mut self.process {
            process.process(block);
            return;
        }
        let rate_hz = self.heard.rate_hz.load(Relaxed);
        if rate_hz > 0 && self.wakes.callback(block.now_ns, block.frames(), rate_hz) {
            self.heard.period_frames.store(self.wakes.period(), Relaxed);
            self.heard.wakes.store(self.wakes.count, Release);
        }
    }
}

/// Groups calls into wake-ups as the delay-locked loop does: a server calls in bunches.
#[derive(Debug, Default)]
struct Wakes {
    /// Finished wake-ups.
    count: u32,
    /// Start of the current wake-up, and its frames so far.
    began_ns: f64,
    frames: u32,
    /// Largest wake-ups in frames, largest first.
    most: [u32; 3],
}

impl Wakes {
    /// Notes a call. True if it starts a new wake-up, so that the one before is finished.
    fn callback(&mut self, now_ns: u64, frames: usize, rate_hz: u32) -> bool {
        let (now, span) = (now_ns as f64, f64::from(self.frames) * 1e9 / f64::from(rate_hz));
        let bunched = now - self.began_ns < BUNCH * span && span < LONGEST_BUNCH_NS;
        let over = self.frames > 0 && !bunched;
        if over {
            self.count += 1;
            let mut frames = self.frames;
            for most in &mut self.most {
                (*most, frames) = ((*most).max(frames), (*most).min(frames));
            }
            self.frames = 0;
        }
        if self.frames == 0 {
            self.began_ns = now;
        }
        self.frames = self.frames.saturating_add(frames as u32);
        over
    }

    /// Frames that wake-ups ask for repeatedly: the third largest. The two largest may be exceptions, since
    /// a device fills its buffer at the start and makes up for a late call.
    fn period(&self) -> u32 {
        self.most.iter().rev().copied().find(|frames| *frames > 0).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device that is awake every `every` frames, and then asks for as many calls of `frames` as have
    /// come due.
    fn listen(every: u64, frames: u64, prefill: u64, late: &[u64]) -> Wakes {
        let (mut wakes, mut asked) = (Wakes::default(), 0);
        let mut now = 1_000_000_000;
        for wake in 0..16 {
            let due = wake * every + prefill;
            let came = now + if late.contains(&wake) { every * 20_000 } else { 0 };
            let calls = (due - asked) / frames;
            for call in 0..calls {
                wakes.callback(came + call * 5_000, frames as usize, 48_000);
            }
            asked += calls * frames;
            now += every * 1_000_000_000 / 48_000;
        }
        wakes
    }

    #[test]
    fn bunched_calls_are_one_wake_up() {
        let wakes = listen(128, 73, 292, &[]);
        assert_eq!((wakes.period(), wakes.count), (146, 15));
        // 96 frames are a tick of 2 ms: a call fits, a wake-up of this device does not.
        assert_eq!(listen(96, 64, 256, &[]).period(), 128);
        assert_eq!(listen(2048, 512, 4096, &[]).period(), 2048);
    }

    #[test]
    fn first_fill_and_late_call_are_not_the_period() {
        assert_eq!(listen(64, 64, 256, &[]).period(), 64);
        assert_eq!(listen(64, 64, 64, &[9]).period(), 64);
        assert_eq!(listen(64, 64, 256, &[9]).period(), 64);
        assert_eq!(listen(16_384, 16_384, 16_384, &[]).period(), 16_384);
    }

    #[test]
    fn switch_reports_wake_ups_until_it_is_given_work() {
        let (mut give, mut switch) = switch();
        let mut call = |now_ns| {
            let mut output = [1.0; 64];
            switch.process(&mut Block { output: &mut output, channels: 1, now_ns, ahead_ns: 0 });
        };
        call(1_000_000);
        assert_eq!(give.heard(), (0, 0));
        give.listen(48_000);
        (1..=4).for_each(|n| call(n * 2_666_667));
        (1..=4).for_each(|n| call(n * 2_666_667 + 5_000));
        let (wakes, period) = give.heard();
        assert!(wakes >= 3 && period >= 64, "{wakes} {period}");
        struct Silence;
        impl Process for Silence {
            fn process(&mut self, _: &mut Block<'_>) {}
        }
        give.give(Box::new(Silence));
        (5..=9).for_each(|n| call(n * 2_666_667));
        assert_eq!(give.heard(), (wakes, period));
    }
}
