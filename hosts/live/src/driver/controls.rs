//! Requests to a driver's threads and their state: atomics alone.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering::*};
use std::time::Duration;

use super::Options;
use crate::RunControl;
use crate::dll::Line;
use crate::meters::Meters;
use crate::now_ns;
use crate::output_limits::SharedLimits;
use crate::ramp::{Level, Ramp};
use crate::realtime::{Asked, Grant};

/// A device counts as dead after three periods without a call, but at least and at most this long [ns].
const DEAD_NS: (u64, u64) = (200_000_000, 800_000_000);

/// Requests to a running driver, and its state. Any thread.
#[derive(Debug)]
pub struct Controls {
    run_control: RunControl,
    /// This driver must stop; the run may go on under another one.
    pub(super) stopping: AtomicBool,
    pub(super) failed: AtomicBool,
    /// The output is down for good.
    down: AtomicBool,
    pub(super) level: AtomicU8,
    /// Bits of the largest sample since the last read, and of the last callback's.
    peak: AtomicU32,
    last_peak: AtomicU32,
    heard_ns: AtomicU64,
    period_ns: AtomicU64,
    pub(super) lead_ns: AtomicU64,
    pub(super) asked: Asked,
    /// Request of the device's thread, if ticks run on another.
    pub(super) device_asked: Option<Asked>,
    meters: Arc<Meters>,
    pub(super) priority: Option<i32>,
    limits: Option<SharedLimits>,
}

impl Controls {
    /// Controls of one driver. `device_asked`: for a device's thread beside the one that ticks.
    pub(super) fn new(options: &Options, device_asked: Option<Asked>) -> Arc<Self> {
        Arc::new(Self {
            run_control: options.run_control.clone(),
            stopping: AtomicBool::default(),
            failed: AtomicBool::default(),
            down: AtomicBool::default(),
            level: AtomicU8::new(Level::Rising as u8),
            peak: AtomicU32::default(),
            last_peak: AtomicU32::default(),
            heard_ns: AtomicU64::default(),
            period_ns: AtomicU64::default(),
            lead_ns: AtomicU64::default(),
            asked: Asked::default(),
            device_asked,
            meters: Arc::clone(&options.meters),
            priority: options.priority,
            limits: options.limits.clone(),
        })
    }

    /// Control of the run.
    pub fn run_control(&self) -> &RunControl {
        &self.run_control
    }

    /// Whether the output is at full level, or ticks run without one.
    pub fn up(&self) -> bool {
        self.level.load(Relaxed) == Level::Full as u8
    }

    /// Whether a tick panicked. Then the output ramped down and nothing runs any more.
    pub fn failed(&self) -> bool {
        self.failed.load(Relaxed)
    }

    /// Real-time priority of the tick thread, or of the device's thread if that got less. `NotAsked` until
    /// both ran, unless one of them was refused before.
    pub fn priority(&self) -> Grant {
        worse(self.asked.get(), self.device_asked.as_ref().map(Asked::get))
    }

    /// Time between a tick's reading of its inputs and the callback that asks for its first sample [ns]:
    /// the driver's part of the latency.
    pub fn lead_ns(&self) -> u64 {
        self.lead_ns.load(Relaxed)
    }

    /// Times and counts.
    pub fn meters(&self) -> &Meters {
        &self.meters
    }

    pub(super) fn stopping(&self) -> bool {
        self.stopping.load(Relaxed) || self.run_control.stopping()
    }

    pub(super) fn heard(&self, now_ns: u64, line: &Line) {
        self.heard_ns.store(now_ns, Relaxed);
        self.period_ns.store((line.period_frames as f64 * line.frame_ns()) as u64, Relaxed);
    }

    /// Opens or closes the ramp as requested.
    pub(super) fn steer(&self, ramp: &mut Ramp) {
        ramp.open(!(self.run_control.muted() || self.stopping() || self.failed()));
    }

    /// Largest sample since the last read, including the last callback's, of full scale.
    pub fn peak(&self) -> f32 {
        // Between two callbacks, the last block still plays.
        f32::from_bits(self.peak.swap(0, Relaxed).max(self.last_peak.load(Relaxed)))
    }

    /// Limits the output by the limits of its channels. One device is open at a time; if another thread has
    /// the limits, the block is silent.
    pub(super) fn hold(&self, output: &mut [f32], channels: usize) {
        let Some(limits) = &self.limits else { return };
        match limits.try_lock() {
            Some(mut limits) => limits.hold(output, channels),
            None => output.fill(0.0),
        }
    }

    /// Notes the state of the ramp and the peak of the output.
    pub(super) fn note(&self, ramp: &Ramp, output: &[f32]) {
        let peak = output.iter().fold(0.0_f32, |most, x| x.abs().max(most));
        // Bits of positive floats are in the order of the numbers.
        self.peak.fetch_max(peak.to_bits(), Relaxed);
        self.last_peak.store(peak.to_bits(), Relaxed);
        self.level.store(ramp.level() as u8, Relaxed);
        if ramp.silent() && (self.stopping() || self.failed()) {
            self.down.store(true, Release);
        }
    }

    pub(super) fn down(&self) -> bool {
        self.down.load(Acquire)
    }

    /// Whether the device has not called for so long that its ramp need not be waited for.
    pub(super) fn dead(&self) -> bool {
        let patience = (3 * self.period_ns.load(Relaxed)).clamp(DEAD_NS.0, DEAD_NS.1);
        now_ns().saturating_sub(self.heard_ns.load(Relaxed)) > patience
    }

    /// Waits until the output is down or the device is dead. Control thread.
    pub(super) fn wait_until_down(&self) {
        while !self.down() && !self.dead() {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// The worse grant of two threads, or the only one.
fn worse(ticks: Grant, device: Option<Grant>) -> Grant {
    match device {
        Some(device) if device.missing() && !ticks.missing() => device,
        Some(Grant::NotAsked) if !ticks.missing() => Grant::NotAsked,
        _ => ticks,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peak_between_callbacks_stays_that_of_the_last_block() {
        let controls = Controls::new(&Options::new(Arc::new(Meters::new(500))), None);
        let ramp = Ramp::new(48_000, 1, 0.0);
        controls.note(&ramp, &[0.1, -0.75, 0.2]);
        controls.note(&ramp, &[0.25]);
        assert_eq!([controls.peak(), controls.peak(), controls.peak()], [0.75, 0.25, 0.25]);
        controls.note(&ramp, &[0.0]);
        assert_eq!(controls.peak(), 0.0);
    }

    #[test]
    fn grant_of_two_threads_is_the_worse_one() {
        use Grant::{Granted, NotAsked, NotSupported, Refused};
        for (ticks, device, told) in [
            (Granted, None, Granted),
            (NotAsked, None, NotAsked),
            (Granted, Some(Granted), Granted),
            (Granted, Some(NotAsked), NotAsked),
            (NotAsked, Some(Granted), NotAsked),
            (Granted, Some(Refused(1)), Refused(1)),
            (NotAsked, Some(NotSupported), NotSupported),
            (Refused(1), Some(Granted), Refused(1)),
            (Refused(1), Some(NotAsked), Refused(1)),
        ] {
            assert_eq!(worse(ticks, device), told, "{ticks:?}, {device:?}");
        }
    }
}
