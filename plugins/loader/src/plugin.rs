//! A loaded plugin.

use std::collections::HashSet;
use std::ffi::{CStr, c_char, c_void};
use std::mem::size_of;
use std::path::{Path, PathBuf};
use std::ptr;
use std::sync::Arc;

use asperity_abi::*;
use asperity_diagnostics::Diagnostic;
use asperity_node::{NodeKind, random};

use crate::checked::{Lie, Theirs};
use crate::foreign::foreign;
use crate::kind::{Functions, PluginKind};
use crate::{describe, file};

/// A plugin in this process. Dropping it unloads nothing.
#[derive(Clone)]
pub struct Plugin {
    path: PathBuf,
    name: String,
    version: String,
    build: u64,
    kinds: Vec<Arc<NodeKind>>,
}

impl std::fmt::Debug for Plugin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let kinds: Vec<&str> = self.kinds.iter().map(|k| k.descriptor().kind.as_ref()).collect();
        f.debug_struct("Plugin").field("path", &self.path).field("kinds", &kinds).finish_non_exhaustive()
    }
}

impl Plugin {
    /// Loads a plugin from its shared library.
    ///
    /// # Errors
    /// A file that is missing, is not a library, is for another machine, lacks the entry symbol; has another
    /// magic number or major version, cannot be loaded, or has wrong descriptors.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        let path = path.as_ref();
        let bytes = file::read(path)?;
        Self::from_copy(path, file::Copy::new(path, &bytes)?, file::build_of(&bytes))
    }

    /// Loads the copy of a checked file.
    pub(crate) fn from_copy(path: &Path, copy: file::Copy, build: u64) -> Result<Self, Diagnostic> {
        let library = file::load(path, copy)?;
        // SAFETY: only the address is taken; what lies there is checked below.
        let entry = unsafe { library.get::<*const AsperityEntry>(c"asperity_entry") }
            .map(|s| unsafe { s.try_as_raw_ptr() });
        // Kinds and instances point into it.
        std::mem::forget(library);
        let refuse = |lie: Lie| Diagnostic::new(lie).in_file(path);
        let entry = match entry {
            Ok(Some(at)) => at.cast::<AsperityEntry>().cast_const(),
            _ => return Err(refuse("its entry symbol cannot be found".into())),
        };
        // SAFETY: the symbol of a plugin is an entry, and the library stays loaded.
        unsafe { Self::from_entry(entry, path, build) }
            .map_err(|lie| refuse(lie).help("build the plugin again with the SDK of this version"))
    }

    /// A plugin that is part of this program, for tests. Error: as for [`load`](Self::load).
    pub fn built_in(entry: &'static AsperityEntry) -> Result<Self, Diagnostic> {
        // SAFETY: a reference is a valid pointer, and what is static stays.
        unsafe { Self::from_entry(entry, Path::new("built in"), 1) }.map_err(Diagnostic::new)
    }

    /// # Safety
    /// `entry` points to at least the magic number of an entry, which stays, as does all that it leads to.
    unsafe fn from_entry(entry: *const AsperityEntry, path: &Path, build: u64) -> Result<Self, Lie> {
        // SAFETY: the caller's promise; read byte by byte, since it may be anything.
        let magic = unsafe { entry.cast::<u64>().read_unaligned() };
        if magic != ASPERITY_MAGIC {
            return Err("its entry does not begin with Asperity's magic number".into());
        }
        if !entry.is_aligned() {
            return Err("its entry is not where such a struct can be".into());
        }
        // SAFETY: the magic number says that this is an entry.
        let (size, major, minor) = unsafe { ((*entry).size, (*entry).major, (*entry).minor) };
        if major != ASPERITY_MAJOR {
            return Err(format!(
                "it was built for version {major}.{minor} of the plugin interface; \
                 this program has {ASPERITY_MAJOR}.{ASPERITY_MINOR}"
            ));
        }
        // Its last member in 1.0 is `open`.
        if (size as usize) < std::mem::offset_of!(AsperityEntry, open) + size_of::<usize>() {
            return Err(format!("its entry says it has {size} bytes"));
        }
        // SAFETY: the size says that the member is there.
        let open = unsafe { (*entry).open }.ok_or("its entry has no `open`")?;
        // SAFETY: `open` is called once for a loaded copy, with a host that stays.
        let plugin = foreign(|| unsafe { open(&HOST.0) });
        if plugin.is_null() {
            return Err("it does not open with this program, or panics while it describes its nodes".into());
        }
        // SAFETY: what `open` answers stays.
        unsafe { Self::described(plugin, path, build) }
    }

    /// # Safety
    /// `plugin` is the plugin's answer.
    unsafe fn described(plugin: *const AsperityPlugin, path: &Path, build: u64) -> Result<Self, Lie> {
        // SAFETY: what a plugin answers stays, and so does all that it leads to.
        let theirs = unsafe { Theirs::trusted() };
        let abi = theirs.read(plugin, "its description")?;
        let name = theirs.text(abi.name, "its name")?;
        let version = theirs.text(abi.version, "its version")?;
        if abi.kinds.is_null() {
            return Err("its list of kinds is NULL".into());
        }
        if abi.kind_count == 0 || abi.kind_count > 1024 {
            return Err(format!("it offers {} kinds of nodes", abi.kind_count));
        }
        let facts = extension_of::<AsperityFacts>(theirs, &abi, c"asperity.facts/1")?;
        let facts = facts.and_then(|it| it.facts);
        let effects = extension_of::<AsperityEffects>(theirs, &abi, c"asperity.effect/1")?;
        let origin: Arc<str> = path.display().to_string().into();
        let mut kinds: Vec<Arc<NodeKind>> = Vec::new();
        let mut names = HashSet::new();
        for i in 0..abi.kind_count as usize {
            // SAFETY: there are `kind_count` pointers.
            let at = unsafe { *abi.kinds.add(i) };
            let kind = theirs.read(at, &format!("kind {i}"))?;
            let descriptor = describe::descriptor(theirs, at, &kind, effects.as_ref())?;
            if !names.insert(descriptor.kind.to_string()) {
                return Err(format!("it offers the kind `{}` twice", descriptor.kind));
            }
            let kind = PluginKind { functions: Functions { at, abi: kind, facts }, descriptor };
            kinds.push(Arc::new(kind.kind(origin.clone(), build)));
        }
        Ok(Self { path: path.to_owned(), name, version, build, kinds })
    }

    /// The file it was loaded from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its name, from its description.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its version, from its description.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// Number of its build.
    pub fn build(&self) -> u64 {
        self.build
    }

    /// Its node kinds, for a registry.
    pub fn kinds(&self) -> &[Arc<NodeKind>] {
        &self.kinds
    }
}

/// An extension of a plugin, if it has it. `T` is the struct of the extension of that name.
fn extension_of<T: Grows>(theirs: Theirs, plugin: &AsperityPlugin, name: &CStr) -> Result<Option<T>, Lie> {
    let Some(extension) = plugin.extension else { return Ok(None) };
    // SAFETY: a text that ends with a zero byte.
    let at = foreign(|| unsafe { extension(name.as_ptr()) }).cast::<T>();
    if at.is_null() {
        return Ok(None);
    }
    theirs.read(at, &format!("its extension `{}`", name.to_string_lossy())).map(Some)
}

/// Description of this program for plugins.
struct Host(AsperityHost);
// SAFETY: constant data behind constant pointers.
unsafe impl Sync for Host {}

static HOST: Host = Host(AsperityHost {
    size: size_of::<AsperityHost>() as u32,
    major: ASPERITY_MAJOR,
    minor: ASPERITY_MINOR,
    name: c"Asperity".as_ptr(),
    version: concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast::<c_char>(),
    extension: Some(extension),
});

static RANDOM: AsperityRandom =
    AsperityRandom { size: size_of::<AsperityRandom>() as u32, reserved: 0, uniform: Some(uniform) };

unsafe extern "C" fn uniform(seed: u64, index: u64) -> f64 {
    random::uniform(seed, index)
}

unsafe extern "C" fn extension(_host: *const AsperityHost, name: *const c_char) -> *const c_void {
    if name.is_null() {
        return ptr::null();
    }
    // SAFETY: a text of the plugin's that ends with a zero byte.
    match unsafe { CStr::from_ptr(name) }.to_str() {
        Ok(ASPERITY_EXTENSION_RANDOM) => ptr::from_ref(&RANDOM).cast(),
        _ => ptr::null(),
    }
}
