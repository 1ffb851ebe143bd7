//! Errors of a source's start.

use std::fmt;

/// Remedy of a [`HandError`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Next {
    /// Change an option: its value is invalid.
    Option,
    /// Install, start or plug in something; then try again.
    Provide,
    /// Wait until another program releases it, or choose another one.
    Free,
}

/// Why a source does not start, and what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HandError {
    /// The fault.
    pub message: String,
    /// The remedy.
    pub help: String,
    /// Kind of remedy.
    pub next: Next,
}

impl HandError {
    /// An invalid option.
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
