//! The commands. Each has its arguments `Args`, whose docs are its help, and `run`. A new one is a file, and
//! three lines here.

pub mod calibrate;
pub mod check;
pub mod choose;
pub mod compare;
pub mod completions;
pub mod devices;
pub mod encode;
pub mod fit_ar;
pub mod graph;
pub mod invert;
pub mod latency;
pub mod man;
pub mod materials;
pub mod nodes;
pub mod plugin;
pub mod recover;
pub mod reference;
pub mod render;
pub mod run;
pub mod scene;
pub mod selftest;
pub mod setup;
pub mod study;
pub mod tone;
pub mod tradeoff;
pub mod trust;

use clap::{ArgAction, CommandFactory as _, Subcommand};

use crate::failure::Failure;

/// The program's whole command line: for completions, man pages and the reference.
pub fn command() -> clap::Command {
    tell_repeatable(crate::Cli::command())
}

/// Adds to the help of every option that may be repeated that it may.
fn tell_repeatable(command: clap::Command) -> clap::Command {
    let told = |arg: clap::Arg| match (arg.get_action(), arg.get_help()) {
        (ArgAction::Append, Some(help)) if !arg.is_positional() => {
            let help = format!("{help}. May be repeated");
            arg.help(help)
        }
        _ => arg,
    };
    command.mut_args(told).mut_subcommands(tell_repeatable)
}

/// Help that follows the options of a command: lines to try.
pub fn examples(lines: &[&str]) -> String {
    let heading = if lines.len() == 1 { "Example" } else { "Examples" };
    format!("{heading}:\n  {}", lines.join("\n  "))
}

/// The commands, in the order in which `--help` lists them.
#[derive(Debug, Subcommand)]
pub enum Command {
    Render(render::Args),
    Run(run::Args),
    Recover(recover::Args),
    Reference(reference::Args),
    Devices(devices::Args),
    Setup(setup::Args),
    Tone(tone::Args),
    Latency(latency::Args),
    Calibrate(Box<calibrate::Args>),
    Check(check::Args),
    Nodes(nodes::Args),
    Graph(graph::Args),
    Invert(invert::Args),
    Compare(compare::Args),
    Tradeoff(tradeoff::Args),
    Choose(choose::Args),
    Encode(encode::Args),
    FitAr(Box<fit_ar::Args>),
    Materials(materials::Args),
    #[command(subcommand)]
    Scene(scene::Command),
    #[command(name = "selftest")]
    SelfTest(selftest::Args),
    #[command(subcommand)]
    Plugin(plugin::Command),
    #[command(subcommand)]
    Study(study::Command),
    Trust(trust::Args),
    Completions(completions::Args),
    Man(man::Args),
}

impl Command {
    /// Runs the command.
    pub fn run(self) -> Result<(), Failure> {
        match self {
            Command::Render(args) => render::run(&args),
            Command::Run(args) => run::run(&args),
            Command::Recover(args) => recover::run(&args),
            Command::Reference(args) => reference::run(&args),
            Command::Devices(args) => devices::run(&args),
            Command::Setup(args) => setup::run(&args),
            Command::Tone(args) => tone::run(&args),
            Command::Latency(args) => latency::run(&args),
            Command::Calibrate(args) => calibrate::run(&args),
            Command::Check(args) => check::run(&args),
            Command::Nodes(args) => nodes::run(&args),
            Command::Graph(args) => graph::run(&args),
            Command::Invert(args) => invert::run(&args),
            Command::Compare(args) => compare::run(&args),
            Command::Tradeoff(args) => tradeoff::run(&args),
            Command::Choose(args) => choose::run(&args),
            Command::Encode(args) => encode::run(&args),
            Command::FitAr(args) => fit_ar::run(&args),
            Command::Materials(args) => materials::run(&args),
            Command::Scene(command) => scene::run(&command),
            Command::SelfTest(args) => selftest::run(&args),
            Command::Plugin(command) => plugin::run(&command),
            Command::Study(command) => study::run(&command),
            Command::Trust(args) => trust::run(&args),
            Command::Completions(args) => completions::run(&args),
            Command::Man(args) => man::run(&args),
        }
    }
}
