//! `asperity tone`: a sine on one channel, to find the actuator.

use std::io::IsTerminal;
use std::process::ExitCode;

use asperity_source::Diagnostic;

use crate::args::Tone;
use crate::failure::{Failure, complain, print};
use crate::live::perform::{Watching, graph, output_nodes, play};

/// Seconds from silence to full: an actuator that is not where one thought is not struck.
const START_S: f64 = 0.5;

/// Runs the command.
pub fn run(args: &Tone) -> Result<ExitCode, Failure> {
    range("--hz", args.hz, 1.0, 0.45 * f64::from(args.rate), "Hz")?;
    range("--amps", args.amps, 0.0, 100.0, "A")?;
    range("--seconds", args.seconds, 0.01, 86_400.0, "s")?;
    if args.device.channel.len() > 1 {
        let d = Diagnostic::new("a tone is played on one channel").in_file("--channel");
        return Err(d.help("one after the other: that is how the actuator is found").into());
    }
    let nodes = format!(
        r#""tone": (kind: "sine", params: (frequency_hz: {:?}, amplitude: {:?}, unit: "A")), {}"#,
        args.hz,
        args.amps,
        output_nodes(&args.actuator)?
    );
    let made = graph("the tone", args.rate, &nodes, r#"("tone", "limiter"), ("limiter", "out")"#)?;
    let ticks = (args.seconds * 500.0).round() as u64;
    let mut told = args.quiet;
    let channel = args.device.channel.first().copied().unwrap_or(1);
    let mut view = |view: &asperity_live::view::View, _: &asperity_live::Listener| {
        if !told && view.period_frames > 0 {
            told = true;
            let end = if std::io::stderr().is_terminal() { "; Ctrl-C stops" } else { "" };
            complain(&format!(
                "{} Hz, {} A peak on channel {channel} of {}, for {} s{end}\n",
                args.hz, args.amps, view.device, args.seconds
            ));
        }
        true
    };
    let watching = Watching { view: &mut view, recorded: &mut |_, _, _| {} };
    let (ended, _) = play(made, &args.device, START_S, Default::default(), ticks, watching)?;
    if !args.quiet {
        print(&limited(&ended))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether the limiter had to hold the tone back.
fn limited(ended: &asperity_live::Ended) -> String {
    let Some(player) = &ended.player else { return String::new() };
    let engine = player.engine();
    let facts = engine.schedule().index_of("limiter").map(|i| engine.facts(i)).unwrap_or_default();
    let number = |name: &str| {
        facts.iter().find(|f| f.name == name).and_then(|f| match f.value {
            asperity_node::FactValue::Number(x, _) => Some(x),
            _ => None,
        })
    };
    match number("largest_reduction") {
        Some(db) if db > 0.1 => format!(
            "the limiter lowered the tone by {db:.1} dB: the actuator of the profile does not stand more; largest {:.4} A\n",
            number("largest").unwrap_or(0.0)
        ),
        _ => String::new(),
    }
}

/// An option within its range.
pub fn range(option: &str, x: f64, least: f64, most: f64, unit: &str) -> Result<(), Failure> {
    if x >= least && x <= most {
        return Ok(());
    }
    let message = format!("{x} {unit} is out of range");
    Err(Diagnostic::new(message).in_file(option).help(format!("{least} to {most} {unit}")).into())
}
