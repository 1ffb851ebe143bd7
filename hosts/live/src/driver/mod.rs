//! Drivers call the ticks: from the audio callback itself, from a paced thread, or from a timer.
//!
//! A driver starts with a [`Ticker`] and returns it when it stops, so that the same run can go on under
//! another one: when a device is lost, a timer takes over until the device is back. A driver with audio
//! fades its output by a [`Ramp`](crate::Ramp), and counts in [`Meters`] the samples that it could not play.

mod callback;
mod controls;
mod paced;
mod run;
mod timer;

pub use callback::{CallbackHalf, callback};
pub use controls::Controls;
pub use paced::{PacedHalf, paced};
pub use run::Rates;
pub use timer::timer;

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use asperity_engine::Flushed;
use parking_lot::Mutex;

use crate::RunControl;
use crate::meters::Meters;
use crate::output_limits::SharedLimits;
use crate::ramp::START_S;
use crate::realtime::{PRIORITY, sleep_sharply};

/// Stack that a tick thread touches at its start.
const STACK: usize = 262_144;
/// Longest wait for a tick before the ticker is given up.
const END: Duration = Duration::from_secs(1);

/// A graph that runs tick by tick. No method may wait, allocate or log. A panic is caught and ends the
/// output.
pub trait Ticker: Send {
    /// Rates and channels of the run, which never change.
    fn rates(&self) -> Rates;

    /// Number of the next tick.
    fn next_tick(&self) -> u64;

    /// Runs the next tick. `time_ns`: when inputs are read, by [`now_ns`](crate::now_ns). `out`: interleaved
    /// samples of exactly this tick, zeroed, to be filled.
    fn tick(&mut self, time_ns: u64, out: &mut [f32]);

    /// Skips `n` ticks.
    fn skip(&mut self, n: u64);
}

/// Clock of the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The audio callback.
    Callback,
    /// A thread with evenly spaced ticks, steered by the callback's clock.
    Paced,
    /// A thread on the system's clock; no audio.
    Timer,
}

impl Clock {
    /// Its name: `callback`, `paced`, `timer`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Callback => "callback",
            Self::Paced => "paced",
            Self::Timer => "timer",
        }
    }
}

/// The requested clock. By default: the callback if the device's real period is at most one tick, a paced
/// thread if it is longer, a timer without a device (`period_frames` 0).
pub fn choose(asked: Option<Clock>, period_frames: u32, rate_hz: u32, tick_hz: u32) -> Clock {
    let fits = u64::from(period_frames) * u64::from(tick_hz) <= u64::from(rate_hz);
    match (asked, period_frames) {
        (Some(clock), _) => clock,
        (None, 0) => Clock::Timer,
        (None, _) if fits => Clock::Callback,
        (None, _) => Clock::Paced,
    }
}

/// A run under way. Dropping it stops it, as [`stop`](Self::stop) does.
#[derive(Debug)]
pub struct Driver<T: Ticker> {
    clock: Clock,
    controls: Arc<Controls>,
    /// `None` once the ticker is taken.
    runs: Option<Runs<T>>,
}

/// Where the ticker is. The slot is taken by `try_lock` alone, so no thread ever waits for it.
#[derive(Debug)]
enum Runs<T> {
    Callback(Arc<Mutex<Option<T>>>),
    Thread(JoinHandle<T>),
}

impl<T: Ticker> Driver<T> {
    /// Starts a thread that runs `ticks` and returns the ticker.
    /// Error: the system gives no thread; the ticker is lost then.
    fn thread(
        clock: Clock,
        controls: Arc<Controls>,
        ticks: impl FnOnce(&Controls) -> T + Send + 'static,
    ) -> std::io::Result<Self>
    where
        T: 'static,
    {
        let shared = Arc::clone(&controls);
        let run = move || {
            let _flushed = Flushed::new();
            shared.asked.once::<STACK>(shared.priority);
            sleep_sharply();
            ticks(&shared)
        };
        let thread = Builder::new().name("asperity-tick".into()).spawn(run)?;
        Ok(Self { clock, controls, runs: Some(Runs::Thread(thread)) })
    }

    /// The clock of the ticks.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Requests to the driver, and its state.
    pub fn controls(&self) -> &Arc<Controls> {
        &self.controls
    }

    /// Ramps the output down and returns the ticker, at once if the device no longer calls. `None` if a
    /// tick does not end within a second.
    pub fn stop(mut self) -> Option<T> {
        self.end(true)
    }

    /// Takes the ticker from a lost device, without a ramp that nobody hears. If the device calls all the
    /// same, it plays silence.
    pub fn take(mut self) -> Option<T> {
        self.end(false)
    }

    fn end(&mut self, ramp: bool) -> Option<T> {
        self.controls.stopping.store(true, Relaxed);
        let runs = self.runs.take()?;
        if ramp && matches!(runs, Runs::Callback(_)) {
            self.controls.wait_until_down();
        }
        let began = Instant::now();
        while began.elapsed() < END {
            match &runs {
                Runs::Callback(slot) => {
                    if let Some(mut ticker) = slot.try_lock() {
                        return ticker.take();
                    }
                }
                Runs::Thread(thread) if thread.is_finished() => break,
                Runs::Thread(_) => {}
            }
            std::thread::sleep(Duration::from_micros(300));
        }
        match runs {
            Runs::Thread(thread) if thread.is_finished() => thread.join().ok(),
            _ => None,
        }
    }
}

impl<T: Ticker> Drop for Driver<T> {
    fn drop(&mut self) {
        drop(self.end(true));
    }
}

/// Sleeps until a time of [`now_ns`](crate::now_ns). One system call and two readings of clocks.
#[cfg(target_os = "linux")]
fn sleep_until(time_ns: u64) {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `now` is of the type that is filled.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut now) };
    let left = time_ns.saturating_sub(crate::now_ns());
    let at = now.tv_nsec as u64 + left;
    let at = libc::timespec {
        tv_sec: now.tv_sec + (at / 1_000_000_000) as libc::time_t,
        tv_nsec: (at % 1_000_000_000) as libc::c_long,
    };
    let sleep = || {
        // SAFETY: `at` outlives the call; no remainder is asked for.
        unsafe {
            libc::clock_nanosleep(libc::CLOCK_MONOTONIC, libc::TIMER_ABSTIME, &at, std::ptr::null_mut())
        }
    };
    // Woken by a signal, it sleeps on: the time is absolute.
    while left > 0 && sleep() == libc::EINTR {}
}

/// Sleeps until a time of [`now_ns`](crate::now_ns).
#[cfg(not(target_os = "linux"))]
fn sleep_until(time_ns: u64) {
    std::thread::sleep(Duration::from_nanos(time_ns.saturating_sub(crate::now_ns())));
}

/// Options of a driver.
#[derive(Clone, Debug)]
pub struct Options {
    /// SCHED_FIFO priority of the tick thread and the device's thread; `None` requests nothing.
    pub priority: Option<i32>,
    /// Seconds from silence to full at the start.
    pub start_s: f64,
    /// Period of the device in frames as measured before, to size the paced driver's ring; 0 if unknown.
    pub seen_frames: u32,
    /// Times and counts.
    pub meters: Arc<Meters>,
    /// Mutes and stops it.
    pub run_control: RunControl,
    /// Limits of the device's channels, if any.
    pub limits: Option<SharedLimits>,
}

impl Options {
    /// Options of a run for a person.
    pub fn new(meters: Arc<Meters>) -> Self {
        Self {
            priority: Some(PRIORITY),
            start_s: START_S,
            seen_frames: 0,
            meters,
            run_control: RunControl::default(),
            limits: None,
        }
    }
}

#[cfg(test)]
#[path = "testing.rs"]
mod testing;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clock_is_callback_up_to_a_period_of_one_tick() {
        assert_eq!(choose(None, 96, 48_000, 500), Clock::Callback);
        assert_eq!(choose(None, 97, 48_000, 500), Clock::Paced);
        assert_eq!(choose(None, 64, 48_000, 1_000), Clock::Paced);
        assert_eq!(choose(None, 0, 48_000, 500), Clock::Timer);
        assert_eq!(choose(Some(Clock::Callback), 1_024, 48_000, 500), Clock::Callback);
    }
}
