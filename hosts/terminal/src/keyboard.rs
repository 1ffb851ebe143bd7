//! The reading thread.
//!
//! Keys have a thread of their own. Reading from a terminal whose window was closed may never return, and
//! keys that stop or mute the run do not wait for a frame.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, TrySendError, sync_channel};
use std::time::Duration;

use asperity_live::RunControl;
use ratatui::crossterm::event::{self, Event};

use crate::keys::at_once;

/// Most keys that wait for a frame.
pub(crate) const KEYS: usize = 64;
/// Longest wait for a key, before the thread looks whether it is still needed.
const WAIT: Duration = Duration::from_millis(50);
/// Longest wait for a key that [`wait`] has seen.
const SEEN: Duration = if cfg!(unix) { Duration::ZERO } else { WAIT };

/// Keys read by a thread of its own; the thread ends after a drop.
pub(crate) struct Keyboard {
    /// Events for the next frame. Disconnected when the terminal is gone.
    pub(crate) events: Receiver<Event>,
    over: Arc<AtomicBool>,
}

impl Keyboard {
    /// Starts the thread. Keys that stop or mute act on `run_control` at once.
    pub(crate) fn start(run_control: RunControl) -> io::Result<Self> {
        let (to, events) = sync_channel(KEYS);
        let over = Arc::new(AtomicBool::new(false));
        let ended = over.clone();
        let read = move || {
            while !ended.load(Relaxed) {
                let seen = wait(WAIT).and_then(|()| event::poll(SEEN));
                let next = seen.and_then(|seen| seen.then(event::read).transpose());
                match next {
                    Ok(Some(Event::Key(key))) if at_once(&key, &run_control) => {}
                    Ok(Some(event)) => {
                        // A key too many is dropped: the thread goes on with those that stop and mute.
                        if let Err(TrySendError::Disconnected(_)) = to.try_send(event) {
                            break;
                        }
                    }
                    Ok(None) => {}
                    Err(_) => break,
                }
            }
        };
        std::thread::Builder::new().name("asperity-keys".into()).spawn(read)?;
        Ok(Self { events, over })
    }
}

impl Drop for Keyboard {
    fn drop(&mut self) {
        self.over.store(true, Relaxed);
    }
}

/// Waits until there may be something to read, at most `most`.
///
/// A read from a closed terminal never returns and keeps a processor busy. So the line is checked first.
///
/// # Errors
///
/// [`io::ErrorKind::BrokenPipe`] where the terminal is gone.
#[cfg(unix)]
fn wait(most: Duration) -> io::Result<()> {
    use std::io::IsTerminal as _;
    let of = |fd, events| libc::pollfd { fd, events, revents: 0 };
    // Standard output is the terminal. Keys come over standard input, or crossterm finds them.
    let mut fds = [of(libc::STDOUT_FILENO, 0), of(libc::STDIN_FILENO, libc::POLLIN)];
    let typed = io::stdin().is_terminal();
    let count = if typed { 2 } else { 1 };
    let most = if typed { most } else { most / 4 };
    // SAFETY: the first `count` of the two entries exist and outlive the call.
    let ready =
        unsafe { libc::poll(fds.as_mut_ptr(), count, i32::try_from(most.as_millis()).unwrap_or(i32::MAX)) };
    let gone = fds.iter().any(|fd| fd.revents & (libc::POLLHUP | libc::POLLERR | libc::POLLNVAL) != 0);
    if ready > 0 && gone { Err(io::ErrorKind::BrokenPipe.into()) } else { Ok(()) }
}

/// Elsewhere [`event::poll`] waits by itself.
#[cfg(not(unix))]
fn wait(_: Duration) -> io::Result<()> {
    Ok(())
}
