//! The plugin file: checked before any of its code runs, then copied and loaded.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use asperity_abi::ASPERITY_ENTRY_SYMBOL;
use asperity_diagnostics::{Diagnostic, file, fnv};
use libloading::Library;
use object::read::NameOrOrdinal;
use object::{Architecture, BinaryFormat, Object, ObjectKind, ObjectSegment};
use tempfile::TempPath;

use crate::foreign::foreign;

/// Largest library that is read, in bytes.
const MAX_BYTES: u64 = 1 << 30;

static COPIES: AtomicU64 = AtomicU64::new(0);

/// Number of copies of plugin files loaded by this process; they are never unloaded.
pub fn loaded_copies() -> u64 {
    COPIES.load(Ordering::Relaxed)
}

/// Library format of this system.
const FORMAT: BinaryFormat = if cfg!(windows) {
    BinaryFormat::Pe
} else if cfg!(target_vendor = "apple") {
    BinaryFormat::MachO
} else {
    BinaryFormat::Elf
};

fn here() -> Option<Architecture> {
    match std::env::consts::ARCH {
        "x86_64" => Some(Architecture::X86_64),
        "aarch64" => Some(Architecture::Aarch64),
        "x86" => Some(Architecture::I386),
        "arm" => Some(Architecture::Arm),
        "riscv64" => Some(Architecture::Riscv64),
        _ => None,
    }
}

/// Help for a file that is no plugin.
const SHARED: &str = "a plugin is a shared library: .so, .dylib or .dll";

/// Reads a file and checks that it can be loaded. Error: a missing or unreadable file, or one that is no
/// complete shared library for this machine with the entry symbol.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, Diagnostic> {
    let bytes = file::read(path, MAX_BYTES).map_err(|e| e.help(SHARED))?;
    check(&bytes).map_err(|e| e.in_file(path))?;
    Ok(bytes)
}

fn check(bytes: &[u8]) -> Result<(), Diagnostic> {
    let is = |what: &str| Diagnostic::new(what).help(SHARED);
    if bytes.is_empty() {
        return Err(is("this file is empty"));
    }
    let file = object::File::parse(bytes).map_err(|_| is("this is not a shared library"))?;
    if file.format() != FORMAT {
        let found = format!("this is a library for another system ({:?})", file.format());
        return Err(Diagnostic::new(found).help("build it on this system"));
    }
    if here().is_some_and(|here| here != file.architecture()) {
        let (found, here) = (file.architecture(), std::env::consts::ARCH);
        let what = format!("this library is for another architecture: {found:?}, and this program is {here}");
        return Err(Diagnostic::new(what).help("build it for this machine"));
    }
    match file.kind() {
        ObjectKind::Dynamic => {}
        ObjectKind::Executable => return Err(is("this is a program, not a shared library")),
        ObjectKind::Relocatable => return Err(is("this is an object file, not a shared library")),
        _ => return Err(is("this is not a shared library")),
    }
    // A file that is still being written would be mapped past its end, which kills the process on
    // access.
    let whole = file.segments().all(|s| {
        let (start, len) = s.file_range();
        start.checked_add(len).is_some_and(|end| end <= bytes.len() as u64)
    });
    if !whole {
        return Err(Diagnostic::new("this library is cut short").help("build it again"));
    }
    let mut exports =
        file.exports().map_err(|e| Diagnostic::new(format!("its exports cannot be read: {e}")))?;
    let is_entry = |name: &[u8]| name.strip_prefix(b"_").is_some_and(is_it) || is_it(name);
    if !exports.any(|e| e.is_ok_and(|e| matches!(e.name(), NameOrOrdinal::Name(name) if is_entry(name)))) {
        let what = format!(
            "this library has no symbol `{ASPERITY_ENTRY_SYMBOL}`, so it is not a plugin of Asperity"
        );
        return Err(Diagnostic::new(what).help(
            "in Rust: `asperity_sdk::export!(MyNode);`; \
             in C: `ASPERITY_EXPORT const AsperityEntry asperity_entry`",
        ));
    }
    Ok(())
}

fn is_it(name: &[u8]) -> bool {
    name == ASPERITY_ENTRY_SYMBOL.as_bytes()
}

/// A copy of a library under a unique name; deleted when this is dropped.
pub struct Copy {
    path: TempPath,
    /// Windows does not load a file that is open for writing.
    _lock: Option<File>,
}

impl Copy {
    pub(crate) fn new(of: &Path, bytes: &[u8]) -> Result<Self, Diagnostic> {
        let stem = of.file_stem().and_then(|s| s.to_str()).unwrap_or("plugin");
        let prefix = format!("asperity-{stem}-");
        let folder = std::env::temp_dir();
        remove_left_over(&folder, &prefix);
        let (file, path) = copy_into(&folder, &prefix, bytes)
            .map_err(|e| Diagnostic::new(format!("cannot make the copy that is loaded: {e}")).in_file(of))?;
        Ok(Self { path, _lock: (!cfg!(windows)).then_some(file) })
    }

    /// Path of the copy.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Loads the copy of a file.
pub(crate) fn load(path: &Path, Copy { path: copy, _lock }: Copy) -> Result<Library, Diagnostic> {
    let fail = |message: String| Diagnostic::new(message).in_file(path);
    // SAFETY: loading runs the library's constructors, which a plugin is trusted with; everything else
    // about the file has been checked.
    let library = foreign(|| unsafe { open(&copy) }).map_err(|e| {
        let reason = std::error::Error::source(&e).map_or_else(|| e.to_string(), ToString::to_string);
        // The system names the copy, but the person knows the original file.
        let reason = reason.replace(&*copy.to_string_lossy(), &path.display().to_string());
        fail(format!("the system does not load it: {reason}"))
    })?;
    COPIES.fetch_add(1, Ordering::Relaxed);
    if cfg!(windows) {
        // A loaded file cannot be deleted there.
        let _ = copy.keep();
    }
    Ok(library)
}

/// Writes the copy and keeps it locked while it is open, so that nobody deletes it as a leftover.
fn copy_into(folder: &Path, prefix: &str, bytes: &[u8]) -> io::Result<(File, TempPath)> {
    loop {
        let copy = tempfile::Builder::new()
            .prefix(prefix)
            .suffix(std::env::consts::DLL_SUFFIX)
            .tempfile_in(folder)?;
        let (mut file, path) = copy.into_parts();
        // Waits for a process that checks the file and may delete it. Not every file system has locks.
        let _ = file.lock();
        if path.exists() {
            file.write_all(bytes)?;
            return Ok((file, path));
        }
    }
}

/// Deletes copies of ended processes, which crashed or were killed while loading them.
fn remove_left_over(folder: &Path, prefix: &str) {
    let random = |name: &str| {
        let random = name.strip_prefix(prefix)?.strip_suffix(std::env::consts::DLL_SUFFIX)?;
        Some(random.len() == 6 && random.bytes().all(|b| b.is_ascii_alphanumeric()))
    };
    for entry in fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
        let is_copy = random(&entry.file_name().to_string_lossy()) == Some(true)
            && entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_copy
            && let Ok(file) = File::open(entry.path())
            && file.try_lock().is_ok()
        {
            // A loaded copy cannot be deleted on Windows.
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(unix)]
unsafe fn open(copy: &Path) -> Result<Library, libloading::Error> {
    use libloading::os::unix;
    // SAFETY: the caller's promise.
    unsafe { unix::Library::open(Some(copy), unix::RTLD_NOW | unix::RTLD_LOCAL) }.map(Into::into)
}

#[cfg(not(unix))]
unsafe fn open(copy: &Path) -> Result<Library, libloading::Error> {
    // SAFETY: the caller's promise.
    unsafe { Library::new(copy) }
}

/// Number of a library's build; never 0.
pub(crate) fn build_of(bytes: &[u8]) -> u64 {
    fnv(bytes).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plugin that crashed while loading once left its copy forever.
    #[test]
    fn copies_of_ended_processes_are_removed() {
        let dir = tempfile::tempdir().unwrap();
        let made = |name: &str| {
            let path = dir.path().join(name.to_owned() + std::env::consts::DLL_SUFFIX);
            File::create(&path).unwrap();
            path
        };
        let [gone, other, longer] =
            ["asperity-a-Ab12Cd", "asperity-b-Ab12Cd", "asperity-a-b-Ab12Cd"].map(made);
        let (_lock, held) = copy_into(dir.path(), "asperity-a-", b"x").unwrap();
        remove_left_over(dir.path(), "asperity-a-");
        let there = [gone.as_path(), &other, &longer, &held].map(Path::exists);
        assert_eq!(there, [false, true, true, true]);
    }
}
