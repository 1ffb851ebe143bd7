//! Where a hand's motion comes from, and how a device pushes back.
//!
//! A source runs on a thread of its own and sends [`Sample`](asperity_live::Sample)s to the tick thread: [`osc`] hears packets of
//! a network, [`openhaptics`] and [`haply`] read force-feedback devices. A device that can push evaluates the
//! [`ForceModel`](asperity_live::ForceModel) that the graph publishes in its own loop, by the law in [`servo`]. Every source is started by a function
//! that answers a [`Handle`]; it stops when the handle is dropped.

mod error;
mod frame;
mod handle;
pub mod haply;
pub mod openhaptics;
pub mod osc;
pub mod servo;

pub use error::{HandError, Next};
pub use frame::Frame;
pub use handle::{Device, Handle};
