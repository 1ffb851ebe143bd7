//! What every kind of node must pass, built in or from a plugin.
//!
//! [`cases`] are run over a [`Subject`]: a kind, settings for the parameters it must be given, and what counts the heap. The kind is
//! put into graphs by the real compiler, with a signal at every input and a probe at every output, and its processor is then
//! called as the engine calls it, but without containing anything: a value that is not finite is found where it appears, and a
//! NaN can be put in. One case runs the same graph through the engine itself and compares to the bit.
//!
//! What comes in is uniform noise, zeros, steps, denormals, values to 1e6 (frames to 1e30), NaN and infinities, and stretches of
//! silence of random length with frames that do not come.

mod cases;
mod fixtures;
mod place;
mod signal;
mod stand;
mod subject;
mod trace;

pub use cases::{Case, Outcome, TickTime, Verdict, cases, tick_time};
pub use subject::{Heap, Nobody, Subject, Touched, Witness};
