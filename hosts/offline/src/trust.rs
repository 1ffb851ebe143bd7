//! Folders whose plugins a graph may load: `asperity trust` keeps the list.

use std::path::{Path, PathBuf};

/// More trusted folders, separated as in `PATH`: for machines without a user.
const VARIABLE: &str = "ASPERITY_TRUST";

/// Whether a file lies in or below a trusted folder; links are followed.
pub fn is_trusted(file: &Path) -> bool {
    let Ok(file) = file.canonicalize() else { return false };
    let more = std::env::var_os(VARIABLE).unwrap_or_default();
    let more = std::env::split_paths(&more).filter(|folder| !folder.as_os_str().is_empty());
    let all = folders().into_iter().chain(more);
    all.filter_map(|folder| folder.canonicalize().ok()).any(|folder| file.starts_with(folder))
}

/// The user's list: a folder a line.
pub fn list() -> Option<PathBuf> {
    Some(dirs::config_dir()?.join("asperity").join("trusted"))
}

/// The folders on it.
pub fn folders() -> Vec<PathBuf> {
    let text = list().and_then(|list| std::fs::read_to_string(list).ok()).unwrap_or_default();
    text.lines().filter(|line| !line.is_empty()).map(PathBuf::from).collect()
}
