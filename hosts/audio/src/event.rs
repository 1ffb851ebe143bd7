//! Events of a stream for the control thread.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// An event of a stream.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// The host reports late or lost samples.
    Xrun,
    /// The device did not call for a time, and then called again.
    Gap {
        /// Time between two calls [ms].
        ms: f64,
    },
    /// The stream has ended: it is closed and will not call again. Comes once.
    Lost {
        /// Reason for a user.
        reason: String,
    },
}

/// Sender of a stream's events, on a thread that may wait, never the audio thread.
pub type Events = SyncSender<Event>;

/// A channel for [`Events`]. If nobody reads, events are dropped, except the loss of the stream, which
/// waits for room.
pub fn events() -> (Events, Receiver<Event>) {
    sync_channel(256)
}
