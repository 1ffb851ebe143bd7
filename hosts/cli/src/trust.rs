//! Folders whose plugins a graph may load.
//!
//! A plugin may do whatever the person may who runs it, from the moment it is loaded. A graph may come from anybody. So a plugin that
//! a graph names is loaded only where the person trusts its folder, or named it on the command line or in `ASPERITY_PLUGIN_PATH`.

use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};

use asperity_diagnostics::Diagnostic;

use crate::failure::{Failure, clean};
use crate::output;

/// More folders that are trusted, separated as in `PATH`: for machines without a person.
pub const TRUST_VARIABLE: &str = "ASPERITY_TRUST";

/// The person's own list: a folder a line.
fn list() -> Option<PathBuf> {
    Some(dirs::config_dir()?.join("asperity").join("trusted"))
}

/// The folders of the person's own list.
pub fn folders() -> Vec<PathBuf> {
    let text = list().and_then(|list| std::fs::read_to_string(list).ok()).unwrap_or_default();
    text.lines().filter(|line| !line.is_empty()).map(PathBuf::from).collect()
}

/// Whether a file lies in a trusted folder or below one, wherever links lead.
pub fn is_trusted(file: &Path) -> bool {
    let Ok(file) = file.canonicalize() else { return false };
    let more = std::env::var_os(TRUST_VARIABLE).unwrap_or_default();
    let more = std::env::split_paths(&more).filter(|folder| !folder.as_os_str().is_empty());
    let all = folders().into_iter().chain(more);
    all.filter_map(|folder| folder.canonicalize().ok()).any(|folder| file.starts_with(folder))
}

/// Trusts a folder from here on.
///
/// # Errors
/// What is no folder; one that everybody may write into; a list that cannot be written.
pub fn add(folder: &Path) -> Result<PathBuf, Failure> {
    let refuse = |what: String| Diagnostic::new(what).in_file(folder);
    let folder = folder.canonicalize().map_err(|e| refuse(format!("there is no such folder: {e}")))?;
    if !folder.is_dir() {
        return Err(refuse("this is no folder".into()).help("trust the folder it lies in").into());
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = std::fs::metadata(&folder).map_or(0, |meta| meta.permissions().mode());
        if mode & 0o002 != 0 {
            let what = "everybody on this machine may write into this folder";
            return Err(refuse(what.into()).help("keep plugins in a folder of your own").into());
        }
    }
    if folder.to_str().is_none_or(|name| name.contains('\n')) {
        return Err(refuse("the name of this folder fits into no line of text".into()).into());
    }
    let mut all = folders();
    if !all.contains(&folder) {
        all.push(folder.clone());
        write(&all)?;
    }
    Ok(folder)
}

/// Trusts a folder no more; false where it was not on the list.
///
/// # Errors
/// A list that cannot be written.
pub fn remove(folder: &Path) -> Result<bool, Failure> {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let all = folders();
    let left: Vec<PathBuf> = all.iter().filter(|f| **f != whole && *f != folder).cloned().collect();
    if left.len() == all.len() {
        return Ok(false);
    }
    write(&left).map(|()| true)
}

fn write(all: &[PathBuf]) -> Result<(), Failure> {
    let Some(list) = list() else {
        return Err(Failure::Machine("this system has no folder for configuration".into()));
    };
    if let Some(folder) = list.parent() {
        std::fs::create_dir_all(folder).map_err(|e| Failure::writing(folder, e))?;
    }
    let lines: Vec<String> = all.iter().map(|folder| format!("{}\n", folder.display())).collect();
    output::write_text(&list, &lines.concat())
}

/// Asks the person, where there is one, whether to trust the folder of a file; a yes is remembered.
pub fn ask(graph: &Path, file: &Path) -> bool {
    let (Some(folder), input) = (file.parent(), std::io::stdin()) else { return false };
    if !input.is_terminal() || !std::io::stderr().is_terminal() {
        return false;
    }
    let (graph, shown) = (graph.display().to_string(), folder.display().to_string());
    let question = format!(
        "{} asks for native code in {}.\nIt may do whatever you may. Trust this folder? [y/N] ",
        clean(&graph),
        clean(&shown)
    );
    let _ = std::io::stderr().write_all(question.as_bytes());
    let mut line = String::new();
    let answered = input.lock().read_line(&mut line).is_ok();
    if !answered || !["y", "yes"].contains(&line.trim().to_lowercase().as_str()) {
        return false;
    }
    match add(folder) {
        Ok(_) => true,
        Err(failure) => {
            failure.report();
            false
        }
    }
}
