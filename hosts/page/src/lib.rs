//! The live page: a surface to stroke, and the figures of a running graph, in a browser on this machine.
//!
//! [`serve`] starts a server on a thread of its own. The control thread of a run hands figures to a
//! [`Feed`] and never waits for a page. Strokes on the page come out of an [`asperity_live::SampleReader`],
//! requests out of the run's [`asperity_live::RunControl`]. The tick thread is not involved.
//!
//! Only programs on this machine that know the token in the address are served. `Host` must be the loopback
//! address or `localhost` with our port: a foreign name that resolves to this machine is refused. `Origin`,
//! where a request has one, must be this page. The page loads nothing from elsewhere, and forbids the
//! browser to do so.
//!
//! The cost is bounded: [`CONNECTIONS`] connections with the token and as many without, [`PAGES`] pages,
//! [`AHEAD`] views on the way to each, and messages of [`MESSAGE`] bytes at a limited rate. A page that
//! acknowledges no view for [`PATIENCE`] is disconnected.

mod client;
mod door;
mod feed;
mod hand;
mod pictures;
mod server;
mod wire;

pub use feed::Feed;
pub use server::{CONNECTIONS, Options, PAGES, Page, serve};
pub use wire::{AHEAD, MESSAGE, PATIENCE};
