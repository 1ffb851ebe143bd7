//! Calls into a plugin's code.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use asperity_numbers::denormals::FloatControl;

/// Parts of the float control that plugins left changed, until they are asked for.
static CHANGED: AtomicU64 = AtomicU64::new(0);

/// Runs a plugin's code. How this thread rounds is afterwards as it was: other nodes run on it too.
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

/// What plugins changed, since this was last asked, about how numbers are rounded; it was put back each time.
pub fn float_changes() -> Vec<String> {
    FloatControl::parts(CHANGED.swap(0, Relaxed))
}
