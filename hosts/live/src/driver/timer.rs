//! Ticks on the system's clock, without audio: for force or network sinks, or while a device is lost.

use std::sync::atomic::Ordering::Relaxed;

use super::run::{self, RUN_BEHIND};
use super::{Clock, Controls, Driver, Options, Ticker, sleep_until};
use crate::now_ns;
use crate::ramp::Level;

/// Longest sleep [ns]. Between sleeps the thread looks for a stop request.
const NAP_NS: u64 = 20_000_000;

/// Starts a run without audio: the output of a tick is computed and dropped. The first tick is due at once.
/// [`Driver::stop`] takes 20 ms and a tick at most.
///
/// # Errors
/// The system gives no thread; the ticker is lost then.
pub fn timer<T: Ticker + 'static>(ticker: T, options: &Options) -> std::io::Result<Driver<T>> {
    Driver::thread(Clock::Timer, Controls::new(options, None), |controls| run(ticker, controls))
}

fn run<T: Ticker>(mut ticker: T, controls: &Controls) -> T {
    let rates = ticker.rates();
    let mut samples = vec![0.0; rates.most()];
    let (first, start_ns) = (ticker.next_tick(), now_ns());
    let due_of = |tick: u64| {
        let since = u128::from(tick - first) * 1_000_000_000 / u128::from(rates.tick_hz);
        start_ns + since as u64
    };
    controls.level.store(Level::Full as u8, Relaxed);
    while !controls.stopping() && !controls.failed() {
        let tick = ticker.next_tick();
        let (due, now) = (due_of(tick), now_ns());
        if due > now {
            sleep_until(due.min(now + NAP_NS));
            if now_ns() < due {
                continue;
            }
        }
        let behind = (now.saturating_sub(due) as f64 / rates.tick_ns()) as u64;
        if behind > RUN_BEHIND {
            ticker.skip(behind);
            controls.meters().skipped_ticks.add(behind);
            continue;
        }
        if behind > 0 {
            controls.meters().caught_up_ticks.add(1);
        }
        let len = rates.len(tick).min(samples.len());
        run::tick(&mut ticker, controls, (due, due), &mut samples[..len]);
    }
    ticker
}

#[cfg(test)]
#[path = "timer_tests.rs"]
mod tests;
