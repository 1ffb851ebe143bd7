//! The `asperity` program: graphs from the command line.

// Everything here is the one program; `pub` says what a module offers the others.
#![allow(unreachable_pub)]

mod args;
mod commands;
mod failure;
mod heap;
mod kinds;
mod leave;
mod live;
mod load;
mod machine;
mod output;
mod phase;
mod render;
mod simulated;
mod source;
mod trust;
mod watch;

use std::process::ExitCode;

use asperity_diagnostics::{Diagnostic, one_of};
use asperity_dsp::Isa;
use clap::Parser;

use args::{Args, Command};
use failure::Failure;

fn main() -> ExitCode {
    simulated::register();
    let args = Args::parse();
    let _staying = leave::on_purpose_only();
    leave::not_for_a_long_file();
    heap::limit(args.memory);
    if args.overwrite {
        output::overwrite();
    }
    if let Err(failure) = instructions(args.portable) {
        return failure.report();
    }
    let result = match args.command {
        Command::Render(args) => render::run(&args),
        Command::Run(args) => live::run(&args),
        Command::Setup(args) => commands::setup::run(&args),
        Command::Recover(args) => commands::recover::run(&args),
        Command::Tone(args) => commands::tone::run(&args),
        Command::Latency(args) => commands::latency::run(&args),
        Command::Devices(args) => commands::devices::run(&args),
        Command::Calibrate(args) => commands::calibrate::run(&args),
        Command::Check(args) => commands::check::run(&args),
        Command::Nodes(args) => commands::nodes::run(&args),
        Command::Graph(args) => commands::graph::run(&args),
        Command::Invert(args) => commands::invert::run(&args),
        Command::Compare(args) => commands::compare::run(&args),
        Command::Tradeoff(args) => commands::tradeoff::run(&args),
        Command::Choose(args) => commands::choose::run(&args),
        Command::Encode(args) => commands::encode::run(&args),
        Command::FitAr(args) => commands::fit_ar::run(&args),
        Command::Materials(args) => commands::materials::run(&args),
        Command::Scene(command) => commands::scene::run(&command),
        Command::SelfTest(args) => commands::selftest::run(&args),
        Command::Plugin(command) => commands::plugin::run(&command),
        Command::Trust(args) => commands::trust::run(&args),
    };
    result.unwrap_or_else(|failure| failure.report())
}

/// The best instruction set that may be used, by its name.
const INSTRUCTIONS: &str = "ASPERITY_ISA";

/// Limits the vector instructions that kernels use, where that is asked for.
fn instructions(portable: bool) -> Result<(), Failure> {
    let Some(name) = std::env::var_os(INSTRUCTIONS).filter(|name| !name.is_empty()) else {
        if portable {
            Isa::limit(Isa::Portable);
        }
        return Ok(());
    };
    let name = name.to_string_lossy();
    let Some(isa) = Isa::ALL.into_iter().find(|isa| isa.name() == name) else {
        let help = one_of(&name, Isa::ALL.map(Isa::name));
        return Err(Diagnostic::new(format!("there is no instruction set `{name}`"))
            .in_file(INSTRUCTIONS)
            .help(help)
            .into());
    };
    if !isa.is_available() {
        let what = format!("this CPU does not have {}", isa.name());
        return Err(Diagnostic::new(what).in_file(INSTRUCTIONS).into());
    }
    Isa::limit(if portable { Isa::Portable } else { isa });
    Ok(())
}
