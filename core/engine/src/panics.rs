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

/// Puts a hook before the program's own that says nothing about panics inside nodes: the default one prints
/// on the tick thread. They are counted and named in the report instead.
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

/// Runs a node's code. After a panic its state is as that left it.
pub(crate) fn contain<T>(f: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    let before = IN_NODE.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(f));
    IN_NODE.set(before);
    match result {
        Ok(answer) => answer,
        Err(payload) => {
            // The panic allocated it here; it is freed here, since a node may panic for as long as it is
            // forgiven. What it carries may be anything, and may panic in its turn: that is left where it
            // is.
            let inside = IN_NODE.replace(true);
            if let Err(payload) = panic::catch_unwind(AssertUnwindSafe(|| drop(payload))) {
                std::mem::forget(payload);
            }
            IN_NODE.set(inside);
            Err(Fault::Panicked)
        }
    }
}
