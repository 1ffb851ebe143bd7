//! Calls into a plugin's code.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use asperity_numbers::denormals::FloatControl;

/// Parts of the float control that plugins left changed since the last question.
static CHANGED: AtomicU64 = AtomicU64::new(0);

/// Runs a plugin's code, then restores this thread's float control: other nodes run on it too.
#[inline]
pub(crate) fn foreign<T>(call: impl FnOnce() -> T) -> T {
    let before = FloatControl::now();
    let answer = call();
    let changed = FloatControl::now().bits(before);
    if changed != 0 {
        before.restore();
        CHANGED.fetch_or(changed, Relaxed);
    }
    answer
}

/// Parts of the float control that plugins changed since the last call; each change was undone.
pub fn float_changes() -> Vec<String> {
    FloatControl::parts(CHANGED.swap(0, Relaxed))
}
