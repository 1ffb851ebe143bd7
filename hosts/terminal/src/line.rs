//! The line to the terminal: whether it is still there, and whether something was typed.

use std::io;
use std::time::Duration;

/// Waits until something may be there to be read, at most so long.
///
/// Reading the keys of a terminal that was closed never comes back and takes a processor: so it is looked after first.
///
/// # Errors
///
/// [`io::ErrorKind::BrokenPipe`] where the terminal is gone.
#[cfg(unix)]
pub(crate) fn wait(most: Duration) -> io::Result<()> {
    use std::io::IsTerminal as _;
    let of = |fd, events| libc::pollfd { fd, events, revents: 0 };
    // Standard output is the terminal. What is typed comes over standard input, or is found by who reads it.
    let mut fds = [of(libc::STDOUT_FILENO, 0), of(libc::STDIN_FILENO, libc::POLLIN)];
    let typed = io::stdin().is_terminal();
    let count = if typed { 2 } else { 1 };
    let most = if typed { most } else { most / 4 };
    // SAFETY: the first `count` of the two are there, and live as long as the call.
    let told =
        unsafe { libc::poll(fds.as_mut_ptr(), count, i32::try_from(most.as_millis()).unwrap_or(i32::MAX)) };
    let gone = fds.iter().any(|fd| fd.revents & (libc::POLLHUP | libc::POLLERR | libc::POLLNVAL) != 0);
    if told > 0 && gone { Err(io::ErrorKind::BrokenPipe.into()) } else { Ok(()) }
}

/// Elsewhere reading waits by itself.
#[cfg(not(unix))]
pub(crate) fn wait(_: Duration) -> io::Result<()> {
    Ok(())
}
