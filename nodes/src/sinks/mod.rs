//! Ends of a graph: `audio_out`, `file_out`, `probe`.

mod audio_out;
mod file_out;
mod probe;

pub use audio_out::AudioOut;
pub use file_out::FileOut;
pub use probe::Probe;
