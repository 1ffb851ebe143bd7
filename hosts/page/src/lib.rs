//! Pages of a program in a browser, and control of a run by other programs.
//!
//! The live page is a surface to stroke, and the figures of a running graph. Pages and other programs control
//! the run by one protocol, whose table is [`MESSAGES`].
//! [`serve`] starts a server on a thread of its own. The control thread of a run hands figures to a
//! [`Feed`] and never waits for a page. Strokes on the page come out of an [`asperity_live::SampleReader`],
//! requests out of the run's [`asperity_live::RunControl`]. The tick thread is not involved.
//!
//! [`screen()`] starts a server of its own for the participant or the experimenter of a study. It shows the
//! states that the host gives it, and hands presses to the host. It keeps nothing.
//!
//! A server is bound to the loopback address unless the user names another. Only programs that know the
//! token in the address are served. `Host` must be the address that the connection came to, or the loopback
//! address, with our port: a foreign name that resolves to this machine is refused. `Origin`, where a
//! request has one, must be this page. The page loads nothing from elsewhere, and forbids the
//! browser to do so.
//!
//! The cost is bounded. There are at most [`CONNECTIONS`] connections with the token and as many without,
//! [`PAGES`] pages and programs with a WebSocket, and [`CLIENTS`] programs with OSC. [`AHEAD`] views are on
//! the way to each page. Messages have at most [`MESSAGE`] bytes, at a limited rate. A page that acknowledges
//! no view for [`PATIENCE`] is disconnected.

mod client;
mod control;
mod door;
mod feed;
mod hand;
mod map;
mod pad;
mod pictures;
mod renders;
mod screen;
mod server;
mod site;
mod stroke;
mod wire;

pub use control::osc::{CLIENTS, SILENCE};
pub use control::{Argument, Kind, MESSAGES, Message, Way, table};
pub use door::CONNECTIONS;
pub use feed::Feed;
pub use map::Map;
pub use renders::Rendered;
pub use screen::{PRESS, Pressed, Screen, Who, screen};
pub use server::{PAGES, Page, serve};
pub use site::{Options, Serves};
pub use wire::{AHEAD, MESSAGE, PATIENCE};
