//! Paths of shipped files on the command line.

use std::path::PathBuf;

use clap::builder::{PathBufValueParser, TypedValueParser};

use asperity_offline::shipped::found;
pub use asperity_offline::shipped::{file, files};

/// Parses a path to be read. A path that begins with `graphs/` and does not exist in the working directory
/// names a shipped file. The first one unpacks all of them to the user's data folder.
pub fn path() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(found)
}
