//! Calls into audio servers that may never return, and that print their errors.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::sync_channel;
use std::time::Duration;

use parking_lot::Mutex;

/// Silences ALSA's library on the calling thread from now on. Does not allocate or wait.
pub(crate) fn hush_alsa() {
    #[cfg(target_os = "linux")]
    {
        use std::ffi::{c_char, c_int};
        unsafe extern "C" fn nothing(
            _file: *const c_char,
            _line: c_int,
            _function: *const c_char,
            _error: c_int,
            _format: *const c_char,
            _arguments: *mut alsa_sys::__va_list_tag,
        ) {
        }
        // SAFETY: the handler has the type ALSA asks for, touches none of its arguments and lives as long
        // as the program. It is set for this thread only. (The handler for all threads is variadic, which
        // stable Rust cannot write.)
        unsafe { alsa_sys::snd_lib_error_set_local(Some(nothing)) };
    }
}

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
    // A send succeeds only if the caller takes the answer: it has that, or the host hangs.
    let (to, from) = sync_channel(0);
    let name = host.to_owned();
    std::thread::spawn(move || {
        hush_alsa();
        let given_up = to.send(catch_unwind(AssertUnwindSafe(call)).ok());
        if given_up.is_err() {
            HANGING.lock().remove(&name);
        }
    });
    let answer = from.recv_timeout(limit);
    if answer.is_err() {
        HANGING.lock().insert(host.to_owned());
    }
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
        while HANGING.lock().contains("panics") {
            std::thread::yield_now();
        }
    }
}
