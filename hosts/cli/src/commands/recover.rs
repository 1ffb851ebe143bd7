//! `asperity recover`: recordings of runs that were killed.

use std::path::PathBuf;
use std::process::ExitCode;

use asperity_diagnostics::Diagnostic;

use crate::args::Recover;
use crate::failure::{Failure, print, warn};
use crate::output::{GROWING, Recovered, recover};

/// Runs the command.
pub fn run(args: &Recover) -> Result<ExitCode, Failure> {
    let cannot = |e: std::io::Error| Diagnostic::new(format!("cannot read this: {e}")).in_file(&args.path);
    let files = if args.path.is_dir() {
        let entries = std::fs::read_dir(&args.path).map_err(cannot)?;
        let is_growing = |path: &PathBuf| path.to_string_lossy().ends_with(GROWING);
        let mut files: Vec<PathBuf> =
            entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_growing).collect();
        files.sort();
        files
    } else {
        vec![args.path.clone()]
    };
    if files.is_empty() {
        print(&format!("{}: there is no recording to recover\n", args.path.display()))?;
    }
    let mut wrong = Vec::new();
    for file in files {
        let name = file.display();
        match recover(&file, 0) {
            Ok(Recovered::Kept(kept)) => print(&format!("recovered {}\n", kept.display()))?,
            Ok(Recovered::Empty) => print(&format!("{name} held nothing and is removed\n"))?,
            Ok(Recovered::Busy) => warn(&format!("{name}: a run still records into this file")),
            Err(e) => wrong.push(Diagnostic::new(format!("cannot recover this: {e}")).in_file(&file)),
        }
    }
    if wrong.is_empty() { Ok(ExitCode::SUCCESS) } else { Err(wrong.into()) }
}
