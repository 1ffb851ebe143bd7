//! Progress bars, and the stop flag of a run.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use asperity_tradeoff::Monitor;
use indicatif::{ProgressBar, ProgressStyle};

use super::Stop;
use crate::failure::complain;
use crate::heap;

/// A bar for each stage.
pub struct Bars {
    stop: Stop,
    /// Counts of parts: of accuracy, and of times.
    lengths: (u64, u64),
    quiet: bool,
    /// Prints a line for each tenth instead, where standard error is no terminal.
    lines: bool,
    bar: Mutex<ProgressBar>,
    told: AtomicBool,
}

impl Bars {
    pub fn new(accuracy: u64, times: u64, quiet: bool, stop: Stop) -> Self {
        let lines = !quiet && !std::io::stderr().is_terminal();
        let (bar, told) = (Mutex::new(ProgressBar::hidden()), AtomicBool::new(false));
        Self { stop, lengths: (accuracy, times), quiet, lines, bar, told }
    }

    pub fn finish(&self) {
        if let Ok(bar) = self.bar.lock() {
            bar.finish_and_clear();
        }
    }
}

impl Monitor for Bars {
    fn heap_bytes(&self) -> Option<u64> {
        Some(heap::bytes())
    }

    fn stopped(&self) -> bool {
        let stop = self.stop.load(Ordering::Relaxed);
        if stop && !self.told.swap(true, Ordering::Relaxed) {
            complain("stopping after the current part; finished parts are kept\n");
        }
        stop
    }

    fn advanced(&self, parts: u64) {
        if let Ok(bar) = self.bar.lock() {
            let tenth = |bar: &ProgressBar| bar.length().map_or(0, |all| 10 * bar.position() / all.max(1));
            let before = tenth(&bar);
            bar.inc(parts);
            let now = tenth(&bar);
            if self.lines && now > before {
                complain(&format!("{}: {} %\n", bar.message(), 10 * now.min(10)));
            }
        }
    }

    fn doing(&self, stage: &str) {
        let Ok(mut bar) = self.bar.lock() else { return };
        bar.finish_and_clear();
        if self.quiet {
            return;
        }
        let length = match stage {
            "accuracy" => self.lengths.0,
            "times" => self.lengths.1,
            _ => 0,
        };
        *bar = if length > 0 { ProgressBar::new(length) } else { ProgressBar::new_spinner() };
        let template = "{msg} {wide_bar} {percent:>3} %  {elapsed} gone, {eta} left";
        if length > 0
            && let Ok(style) = ProgressStyle::with_template(template)
        {
            bar.set_style(style);
        }
        bar.set_message(stage.to_owned());
        bar.tick();
    }
}
