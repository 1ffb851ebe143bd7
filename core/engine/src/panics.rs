//! Panics on the tick thread: caught, and silent.

#[cfg(panic = "abort")]
compile_error!("a node that panics is contained by unwinding: build with panic = \"unwind\"");

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

use asperity_node::Fault;

thread_local! {
    static IN_NODE: Cell<bool> = const { Cell::new(false) };
}

static HOOK: Once = Once::new();

/// Installs a panic hook that says nothing about panics inside nodes, because the default one prints on
/// the tick thread. Such panics are counted and named in the report.
pub(crate) fn install_silent_hook() {
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !IN_NODE.with(Cell::get) {
                before(info);
            }
        }));
    });
}

/// Runs a node's code and turns a panic into a fault.
pub(crate) fn contain<T>(f: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    let before = IN_NODE.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(f));
    IN_NODE.set(before);
    match result {
        Ok(answer) => answer,
        Err(payload) => {
            // The payload was allocated on this thread and is freed here, since a node may panic many
            // times before its quarantine. Its drop may panic too; then it is leaked.
            let inside = IN_NODE.replace(true);
            if let Err(payload) = panic::catch_unwind(AssertUnwindSafe(|| drop(payload))) {
                std::mem::forget(payload);
            }
            IN_NODE.set(inside);
            Err(Fault::Panicked)
        }
    }
}
