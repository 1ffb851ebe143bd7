//! Runs a graph in real time.
//!
//! A driver says when the next tick is due: the audio callback itself, a thread that is paced by a delay-locked loop on the
//! callback's clock, or a timer where there is no audio. Before a tick, inputs are read at the tick's own time; after it,
//! sinks are handed on. What happens is counted on the tick thread and looked at from others.

mod conductor;
mod driver;
mod force;
mod layout;
mod player;
mod sample;
mod timeline;
pub mod view;

pub use asperity_audio::now_ns;
pub use conductor::{Conductor, Ends, FORCES, HANDS, conduct};
pub use force::{ForceModel, ForceReader, ForceWriter, force_model};
pub use player::{MicReader, MicWriter, Player, TapeReader, mic};
pub use sample::{QUEUE, Sample, SampleReader, SampleWriter, samples};
