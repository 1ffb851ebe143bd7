//! Texts for the host, and reading of the host's texts.

use std::ffi::{CStr, CString, c_char};
use std::ptr;

use asperity_abi::{AsperityError, Grows, read_grown};

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

/// The host's data, whose pointers are trusted for the time of a call.
#[derive(Clone, Copy)]
pub(crate) struct Theirs(());

impl Theirs {
    /// # Safety
    /// Every pointer that is read or written through it is NULL, or leads to a value of the declared type
    /// that nobody else changes meanwhile.
    pub(crate) unsafe fn trusted() -> Self {
        Self(())
    }

    /// Reads a struct.
    pub(crate) fn read<T: Grows>(self, at: *const T) -> Option<T> {
        // SAFETY: these pointers are trusted.
        unsafe { read_grown(at) }
    }

    /// An element of an array, whose structs may be longer than ours: each is as far from the next as `size`
    /// of the first says. None of a NULL array.
    pub(crate) fn element<T: Grows>(self, first: *const T, index: usize) -> Option<*const T> {
        // SAFETY: these pointers are trusted, and every such struct begins with its size.
        (!first.is_null()).then(|| unsafe { first.byte_add(index * first.cast::<u32>().read() as usize) })
    }

    /// Reads all elements of an array.
    pub(crate) fn all<T: Grows>(self, first: *const T, count: u32) -> Option<Vec<T>> {
        (0..count as usize).map(|i| self.read(self.element(first, i)?)).collect()
    }

    /// Reads a list of plain values; empty for NULL.
    pub(crate) fn list<T: Copy>(self, first: *const T, count: u32) -> Vec<T> {
        if first.is_null() {
            return Vec::new();
        }
        // SAFETY: these pointers are trusted.
        unsafe { std::slice::from_raw_parts(first, count as usize) }.to_vec()
    }

    /// Reads a text; empty for NULL. Invalid UTF-8 is replaced.
    pub(crate) fn text(self, text: *const c_char) -> String {
        if text.is_null() {
            return String::new();
        }
        // SAFETY: these pointers are trusted.
        unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
    }

    /// Writes an error.
    pub(crate) fn tell(self, message: &str, help: &str, param: Option<usize>, error: *mut AsperityError) {
        let Some(room) = self.read(error) else { return };
        let param = param.and_then(|p| i32::try_from(p).ok()).unwrap_or(-1);
        // SAFETY: these pointers are trusted, and both texts have the room that the host says.
        unsafe {
            (&raw mut (*error).param).write(param);
            write(message, room.message, room.message_capacity);
            write(help, room.help, room.help_capacity);
        }
    }
}

/// Writes a text into memory of the host, cut to its capacity, with a zero at its end.
///
/// # Safety
/// NULL, or `capacity` bytes that may be written.
unsafe fn write(text: &str, to: *mut c_char, capacity: u32) {
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
