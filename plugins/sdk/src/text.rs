//! Texts across the interface.

use std::ffi::{CStr, CString, c_char};
use std::ptr;

/// Texts for the host, which live as long as this does.
#[derive(Debug, Default)]
pub(crate) struct Texts {
    texts: Vec<CString>,
    lists: Vec<Vec<*const c_char>>,
}

impl Texts {
    /// Stores a text. Anything after a zero byte is dropped.
    pub(crate) fn text(&mut self, text: &str) -> *const c_char {
        let end = text.find('\0').unwrap_or(text.len());
        self.texts.push(CString::new(&text[..end]).unwrap_or_default());
        // Its bytes stay in place when the list grows.
        self.texts.last().map_or(ptr::null(), |t| t.as_ptr())
    }

    /// Stores a text; NULL for an empty one.
    pub(crate) fn some(&mut self, text: &str) -> *const c_char {
        if text.is_empty() { ptr::null() } else { self.text(text) }
    }

    /// Stores a list of texts that ends with NULL.
    pub(crate) fn list<'a>(&mut self, texts: impl Iterator<Item = &'a str>) -> *const *const c_char {
        let mut list: Vec<*const c_char> = texts.map(|t| self.text(t)).collect();
        list.push(ptr::null());
        self.lists.push(list);
        self.lists.last().map_or(ptr::null(), |l| l.as_ptr())
    }
}

/// Reads a text of the host; empty for NULL. Invalid UTF-8 is replaced.
///
/// # Safety
/// NULL, or ends with a zero byte and lives through the call.
pub(crate) unsafe fn read(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not NULL, and ends with a zero byte as the caller promises.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// Writes a text into memory of the host, cut to its capacity, with a zero at its end.
///
/// # Safety
/// NULL, or `capacity` bytes that may be written.
pub(crate) unsafe fn write(text: &str, to: *mut c_char, capacity: u32) {
    if to.is_null() || capacity == 0 {
        return;
    }
    let mut len = text.find('\0').unwrap_or(text.len()).min(capacity as usize - 1);
    while !text.is_char_boundary(len) {
        len -= 1;
    }
    // SAFETY: len < capacity bytes are there, and texts do not overlap: one is ours, one the host's.
    unsafe {
        ptr::copy_nonoverlapping(text.as_ptr().cast(), to, len);
        *to.add(len) = 0;
    }
}
