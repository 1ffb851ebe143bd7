//! A thread on the system's clock, where there is no audio: force or network sinks, or a device that is lost.

use std::sync::Arc;
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use asperity_engine::Flushed;

use super::run::{self, RUN_BEHIND, Rates};
use super::{Controls, Options, Ticker, sleep};
use crate::now_ns;
use crate::realtime::sleep_sharply;

/// The longest sleep: a request to stop is looked at between.
const NAP_NS: u64 = 20_000_000;
/// Stack that is brought in.
const STACK: usize = 262_144;
/// How long a thread may take to end.
const END: Duration = Duration::from_secs(1);

/// A run without audio. What a tick puts out is computed and dropped. Dropped, it asks for a stop.
#[derive(Debug)]
pub struct Timer<T> {
    thread: Option<JoinHandle<T>>,
    controls: Arc<Controls>,
}

impl<T: Ticker + 'static> Timer<T> {
    /// Starts the thread; the first tick is due at once.
    ///
    /// # Errors
    /// Where the system gives no thread; the ticker is lost then.
    pub fn new(ticker: T, options: &Options) -> std::io::Result<Self> {
        let controls = Controls::new(options);
        let shared = Arc::clone(&controls);
        let thread = Builder::new().name("asperity-tick".into()).spawn(move || run(ticker, &shared))?;
        Ok(Self { thread: Some(thread), controls })
    }

    /// Requests, and how it stands.
    pub fn controls(&self) -> &Arc<Controls> {
        &self.controls
    }

    /// Takes the ticker back, within 20 ms and a tick; `None` where a tick does not end within a second.
    pub fn stop(mut self) -> Option<T> {
        self.controls.request_stop();
        self.thread.take().and_then(join)
    }
}

impl<T> Drop for Timer<T> {
    fn drop(&mut self) {
        self.controls.request_stop();
    }
}

/// What a thread gives back; `None` where it does not end in time: then it is left to itself.
pub(super) fn join<T>(thread: JoinHandle<T>) -> Option<T> {
    let began = Instant::now();
    while !thread.is_finished() {
        if began.elapsed() > END {
            return None;
        }
        std::thread::sleep(Duration::from_micros(500));
    }
    thread.join().ok()
}

fn run<T: Ticker>(mut ticker: T, controls: &Controls) -> T {
    let _flushed = Flushed::new();
    controls.ask::<STACK>();
    sleep_sharply();
    let rates = Rates::of(&ticker);
    let mut samples = vec![0.0; rates.most()];
    let (first, start_ns) = (ticker.next_tick(), now_ns());
    let due_of = |tick: u64| {
        let since = u128::from(tick - first) * 1_000_000_000 / u128::from(rates.tick_hz);
        start_ns + since as u64
    };
    controls.playing();
    while !controls.stopping() && !controls.failed() {
        let tick = ticker.next_tick();
        let (due, now) = (due_of(tick), now_ns());
        if due > now {
            sleep::until(due.min(now + NAP_NS));
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
