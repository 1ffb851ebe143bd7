//! Calls into audio servers that may never answer.

use std::collections::BTreeSet;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::quiet::hush_alsa;

/// Hosts in which a call hangs. Another one is not begun before that has come back, so that threads do not pile up.
static HANGING: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

enum Answer<T> {
    Awaited,
    /// None: the call panicked.
    Here(Option<T>),
    Abandoned,
}

/// The slot of an answer, and what tells of it.
type Place<T> = Arc<(Mutex<Answer<T>>, Condvar)>;

/// Gives the answer when it is dropped, so that a call that panics comes back too.
struct Return<T> {
    host: String,
    place: Place<T>,
    answer: Option<T>,
}

impl<T> Drop for Return<T> {
    fn drop(&mut self) {
        let (slot, told) = &*self.place;
        let mut slot = lock(slot);
        if matches!(*slot, Answer::Abandoned) {
            lock(&HANGING).remove(&self.host);
        } else {
            *slot = Answer::Here(self.answer.take());
            told.notify_one();
        }
    }
}

/// Runs `call` on a thread of its own, where ALSA's library prints nothing. None where it takes longer than `limit`, or where an
/// earlier call into the same host still hangs; the thread is left to its fate then, and what it answers is dropped. None, at once,
/// where it panics.
pub(crate) fn bounded<T: Send + 'static>(
    host: &str,
    limit: Duration,
    call: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    if lock(&HANGING).contains(host) {
        return None;
    }
    let place: Place<T> = Arc::new((Mutex::new(Answer::Awaited), Condvar::new()));
    let back = Return { host: host.to_owned(), place: place.clone(), answer: None };
    std::thread::spawn(move || {
        hush_alsa();
        let mut back = back;
        back.answer = Some(call());
    });
    let (slot, told) = &*place;
    let waiting = |answer: &mut Answer<T>| matches!(answer, Answer::Awaited);
    let (mut slot, _) =
        told.wait_timeout_while(lock(slot), limit, waiting).unwrap_or_else(PoisonError::into_inner);
    match std::mem::replace(&mut *slot, Answer::Abandoned) {
        Answer::Here(answer) => answer,
        _ => {
            lock(&HANGING).insert(host.to_owned());
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_that_hangs_is_left_alone_until_it_answers() {
        let (go, wait) = std::sync::mpsc::channel::<()>();
        let short = Duration::from_millis(20);
        assert_eq!(bounded("one", short, move || wait.recv().is_ok()), None);
        assert_eq!(bounded("one", short, || true), None);
        assert_eq!(bounded("two", Duration::from_secs(10), || true), Some(true));
        go.send(()).unwrap();
        while lock(&HANGING).contains("one") {
            std::thread::yield_now();
        }
        assert_eq!(bounded("one", Duration::from_secs(10), || true), Some(true));
    }

    #[test]
    fn a_call_that_panics_does_not_close_its_host_for_ever() {
        let long = Duration::from_secs(60);
        assert_eq!(bounded("panics", long, || -> bool { panic!("within the host") }), None);
        assert_eq!(bounded("panics", long, || true), Some(true));
        // The same where nobody waits any more.
        let (go, wait) = std::sync::mpsc::channel::<()>();
        let late = move || -> bool { panic!("late: {:?}", wait.recv()) };
        assert_eq!(bounded("panics", Duration::from_millis(20), late), None);
        assert!(lock(&HANGING).contains("panics"));
        go.send(()).unwrap();
        let began = std::time::Instant::now();
        while lock(&HANGING).contains("panics") {
            assert!(began.elapsed() < long, "it hangs for ever");
            std::thread::yield_now();
        }
    }
}
