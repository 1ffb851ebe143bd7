//! Panics inside a node: caught before they reach the host, and silent.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

use asperity_abi::ASPERITY_PANICKED;

thread_local! {
    static IN_NODE: Cell<bool> = const { Cell::new(false) };
}

/// The default hook prints on the tick thread; faults are counted and named by the host instead.
pub(crate) fn install_silent_hook() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !IN_NODE.with(Cell::get) {
                before(info);
            }
        }));
    });
}

/// Runs a node's code. `None` if it panicked.
pub(crate) fn caught<T>(f: impl FnOnce() -> T) -> Option<T> {
    let before = IN_NODE.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(f));
    IN_NODE.set(before);
    // Dropping a payload would free memory on the tick thread and might panic again. The host's quarantine bounds what leaks.
    result.map_err(std::mem::forget).ok()
}

/// The same for code that answers a status.
pub(crate) fn guarded(f: impl FnOnce() -> i32) -> i32 {
    caught(f).unwrap_or(ASPERITY_PANICKED)
}
