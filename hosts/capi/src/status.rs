//! Statuses and texts of errors, and the border that no panic crosses.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use asperity_offline::failure::Failure;

/// Result of a function: one of the values below. `asperity_last_error` has the reason.
pub type AsperityStatus = i32;

/// Done.
pub const ASPERITY_OK: AsperityStatus = 0;
/// An argument, a handle or a file is wrong. Nothing changed. Do not try again with the same.
pub const ASPERITY_INVALID: AsperityStatus = 1;
/// Another thread is in a call with this handle, or a queue is full. Nothing changed. Try again later.
pub const ASPERITY_BUSY: AsperityStatus = 2;
/// The run broke off, or the machine refused. Free the handle.
pub const ASPERITY_FAILED: AsperityStatus = 3;

/// Why something was not done.
#[derive(Debug)]
pub(crate) struct Refusal {
    status: AsperityStatus,
    text: Cow<'static, CStr>,
}

pub(crate) type Answer<T = ()> = Result<T, Refusal>;

/// A text with a zero byte at its end, in place of any within.
pub(crate) fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', "\\0")).unwrap_or_default()
}

impl Refusal {
    /// A refusal of a real-time function, which must not allocate.
    pub(crate) const fn fixed(status: AsperityStatus, text: &'static CStr) -> Self {
        Self { status, text: Cow::Borrowed(text) }
    }

    pub(crate) fn invalid(text: &str) -> Self {
        Self { status: ASPERITY_INVALID, text: Cow::Owned(c_text(text)) }
    }

    pub(crate) fn busy(text: &str) -> Self {
        Self { status: ASPERITY_BUSY, text: Cow::Owned(c_text(text)) }
    }

    pub(crate) fn failed(text: &str) -> Self {
        Self { status: ASPERITY_FAILED, text: Cow::Owned(c_text(text)) }
    }

    /// Keeps the text for this thread.
    fn keep(self) -> AsperityStatus {
        match self.text {
            Cow::Borrowed(text) => LAST.set(text.as_ptr()),
            Cow::Owned(text) => OWNED.with(|owned| {
                // One that ends has no storage any more, and nobody reads its texts.
                if let Ok(mut owned) = owned.try_borrow_mut() {
                    *owned = text;
                    LAST.set(owned.as_ptr());
                }
            }),
        }
        self.status
    }
}

impl From<Failure> for Refusal {
    fn from(failure: Failure) -> Self {
        let text = failure.text();
        let text = text.trim_end();
        let text = text.strip_prefix("error: ").unwrap_or(text);
        match failure {
            Failure::Input(_) => Self::invalid(text),
            Failure::Machine(_) | Failure::Said(_) => Self::failed(text),
        }
    }
}

thread_local! {
    /// The last error. Without a destructor, so that a real-time thread may have it.
    static LAST: Cell<*const c_char> = const { Cell::new(c"".as_ptr()) };
    static OWNED: RefCell<CString> = RefCell::default();
    /// The last other text.
    static TEXT: RefCell<CString> = RefCell::default();
}

/// Text of the last error of this thread: `file:line:column: error: ...`, the line with a caret, and help.
/// Empty before the first error. It is valid until the next error of this thread. A call that succeeds leaves
/// it as it is.
///
/// Any thread. Never blocks.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_last_error() -> *const c_char {
    LAST.get()
}

const PANICKED: Refusal =
    Refusal::fixed(ASPERITY_FAILED, c"a bug of Asperity: a panic was caught; please report it");

/// Runs a function of the interface. Nothing unwinds into C.
pub(crate) fn call(function: impl FnOnce() -> Answer) -> AsperityStatus {
    match catch_unwind(AssertUnwindSafe(function)) {
        Ok(Ok(())) => ASPERITY_OK,
        Ok(Err(refusal)) => refusal.keep(),
        Err(payload) => {
            // Freeing it could run any code.
            std::mem::forget(payload);
            PANICKED.keep()
        }
    }
}

/// Runs a function that answers a text, which the thread keeps; NULL after an error.
pub(crate) fn text(function: impl FnOnce() -> Answer<String>) -> *const c_char {
    let mut kept = std::ptr::null();
    call(|| {
        let text = c_text(&function()?);
        TEXT.with_borrow_mut(|last| {
            *last = text;
            kept = last.as_ptr();
        });
        Ok(())
    });
    kept
}

/// A text that C gives.
///
/// # Safety
/// `text` is NULL or ends with a zero byte.
pub(crate) unsafe fn given<'a>(text: *const c_char, name: &str) -> Answer<&'a str> {
    if text.is_null() {
        return Err(null(name));
    }
    // SAFETY: the caller's promise.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str()
        .map_err(|e| Refusal::invalid(&format!("`{name}` is not UTF-8 after byte {}", e.valid_up_to())))
}

/// The place where a result goes.
///
/// # Safety
/// `to` is NULL or may be written.
pub(crate) unsafe fn place<'a, T>(to: *mut T, name: &str) -> Answer<&'a mut T> {
    // SAFETY: the caller's promise.
    unsafe { to.as_mut() }.ok_or_else(|| null(name))
}

pub(crate) fn null(name: &str) -> Refusal {
    Refusal::invalid(&format!("`{name}` is NULL"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last() -> &'static str {
        // SAFETY: a text that this thread keeps.
        unsafe { CStr::from_ptr(asperity_last_error()) }.to_str().expect("UTF-8")
    }

    #[test]
    fn panic_is_caught_and_the_newest_error_counts() {
        assert_eq!((call(|| Ok(())), last()), (ASPERITY_OK, ""));
        assert_eq!((call(|| Err(Refusal::invalid("a\0b"))), last()), (ASPERITY_INVALID, "a\\0b"));
        assert_eq!((call(|| Ok(())), last()), (ASPERITY_OK, "a\\0b"));
        std::panic::set_hook(Box::new(|_| {}));
        assert_eq!(call(|| panic!("asked for")), ASPERITY_FAILED);
        let _ = std::panic::take_hook();
        assert!(last().contains("a panic was caught"));
        assert_eq!((call(|| Err(Refusal::busy("b"))), last()), (ASPERITY_BUSY, "b"));
        assert!(text(|| Err(Refusal::busy("c"))).is_null());
        // SAFETY: a text that this thread keeps.
        assert_eq!(unsafe { CStr::from_ptr(text(|| Ok("d".into()))) }, c"d");
    }
}
