//! The page's server by the library's own interface, with a made-up run behind it: sockets, and a browser.

mod browser;
mod made_up;
mod sockets;
