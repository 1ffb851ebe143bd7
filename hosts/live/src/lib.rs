//! Runs a graph in real time.
//!
//! A driver calls the ticks: the audio callback itself, a thread paced by the callback's clock, or a timer
//! without audio. Before a tick, inputs are read at the tick's own time. After it, outputs go to their
//! sinks. The tick thread counts what happens; other threads read the counts.
//!
//! To change one thing, read: `session` for a run and its device, `graph_controller` for changes of the
//! graph, `player` for one tick, `driver` for the clocks, `output_limits` for the limits of the device.
//! `pulled` is a run in the audio callback of another program.

/// Gives types a `Debug` that shows their name alone, since their queues have none.
macro_rules! opaque_debug {
    ($($type:ty),*) => {$(
        impl std::fmt::Debug for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.debug_struct(stringify!($type)).finish_non_exhaustive()
            }
        }
    )*};
}

mod apart;
mod dll;
pub mod driver;
mod graph_controller;
mod layout;
mod meters;
mod output_limits;
mod player;
mod pulled;
mod ramp;
pub mod realtime;
mod remote_clock;
mod run_control;
mod sample;
mod session;
mod timeline;
pub mod view;

pub use apart::apart;
pub use asperity_audio::now_ns;
pub use dll::{BANDWIDTH_HZ, Dll, Heard, Line};
pub use graph_controller::{
    DOES_NOT_COME_BACK, DeviceQueues, GraphController, Recorded, needs_queues, prepare_live,
};
pub use meters::{Count, Histogram, Meters, Record};
pub use output_limits::{OutputLimits, SharedLimits, Standing};
pub use player::{
    HandInput, Listener, MicReader, MicWriter, Player, StylusReader, StylusRow, TapeReader, mic, place,
};
pub use pulled::Pulled;
pub use ramp::{DOWN_S, FED_S, Level, Ramp, START_S, STARVED_S, UNMUTE_S};
pub use remote_clock::{Order, RemoteClock};
pub use run_control::{RunControl, Unheard};
pub use sample::{
    ForceModel, ForceReader, ForceWriter, QUEUE, Sample, SampleReader, SampleWriter, force_model, samples,
};
pub use session::{CoilMonitor, Ended, Opened, Session, SessionError, SessionOptions, StartValues};
pub use timeline::{Reading, Seen, Timeline};
