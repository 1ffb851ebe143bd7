//! `asperity setup`: writes down what stands behind a channel of the sound card.

use std::io::{BufRead as _, IsTerminal as _};
use std::path::Path;
use std::process::ExitCode;
use std::str::FromStr;

use asperity_diagnostics::{Diagnostic, Source};

use crate::args::Setup;
use crate::failure::{Failure, complain, print};
use crate::live::perform;
use crate::machine::{Machine, default_path};
use crate::output::Pending;

/// Runs the command.
pub fn run(args: &Setup) -> Result<ExitCode, Failure> {
    let path = args.machine.clone().or_else(default_path);
    let path = path.ok_or_else(|| Failure::Machine("this system has no folder for configuration".into()))?;
    let device: String = given(&args.device, "--device", "Device, as `asperity devices` lists it")?;
    let channel: u16 = given(&args.channel, "--channel", "Channel, from 1")?;
    let profile: String = given(&args.profile, "--profile", "Actuator: a shipped profile or a .ron file")?;
    let handle: f64 = given(&args.handle_mass_g, "--handle-mass-g", "Mass of what it is fixed to, in g")?;
    perform::actuator(("--profile", &profile), &[("--handle-mass-g", handle)])?;
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
        perform::named(&profile)?
    );
    let text = edited(&path, &device, channel, &entry, args.overwrite)?;
    // What this would not read is not written.
    Machine::parse(&Source::new(&path, text.clone()))?;
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(|e| Failure::writing(folder, e))?;
    }
    let path = Pending::create(&path)?.fill(&text)?.keep()?;
    print(&format!(
        "wrote {}: no graph can drive channel {channel} of `{device}` beyond it\n{entry}\n",
        path.display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// The file's text with an entry for a channel; what else stands in it stays.
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
            let message =
                format!("this file already says what stands behind channel {channel} of `{device}`");
            return Err(Diagnostic::new(message)
                .at(&machine.source, output.place.span)
                .help("--overwrite replaces it")
                .into());
        }
        None => text.insert_str(machine.list.span.start + 1, &format!("\n        {entry},")),
    }
    Ok(text)
}

/// An option's value; asked for in a terminal where the option is missing.
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
