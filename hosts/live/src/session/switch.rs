//! A process that plays silence until it is given another one, and measures the device's wake-ups
//! meanwhile.

use std::sync::Arc;
use std::time::Duration;

use asperity_audio::{Block, Process};
use parking_lot::{Mutex, MutexGuard};

use crate::dll::{BUNCH, LONGEST_BUNCH_NS};

/// Process that a device calls from its start on. Both sides take it by `try_lock` alone; the device plays a
/// block of silence while the control thread looks.
#[derive(Clone)]
pub(super) struct Switch(Arc<Mutex<(Wakes, Option<Box<dyn Process>>)>>);

impl Switch {
    /// For a device of this rate.
    pub(super) fn new(rate_hz: u32) -> Self {
        Self(Arc::new(Mutex::new((Wakes { rate_hz, ..Wakes::default() }, None))))
    }

    fn lock(&self) -> MutexGuard<'_, (Wakes, Option<Box<dyn Process>>)> {
        loop {
            if let Some(it) = self.0.try_lock() {
                return it;
            }
            std::thread::sleep(Duration::from_micros(100));
        }
    }

    /// Finished wake-ups, and frames a wake-up (all calls of a bunch together); 0 for none.
    pub(super) fn heard(&self) -> (u32, u32) {
        let wakes = &self.lock().0;
        (wakes.count, wakes.period())
    }

    pub(super) fn give(&self, process: Box<dyn Process>) {
        self.lock().1 = Some(process);
    }
}

impl Process for Switch {
    fn process(&mut self, block: &mut Block<'_>) {
        let Some(mut it) = self.0.try_lock() else { return };
        match &mut *it {
            (_, Some(process)) => process.process(block),
            (wakes, None) => wakes.callback(block.now_ns, block.frames()),
        }
    }
}

/// Groups calls into wake-ups as the delay-locked loop does: a server calls in bunches.
#[derive(Debug, Default)]
struct Wakes {
    rate_hz: u32,
    /// Finished wake-ups.
    count: u32,
    /// Start of the current wake-up, and its frames so far.
    began_ns: f64,
    frames: u32,
    /// Largest wake-ups in frames, largest first.
    most: [u32; 3],
}

impl Wakes {
    /// Notes a call.
    fn callback(&mut self, now_ns: u64, frames: usize) {
        let (now, span) = (now_ns as f64, f64::from(self.frames) * 1e9 / f64::from(self.rate_hz));
        let bunched = now - self.began_ns < BUNCH * span && span < LONGEST_BUNCH_NS;
        if self.frames > 0 && !bunched {
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
        let (mut wakes, mut asked) = (Wakes { rate_hz: 48_000, ..Wakes::default() }, 0);
        let mut now = 1_000_000_000;
        for wake in 0..16 {
            let due = wake * every + prefill;
            let came = now + if late.contains(&wake) { every * 20_000 } else { 0 };
            let calls = (due - asked) / frames;
            for call in 0..calls {
                wakes.callback(came + call * 5_000, frames as usize);
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
        let mut switch = Switch::new(48_000);
        let control = switch.clone();
        let mut call = |now_ns| {
            let mut output = [1.0; 64];
            switch.process(&mut Block { output: &mut output, channels: 1, now_ns });
        };
        (1..=4).for_each(|n| call(n * 2_666_667));
        (1..=4).for_each(|n| call(n * 2_666_667 + 5_000));
        let (wakes, period) = control.heard();
        assert!(wakes >= 3 && period >= 64, "{wakes} {period}");
        struct Silence;
        impl Process for Silence {
            fn process(&mut self, _: &mut Block<'_>) {}
        }
        control.give(Box::new(Silence));
        (5..=9).for_each(|n| call(n * 2_666_667));
        assert_eq!(control.heard(), (wakes, period));
    }
}
