//! The C interface between Asperity and its plugins: plain data and function pointers, version 1.0.
//!
//! `include/asperity.h` is generated from this crate and serves C and C++. A Rust node needs neither: it implements
//! `asperity_sdk::Node` and is exported with one line.
//!
//! Rules that hold for every function and struct here:
//!
//! - **Growth.** Every struct that may grow begins with its own size in bytes as its maker knew it. A reader looks at a member
//!   only where the size says it is there; members are added at the end and never change. A new minor version adds members,
//!   constants and extensions; a new major version may change anything, and a host refuses a plugin of another one.
//! - **Threads.** *Control thread* functions may allocate, lock and read files; the host calls them from any thread but never
//!   two at once for one instance. *Tick thread* functions run in real time: no allocation, lock, log, system call or wait.
//!   They too are never called two at once for one instance, but another thread than before may call. Different instances may be called
//!   at the same time from different threads.
//! - **Texts** are UTF-8 and end with a zero byte. What a plugin hands out in [`AsperityPlugin`] stays valid for as long as the
//!   process lives: a plugin is never unloaded. What a host hands in is valid during the call.
//! - **Nothing unwinds** across a call: a C++ exception or a Rust panic must be caught on the plugin's side, and is then answered
//!   as [`ASPERITY_PANICKED`].
//! - **Reserved** members and unknown flags are 0.

mod kind;
mod node;

pub use kind::*;
pub use node::*;

use std::ffi::{c_char, c_void};

/// The first eight bytes of [`AsperityEntry`]: `ASPERITY` in ASCII, read as a little-endian number.
pub const ASPERITY_MAGIC: u64 = 0x5954_4952_4550_5341;
/// Major version: a host refuses plugins of another one.
pub const ASPERITY_MAJOR: u16 = 1;
/// Minor version: what has been added to the major one.
pub const ASPERITY_MINOR: u16 = 0;
/// Name of the one symbol a plugin exports: an [`AsperityEntry`].
pub const ASPERITY_ENTRY_SYMBOL: &str = "asperity_entry";

/// What a plugin exports, as constant data under the name `asperity_entry`.
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
    /// Answers what the plugin offers, or NULL where this host does not suit it. Control thread; called once, before
    /// anything else. `host` stays valid for as long as the process lives.
    pub open: Option<unsafe extern "C" fn(host: *const AsperityHost) -> *const AsperityPlugin>,
}

/// What the host says of itself.
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
    /// Finds an extension of the host by name and revision, such as `asperity.random/1`; NULL where it has none of that
    /// name. Any thread.
    pub extension:
        Option<unsafe extern "C" fn(host: *const AsperityHost, name: *const c_char) -> *const c_void>,
}

/// What a plugin offers.
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
    /// Finds an extension of the plugin by name and revision, such as `asperity.facts/1`; NULL where it has none of that name.
    /// Any thread. The pointer itself may be NULL.
    pub extension: Option<unsafe extern "C" fn(name: *const c_char) -> *const c_void>,
}

/// The host's extension `asperity.random/1`: random numbers by index, so that skipped work does not change what follows.
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

/// The plugin's extension `asperity.facts/1`: what an instance tells about itself in reports.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityFacts {
    /// `sizeof(AsperityFacts)`.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Tells `sink` every fact of an instance of `kind` that has been prepared. Control thread.
    pub facts: Option<
        unsafe extern "C" fn(kind: *const AsperityKind, instance: *mut c_void, sink: *const AsperityFactSink),
    >,
}

/// Name of [`AsperityFacts`].
pub const ASPERITY_EXTENSION_FACTS: &str = "asperity.facts/1";

/// Where facts are told. Names are lower case, words joined by `_`. Valid during the call it is handed to.
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
