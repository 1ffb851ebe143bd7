//! `asperity tone`: plays a sine on one channel, to find the actuator.

use std::io::IsTerminal;

use asperity_engine::Engine;
use asperity_graph::Compiled;
use asperity_node::Buffer;

use crate::card::{ActuatorArgs, OutputArgs, TICK_HZ, Watching, graph, output_nodes, play, range};
use crate::failure::{Failure, complain, print};
use crate::number::{number, whole};

/// Play a sine on one channel of a device, to find the actuator; the actuator's limits apply
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args = crate::number::may_be_negative)]
#[command(after_help = crate::commands::examples(&[
    "asperity tone --device \"USB Audio\" --channel 3 --hz 80 --amps 0.05",
]))]
pub struct Args {
    #[command(flatten)]
    pub output: OutputArgs,
    /// Frequency, at most 0.45 of the audio rate
    #[arg(long, default_value_t = 80.0, value_name = "HZ", value_parser = number(1.0, 20_000.0, "Hz"))]
    pub hz: f64,
    /// Peak current, with an amplifier of `--amps-per-volt`
    #[arg(long, default_value_t = 0.05, value_name = "A", value_parser = number(1e-4, 100.0, "A"))]
    pub amps: f64,
    /// Duration
    #[arg(long, default_value_t = 3.0, value_name = "S", value_parser = number(0.01, 86_400.0, "s"))]
    pub seconds: f64,
    /// Audio rate
    #[arg(long, default_value_t = 48_000, value_name = "HZ", value_parser = whole(8_000_u32, 192_000, "Hz"))]
    pub rate: u32,
    #[command(flatten)]
    pub actuator: ActuatorArgs,
    /// Print errors only
    #[arg(long, short)]
    pub quiet: bool,
}

/// Ramp from silence to the full level \[s\]: it spares an actuator on an unexpected channel.
const START_S: f64 = 0.5;
/// Longest trial without a device, which finds the level \[s\]: by then the limiter has settled.
const TRIED_S: f64 = 3.0;
/// Part of the trial at its end, in which the level is steady \[s\].
const LAST_S: f64 = 0.2;
/// A level below this part of the requested one is reported.
const AS_ASKED: f64 = 0.99;

pub fn run(args: &Args) -> Result<(), Failure> {
    range("--hz", args.hz, 1.0, (0.45 * f64::from(args.rate)).min(20_000.0), "Hz")?;
    let actuator = args.actuator.on(&args.output)?;
    let nodes = format!(
        r#""tone": (kind: "sine", params: (frequency_hz: {:?}, amplitude: {:?}, unit: "A")), {}"#,
        args.hz,
        args.amps,
        output_nodes(&actuator)?
    );
    let wires = r#"("tone", "limiter"), ("limiter", "out")"#;
    let (_, tried) = graph("the tone", args.rate, &nodes, wires)?;
    let peaks = peaks(tried, args, actuator.full_scale_a());
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
    Ok(())
}

/// Maximum and steady level of the tone behind limiter, full scale and ramp \[A peak\], without a device.
fn peaks(compiled: Compiled, args: &Args, full_scale: f64) -> [f64; 2] {
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

/// The level in words, and why it is not the requested one.
fn loudness(asked: f64, [strongest, stays]: [f64; 2]) -> String {
    if stays >= AS_ASKED * asked {
        return format!("{asked} A peak");
    }
    let then = if strongest > stays / AS_ASKED { format!(", then {stays:.3} A") } else { String::new() };
    format!(
        "{strongest:.3} A peak{then} ({asked} A are asked for; \
         the limiter and the card's full scale let no more through)"
    )
}

/// Says by how much the limiter lowered the tone, if it did.
fn limited(ended: &asperity_live::Ended) -> String {
    let limiter = ended.graph_controller.schedule().index_of("limiter");
    let Some(facts) = limiter.and_then(|i| ended.facts.get(i)) else { return String::new() };
    let number = |name: &str| {
        facts.iter().find(|f| f.name == name).and_then(|f| match f.value {
            asperity_node::FactValue::Number(x, _) => Some(x),
            _ => None,
        })
    };
    match number("largest_reduction") {
        Some(db) if db > 0.1 => format!(
            "the limiter lowered the tone by {db:.1} dB: the actuator of the profile does not stand more; \
             largest {:.4} A\n",
            number("largest").unwrap_or(0.0)
        ),
        _ => String::new(),
    }
}
