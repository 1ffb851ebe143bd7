//! Audio devices: lists them, and plays and records on one.
//!
//! Only this crate sees cpal. It knows nothing of graphs: a device calls a [`Process`] for every block to
//! play, and a [`Capture`] for every recorded block. [`hosts`] lists devices, [`open`] opens exactly the
//! device of a [`Request`]. [`simulated`] is a sound card for those who have none.

mod block;
mod bounded;
mod callback;
mod format;
mod hosts;
mod info;
mod request;
pub mod simulated;
mod stream;
mod watch;

pub use block::{Block, Capture, Captured, Process, now_ns};
pub use format::Format;
pub use info::{DeviceInfo, HostInfo, RATES_HZ, SideInfo, hosts};
pub use request::{Cause, OpenError, Request};
pub use stream::{Stats, Stream, open};
