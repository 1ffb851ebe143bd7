//! The process around a plugin: whether the plugin changed it.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use asperity_checks::{Subject, node_cases};
use asperity_loader::float_changes;
use asperity_numbers::denormals::FloatControl;

use super::check::signal_name;

/// Name of the row of this check.
pub const SURROUNDINGS: &str = "surroundings";

/// Cases that make instances, call them and drop them.
const STIRRED_BY: [&str; 3] = ["zero", "reset", "state"];

/// Time in which a thread has to end after its instance.
const PATIENCE: Duration = Duration::from_secs(1);

pub struct Surroundings {
    float: FloatControl,
    folder: Option<PathBuf>,
    /// Address and flags of each signal's handler.
    handlers: Vec<(usize, i64)>,
    threads: Option<usize>,
}

impl Surroundings {
    pub fn now() -> Self {
        Self {
            float: FloatControl::now(),
            folder: std::env::current_dir().ok(),
            handlers: handlers(),
            threads: threads(),
        }
    }

    /// Runs instances of a kind. Answers the changes of the process since `self`.
    pub fn disturbed_by(&self, subject: &Subject<'_>) -> Vec<String> {
        for case in node_cases().iter().filter(|case| STIRRED_BY.contains(&case.name)) {
            // Its result is another row.
            let _ = case.run(subject);
        }
        let until = Instant::now() + PATIENCE;
        while threads() > self.threads && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(5));
        }
        let now = Self::now();
        let mut found: Vec<String> = float_changes();
        found.extend(now.float.differs(self.float));
        found.dedup();
        let mut found: Vec<String> = found.iter().map(|what| format!("it changed {what}")).collect();
        if now.folder != self.folder {
            let at = now.folder.map_or_else(|| "one that is gone".into(), |f| f.display().to_string());
            found.push(format!("it changed the working directory, to {at}"));
        }
        let signals = now.handlers.iter().zip(&self.handlers).enumerate().filter(|(_, (a, b))| a != b);
        found
            .extend(signals.map(|(i, _)| format!("it changed the handler of {}", signal_name(i as i32 + 1))));
        if let (Some(now), Some(before)) = (now.threads, self.threads)
            && now > before
        {
            found.push(format!("it left {} of its threads behind", now - before));
        }
        found
    }
}

#[cfg(unix)]
fn handlers() -> Vec<(usize, i64)> {
    let of = |signal| {
        // SAFETY: a struct of numbers and addresses, which may be zero.
        let mut action: libc::sigaction = unsafe { std::mem::zeroed() };
        // SAFETY: nothing is set; the handler is written to a struct of that type. An unknown signal leaves
        // it alone.
        unsafe { libc::sigaction(signal, std::ptr::null(), &mut action) };
        (action.sa_sigaction, i64::from(action.sa_flags))
    };
    (1..=64).map(of).collect()
}

#[cfg(not(unix))]
fn handlers() -> Vec<(usize, i64)> {
    Vec::new()
}

/// Number of threads of this process, where the system tells.
fn threads() -> Option<usize> {
    Some(std::fs::read_dir("/proc/self/task").ok()?.count())
}
