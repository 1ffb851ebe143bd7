//! Signals that come from nowhere else in a graph: `audio_in`.

mod audio_in;

pub use audio_in::AudioIn;
