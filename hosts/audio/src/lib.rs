//! Audio devices: what there is, and how to play on one.
//!
//! This is the only crate that sees cpal. It knows nothing of graphs: a device calls a [`Process`] for
//! every block it wants, and a [`Capture`] for every block it recorded. [`hosts`] says what there is,
//! [`open`] opens what a [`Request`] asks for and nothing else, and [`Event`]s say what happens to it.
//! [`simulated`] is a sound card for those who have none.

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
