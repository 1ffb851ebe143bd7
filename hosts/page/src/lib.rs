//! The live page: a surface to stroke, and what a running graph does, in a browser on this machine.
//!
//! [`serve`] starts a server on a thread of its own. The control thread of a run hands its figures to a [`Feed`] and goes on at
//! once, whatever the pages do; what a hand does on the page comes out of an
//! [`asperity_live::SampleReader`], and what a person asks for out of the run's [`asperity_live::Reins`]. The tick thread knows nothing of all this.
//!
//! Who may look: programs on this machine that know the token in the address. Every request names its host, which must be
//! the loopback address or `localhost` with our port, so that a foreign name that resolves to this machine gets nothing; where it names an
//! origin, that must be this page. Nothing is loaded from elsewhere, and the browser is told to load nothing from elsewhere.
//!
//! The cost of a page is bounded: [`CONNECTIONS`] connections with the token and as many without, [`PAGES`]
//! pages that watch, [`AHEAD`] views on the way to each of them, messages of [`MESSAGE`] bytes and so many a
//! second. A page that does not say for [`PATIENCE`] that it has got a view is let go.

mod client;
mod door;
mod feed;
mod guard;
mod hand;
mod server;
mod wire;

pub use feed::Feed;
pub use server::{CONNECTIONS, Counts, Options, PAGES, Page, serve};
pub use wire::{AHEAD, MESSAGE, PATIENCE};
