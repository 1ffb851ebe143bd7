//! `asperity trust`: folders whose plugins a graph may load.

use std::process::ExitCode;

use asperity_diagnostics::Diagnostic;

use crate::args::Trust;
use crate::failure::{Failure, print};
use crate::trust;

/// Runs the command.
pub fn run(args: &Trust) -> Result<ExitCode, Failure> {
    match &args.folder {
        Some(folder) if args.remove => {
            if !trust::remove(folder)? {
                let what = "this folder is not on the list of trusted ones";
                return Err(Diagnostic::new(what).in_file(folder).help("see `asperity trust`").into());
            }
            print(&format!("{} is trusted no more\n", folder.display()))?;
        }
        Some(folder) => {
            let folder = trust::add(folder)?;
            print(&format!("graphs may load plugins from {}\n", folder.display()))?;
        }
        None => {
            let lines: Vec<String> =
                trust::folders().iter().map(|folder| format!("{}\n", folder.display())).collect();
            print(&if lines.is_empty() { "no folder is trusted\n".to_owned() } else { lines.concat() })?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
