//! The interface as a C plugin sees it.

mod growth;
mod header;
mod layout;
