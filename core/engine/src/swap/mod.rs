//! Hot swap: a running engine takes over another graph at the start of a tick.
//!
//! The control thread works out which nodes stay ([`plan`]), which old ones run on for as long as it fades
//! ([`shadow`]), in which order all of them run ([`order`]), and allocates everything ([`build`]). The tick thread
//! exchanges parts in place ([`takeover`]) and crossfades what is heard from elsewhere than before ([`crossfade`]); when
//! it has faded, all that is left of the old graph goes back in one box.

mod build;
mod control;
mod crossfade;
mod order;
mod plan;
mod report;
mod shadow;
mod takeover;

pub(crate) use build::buffers;
pub use control::{Controller, MAX_SWAPS};
pub use crossfade::CROSSFADE_S;
pub(crate) use order::Run;
pub use report::{Change, Finished, NodeChange, ParameterChange, ParameterError, SwapError, SwapReport};
pub(crate) use takeover::Link;
