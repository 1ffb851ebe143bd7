//! Progress bars, and the stop flag of a run.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use asperity_tradeoff::Monitor;
use indicatif::ProgressBar;
use parking_lot::Mutex;

use crate::failure::{complain, progress};
use crate::heap;

pub struct Bars {
    pub stop: Arc<AtomicBool>,
    /// Counts of parts: of accuracy, and of times.
    pub parts: (u64, u64),
    pub quiet: bool,
    pub bar: Mutex<ProgressBar>,
    pub told: AtomicBool,
}

impl Monitor for Bars {
    fn heap_bytes(&self) -> Option<u64> {
        Some(heap::bytes())
    }

    fn stopped(&self) -> bool {
        let stop = self.stop.load(Relaxed);
        if stop && !self.told.swap(true, Relaxed) {
            complain("stopping after the current part; finished parts are kept\n");
        }
        stop
    }

    fn advanced(&self, parts: u64) {
        self.bar.lock().inc(parts);
    }

    fn doing(&self, stage: &str) {
        let mut bar = self.bar.lock();
        bar.finish_and_clear();
        let parts = match stage {
            "accuracy" => self.parts.0,
            "times" => self.parts.1,
            _ => 0,
        };
        let whole = "{msg} {wide_bar} {percent:>3} %  {elapsed} gone, {eta} left";
        *bar = progress(parts, if parts > 0 { whole } else { "{msg}" }, self.quiet);
        bar.set_message(stage.to_owned());
        bar.tick();
    }
}
