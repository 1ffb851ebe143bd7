//! What is let go while a graph plays: devices, and edits that nobody wants any more. It takes a while (a device's force is ramped
//! down first), and nobody waits for it but who opens others, and the end of the run.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Closings under way.
static UNDER_WAY: Mutex<usize> = Mutex::new(0);
/// There is another one, or one less.
static CHANGED: Condvar = Condvar::new();

/// One of the closings, from the call that begins it on: who opens something after that call waits for it.
struct Closing;

impl Closing {
    fn begin() -> Self {
        *count() += 1;
        CHANGED.notify_all();
        Self
    }
}

impl Drop for Closing {
    fn drop(&mut self) {
        *count() -= 1;
        CHANGED.notify_all();
    }
}

fn count() -> MutexGuard<'static, usize> {
    UNDER_WAY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Closes something on a thread of its own.
pub fn elsewhere(close: impl FnOnce() + Send + 'static) {
    let closing = Closing::begin();
    // Where there is no thread, what it would close is dropped here.
    let _ = std::thread::Builder::new().name("asperity-close".into()).spawn(move || {
        close();
        drop(closing);
    });
}

/// Waits until nothing is being closed. False for who is told that it is over: set that before a call of [`elsewhere`].
pub fn wait(over: &AtomicBool) -> bool {
    let _count = CHANGED
        .wait_while(count(), |count| *count > 0 && !over.load(Relaxed))
        .unwrap_or_else(PoisonError::into_inner);
    !over.load(Relaxed)
}

/// Waits until nothing is being closed, for so long at most.
pub fn wait_for(most: Duration) {
    let _ = CHANGED.wait_timeout_while(count(), most, |count| *count > 0);
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, mpsc};

    use super::*;

    #[test]
    fn who_opens_something_waits_for_what_was_closed_before_unless_it_is_over() {
        let (go, told) = mpsc::channel::<()>();
        let closed = Arc::new(AtomicBool::new(false));
        let done = closed.clone();
        elsewhere(move || {
            let _ = told.recv();
            std::thread::sleep(Duration::from_millis(20));
            done.store(true, Relaxed);
        });
        assert!(!wait(&AtomicBool::new(true)));
        wait_for(Duration::from_millis(1));
        assert!(!closed.load(Relaxed));
        go.send(()).expect("it waits");
        assert!(wait(&AtomicBool::new(false)) && closed.load(Relaxed));
    }
}
