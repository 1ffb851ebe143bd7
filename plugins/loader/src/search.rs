//! Search for plugins.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, nearest};

/// Environment variable that lists folders and files of plugins, as `PATH` lists folders.
pub const PATH_VARIABLE: &str = "ASPERITY_PLUGIN_PATH";

/// A possible plugin file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The file.
    pub path: PathBuf,
    /// The entry of the search path that contains it.
    pub by: PathBuf,
}

/// File name of the plugin called `name` on this system, such as `librtpghi.so`.
pub fn file_name(name: &str) -> String {
    format!("{}{}{}", std::env::consts::DLL_PREFIX, name.replace('-', "_"), std::env::consts::DLL_SUFFIX)
}

/// Whether a plugin is named by its file, not by its name alone.
pub fn is_path(plugin: &str) -> bool {
    plugin.contains(['/', '\\']) || [".so", ".dylib", ".dll"].iter().any(|e| plugin.ends_with(e))
}

/// Folders and files in `list` (the value of [`PATH_VARIABLE`]).
fn entries(list: Option<OsString>) -> Vec<PathBuf> {
    list.map(|l| std::env::split_paths(&l).filter(|p| !p.as_os_str().is_empty()).collect())
        .unwrap_or_default()
}

/// Every shared library in the folders of `list`, and its files, each once, in order; and the entries
/// of the list that cannot be read.
pub fn search(list: Option<OsString>) -> (Vec<Found>, Vec<Diagnostic>) {
    let (mut out, mut problems): (Vec<Found>, Vec<Diagnostic>) = (Vec::new(), Vec::new());
    for by in entries(list) {
        let files = libraries(&by).unwrap_or_else(|e| {
            let message = format!("cannot look for plugins here: {e}");
            problems.push(Diagnostic::new(message).in_file(&by).help(format!("{PATH_VARIABLE} names it")));
            Vec::new()
        });
        for path in files {
            if !out.iter().any(|f| same(&f.path, &path)) {
                out.push(Found { path, by: by.clone() });
            }
        }
    }
    (out, problems)
}

/// Shared libraries of a folder in the order of their names, or the file itself.
fn libraries(by: &Path) -> std::io::Result<Vec<PathBuf>> {
    if !std::fs::metadata(by)?.is_dir() {
        return Ok(vec![by.to_owned()]);
    }
    let mut files = Vec::new();
    for entry in std::fs::read_dir(by)? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == std::env::consts::DLL_EXTENSION) && path.is_file() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Whether two paths lead to the same file.
fn same(a: &Path, b: &Path) -> bool {
    a == b || matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// File of a plugin in a graph or on a command line: a path relative to `base`, or a name that is
/// searched in `base` and then along `list`.
///
/// # Errors
/// A name that is not found. A path is returned unchecked: loading checks it.
pub fn find(plugin: &str, base: &Path, list: Option<OsString>) -> Result<PathBuf, Diagnostic> {
    if is_path(plugin) {
        return Ok(base.join(plugin));
    }
    let file = file_name(plugin);
    let here = base.join(&file);
    if here.is_file() {
        return Ok(here);
    }
    let (found, _) = search(list);
    let name = |f: &Found| f.path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    if let Some(f) = found.iter().find(|f| name(f) == file) {
        return Ok(f.path.clone());
    }
    let names: Vec<String> = found.iter().map(name).collect();
    let near = nearest(&file, names.iter().map(String::as_str)).map(|n| format!("did you mean `{n}`? "));
    let help = format!(
        "{}`{file}` is looked for in {} and along {PATH_VARIABLE}",
        near.unwrap_or_default(),
        if base.as_os_str().is_empty() { "this folder".into() } else { base.display().to_string() },
    );
    Err(Diagnostic::new(format!("there is no plugin `{plugin}`")).help(help))
}
