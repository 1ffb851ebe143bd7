//! `asperity devices`: lists audio hosts and devices.

use std::fmt::Write as _;

use asperity_audio::{DeviceInfo, HostInfo, SideInfo};

use crate::failure::{Failure, plural, print_report};

/// List audio hosts and devices: rates, formats, channels, buffer sizes
#[derive(Debug, clap::Args)]
#[command(after_help = super::examples(&["asperity devices"]))]
pub struct Args {
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let hosts = asperity_audio::hosts();
    print_report(args.json, || &hosts, || text(&hosts))
}

/// The next steps where there is a device to play on.
const FOUND: &str = "\
`--device` takes a name, an id, or HOST:ID. Without a sound card: --device simulated:frames=256
To find the actuator: asperity tone --device D --channel 1 --hz 80 --amps 0.05
";

/// The next steps where there is none.
const NOTHING: &str = "\
There is nothing to play on. Do one of these:
  Plug in a sound card, such as a USB audio interface, and run this command again.
  Start the sound server of your desktop: PipeWire or PulseAudio. Or start JACK.
  Play without a sound card. The page in your browser shows what would be played:
      asperity run graphs/live.ron --device simulated:frames=256 --page
";

fn text(hosts: &[HostInfo]) -> String {
    let mut out = String::new();
    for host in hosts {
        let _ = writeln!(out, "{}", host.name);
        match &host.note {
            Some(note) => drop(writeln!(out, "  {note}")),
            None if host.devices.is_empty() => drop(writeln!(out, "  no device")),
            None => {}
        }
        host.devices.iter().for_each(|d| device(&mut out, d));
        out.push('\n');
    }
    let plays = |host: &HostInfo| host.devices.iter().any(|device| device.output.is_some());
    out.push_str(if hosts.iter().any(plays) { FOUND } else { NOTHING });
    out
}

fn device(out: &mut String, d: &DeviceInfo) {
    let default = match (d.default_output, d.default_input) {
        (true, true) => "  (default)",
        (true, false) => "  (default output)",
        (false, true) => "  (default input)",
        (false, false) => "",
    };
    let id = if d.id == d.name { String::new() } else { format!("  [{}]", d.id) };
    let _ = writeln!(out, "  {}{id}{default}", d.name);
    for (what, side) in [("out", &d.output), ("in", &d.input)] {
        if let Some(side) = side {
            let _ = writeln!(out, "      {what:3} {}", side_text(side));
        }
    }
    if let Some(note) = &d.note {
        let _ = writeln!(out, "      {note}");
    }
}

fn side_text(side: &SideInfo) -> String {
    let channels = plural(side.channels.into(), "channel");
    let card = side.card_channels.map_or(String::new(), |n| format!(", {n} of them to a card"));
    let rates: Vec<String> = side.rates_hz.iter().map(u32::to_string).collect();
    let rates = if rates.is_empty() {
        format!("{} to {}", side.rate_range_hz.0, side.rate_range_hz.1)
    } else {
        rates.join(", ")
    };
    let formats: Vec<String> = side.formats.iter().map(ToString::to_string).collect();
    let frames = match side.buffer_frames {
        Some((least, most)) if least == most => format!("; {least} frames at a time"),
        Some((least, most)) => format!("; {least} to {most} frames at a time"),
        None => String::new(),
    };
    format!("{channels}{card}; {rates} Hz; {}{frames}", formats.join(", "))
}
