//! Calls into audio servers that may never return.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::sync_channel;
use std::time::Duration;

use parking_lot::Mutex;

use crate::quiet::hush_alsa;

/// Hosts with a call that hangs. No other call into such a host is made until it returns, so that threads
/// do not pile up.
static HANGING: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Runs `call` on a thread of its own, with ALSA's messages off. `None` if the call takes longer than
/// `limit`, if an earlier call into the same host still hangs, or (at once) if the call panics. A call that
/// takes too long keeps its thread; its result is dropped.
pub(crate) fn bounded<T: Send + 'static>(
    host: &str,
    limit: Duration,
    call: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    if HANGING.lock().contains(host) {
        return None;
    }
    let (to, from) = sync_channel(1);
    let name = host.to_owned();
    std::thread::spawn(move || {
        hush_alsa();
        let answer = catch_unwind(AssertUnwindSafe(call)).ok();
        // The caller gives up under the same lock: either it has this answer, or the send fails.
        let mut hanging = HANGING.lock();
        let given_up = to.send(answer);
        if given_up.is_err() {
            hanging.remove(&name);
        }
        // Dropping the answer may take long: not under the lock.
        drop(hanging);
        drop(given_up);
    });
    if let Ok(answer) = from.recv_timeout(limit) {
        return answer;
    }
    let mut hanging = HANGING.lock();
    let answer = from.try_recv();
    if answer.is_err() {
        hanging.insert(host.to_owned());
    }
    drop(from);
    answer.ok().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hanging_host_is_left_alone_until_it_answers() {
        let (go, wait) = std::sync::mpsc::channel::<()>();
        let short = Duration::from_millis(20);
        assert_eq!(bounded("one", short, move || wait.recv().is_ok()), None);
        assert_eq!(bounded("one", short, || true), None);
        assert_eq!(bounded("two", Duration::from_secs(10), || true), Some(true));
        go.send(()).unwrap();
        while HANGING.lock().contains("one") {
            std::thread::yield_now();
        }
        assert_eq!(bounded("one", Duration::from_secs(10), || true), Some(true));
    }

    #[test]
    fn panicking_call_does_not_close_its_host() {
        let long = Duration::from_secs(60);
        assert_eq!(bounded("panics", long, || -> bool { panic!("within the host") }), None);
        assert_eq!(bounded("panics", long, || true), Some(true));
        // The same where nobody waits any more.
        let (go, wait) = std::sync::mpsc::channel::<()>();
        let late = move || -> bool { panic!("late: {:?}", wait.recv()) };
        assert_eq!(bounded("panics", Duration::from_millis(20), late), None);
        assert!(HANGING.lock().contains("panics"));
        go.send(()).unwrap();
        let began = std::time::Instant::now();
        while HANGING.lock().contains("panics") {
            assert!(began.elapsed() < long, "it hangs for ever");
            std::thread::yield_now();
        }
    }
}
