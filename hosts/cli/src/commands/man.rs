//! `asperity man`: manual pages.

use std::path::PathBuf;

use asperity_diagnostics::one_of;
use clap_mangen::{Man, generate_to};

use super::{command, examples};
use crate::failure::{Failure, print, wrong};

/// Print the manual page of a command, or write those of all commands to a folder
#[derive(Debug, clap::Args)]
#[command(after_help = examples(&[
    "asperity man render | man -l -",
    "asperity man --out ~/.local/share/man/man1",
]))]
pub struct Args {
    /// The command, such as `render` or `scene explain`; the whole program, unless given
    #[arg(value_name = "COMMAND", conflicts_with = "out")]
    pub of: Vec<String>,
    /// Folder for a page of each command; it is made where it is missing
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let mut all = command().propagate_version(true);
    if let Some(folder) = &args.out {
        let write = || std::fs::create_dir_all(folder).and_then(|()| generate_to(all, folder));
        return write().map_err(|e| Failure::writing(folder, e));
    }
    // Gives commands their full names.
    all.build();
    let mut one = &all;
    for name in &args.of {
        one = one.find_subcommand(name).ok_or_else(|| {
            let names: Vec<&str> = one.get_subcommands().map(clap::Command::get_name).collect();
            wrong("asperity man", format!("there is no command `{name}`"), one_of(name, names))
        })?;
    }
    let mut page = Vec::new();
    Man::new(one.clone()).render(&mut page).map_err(|e| Failure::Machine(e.to_string()))?;
    print(&String::from_utf8_lossy(&page))
}
