//! Loads plugins and offers their nodes like built-in ones.
//!
//! [`Plugin::load`] first checks the file: a whole shared library for this machine that exports the
//! entry symbol. Then it loads a copy of the file under a unique name, so that the file can be rebuilt
//! and loaded again while the old code runs. Copies are never unloaded. Every descriptor is checked
//! before a kind is offered.
//!
//! A plugin is code in this process. Its error codes, its caught panics and its NaNs are contained by
//! the engine. A segmentation fault cannot be contained; the host handles an endless loop.

mod cache;
mod checked;
mod describe;
mod effect;
mod file;
mod foreign;
mod kind;
mod plugin;
mod processor;
#[cfg(test)]
mod round_trip_tests;
mod said;
mod search;
mod setup;

pub use cache::Loader;
pub use file::{Copy, loaded_copies};
pub use foreign::float_changes;
pub use plugin::Plugin;
pub use search::{Found, PATH_VARIABLE, file_name, find, is_path, search};
