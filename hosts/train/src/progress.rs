//! Progress messages of a run.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressStyle};

use crate::descent::Progress;

/// A bar on a terminal, lines elsewhere.
pub(crate) struct Teller {
    bar: Option<ProgressBar>,
    what: &'static str,
    steps: usize,
    next_line: usize,
}

impl Teller {
    /// A bar for `steps` steps.
    pub(crate) fn new(what: &'static str, steps: usize) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len} {msg} {elapsed} gone");
            ProgressBar::new(steps as u64)
                .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
                .with_prefix(what)
        });
        Self { bar, what, steps, next_line: 0 }
    }

    /// Reports the step with a remark.
    pub(crate) fn tell(&mut self, step: usize, remark: &str) {
        match &self.bar {
            Some(bar) => {
                bar.set_position(step as u64);
                bar.set_message(remark.to_owned());
                if step == self.steps {
                    bar.finish();
                }
            }
            None if step >= self.next_line || step == self.steps => {
                self.next_line = step + self.steps.div_ceil(40);
                eprintln!("{}: {step} of {}, {remark}", self.what, self.steps);
            }
            None => {}
        }
    }

    /// Reports a stage's progress.
    pub(crate) fn progress(&mut self, p: &Progress) {
        let left = p.left.as_secs();
        let remark =
            format!("loss {:.4}, {:.1} steps/s, {} min {:02} s left", p.loss, p.rate, left / 60, left % 60);
        self.tell(p.step, &remark);
    }
}
