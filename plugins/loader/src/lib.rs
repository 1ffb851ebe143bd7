//! Loads plugins and makes their nodes look like any others.
//!
//! [`Plugin::load`] looks into the file before the system's loader does: that it is a whole shared
//! library for this machine that exports the entry symbol. Then a copy of it with a name of its own is
//! loaded (so that a file can be rebuilt and loaded again while the old code still runs), and is never
//! unloaded. Every descriptor is checked before a kind is offered.
//!
//! A plugin is code in this process: what it does wrong by its return values, by a panic that it caught,
//! or by a NaN is contained by the engine. A segmentation fault is not, and cannot be; of an endless loop
//! the host takes care.

mod cache;
mod checked;
mod describe;
mod file;
mod foreign;
mod kind;
mod plugin;
mod processor;
mod search;
mod setup;

pub use cache::Loader;
pub use file::{Copy, loaded_copies};
pub use foreign::float_changes;
pub use plugin::Plugin;
pub use search::{Found, PATH_VARIABLE, file_name, find, is_path, search};
