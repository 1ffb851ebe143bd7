//! The program around this crate: it shows warnings, and answers questions about plugins.

use std::path::Path;
use std::sync::OnceLock;

use asperity_diagnostics::Diagnostic;

/// Functions of the program. Each may be called from any thread.
#[derive(Clone, Copy, Debug)]
pub struct Host {
    /// Shows a warning: a sentence without an end.
    pub warn: fn(&str),
    /// Asks the user whether a graph may load a plugin: the graph, the plugin.
    pub ask: fn(&Path, &Path) -> bool,
    /// Tries a plugin in another process, before it runs in this one: the plugin, a copy of it.
    pub survives: fn(&Path, &Path) -> Result<(), Diagnostic>,
}

static HOST: OnceLock<Host> = OnceLock::new();

/// Without a program, as in tests: warnings go to the standard error, and nobody is asked.
const NONE: Host =
    Host { warn: |message| eprintln!("warning: {message}"), ask: |_, _| false, survives: |_, _| Ok(()) };

/// Sets the program, once and before all else.
pub fn set(host: Host) {
    let _ = HOST.set(host);
}

pub(crate) fn host() -> Host {
    *HOST.get().unwrap_or(&NONE)
}

/// Shows a warning.
pub fn warn(message: &str) {
    (host().warn)(message);
}
