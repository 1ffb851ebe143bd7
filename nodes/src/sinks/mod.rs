//! Ends of a graph: `audio_out`, `file_out`, `probe`.

mod audio_out;
mod file_out;
mod probe;

pub use audio_out::AudioOut;
pub use file_out::FileOut;
pub use probe::Probe;

use crate::prelude::*;

/// Checks that the parameter `file` ends in one of these ways.
fn check_file(setup: &Setup<'_>, ends: &[&str]) -> Result<(), Diagnostic> {
    let file = setup.params.text("file").to_lowercase();
    if ends.iter().any(|end| file.ends_with(end)) {
        return Ok(());
    }
    Err(setup.params.error("file", format!("cannot tell the format of {file:?}")).help(ends.join(", ")))
}
