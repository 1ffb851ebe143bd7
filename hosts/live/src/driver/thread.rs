//! Thread that runs ticks, apart from an audio device's own.

use std::sync::Arc;
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use asperity_engine::Flushed;

use super::Controls;
use crate::realtime::sleep_sharply;

/// Stack that the thread touches at its start.
const STACK: usize = 262_144;
/// Longest time that the thread may take to end.
const END: Duration = Duration::from_secs(1);

/// Run whose ticks a thread of its own calls: [`paced`](super::paced) or [`timer`](super::timer). Dropping
/// it requests a stop.
#[derive(Debug)]
pub struct TickThread<T> {
    thread: Option<JoinHandle<T>>,
    controls: Arc<Controls>,
}

impl<T: Send + 'static> TickThread<T> {
    /// Starts a thread that runs `ticks` and returns the ticker.
    /// Error: the system gives no thread; the ticker is lost then.
    pub(super) fn start(
        controls: Arc<Controls>,
        ticks: impl FnOnce(&Controls) -> T + Send + 'static,
    ) -> std::io::Result<Self> {
        let shared = Arc::clone(&controls);
        let run = move || {
            let _flushed = Flushed::new();
            shared.ask::<STACK>();
            sleep_sharply();
            ticks(&shared)
        };
        let thread = Builder::new().name("asperity-tick".into()).spawn(run)?;
        Ok(Self { thread: Some(thread), controls })
    }

    /// Requests to the driver, and its state.
    pub fn controls(&self) -> &Arc<Controls> {
        &self.controls
    }

    /// Stops the ticks and returns the ticker. A paced output ramps down first, unless the device no longer
    /// calls. `None` if a tick does not end within a second: the thread is left to itself.
    pub fn stop(mut self) -> Option<T> {
        self.controls.request_stop();
        let thread = self.thread.take()?;
        let began = Instant::now();
        while !thread.is_finished() {
            if began.elapsed() > END {
                return None;
            }
            std::thread::sleep(Duration::from_micros(500));
        }
        thread.join().ok()
    }
}

impl<T> Drop for TickThread<T> {
    fn drop(&mut self) {
        self.controls.request_stop();
    }
}
