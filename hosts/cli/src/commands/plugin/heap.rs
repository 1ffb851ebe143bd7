//! Counting what a plugin does to the heap.
//!
//! A plugin brings the allocator of its own language, and the program's cannot see it. All of them come down to the C library's
//! `malloc`, so a small library (`heap.c`) is put before that one in the process that runs the cases. On systems where this is
//! not possible nothing is counted, and the case says so.

use std::io::Write;
use std::process::Command;

use asperity_checks::conformance::{Heap, Touched};
use tempfile::TempPath;

/// The library; empty where it could not be built.
const LIBRARY: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/heap.so"));

/// What tells the system's loader to put a library before all others.
const PRELOAD: &str = "LD_PRELOAD";

/// The library as a file, for as long as this lives.
pub struct Preload(Option<TempPath>);

impl Preload {
    /// Writes the file, if there is anything to write and a place for it.
    pub fn new() -> Self {
        let write = || {
            let mut file = tempfile::Builder::new().prefix("asperity-heap-").suffix(".so").tempfile()?;
            file.write_all(LIBRARY)?;
            Ok::<_, std::io::Error>(file.into_temp_path())
        };
        Self(if LIBRARY.is_empty() { None } else { write().ok() })
    }

    /// Has a process begin with it.
    pub fn put_before(&self, command: &mut Command) {
        let Some(file) = &self.0 else { return };
        let mut all = file.as_os_str().to_owned();
        if let Some(others) = std::env::var_os(PRELOAD).filter(|o| !o.is_empty()) {
            all.push(":");
            all.push(others);
        }
        command.env(PRELOAD, all);
    }
}

/// The counting library in this process.
#[cfg(unix)]
pub struct Counter {
    begin: unsafe extern "C" fn(),
    end: unsafe extern "C" fn(*mut u64, *mut u64),
}

/// There is none.
#[cfg(not(unix))]
pub struct Counter {}

#[cfg(unix)]
impl Counter {
    /// Finds it, and makes sure that it sees an allocation.
    pub fn find() -> Option<Self> {
        let this = libloading::os::unix::Library::this();
        // SAFETY: symbols of the library above, with the types that they have there; it stays for as long as the process.
        let counter = unsafe {
            let begin = this.get::<unsafe extern "C" fn()>(c"asperity_heap_begin").ok()?;
            let end = this.get::<unsafe extern "C" fn(*mut u64, *mut u64)>(c"asperity_heap_end").ok()?;
            Self { begin: *begin, end: *end }
        };
        counter.begin();
        drop(std::hint::black_box(Box::new([0_u8; 64])));
        (counter.end() == Touched { taken: 1, freed: 1 }).then_some(counter)
    }
}

#[cfg(not(unix))]
impl Counter {
    /// There is none.
    pub fn find() -> Option<Self> {
        None
    }
}

#[cfg(unix)]
impl Heap for Counter {
    fn begin(&self) {
        // SAFETY: takes nothing, and touches variables of this thread only.
        unsafe { (self.begin)() };
    }

    fn end(&self) -> Touched {
        let mut touched = Touched::default();
        // SAFETY: two numbers that it writes to.
        unsafe { (self.end)(&mut touched.taken, &mut touched.freed) };
        touched
    }
}

#[cfg(not(unix))]
impl Heap for Counter {
    fn begin(&self) {}

    fn end(&self) -> Touched {
        Touched::default()
    }
}
