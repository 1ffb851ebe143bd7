//! `asperity tone`: a sine on one channel, to find the actuator.

use std::io::IsTerminal;
use std::process::ExitCode;

use asperity_diagnostics::Diagnostic;
use asperity_engine::Engine;
use asperity_graph::Compiled;
use asperity_node::Buffer;

use crate::args::Tone;
use crate::failure::{Failure, complain, print};
use crate::live::perform::{Watching, graph, output_nodes, play};

/// Seconds from silence to full: an actuator that is not where one thought is not struck.
const START_S: f64 = 0.5;
/// Ticks a second, as the graph of [`graph`] has.
const TICK_HZ: f64 = 500.0;
/// Longest that is tried beforehand, to say how loud it will be: by then the limiter has found its gain \[s\].
const TRIED_S: f64 = 3.0;
/// The last seconds of it, in which it is as loud as it stays.
const LAST_S: f64 = 0.2;
/// What is this much below the tone that was asked for is told.
const AS_ASKED: f64 = 0.99;

/// Runs the command.
pub fn run(args: &Tone) -> Result<ExitCode, Failure> {
    range("--hz", args.hz, 1.0, (0.45 * f64::from(args.rate)).min(20_000.0), "Hz")?;
    let nodes = format!(
        r#""tone": (kind: "sine", params: (frequency_hz: {:?}, amplitude: {:?}, unit: "A")), {}"#,
        args.hz,
        args.amps,
        output_nodes(&args.actuator)?
    );
    let wires = r#"("tone", "limiter"), ("limiter", "out")"#;
    let (_, tried) = graph("the tone", args.rate, &nodes, wires)?;
    let peaks = peaks(tried, args);
    let made = graph("the tone", args.rate, &nodes, wires)?;
    let ticks = (args.seconds * TICK_HZ).round() as u64;
    let mut told = args.quiet;
    let channel = args.output.channel();
    let mut view = |view: &asperity_live::view::View, _: &asperity_live::Listener| {
        if !told && view.period_frames > 0 {
            told = true;
            let end = if std::io::stderr().is_terminal() { "; Ctrl-C stops" } else { "" };
            complain(&format!(
                "{} Hz, {} on channel {channel} of {}, for {} s{end}\n",
                args.hz,
                loudness(args.amps, peaks),
                view.device,
                args.seconds
            ));
        }
        true
    };
    let watching = Watching { view: &mut view, recorded: &mut |_, _, _| {} };
    let card = args.output.recording_from(None);
    let (ended, _) = play(made, &card, START_S, Default::default(), ticks, watching)?;
    if !args.quiet {
        print(&limited(&ended))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// How strong the tone is behind the limiter, within the card's full scale and after the ramp of the start \[A peak\]: at its strongest,
/// and as it stays. It is run without a device.
fn peaks(compiled: Compiled, args: &Tone) -> [f64; 2] {
    let full_scale = args.actuator.amps_per_volt * args.actuator.volts_at_full_scale;
    let Some(out) = compiled.schedule.index_of("out") else { return [args.amps.min(full_scale); 2] };
    let mut engine = Engine::new(compiled, Default::default());
    let ticks = (args.seconds.clamp(START_S + LAST_S, TRIED_S) * TICK_HZ) as u64;
    let last = ticks.saturating_sub((LAST_S * TICK_HZ) as u64);
    let (mut strongest, mut stays) = (0.0_f64, 0.0_f64);
    for tick in 0..ticks {
        engine.tick();
        let Some(Buffer::Audio { samples, len, .. }) = engine.output(out, 0) else { continue };
        let ramp = (tick as f64 / (START_S * TICK_HZ)).min(1.0);
        let peak = samples[..*len].iter().fold(0.0_f64, |peak, x| peak.max(f64::from(x.abs())));
        let peak = ramp * peak.min(1.0) * full_scale;
        strongest = strongest.max(peak);
        if tick >= last {
            stays = stays.max(peak);
        }
    }
    [strongest, stays]
}

/// What is played, and why it is not what was asked for.
fn loudness(asked: f64, [strongest, stays]: [f64; 2]) -> String {
    if stays >= AS_ASKED * asked {
        return format!("{asked} A peak");
    }
    let then = if strongest > stays / AS_ASKED { format!(", then {stays:.3} A") } else { String::new() };
    format!(
        "{strongest:.3} A peak{then} ({asked} A are asked for; the limiter and the card's full scale let no more through)"
    )
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

/// An option within a range that depends on others.
pub fn range(option: &str, x: f64, least: f64, most: f64, unit: &str) -> Result<(), Failure> {
    if x >= least && x <= most {
        return Ok(());
    }
    let message = format!("{x} {unit} is out of range");
    Err(Diagnostic::new(message).in_file(option).help(format!("{least} to {most} {unit}")).into())
}
