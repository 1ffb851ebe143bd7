//! The `asperity` program: graphs from the command line.
//!
//! A command is one file or folder in [`commands`]: its arguments, its help and `run`. [`load`] makes a
//! schedule of a graph or scene; [`card`] opens the sound card; [`output`] writes files.

// Everything here is the one program; `pub` says what a module offers the others.
#![allow(unreachable_pub)]

mod card;
mod commands;
mod failure;
mod heap;
mod leave;
mod load;
mod machine;
mod number;
mod output;
mod shipped;
mod simulated;

use std::process::ExitCode;

use asperity_diagnostics::{Diagnostic, one_of};
use asperity_dsp::Isa;
use asperity_offline::host::{self, Host};
use asperity_offline::{kinds, lag, phase};
use clap::{FromArgMatches as _, Parser};

use commands::Command;
use failure::{Failure, report};

/// Render touch: a stylus moves, a model predicts the vibration, an actuator plays it
#[derive(Debug, Parser)]
#[command(name = "asperity", version = VERSION, max_term_width = 100)]
#[command(after_help = r"Start here:
  asperity run graphs/live.ron --device simulated --page    stroke and hear a texture in the browser
  asperity render graphs/texture.ron --out canvas.wav       render a stroke to a file
  asperity materials                                        list the materials")]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Memory limit for files and graphs; by default half of the machine's memory
    #[arg(long, global = true, value_name = "N MiB|GiB", value_parser = number::memory)]
    memory: Option<u64>,
    /// Use only vector instructions that every CPU has. Slower, with the same output
    #[arg(long, global = true)]
    portable: bool,
    /// Let a graph overwrite files that Asperity did not make
    #[arg(long, global = true)]
    overwrite: bool,
}

/// Version, commit and features.
const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("ASPERITY_BUILD"), ")");

fn main() -> ExitCode {
    host::set(Host { warn: failure::warn, ask: commands::trust::ask, survives: commands::plugin::survives });
    #[cfg(feature = "tract")]
    asperity_texture::run_graphs_by(asperity_tract::compile);
    simulated::register();
    let cli = Cli::from_arg_matches(&commands::command().get_matches()).unwrap_or_else(|e| e.exit());
    let _staying = leave::on_purpose_only();
    leave::not_for_a_long_file();
    heap::limit(cli.memory);
    if cli.overwrite {
        output::overwrite();
    }
    if let Err(failure) = instructions(cli.portable) {
        return report(&failure);
    }
    cli.command.run().map_or_else(|failure| report(&failure), |()| ExitCode::SUCCESS)
}

/// Environment variable that names the best instruction set to use.
const INSTRUCTIONS: &str = "ASPERITY_ISA";

/// Limits the vector instructions of kernels, as `--portable` or the environment asks.
fn instructions(portable: bool) -> Result<(), Failure> {
    let name = std::env::var_os(INSTRUCTIONS).filter(|name| !name.is_empty());
    if let Some(name) = name.map(|name| name.to_string_lossy().into_owned()) {
        let refuse = |what: String| Diagnostic::new(what).in_file(INSTRUCTIONS);
        let Some(isa) = Isa::ALL.into_iter().find(|isa| isa.name() == name) else {
            let help = one_of(&name, Isa::ALL.map(Isa::name));
            return Err(refuse(format!("there is no instruction set `{name}`")).help(help).into());
        };
        if !isa.is_available() {
            return Err(refuse(format!("this CPU does not have {}", isa.name())).into());
        }
        Isa::limit(isa);
    }
    if portable {
        Isa::limit(Isa::Portable);
    }
    Ok(())
}
