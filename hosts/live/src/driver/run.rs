//! Parts of all drivers: one tick, and a device's block around its samples.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use asperity_audio::Block;
use asperity_node::time;

use super::{Controls, Ticker};
use crate::dll::{Dll, Heard};
use crate::meters::Record;
use crate::now_ns;
use crate::ramp::Ramp;

/// Late ticks up to this number run at once, since they cost microseconds. Beyond that they are skipped.
pub(super) const RUN_BEHIND: u64 = 16;
/// Fastest change of a delay, as a share of time. It distorts speeds by as much.
pub(super) const SLEW: f64 = 0.02;

/// Rates and channels of a run.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    /// Ticks a second, at least 1.
    pub tick_hz: u32,
    /// Samples a second of the output.
    pub rate_hz: u32,
    /// Channels of the output, at least 1.
    pub channels: usize,
}

impl Rates {
    pub(super) fn tick_ns(&self) -> f64 {
        1e9 / f64::from(self.tick_hz)
    }

    pub(crate) fn first_sample(&self, tick: u64) -> u64 {
        time::first_sample(tick, self.rate_hz, self.tick_hz)
    }

    /// Values (samples times channels) of a tick.
    pub(super) fn len(&self, tick: u64) -> usize {
        let samples = time::samples(tick, self.rate_hz, self.tick_hz);
        (samples.end - samples.start) as usize * self.channels
    }

    pub(super) fn most(&self) -> usize {
        time::max_samples(self.rate_hz, self.tick_hz) * self.channels
    }

    /// Samples from `origin` to the start of a tick, not rounded to whole samples: a tick at 44.1 kHz and
    /// 500 Hz has 88 or 89 samples, but ticks are 2 ms apart.
    pub(super) fn samples_from(&self, origin: u64, tick: u64) -> f64 {
        let (tick_hz, rate_hz) = (i128::from(self.tick_hz), i128::from(self.rate_hz));
        (i128::from(tick) * rate_hz - i128::from(origin) * tick_hz) as f64 / tick_hz as f64
    }

    /// Last tick that begins at or before a sample.
    pub(super) fn tick_at(&self, sample: u64) -> u64 {
        let next = (u128::from(sample) + 1) * u128::from(self.tick_hz);
        (next.div_ceil(u128::from(self.rate_hz.max(1))) - 1) as u64
    }
}

/// Runs the next tick into `out`. False if it panicked: the ticker must not run again.
pub(super) fn tick(
    ticker: &mut impl Ticker,
    controls: &Controls,
    (time_ns, due_ns): (u64, u64),
    out: &mut [f32],
) -> bool {
    let (tick, woke_ns) = (ticker.next_tick(), now_ns());
    out.fill(0.0);
    if let Err(payload) = catch_unwind(AssertUnwindSafe(|| ticker.tick(time_ns, out))) {
        // Freeing it could run any code. This happens once in a run.
        std::mem::forget(payload);
        controls.failed.store(true, Relaxed);
        return false;
    }
    controls.meters().record(Record { tick, due_ns, woke_ns, done_ns: now_ns() });
    true
}

/// A device's side of a driver: its time, and the envelope and limits of its output.
#[derive(Debug)]
pub(super) struct Output {
    pub(super) controls: Arc<Controls>,
    pub(super) channels: usize,
    pub(super) dll: Dll,
    ramp: Ramp,
}

impl Output {
    pub(super) fn new(controls: Arc<Controls>, rates: &Rates, start_s: f64) -> Self {
        let ramp = Ramp::new(rates.rate_hz, rates.channels, start_s);
        Self { controls, channels: rates.channels, dll: Dll::new(rates.rate_hz), ramp }
    }

    /// Begins a block. `None` if the device has other channels than the run, which fails then.
    pub(super) fn begin(&mut self, block: &Block<'_>) -> Option<Heard> {
        if block.channels != self.channels {
            self.controls.failed.store(true, Relaxed);
            return None;
        }
        let heard = self.dll.callback(block.now_ns, block.frames() as u64);
        self.controls.heard(block.now_ns, self.dll.line());
        if heard.lost > 0 {
            self.controls.meters().xruns.add(1);
            self.ramp.broken();
        }
        Some(heard)
    }

    /// Ends it. Frames `before` the stream are silent, `filled` ones are played, those after are missing.
    pub(super) fn end(&mut self, output: &mut [f32], before: usize, filled: usize) {
        self.controls.steer(&mut self.ramp);
        let (silent, rest) = output.split_at_mut(before * self.channels);
        let (played, missing) = rest.split_at_mut(filled * self.channels);
        self.ramp.starve(silent);
        self.ramp.play(played);
        self.ramp.starve(missing);
        self.controls.hold(output, self.channels);
        self.controls.note(&self.ramp, output);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tick_at_a_sample_is_the_last_to_begin_by_then() {
        for (rate_hz, tick_hz) in
            [(48_000, 500), (44_100, 500), (2_500, 4_000), (44_100, 4_000), (96_000, 100)]
        {
            let rates = Rates { tick_hz, rate_hz, channels: 1 };
            for sample in (0..3_000).chain([1 << 40]) {
                let tick = rates.tick_at(sample);
                assert!(rates.first_sample(tick) <= sample && sample < rates.first_sample(tick + 1));
            }
            assert_eq!(rates.samples_from(100, 0), -100.0);
        }
    }
}
