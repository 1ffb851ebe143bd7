//! Panics inside a node: caught before they reach the host, and silent.

use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;
use std::sync::atomic::{AtomicUsize, Ordering};

use asperity_abi::{ASPERITY_FAILED, ASPERITY_PANICKED};

/// Number of calls of nodes in progress, on any thread. It is not thread-local, because the first
/// access to such a variable allocates, and that would be on the tick thread. This library's hook sees
/// only panics of this library.
static IN_NODES: AtomicUsize = AtomicUsize::new(0);

/// Installs a silent panic hook, because the default one prints on the tick thread. The host counts and
/// names faults instead.
pub(crate) fn install_silent_hook() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if IN_NODES.load(Ordering::Relaxed) == 0 {
                before(info);
            }
        }));
    });
}

/// Runs a node's code with the hook silent.
fn run<T>(f: impl FnOnce() -> T) -> std::thread::Result<T> {
    IN_NODES.fetch_add(1, Ordering::Relaxed);
    let result = panic::catch_unwind(AssertUnwindSafe(f));
    IN_NODES.fetch_sub(1, Ordering::Relaxed);
    result
}

/// Runs a node's code. `None` if it panicked.
pub(crate) fn caught<T>(f: impl FnOnce() -> T) -> Option<T> {
    // Dropping a payload would free memory on the tick thread and might panic again. The host's
    // quarantine bounds the leak.
    run(f).map_err(std::mem::forget).ok()
}

/// Runs a node's code off the tick thread. The error is the message of its panic.
pub(crate) fn heard<T>(f: impl FnOnce() -> T) -> Result<T, String> {
    run(f).map_err(|payload| match (payload.downcast_ref::<String>(), payload.downcast_ref::<&str>()) {
        (Some(text), _) => text.clone(),
        (_, Some(text)) => (*text).to_owned(),
        _ => "nothing is known of it".to_owned(),
    })
}

/// Runs a node's code that returns a status, or none where the host's data or the node does not allow it.
pub(crate) fn guarded(f: impl FnOnce() -> Option<i32>) -> i32 {
    caught(f).map_or(ASPERITY_PANICKED, |answer| answer.unwrap_or(ASPERITY_FAILED))
}
