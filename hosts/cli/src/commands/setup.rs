//! `asperity setup`: writes the machine's file, which describes the amplifier and actuator behind a channel
//! of the sound card.

use std::io::{BufRead as _, IsTerminal as _};
use std::path::Path;
use std::path::PathBuf;
use std::str::FromStr;

use asperity_diagnostics::{Diagnostic, Source};
use asperity_node::Role;

use crate::card;
use crate::failure::{Failure, complain, print};
use crate::kinds::Kinds;
use crate::load::{self, GraphArgs, PluginArgs};
use crate::machine::{Machine, default_path};
use crate::number::{channel, number};
use crate::output::Pending;
use crate::shipped;

/// Describe the actuator and the amplifier behind a channel of the sound card
///
/// The description applies to every graph. No graph can raise its limits, and a graph that contradicts it
/// is refused. At a terminal, the command asks for missing options.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&["asperity setup --device \"USB Audio\" --channel 3"]))]
pub struct Args {
    /// Name or id of the device, as `asperity devices` lists it
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Channel of the device, from 1
    #[arg(long, value_name = "N", value_parser = channel)]
    pub channel: Option<u16>,
    /// Actuator on the channel: a shipped profile or a .ron file
    #[arg(long, value_name = "PROFILE")]
    pub profile: Option<String>,
    /// Mass of the handle that holds the actuator
    #[arg(long, value_name = "G", value_parser = number(1.0, 10_000.0, "g"))]
    pub handle_mass_g: Option<f64>,
    /// Peak volts of the card at full scale
    #[arg(long, value_name = "V", value_parser = number(1e-3, 100.0, "V"))]
    pub volts_at_full_scale: Option<f64>,
    /// Gain of the current amplifier behind the card
    #[arg(long, value_name = "A/V", value_parser = number(1e-3, 100.0, "A/V"))]
    pub amps_per_volt: Option<f64>,
    /// Gain of the voltage amplifier behind the card, if it is one
    #[arg(long, value_name = "V/V", conflicts_with = "amps_per_volt")]
    #[arg(value_parser = number(1e-3, 1000.0, "V/V"))]
    pub volts_per_volt: Option<f64>,
    /// Limit of the card's output voltage; by default full scale
    #[arg(long, value_name = "V", value_parser = number(1e-3, 100.0, "V"))]
    pub most_volts: Option<f64>,
    /// File to write; by default your own
    #[arg(long, value_name = "FILE")]
    pub machine: Option<PathBuf>,
    /// Overwrite the entry of this channel
    #[arg(long)]
    pub overwrite: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let path = args.machine.clone().or_else(default_path);
    let path = path.ok_or_else(|| Failure::Machine("this system has no folder for configuration".into()))?;
    let device: String = given(&args.device, "--device", "Device, as `asperity devices` lists it")?;
    let channel: u16 = given(&args.channel, "--channel", "Channel, from 1")?;
    let profile: String = given(&args.profile, "--profile", "Actuator: a shipped profile or a .ron file")?;
    let handle: f64 = given(&args.handle_mass_g, "--handle-mass-g", "Mass of its handle, in g")?;
    card::actuator(("--profile", &profile), &[("--handle-mass-g", handle)])?;
    let full: f64 =
        given(&args.volts_at_full_scale, "--volts-at-full-scale", "Peak volts of the card at full scale")?;
    let amplifier = match args.volts_per_volt {
        Some(gain) => format!("volts_per_volt: {gain:?}"),
        None => {
            let gain: f64 = given(
                &args.amps_per_volt,
                "--amps-per-volt",
                "Amperes per volt of the current amplifier (a voltage amplifier: --volts-per-volt)",
            )?;
            format!("amps_per_volt: {gain:?}")
        }
    };
    let most = args.most_volts.unwrap_or(full);
    let entry = format!(
        "(device: {device:?}, channel: {channel}, profile: {:?}, handle_mass_g: {handle:?},\n         \
         volts_at_full_scale: {full:?}, {amplifier}, most_volts: {most:?})",
        card::absolute(&profile)?
    );
    let text = edited(&path, &device, channel, &entry, args.overwrite)?;
    // A file that could not be read again is not written.
    Machine::parse(&Source::new(&path, text.clone()))?;
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|e| Failure::writing(folder, e))?;
    }
    let path = Pending::create(&path)?.fill(&text)?.keep()?;
    let mut on = format!(" --device {device:?} --channel {channel}");
    if let Some(machine) = &args.machine {
        on += &format!(" --machine {:?}", machine.display().to_string());
    }
    let options = options(&Machine::read(&path)?, &device, channel)?;
    print(&format!(
        "wrote {}: no graph can drive channel {channel} of `{device}` beyond it\n{entry}\n\n\
         find it:  asperity tone{on}\n\
         play:     asperity run {PLAYED} --page{on}{options}\n",
        path.display()
    ))
}

/// The graph that is offered to play.
const PLAYED: &str = "graphs/live.ron";

/// Options with which this graph follows the entry for a channel.
fn options(machine: &Machine, device: &str, channel: u16) -> Result<String, Failure> {
    let graph = shipped::file(Path::new(PLAYED));
    let args = GraphArgs::plain(graph.as_deref().unwrap_or(Path::new(PLAYED)), &PluginArgs::default());
    let schedule = load::load(&args, &mut Kinds::new(&[]))?.compiled.schedule;
    let out = schedule.with_role(Role::AudioOutput).next().map(|(_, out)| out);
    let entry = machine.named(device, channel);
    Ok(entry.zip(out).map_or_else(String::new, |(entry, out)| entry.options(out, &schedule)))
}

/// The file's text with an entry for a channel. The rest of the text stays.
fn edited(path: &Path, device: &str, channel: u16, entry: &str, overwrite: bool) -> Result<String, Failure> {
    if !path.exists() {
        return Ok(format!(
            "// What stands behind the channels of this machine's sound cards. No graph can raise it.\n\
             Machine(\n    version: 1,\n    outputs: [\n        {entry},\n    ],\n)\n"
        ));
    }
    let machine = Machine::read(path)?;
    let mut text = machine.source.text().to_owned();
    match machine.outputs.iter().find(|o| o.device == device && o.channel == channel) {
        Some(output) if overwrite => {
            text.replace_range(output.place.span.start..output.place.span.end, entry);
        }
        Some(output) => {
            let message = format!("this file already describes channel {channel} of `{device}`");
            return Err(Diagnostic::new(message)
                .at(&machine.source, output.place.span)
                .help("--overwrite replaces it")
                .into());
        }
        None => text.insert_str(machine.list.span.start + 1, &format!("\n        {entry},")),
    }
    Ok(text)
}

/// An option's value; at a terminal, a missing one is asked for.
fn given<T: FromStr + Clone>(value: &Option<T>, option: &str, question: &str) -> Result<T, Failure> {
    if let Some(value) = value {
        return Ok(value.clone());
    }
    let missing = |what: String| Diagnostic::new(what).in_file(option).help(question.to_owned());
    if !std::io::stdin().is_terminal() {
        return Err(missing("this option is missing".into()).into());
    }
    complain(&format!("{question}: "));
    let mut line = String::new();
    std::io::stdin().lock().read_line(&mut line).map_err(|e| Failure::Machine(e.to_string()))?;
    line.trim().parse().map_err(|_| missing(format!("`{}` is no answer to this", line.trim())).into())
}
