//! Reads data of a plugin with care: it may be of an older minor version, or wrong.

use std::ffi::{CStr, c_char};

use asperity_abi::{Grows, read_grown};

/// An error in a plugin's data, in one sentence.
pub(crate) type Lie = String;

/// Longest text that is read, in bytes.
const MAX_TEXT: usize = 1 << 16;

/// Data of a plugin, whose pointers are trusted.
#[derive(Clone, Copy)]
pub(crate) struct Theirs(());

impl Theirs {
    /// # Safety
    /// Every pointer that is read through it is NULL, or leads to a value of the declared type: a struct of
    /// the size it says, as many structs, numbers or texts as are said, a text that ends with a zero byte.
    pub(crate) unsafe fn trusted() -> Self {
        Self(())
    }

    /// Reads a struct that begins with its size. Members unknown to its maker are zero.
    pub(crate) fn read<T: Grows>(self, at: *const T, what: &str) -> Result<T, Lie> {
        if at.is_null() {
            return Err(format!("{what} is NULL"));
        }
        if !at.is_aligned() {
            return Err(format!("{what} is not where such a struct can be"));
        }
        // SAFETY: these pointers are trusted.
        unsafe { read_grown(at) }.ok_or_else(|| {
            // SAFETY: every such struct begins with its size.
            let size = unsafe { at.cast::<u32>().read() };
            format!("{what} says it has {size} bytes; {} or a few more would fit", T::SIZE_1_0)
        })
    }

    /// Reads an array of such structs, each as far from the next as the first one's size.
    pub(crate) fn read_all<T: Grows>(self, first: *const T, count: u32, what: &str) -> Result<Vec<T>, Lie> {
        if count > 256 {
            return Err(format!("{count} of {what}; at most 256 are taken"));
        }
        let mut out = Vec::new();
        let mut stride = 0;
        for i in 0..count {
            // SAFETY: `count` structs are there, `stride` bytes apart.
            let at = unsafe { first.byte_add((i * stride) as usize) };
            out.push(self.read(at, &format!("{what} {i}"))?);
            // SAFETY: it was read.
            let size = unsafe { *at.cast::<u32>() };
            if i > 0 && size != stride {
                return Err(format!("{what} {i} says it has {size} bytes, and the one before {stride}"));
            }
            stride = size;
        }
        Ok(out)
    }

    /// Reads a text.
    pub(crate) fn text(self, text: *const c_char, what: &str) -> Result<String, Lie> {
        self.some_text(text, what)?.ok_or_else(|| format!("{what} is NULL"))
    }

    /// Reads a text that may be NULL.
    pub(crate) fn some_text(self, text: *const c_char, what: &str) -> Result<Option<String>, Lie> {
        if text.is_null() {
            return Ok(None);
        }
        // SAFETY: these pointers are trusted.
        let bytes = unsafe { CStr::from_ptr(text) }.to_bytes();
        if bytes.len() > MAX_TEXT {
            return Err(format!("{what} has {} bytes", bytes.len()));
        }
        let text = std::str::from_utf8(bytes).map_err(|_| format!("{what} is not UTF-8"))?;
        // Characters that move a terminal's cursor, or reverse its text.
        let odd = |c: char| c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        if text.contains(odd) {
            return Err(format!("{what} has control characters in it"));
        }
        Ok(Some(text.to_owned()))
    }

    /// Reads a list of texts that ends with NULL.
    pub(crate) fn texts(self, first: *const *const c_char, what: &str) -> Result<Vec<String>, Lie> {
        let mut out = Vec::new();
        if first.is_null() {
            return Ok(out);
        }
        for i in 0..=1024 {
            // SAFETY: the list goes on until its NULL.
            match self.some_text(unsafe { *first.add(i) }, what)? {
                Some(text) => out.push(text),
                None => return Ok(out),
            }
        }
        Err(format!("{what} does not end with NULL"))
    }

    /// Reads numbers.
    pub(crate) fn numbers(self, first: *const f64, count: u32, what: &str) -> Result<Vec<f64>, Lie> {
        if count > 0 && first.is_null() || count > 65_536 {
            return Err(format!("{what} says it has {count} numbers by default"));
        }
        // SAFETY: that many numbers are there.
        Ok((0..count as usize).map(|i| unsafe { *first.add(i) }).collect())
    }
}
