//! Reads data of a plugin with care: it may be of an older minor version, or wrong.

use std::ffi::{CStr, c_char};

use asperity_abi::{Grows, read_grown};

/// An error in a plugin's data, in one sentence.
pub(crate) type Lie = String;

/// Longest text that is read, in bytes.
const MAX_TEXT: usize = 1 << 16;

/// Reads a struct that begins with its size. Members unknown to its maker are zero.
///
/// # Safety
/// `at` is NULL or points to a struct of the size it says.
pub(crate) unsafe fn read<T: Grows>(at: *const T, what: &str) -> Result<T, Lie> {
    if at.is_null() {
        return Err(format!("{what} is NULL"));
    }
    if !at.is_aligned() {
        return Err(format!("{what} is not where such a struct can be"));
    }
    // SAFETY: the caller's promise.
    unsafe { read_grown(at) }.ok_or_else(|| {
        // SAFETY: every such struct begins with its size.
        let size = unsafe { at.cast::<u32>().read() };
        format!("{what} says it has {size} bytes; {} or a few more would fit", T::SIZE_1_0)
    })
}

/// Reads an array of such structs, each as far from the next as the first one's size.
///
/// # Safety
/// `first` is NULL or points to `count` structs.
pub(crate) unsafe fn read_all<T: Grows>(first: *const T, count: u32, what: &str) -> Result<Vec<T>, Lie> {
    if count > 256 {
        return Err(format!("{count} of {what}; at most 256 are taken"));
    }
    let mut out = Vec::new();
    let mut stride = 0;
    for i in 0..count {
        // SAFETY: `count` structs are there, `stride` bytes apart.
        unsafe {
            let at = first.byte_add((i * stride) as usize);
            out.push(read(at, &format!("{what} {i}"))?);
            let size = *at.cast::<u32>();
            if i > 0 && size != stride {
                return Err(format!("{what} {i} says it has {size} bytes, and the one before {stride}"));
            }
            stride = size;
        }
    }
    Ok(out)
}

/// Reads a text.
///
/// # Safety
/// `text` is NULL or ends with a zero byte.
pub(crate) unsafe fn text(text: *const c_char, what: &str) -> Result<String, Lie> {
    // SAFETY: the caller's promise.
    unsafe { some_text(text, what)? }.ok_or_else(|| format!("{what} is NULL"))
}

/// Reads a text that may be NULL.
///
/// # Safety
/// As for [`text`].
pub(crate) unsafe fn some_text(text: *const c_char, what: &str) -> Result<Option<String>, Lie> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    let bytes = unsafe { CStr::from_ptr(text) }.to_bytes();
    if bytes.len() > MAX_TEXT {
        return Err(format!("{what} has {} bytes", bytes.len()));
    }
    match std::str::from_utf8(bytes) {
        // Characters that move a terminal's cursor, or reverse its text.
        Ok(text)
            if text.chars().any(|c| {
                c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
            }) =>
        {
            Err(format!("{what} has control characters in it"))
        }
        Ok(text) => Ok(Some(text.to_owned())),
        Err(_) => Err(format!("{what} is not UTF-8")),
    }
}

/// Reads a list of texts that ends with NULL.
///
/// # Safety
/// `first` is NULL or points to such a list.
pub(crate) unsafe fn texts(first: *const *const c_char, what: &str) -> Result<Vec<String>, Lie> {
    let mut out = Vec::new();
    if first.is_null() {
        return Ok(out);
    }
    for i in 0..=1024 {
        // SAFETY: the list goes on until its NULL.
        let at = unsafe { *first.add(i) };
        // SAFETY: texts of the list end with a zero byte.
        match unsafe { some_text(at, what)? } {
            Some(text) => out.push(text),
            None => return Ok(out),
        }
    }
    Err(format!("{what} does not end with NULL"))
}
