//! `asperity latency`

use std::path::PathBuf;

use clap::{Arg, ArgGroup};

use super::number::{channel, number, whole};
use super::{ActuatorArgs, OutputArgs, PluginArgs};

/// `asperity latency`
#[derive(Clone, Debug, clap::Args)]
#[command(group = ArgGroup::new("card").args(["host", "device"]).multiple(true))]
pub struct LatencyArgs {
    /// Graphs whose answer to a step of speed is told
    pub graphs: Vec<PathBuf>,
    #[command(flatten)]
    pub output: OutputArgs,
    /// Device to record from; the same host's default, unless given
    #[arg(long, value_name = "DEVICE")]
    pub input_device: Option<String>,
    /// Channel of the input that the output is joined to
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = channel)]
    pub input_channel: u16,
    /// The loopback is inside the audio server, so that no card adds to it
    #[arg(long)]
    pub inside: bool,
    /// What the input adds, from sound to callback, where it is known
    #[arg(long, value_name = "MS", conflicts_with = "inside", value_parser = number(0.0, 10_000.0, "ms"))]
    pub input_latency_ms: Option<f64>,
    /// How many clicks
    #[arg(long, default_value_t = 50, value_name = "N", value_parser = whole(3_u32, 10_000, "clicks"))]
    pub trials: u32,
    /// Height of a click
    #[arg(long, default_value_t = 0.1, value_name = "A", value_parser = number(1e-4, 100.0, "A"))]
    pub amps: f64,
    /// Level at the input, of full scale, that counts as a click
    #[arg(long, default_value_t = 0.01, value_name = "LEVEL", value_parser = number(1e-6, 1.0, "of full scale"))]
    pub level: f64,
    /// Audio rate
    #[arg(long, default_value_t = 48_000, value_name = "HZ", value_parser = whole(8_000_u32, 192_000, "Hz"))]
    pub rate: u32,
    #[command(flatten)]
    pub actuator: ActuatorArgs,
    /// Set a parameter of the graphs that have it: NODE.PARAM=VALUE
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    pub set: Vec<String>,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Options of graphs need one, all others a device: none is there to be passed over.
pub fn only_with_what_it_is_for(arg: Arg) -> Arg {
    match arg.get_id().as_str() {
        "graphs" | "host" | "device" | "json" | "help" => arg,
        "set" | "plugin" => arg.requires("graphs"),
        _ => arg.requires("card"),
    }
}
