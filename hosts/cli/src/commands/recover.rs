//! `asperity recover`: completes recordings of runs that were killed.

use std::path::PathBuf;

use asperity_diagnostics::Diagnostic;

use crate::failure::{Failure, print, warn};
use crate::output::{GROWING, Recovered, recover};

/// Complete recordings that a killed run left behind
///
/// An unfinished recording is called take.wav.recording. This command corrects its header and renames it to
/// take.wav. If there is a take.wav already, the new name is take-1.wav.
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity recover",
    "asperity recover take.wav.recording",
]))]
pub struct Args {
    /// Recording, or folder of recordings
    #[arg(value_name = "FILE|FOLDER", default_value = ".")]
    pub path: PathBuf,
}

pub fn run(args: &Args) -> Result<(), Failure> {
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
    if wrong.is_empty() { Ok(()) } else { Err(wrong.into()) }
}
