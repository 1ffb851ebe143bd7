//! Audio devices: lists them, and plays and records on one.
//!
//! Only this crate sees cpal. It knows nothing of graphs: a device calls a [`Process`] for every block to
//! play, and a [`Capture`] for every recorded block. [`hosts`] lists devices, [`open`] opens exactly the
//! device of a [`Request`], and [`Event`]s report what happens to it. [`simulated`] is a sound card for
//! those who have none.

mod block;
mod bounded;
mod callback;
mod event;
mod find;
mod format;
mod hosts;
mod info;
mod jack;
mod plan;
mod quiet;
mod request;
mod roll;
pub mod simulated;
mod stream;
mod watch;

pub use block::{Block, Capture, Captured, Process, now_ns};
pub use event::{Event, Events, events};
pub use format::Format;
pub use info::{DeviceInfo, HostInfo, RATES_HZ, SideInfo, devices, hosts};
pub use request::{OpenError, Request};
pub use stream::{Stats, Stream, open};
