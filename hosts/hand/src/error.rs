//! What keeps a source from starting.

use std::fmt;

/// What the caller can do about a [`HandError`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Next {
    /// Change an option: what is written cannot be meant.
    Option,
    /// Install or start something, or plug it in; then try again.
    Provide,
    /// Wait until somebody else lets go of it, or choose another.
    Free,
}

/// Why a source does not start: what was found, and what would do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HandError {
    /// What was found.
    pub message: String,
    /// What would do.
    pub help: String,
    /// Which of the caller's doings that is.
    pub next: Next,
}

impl HandError {
    /// An option that cannot be meant.
    pub(crate) fn option(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: help.into(), next: Next::Option }
    }

    /// Something that is not there.
    pub(crate) fn missing(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: help.into(), next: Next::Provide }
    }

    /// Something that another holds.
    pub(crate) fn taken(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: help.into(), next: Next::Free }
    }
}

impl fmt::Display for HandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", self.message, self.help)
    }
}

impl std::error::Error for HandError {}
