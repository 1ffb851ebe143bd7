//! `asperity completions`: completions of commands and options for a shell.

use clap_complete::{Shell, generate};

use super::{command, examples};
use crate::failure::{Failure, print};

/// Print completions of commands and options for a shell
#[derive(Debug, clap::Args)]
#[command(after_help = examples(&[
    "asperity completions bash > ~/.local/share/bash-completion/completions/asperity",
    "asperity completions zsh > ~/.zfunc/_asperity",
    "asperity completions fish > ~/.config/fish/completions/asperity.fish",
]))]
pub struct Args {
    /// The shell
    pub shell: Shell,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let mut text = Vec::new();
    generate(args.shell, &mut command(), "asperity", &mut text);
    print(&String::from_utf8_lossy(&text))
}
