//! Messages to the user, and exit codes.

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

pub use asperity_offline::failure::{Failure, clean, json, plural, without_path, wrong};
use asperity_offline::failure::{grouped, open_files};

/// Prints an error and answers the exit code.
pub fn report(failure: &Failure) -> ExitCode {
    complain(&failure.text());
    match failure {
        Failure::Input(all) => {
            if all.len() > 1 {
                let count = grouped(all.len());
                complain(&format!("{count} errors; nothing was started, nothing written\n"));
            }
            let machine = all.iter().any(|d| open_files(&d.message).is_some());
            ExitCode::from(if machine { 1 } else { 2 })
        }
        Failure::Machine(_) => ExitCode::from(1),
        Failure::Said(code) => ExitCode::from(*code),
    }
}

/// Whether a file goes to the standard output, so that all texts go to the standard error.
static TAKEN: AtomicBool = AtomicBool::new(false);

/// From now on, texts go to the standard error: a file goes to the standard output.
pub fn standard_output_is_taken() {
    TAKEN.store(true, Ordering::Relaxed);
}

/// Prints to the standard output. If its reader has gone, the program ends quietly.
pub fn print(text: &str) -> Result<(), Failure> {
    use std::io::Write as _;
    if TAKEN.load(Ordering::Relaxed) {
        complain(text);
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    written(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
}

/// The outcome of writing to the standard output. If its reader has gone, the program ends quietly.
pub fn written(done: std::io::Result<()>) -> Result<(), Failure> {
    match done {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => crate::leave::now(0),
        Err(e) => Err(Failure::Machine(format!("cannot write to the standard output: {e}"))),
        Ok(()) => Ok(()),
    }
}

/// Prints a report as JSON or as text.
pub fn print_report<T: Serialize>(
    json: bool,
    value: impl FnOnce() -> T,
    text: impl FnOnce() -> String,
) -> Result<(), Failure> {
    print(&if json { self::json(&value())? } else { text() })
}

/// A progress bar; a quiet one is hidden.
pub fn progress(steps: u64, template: &str, quiet: bool) -> ProgressBar {
    let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(steps) };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

pub fn warn(message: &str) {
    if !QUIET.load(Ordering::Relaxed) {
        complain(&format!("warning: {message}\n"));
    }
}

static QUIET: AtomicBool = AtomicBool::new(false);

/// Prints only errors from now on, if `quiet`.
pub fn be_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

/// Writes to the standard error, and ignores its errors.
pub fn complain(text: &str) {
    use std::io::Write as _;
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}
