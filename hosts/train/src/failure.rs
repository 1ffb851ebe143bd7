//! Why a run ended early.

use asperity_diagnostics::Diagnostic;

/// Why a run ended early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// A file, a name or a range.
    Input(Diagnostic),
    /// The training or its result is not what it must be.
    Model(String),
    /// The user asked for it; everything is kept.
    Stopped,
}

impl From<Diagnostic> for Failure {
    fn from(e: Diagnostic) -> Self {
        Self::Input(e)
    }
}
