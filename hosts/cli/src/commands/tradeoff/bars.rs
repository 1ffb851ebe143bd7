//! Progress bars, and the stop flag of a run.

use std::io::IsTerminal;
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
        let bar = self.bar.lock();
        let tenth = || bar.length().and_then(|all| (10 * bar.position()).checked_div(all)).unwrap_or(0);
        let before = tenth();
        bar.inc(parts);
        // Where standard error is no terminal, each tenth is a line.
        if !self.quiet && !std::io::stderr().is_terminal() && tenth() > before {
            complain(&format!("{}: {} %\n", bar.message(), 10 * tenth().min(10)));
        }
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
