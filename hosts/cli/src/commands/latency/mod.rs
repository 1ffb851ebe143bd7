//! `asperity latency`: time from the hand to the actuator.
//!
//! Two parts add up. [`chain`]: the response lag of a graph after a change of speed, found offline.
//! [`loopback`]: reading the hand and buffering in real time, declared item by item, and measured over a
//! loopback from the output to an input.

mod chain;
mod loopback;

use std::path::PathBuf;

use clap::{Arg, ArgGroup};
use serde::Serialize;
use serde_json::{Value, json};

use crate::card::{ActuatorArgs, OutputArgs};
use crate::failure::{Failure, print_report, wrong};
use crate::load::PluginArgs;
use crate::number::{channel, number, whole};
use chain::Chain;
use loopback::{Loopback, TICK_MS};

/// Report the response lag of graphs, or measure a device's latency through a loopback cable
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args = crate::number::may_be_negative, mut_args = with_graph_or_device)]
#[command(group = ArgGroup::new("card").args(["host", "device"]).multiple(true))]
#[command(after_help = crate::commands::examples(&[
    "asperity latency graphs/texture.ron graphs/heravi2024.ron",
    "asperity latency --device \"USB Audio\" --channel 3 --input-channel 1",
]))]
pub struct Args {
    /// Graphs whose response lag to a step of speed is reported
    #[arg(value_parser = crate::shipped::path())]
    pub graphs: Vec<PathBuf>,
    #[command(flatten)]
    pub output: OutputArgs,
    /// Device to record from; by default the host's default input
    #[arg(long, value_name = "DEVICE")]
    pub input_device: Option<String>,
    /// Channel of the input that is connected to the output
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = channel)]
    pub input_channel: u16,
    /// The loopback is inside the audio server, not a cable
    #[arg(long)]
    pub inside: bool,
    /// Known latency of the input, from sound to callback
    #[arg(long, value_name = "MS", conflicts_with = "inside", value_parser = number(0.0, 10_000.0, "ms"))]
    pub input_latency_ms: Option<f64>,
    /// Number of clicks
    #[arg(long, default_value_t = 50, value_name = "N", value_parser = whole(3_u32, 10_000, "clicks"))]
    pub trials: u32,
    /// Height of a click
    #[arg(long, default_value_t = 0.1, value_name = "A", value_parser = number(1e-4, 100.0, "A"))]
    pub amps: f64,
    /// Input level that counts as a click, as a part of full scale
    #[arg(long, default_value_t = 0.01, value_name = "LEVEL")]
    #[arg(value_parser = number(1e-6, 1.0, "of full scale"))]
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

/// A part of a latency, in words.
#[derive(Serialize)]
struct Item {
    what: String,
    ms: f64,
}

/// Refuses options without effect: those of graphs need a graph, all others a device.
fn with_graph_or_device(arg: Arg) -> Arg {
    match arg.get_id().as_str() {
        "graphs" | "host" | "device" | "json" | "help" => arg,
        "set" | "plugin" => arg.requires("graphs"),
        _ => arg.requires("card"),
    }
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let wanted = args.output.card.device.is_some() || args.output.card.host.is_some();
    if args.graphs.is_empty() && !wanted {
        return Err(wrong(
            "asperity latency",
            "there is nothing to measure",
            "name graphs, or a device whose output is connected to its input: --device D",
        ));
    }
    let clicks = wanted.then(|| loopback::prepare(args)).transpose()?;
    let ready = chain::prepare(args)?;
    let chains: Vec<Chain> = ready.into_iter().map(chain::measure).collect::<Result<_, _>>()?;
    let around = clicks.map(|made| loopback::measure(args, made)).transpose()?;
    let around = around.as_ref();
    print_report(args.json, || as_json(&chains, around), || text(&chains, around))?;
    Failure::said(around.is_some_and(|a| !a.agrees()))
}

fn text(chains: &[Chain], around: Option<&Loopback>) -> String {
    let mut out = String::new();
    let items = |items: &[Item]| -> String {
        items.iter().map(|Item { what, ms }| format!("  {ms:8.2} ms  {what}\n")).collect()
    };
    if let Some(a) = around {
        let (device, clock, frames) = (&a.device, &a.clock, a.period_frames);
        let [least, median, most] = a.range_ms();
        let verdict = if a.agrees() { "they agree within a tick" } else { "THEY DO NOT AGREE within a tick" };
        out += &format!("from a hand to the output, on {device}, {clock} clock, {frames} frames\n");
        out += &items(&a.items);
        out += &format!(
            "  {:8.2} ms  declared in all\n  \
             {median:8.2} ms  measured over the loopback: median of {}, from {least:.2} to {most:.2} ms\n  \
             {:8.2} ms  between them: {verdict} ({TICK_MS:.2} ms)\n\n",
            a.declared_ms(),
            a.measured_ms.len(),
            a.off_ms()
        );
    }
    for Chain { graph, lag, items: known } in chains {
        out += &format!("{graph}: {lag}\n{}", items(known));
        if let Ok([tenth, half, most]) = lag.measured {
            out += &format!(
                "  a step of speed shows by 10, 50 and 90 % after {tenth:.1}, {half:.1} and {most:.1} ms\n"
            );
            if let Some(around) = around {
                let all = around.declared_ms() + half;
                out += &format!("  response lag with the device: {all:.1} ms\n");
            }
        }
        out += "\n";
    }
    out.truncate(out.trim_end().len());
    out.push('\n');
    out
}

fn as_json(chains: &[Chain], around: Option<&Loopback>) -> Value {
    let around = around.map(|a| {
        json!({
            "device": a.device, "clock": a.clock, "period_frames": a.period_frames, "tick_ms": TICK_MS,
            "items": a.items, "declared_ms": a.declared_ms(), "measured_ms": a.measured_ms,
            "median_ms": a.range_ms()[1], "agrees": a.agrees(),
        })
    });
    json!({ "graphs": chains, "around": around })
}
