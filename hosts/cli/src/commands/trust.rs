//! `asperity trust`: folders whose plugins a graph may load.
//!
//! A plugin may do whatever its user may, from the moment it is loaded, and a graph may come from anybody.
//! So a plugin that a graph names is loaded only from a folder that the user trusts, or if the command line
//! or `ASPERITY_PLUGIN_PATH` names it too.

use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};

use asperity_diagnostics::Diagnostic;
use asperity_offline::trust::{folders, list};

use crate::failure::{Failure, clean, print, report, wrong};
use crate::output;

/// Let graphs load plugins from a folder, or list such folders
///
/// A plugin can do anything that you can, from the moment it is loaded. So a graph loads plugins only from
/// trusted folders, or if --plugin or ASPERITY_PLUGIN_PATH names them too. ASPERITY_TRUST lists more
/// trusted folders.
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity trust ~/asperity/plugins",
    "asperity trust ~/asperity/plugins --remove",
]))]
pub struct Args {
    /// Folder to trust; without one, the trusted folders are listed
    pub folder: Option<PathBuf>,
    /// Stop trusting the folder
    #[arg(long, requires = "folder")]
    pub remove: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    print(&match &args.folder {
        Some(folder) if args.remove => {
            remove(folder)?;
            format!("{} is trusted no more\n", folder.display())
        }
        Some(folder) => format!("graphs may load plugins from {}\n", add(folder)?.display()),
        None if folders().is_empty() => "no folder is trusted\n".to_owned(),
        None => lines(&folders()),
    })
}

/// Asks the user at the terminal, if there is one, whether to trust the folder of a file. Remembers a yes.
pub fn ask(graph: &Path, file: &Path) -> bool {
    let (Some(folder), input) = (file.parent(), std::io::stdin()) else { return false };
    if !input.is_terminal() || !std::io::stderr().is_terminal() {
        return false;
    }
    let [graph, shown] = [graph, folder].map(|path| clean(&path.display().to_string()));
    let question = format!(
        "{graph} asks for native code in {shown}.\nIt may do whatever you may. Trust this folder? [y/N] "
    );
    let _ = std::io::stderr().write_all(question.as_bytes());
    let mut line = String::new();
    let answered = input.lock().read_line(&mut line).is_ok();
    if !answered || !["y", "yes"].contains(&line.trim().to_lowercase().as_str()) {
        return false;
    }
    add(folder).map_err(|failure| report(&failure)).is_ok()
}

fn add(folder: &Path) -> Result<PathBuf, Failure> {
    let refuse = |what: &str| Diagnostic::new(what).in_file(folder);
    let whole = folder.canonicalize().map_err(|e| refuse(&format!("there is no such folder: {e}")))?;
    if !whole.is_dir() {
        return Err(refuse("this is no folder").help("trust the folder it lies in").into());
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = std::fs::metadata(&whole).map_or(0, |meta| meta.permissions().mode());
        if mode & 0o002 != 0 {
            let what = "everybody on this machine may write into this folder";
            return Err(refuse(what).help("keep plugins in a folder of your own").into());
        }
    }
    if whole.to_str().is_none_or(|name| name.contains('\n')) {
        return Err(refuse("the list cannot hold this name: it has a line break or is not UTF-8").into());
    }
    let mut all = folders();
    if !all.contains(&whole) {
        all.push(whole.clone());
        write(&all)?;
    }
    Ok(whole)
}

fn remove(folder: &Path) -> Result<(), Failure> {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let (gone, left): (Vec<_>, Vec<_>) = folders().into_iter().partition(|f| *f == whole || f == folder);
    if gone.is_empty() {
        let what = "this folder is not on the list of trusted ones";
        return Err(wrong(folder, what, "see `asperity trust`"));
    }
    write(&left)
}

fn lines(folders: &[PathBuf]) -> String {
    folders.iter().map(|folder| format!("{}\n", folder.display())).collect()
}

fn write(all: &[PathBuf]) -> Result<(), Failure> {
    let list =
        list().ok_or_else(|| Failure::Machine("this system has no folder for configuration".into()))?;
    if let Some(folder) = list.parent() {
        std::fs::create_dir_all(folder).map_err(|e| Failure::writing(folder, e))?;
    }
    output::write_text(&list, &lines(all))
}
