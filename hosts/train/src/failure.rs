//! Reasons for an early end of a run.

use asperity_diagnostics::Diagnostic;

/// Reasons for an early end of a run.
#[derive(Debug)]
pub(crate) enum Failure {
    /// A file, a name or a range.
    Input(Diagnostic),
    /// Invalid training or result.
    Model(String),
    /// Stopped by the user; everything is kept.
    Stopped,
}

impl From<Diagnostic> for Failure {
    fn from(e: Diagnostic) -> Self {
        Self::Input(e)
    }
}
