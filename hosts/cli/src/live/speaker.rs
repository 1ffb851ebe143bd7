//! Lines of text to the standard error, which nobody may be reading: a run never waits for them.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::failure::complain;

/// Lines that may wait to be written; of more, the newest are left out.
const LINES: usize = 256;
/// How long the end of a run waits for the last of them.
const PATIENCE: Duration = Duration::from_millis(500);

/// Says things from a thread of its own.
pub struct Speaker(Option<(SyncSender<String>, JoinHandle<()>)>);

impl Speaker {
    /// A speaker; a quiet one says nothing.
    pub fn new(quiet: bool) -> Self {
        let (to, lines): (_, Receiver<String>) = sync_channel(LINES);
        let write = move || lines.iter().for_each(|line| complain(&line));
        let thread = (!quiet).then(|| std::thread::Builder::new().name("asperity-say".into()).spawn(write));
        Self(thread.and_then(Result::ok).map(|thread| (to, thread)))
    }

    /// Says a line.
    pub fn say(&self, text: &str) {
        if let Some((to, _)) = &self.0 {
            let _ = to.try_send(format!("{text}\n"));
        }
    }

    /// Waits until all is written, if somebody reads it.
    pub fn close(self) {
        let Some((to, thread)) = self.0 else { return };
        drop(to);
        let began = Instant::now();
        while !thread.is_finished() && began.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}
