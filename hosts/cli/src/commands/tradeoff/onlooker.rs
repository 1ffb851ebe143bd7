//! Progress, and what is asked of the outside while a study runs.

use std::sync::Mutex;
use std::sync::atomic::Ordering;

use asperity_study::Onlooker;
use indicatif::{ProgressBar, ProgressStyle};

use super::Stop;
use crate::heap;

/// A bar for each stage.
pub struct Bars {
    stop: Stop,
    /// Parts of accuracy and of times.
    lengths: (u64, u64),
    quiet: bool,
    bar: Mutex<ProgressBar>,
}

impl Bars {
    pub fn new(accuracy: u64, times: u64, quiet: bool, stop: Stop) -> Self {
        Self { stop, lengths: (accuracy, times), quiet, bar: Mutex::new(ProgressBar::hidden()) }
    }

    pub fn finish(&self) {
        if let Ok(bar) = self.bar.lock() {
            bar.finish_and_clear();
        }
    }
}

impl Onlooker for Bars {
    fn heap_bytes(&self) -> Option<u64> {
        Some(heap::bytes())
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn advanced(&self, parts: u64) {
        if let Ok(bar) = self.bar.lock() {
            bar.inc(parts);
        }
    }

    fn doing(&self, what: &str) {
        let Ok(mut bar) = self.bar.lock() else { return };
        bar.finish_and_clear();
        if self.quiet {
            return;
        }
        let length = match what {
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
        bar.set_message(what.to_owned());
        bar.tick();
    }
}
