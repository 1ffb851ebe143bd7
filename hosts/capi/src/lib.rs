//! Asperity from C: the shared library `libasperity` and its header `include/asperity.h`.
//!
//! The header is generated from this crate. C sees handles, plain structs and statuses ([`status`]). A
//! [`graph`] is read and set; an [`engine`] runs it tick by tick, and a [`live`] run is pulled by the audio
//! callback of another program. [`handles`] keeps all objects, so that a wrong handle is an error.
//!
//! The queues between the threads of a run are those of `asperity_live`. Here a thread only tries a lock,
//! which says at once that another thread is inside.

// The interface is what C sees; the modules are for readers of the code.
#![allow(missing_docs, reason = "the modules have their docs")]

mod handles;

// In the order of the header.
pub mod status;

pub mod graph;

pub mod engine;

pub mod live;

#[cfg(test)]
mod tests;

use std::ffi::c_char;

use status::{AsperityStatus, Refusal, call};

/// Version of the header, checked by `asperity_check_version`.
pub const ASPERITY_VERSION_MAJOR: u32 = 0;
/// Version of the header, checked by `asperity_check_version`.
pub const ASPERITY_VERSION_MINOR: u32 = 1;
/// Version of the header.
pub const ASPERITY_VERSION_PATCH: u32 = 0;

const VERSION: &std::ffi::CStr =
    match std::ffi::CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(version) => version,
        Err(_) => panic!("a version without a zero byte"),
    };

/// Version of the library, such as `0.1.0`.
///
/// Any thread. Never blocks.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_version() -> *const c_char {
    VERSION.as_ptr()
}

/// Checks that a program that was built with this version of the header can use the library. Give it
/// ASPERITY_VERSION_MAJOR and ASPERITY_VERSION_MINOR before all other calls. The major versions must be the
/// same, and the library at least as new. Before 1.0, the minor versions must be the same too.
///
/// Any thread. Never blocks.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_check_version(major: u32, minor: u32) -> AsperityStatus {
    call(|| {
        let (own_major, own_minor) = (ASPERITY_VERSION_MAJOR, ASPERITY_VERSION_MINOR);
        let newer = if own_major == 0 { minor == own_minor } else { minor <= own_minor };
        if major == own_major && newer {
            return Ok(());
        }
        let own = env!("CARGO_PKG_VERSION");
        Err(Refusal::invalid(&format!(
            "this program was built for version {major}.{minor} of Asperity, and the library is {own}: build \
             it anew"
        )))
    })
}
