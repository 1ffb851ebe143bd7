//! The C interface between Asperity and its plugins: plain data and function pointers, version 1.1.
//!
//! `include/asperity_plugin.h` is generated from this crate and serves C and C++. A Rust node needs neither:
//! it implements `asperity_sdk::Node` and is exported with one line.
//!
//! Rules for every function and struct:
//!
//! - **Growth.** Every struct that may grow begins with its size in bytes as its maker knew it. A
//!   reader uses a member only if the size includes it. Members are added at the end and never change.
//!   A new minor version adds members, constants and extensions. A new major version may change
//!   anything, and a host refuses a plugin of another one.
//! - **Threads.** *Control thread* functions may allocate, lock and read files. The host calls them
//!   from any thread, but never two at once for one instance. *Tick thread* functions run in real time:
//!   no allocation, lock, log, system call or wait. They too are never called two at once for one
//!   instance, but the thread may change. Different instances, and `ports` and `create` of a kind, may
//!   be called at the same time from different threads.
//! - **Texts** are UTF-8 and end with a zero byte. Texts in [`AsperityPlugin`] stay valid for the life
//!   of the process: a plugin is never unloaded. Texts from the host are valid during the call.
//! - **Nothing unwinds** across a call. The plugin catches C++ exceptions and Rust panics and returns
//!   [`ASPERITY_PANICKED`].
//! - **Reserved** members and unknown flags are 0.

mod effect;
mod kind;
mod node;
#[cfg(test)]
mod tests;

pub use effect::*;
pub use kind::*;
pub use node::*;

use std::ffi::{c_char, c_void};

/// The first eight bytes of [`AsperityEntry`]: `ASPERITY` in ASCII, read as a little-endian number.
pub const ASPERITY_MAGIC: u64 = 0x5954_4952_4550_5341;
/// Major version: a host refuses plugins of another one.
pub const ASPERITY_MAJOR: u16 = 1;
/// Minor version: additions to the major one.
pub const ASPERITY_MINOR: u16 = 1;
/// Name of the one symbol a plugin exports: an [`AsperityEntry`].
pub const ASPERITY_ENTRY_SYMBOL: &str = "asperity_entry";

/// A struct that begins with its size and may have grown since version 1.0.
///
/// # Safety
/// The type is `repr(C)`, begins with a `u32` that is its size, and all-zero bytes are a value of it.
pub unsafe trait Grows: Copy {
    /// Its size in the first version that had it, on a machine with pointers of this size.
    const SIZE_1_0: usize;
}

macro_rules! grows {
    ($($t:ident)*) => {$(
        // SAFETY: all are repr(C), begin with `size`, and hold numbers, pointers and optional functions.
        unsafe impl Grows for $t {
            const SIZE_1_0: usize = size_of::<$t>();
        }
    )*};
}

// A struct that grows after its first version leaves this list, as `AsperitySetup` did.
grows! {
    AsperityHost
    AsperityPlugin
    AsperityRandom
    AsperityFacts
    AsperityFactSink
    AsperityPort
    AsperityParam
    AsperityPortSink
    AsperityKind
    AsperityValue
    AsperityWire
    AsperityError
    AsperityInfo
    AsperityTick
    AsperityEffects
    AsperityEffect
    AsperityForm
    AsperityNeed
    AsperitySettings
    AsperitySlot
    AsperityLaw
}

// SAFETY: as those above.
unsafe impl Grows for AsperitySetup {
    const SIZE_1_0: usize = std::mem::offset_of!(AsperitySetup, slots);
}

/// A struct whose members are all zero, but for its size.
pub fn blank<T: Grows>() -> T {
    let mut out = core::mem::MaybeUninit::<T>::zeroed();
    // SAFETY: zeroed bytes are a T, which begins with its size.
    unsafe {
        out.as_mut_ptr().cast::<u32>().write(size_of::<T>() as u32);
        out.assume_init()
    }
}

/// Reads a struct from the other side, which may be of an older or a newer minor version. Members
/// unknown to its maker are zero; members unknown here are ignored. `None` if it is NULL, not aligned,
/// or says an impossible size.
///
/// # Safety
/// `at` is NULL or points to at least 4 bytes and to as many as these say.
pub unsafe fn read_grown<T: Grows>(at: *const T) -> Option<T> {
    if at.is_null() || !at.is_aligned() {
        return None;
    }
    // SAFETY: the caller's promise; every such struct begins with its size.
    let size = unsafe { at.cast::<u32>().read() } as usize;
    if size < T::SIZE_1_0 || size > MAX_STRUCT || !size.is_multiple_of(align_of::<T>()) {
        return None;
    }
    let mut out = core::mem::MaybeUninit::<T>::zeroed();
    // SAFETY: that many bytes are there and fit, and zeroed bytes are a T.
    unsafe {
        core::ptr::copy_nonoverlapping(at.cast::<u8>(), out.as_mut_ptr().cast(), size.min(size_of::<T>()));
        Some(out.assume_init())
    }
}

/// Largest accepted struct in bytes.
const MAX_STRUCT: usize = 1 << 12;

/// The symbol `asperity_entry` that a plugin exports, as constant data.
///
/// The host reads `magic`, `size` and `major` before it calls anything.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityEntry {
    /// [`ASPERITY_MAGIC`].
    pub magic: u64,
    /// `sizeof(AsperityEntry)`.
    pub size: u32,
    /// [`ASPERITY_MAJOR`] that the plugin was built with.
    pub major: u16,
    /// [`ASPERITY_MINOR`] that the plugin was built with.
    pub minor: u16,
    /// Returns the plugin's description, or NULL if this host does not suit it. Control thread; called
    /// once, before anything else. `host` stays valid for the life of the process.
    pub open: Option<unsafe extern "C" fn(host: *const AsperityHost) -> *const AsperityPlugin>,
}

/// Description of the host.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityHost {
    /// `sizeof(AsperityHost)`.
    pub size: u32,
    /// The host's major version.
    pub major: u16,
    /// The host's minor version.
    pub minor: u16,
    /// The program's name.
    pub name: *const c_char,
    /// The program's version.
    pub version: *const c_char,
    /// Finds an extension of the host by name and revision, such as `asperity.random/1`; NULL if there
    /// is none. Any thread.
    pub extension:
        Option<unsafe extern "C" fn(host: *const AsperityHost, name: *const c_char) -> *const c_void>,
}

/// Description of a plugin.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityPlugin {
    /// `sizeof(AsperityPlugin)`.
    pub size: u32,
    /// Number of node kinds.
    pub kind_count: u32,
    /// The kinds, as an array of `kind_count` pointers.
    pub kinds: *const *const AsperityKind,
    /// The plugin's name.
    pub name: *const c_char,
    /// The plugin's version.
    pub version: *const c_char,
    /// Finds an extension of the plugin by name and revision, such as `asperity.facts/1`; NULL if there
    /// is none. Any thread. The pointer itself may be NULL.
    pub extension: Option<unsafe extern "C" fn(name: *const c_char) -> *const c_void>,
}

/// The host's extension `asperity.random/1`: random numbers by index, so that skipped work does not
/// change later numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityRandom {
    /// `sizeof(AsperityRandom)`.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Uniform in [0, 1), a function of both arguments alone. Any thread.
    pub uniform: Option<unsafe extern "C" fn(seed: u64, index: u64) -> f64>,
}

/// Name of [`AsperityRandom`].
pub const ASPERITY_EXTENSION_RANDOM: &str = "asperity.random/1";

/// The plugin's extension `asperity.facts/1`: facts about an instance, for reports.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityFacts {
    /// `sizeof(AsperityFacts)`.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Reports every fact of a prepared instance of `kind` (the pointer from the plugin) to `sink`.
    /// Control thread.
    pub facts: Option<
        unsafe extern "C" fn(kind: *const AsperityKind, instance: *mut c_void, sink: *const AsperityFactSink),
    >,
}

/// Name of [`AsperityFacts`].
pub const ASPERITY_EXTENSION_FACTS: &str = "asperity.facts/1";

/// Receives facts. Names are lower case, words joined by `_`. Valid during the call that gets it, on
/// its thread.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityFactSink {
    /// `sizeof(AsperityFactSink)`.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// The first argument of the functions below.
    pub context: *mut c_void,
    /// A text.
    pub text: Option<unsafe extern "C" fn(context: *mut c_void, name: *const c_char, text: *const c_char)>,
    /// A number in a unit; an empty unit for none.
    pub number: Option<
        unsafe extern "C" fn(context: *mut c_void, name: *const c_char, number: f64, unit: *const c_char),
    >,
    /// A count.
    pub count: Option<unsafe extern "C" fn(context: *mut c_void, name: *const c_char, count: u64)>,
}
