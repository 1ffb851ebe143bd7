//! What happens to a stream, told to the control thread.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Something that happened to a stream.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// The host says that samples were late or lost.
    Xrun,
    /// The device did not call for this long, and called again.
    Gap {
        /// Time between two calls [ms].
        ms: f64,
    },
    /// The stream is over: it has been closed and will not call again. Comes once.
    Lost {
        /// Why, in words for a user.
        reason: String,
    },
}

/// Where a stream sends its events: from a thread that may wait, never from the audio thread.
pub type Events = SyncSender<Event>;

/// A channel for [`Events`]. Where nobody reads, events are dropped; the loss of a stream waits for room.
pub fn events() -> (Events, Receiver<Event>) {
    sync_channel(256)
}
