//! Hot swap: a running engine takes over another graph at the start of a tick.
//!
//! The control thread works out which nodes stay ([`plan`]), which old ones run on for as long as it
//! fades ([`shadow`]), in which order all of them run ([`order`]), and allocates everything ([`build`]).
//! The tick thread exchanges parts in place ([`takeover`]) and crossfades what is heard from elsewhere
//! than before ([`crossfade`]); when it has faded, all that is left of the old graph goes back in one
//! box.
//!
//! Measured with `cargo bench --bench swap` built as tests are, on two busy cores of an EPYC, medians: a
//! tick of the shipped graph is 22 us; the tick that takes over another phase retrieval 30 us, the others
//! of its fade 24 us; where every node is rebuilt, the network among them, 93 us and 49 us. The control
//! thread takes 80 us beside compiling.

mod build;
mod control;
mod crossfade;
mod order;
mod plan;
mod report;
mod shadow;
mod takeover;

pub(crate) use build::{buffers, fed_audio};
pub use control::{Controller, MAX_SWAPS};
pub use crossfade::CROSSFADE_S;
pub(crate) use order::Run;
pub use report::{Change, Finished, NodeChange, ParameterChange, ParameterError, SwapError, SwapReport};
pub(crate) use takeover::Link;
