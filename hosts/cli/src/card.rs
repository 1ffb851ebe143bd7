//! The sound card: its options, how a device is opened, and graphs that a command makes and plays itself.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use asperity_actuator::{ActuatorProfile, Drive, Dynamics};
use asperity_audio::{Cause, Format, Request};
use asperity_diagnostics::{Diagnostic, Source, one_of};
use asperity_graph::{Compiled, GraphFile, Schedule, compile};
use asperity_live::driver::Clock;
use asperity_live::view::View;
use asperity_live::{
    DeviceQueues, Ended, Listener, RunControl, START_S, Session, SessionError, SessionOptions, mic,
    prepare_live,
};
use asperity_node::Role;
use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::failure::{Failure, warn, wrong};
use crate::kinds;
use crate::leave::stop_flag;
use crate::machine::{Coils, Machine};
use crate::number::{channel, number, whole};

/// Which sound card, and how it is opened.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct CardArgs {
    /// Audio host: alsa, jack, pulseaudio, simulated; `asperity devices` lists them
    #[arg(long, value_name = "HOST")]
    pub host: Option<String>,
    /// Device to play on: name, id, or HOST:ID; by default the host's default. No other device replaces it
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Requested buffer size in frames. The device may choose another
    #[arg(long, value_name = "FRAMES", value_parser = whole(1_u32, 65_536, "frames"))]
    pub period: Option<u32>,
    /// Sample format of the device: f32, i16, i24, i32
    #[arg(long, value_name = "FORMAT")]
    pub device_format: Option<String>,
    /// File that `asperity setup` wrote, whose limits no graph can exceed; by default your own
    #[arg(long, value_name = "FILE")]
    pub machine: Option<PathBuf>,
    /// Share the actuator with another run. Both need --share, and each gets half of every limit
    #[arg(long)]
    pub share: bool,
}

/// The sound card of a graph, and the clock of its ticks.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct DeviceArgs {
    #[command(flatten)]
    pub card: CardArgs,
    /// Channels of the device, from 1: one for each `audio_out` of the graph, such as 3,4
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = channel)]
    pub channel: Vec<u16>,
    /// Device to record from, for `audio_in`; by default the host's default input
    #[arg(long, value_name = "DEVICE")]
    pub input_device: Option<String>,
    /// Clock of the ticks. By default `callback` if a buffer is at most a tick long, else `paced`
    #[arg(long, value_enum)]
    pub clock: Option<ClockKind>,
    /// End the run when the device is lost, instead of waiting for it
    #[arg(long)]
    pub no_reconnect: bool,
}

/// The sound card of a command that plays one channel of its own, and ends where the device is lost.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct OutputArgs {
    #[command(flatten)]
    pub card: CardArgs,
    /// Channel of the device, from 1; by default 1
    #[arg(long, value_name = "N", value_parser = channel)]
    pub channel: Option<u16>,
    /// Clock of the ticks. By default `callback` if a buffer is at most a tick long, else `paced`
    #[arg(long, value_parser = audio_clock())]
    pub clock: Option<ClockKind>,
}

impl OutputArgs {
    pub fn channel(&self) -> u16 {
        self.channel.unwrap_or(1)
    }

    /// Options for a graph with one output that records from this device.
    pub fn recording_from(&self, input_device: Option<&str>) -> DeviceArgs {
        DeviceArgs {
            card: self.card.clone(),
            channel: vec![self.channel()],
            input_device: input_device.map(str::to_owned),
            clock: self.clock,
            no_reconnect: true,
        }
    }
}

/// Clock of the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClockKind {
    /// The audio callback: least latency
    Callback,
    /// A thread that follows the callback's clock: evenly spaced ticks on any device
    Paced,
    /// The computer's own clock: no audio device
    Timer,
}

/// Parses a clock that drives a device.
fn audio_clock() -> impl TypedValueParser<Value = ClockKind> {
    PossibleValuesParser::new(["callback", "paced"])
        .map(|name| if name == "paced" { ClockKind::Paced } else { ClockKind::Callback })
}

/// The actuator, and the amplifier before it. By default they are as `asperity setup` wrote them down.
#[derive(Clone, Debug, clap::Args)]
pub struct ActuatorArgs {
    /// Actuator whose limits apply: a shipped profile or a .ron file; by default that of `asperity setup`, or
    /// hapcoil_one
    #[arg(long, value_name = "PROFILE")]
    profile: Option<String>,
    /// Mass of the handle that holds the actuator; by default that of `asperity setup`, or 100
    #[arg(long, value_name = "G", value_parser = number(1.0, 10_000.0, "g"))]
    handle_mass_g: Option<f64>,
    /// Peak volts of the card at full scale; by default those of `asperity setup`, or 1
    #[arg(long, value_name = "V", value_parser = number(1e-3, 100.0, "V"))]
    volts_at_full_scale: Option<f64>,
    /// Gain of the current amplifier behind the card; by default that of `asperity setup`, or 1
    #[arg(long, value_name = "A/V", value_parser = number(1e-3, 100.0, "A/V"))]
    amps_per_volt: Option<f64>,
}

/// The actuator and the amplifier before it.
pub struct Actuator {
    profile: String,
    handle_mass_g: f64,
    volts_at_full_scale: f64,
    amps_per_volt: f64,
}

impl ActuatorArgs {
    /// The actuator on the channel of an output.
    pub fn on(&self, output: &OutputArgs) -> Result<Actuator, Failure> {
        let machine = Machine::find(output.card.machine.as_deref())?;
        let device = output.card.device.as_deref().unwrap_or_default();
        let known = machine.as_ref().and_then(|machine| machine.named(device, output.channel()));
        let gain = known.map(|o| o.amplifier).filter(|(drive, _)| *drive == Drive::Current);
        let of = |said: Option<f64>, known: Option<f64>, usual| said.or(known).unwrap_or(usual);
        let profile = self.profile.clone().or_else(|| known.map(|o| o.profile.clone()));
        Ok(Actuator {
            profile: profile.unwrap_or_else(|| "hapcoil_one".into()),
            handle_mass_g: of(self.handle_mass_g, known.map(|o| o.handle_mass_g), 100.0),
            volts_at_full_scale: of(self.volts_at_full_scale, known.map(|o| o.volts_at_full_scale), 1.0),
            amps_per_volt: of(self.amps_per_volt, gain.map(|(_, gain)| gain), 1.0),
        })
    }
}

impl Actuator {
    /// Current at the card's full scale \[A\].
    pub fn full_scale_a(&self) -> f64 {
        self.amps_per_volt * self.volts_at_full_scale
    }
}

/// The device that a graph needs, as the command line asks for it; `None` where it needs no sound card.
pub fn request(args: &DeviceArgs, schedule: &Schedule) -> Result<Option<Request>, Failure> {
    let of = |role| schedule.with_role(role).map(|(_, node)| node).collect::<Vec<_>>();
    let (outs, ins) = (of(Role::AudioOutput), of(Role::AudioInput));
    let (card, timer) = (&args.card, args.clock == Some(ClockKind::Timer));
    let Some(node) = outs.first().or(ins.first()) else {
        let named = [
            ("--host", card.host.is_some()),
            ("--device", card.device.is_some()),
            ("--channel", !args.channel.is_empty()),
            ("--input-device", args.input_device.is_some()),
            ("--period", card.period.is_some()),
            ("--device-format", card.device_format.is_some()),
            ("--clock", args.clock.is_some() && !timer),
            ("--no-reconnect", args.no_reconnect),
            ("--machine", card.machine.is_some()),
            ("--share", card.share),
        ];
        return match named.iter().find(|(_, is)| *is) {
            Some((option, _)) => Err(wrong(
                option,
                "this graph does not use a sound card",
                "it has no audio_out and no audio_in: leave the option out",
            )),
            None => Ok(None),
        };
    };
    if timer {
        let what = format!("a timer drives no audio device, and `{}` needs one", node.id);
        let help = "leave --clock out, or take the node out of the graph";
        return Err(wrong("--clock", what, help));
    }
    Ok(Some(Request {
        host: card.host.clone(),
        device: card.device.clone(),
        channels: channels(args, outs.len())?,
        input_device: args.input_device.clone(),
        inputs: ins.iter().map(|n| u16::try_from(n.params.integer("channel")).unwrap_or(u16::MAX)).collect(),
        rate_hz: schedule.audio_hz,
        period_frames: card.period,
        format: card.device_format.as_deref().map(format).transpose()?,
    }))
}

fn channels(args: &DeviceArgs, outs: usize) -> Result<Vec<u16>, Failure> {
    let (named, wanted) = (&args.channel, outs.max(1));
    if named.is_empty() {
        return Ok((1..=u16::try_from(wanted).unwrap_or(u16::MAX)).collect());
    }
    if named.len() != wanted {
        let what = format!("{} channels are named, and the graph has {outs} audio_out", named.len());
        return Err(wrong("--channel", what, "one channel for each, such as --channel 3,4"));
    }
    if let Some(twice) = (1..wanted).find(|&i| named[..i].contains(&named[i])) {
        let what = format!("channel {} is named twice", named[twice]);
        return Err(wrong("--channel", what, "a channel for each audio_out; `mix` adds signals"));
    }
    Ok(named.clone())
}

fn format(text: &str) -> Result<Format, Failure> {
    Format::ALL.into_iter().find(|f| f.name() == text).ok_or_else(|| {
        let names = Format::ALL.map(Format::name);
        let help = one_of(text, names.iter().map(String::as_str));
        wrong("--device-format", format!("there is no sample format `{text}`"), help)
    })
}

pub fn coils(args: &DeviceArgs, schedule: &Schedule) -> Result<Coils, Failure> {
    let machine = Machine::find(args.card.machine.as_deref())?;
    Ok(Coils::new(args.card.share, machine.map(Arc::new), Arc::new(schedule.clone())))
}

/// Options of a session that Ctrl-C and the signals for an end stop.
pub fn options(args: &DeviceArgs, device: Option<Request>, coils: Coils) -> SessionOptions {
    let clock = args.clock.map(|c| match c {
        ClockKind::Callback => Clock::Callback,
        ClockKind::Paced => Clock::Paced,
        ClockKind::Timer => Clock::Timer,
    });
    SessionOptions {
        clock: if device.is_none() { Some(Clock::Timer) } else { clock },
        device,
        reconnect: !args.no_reconnect,
        start_s: START_S,
        realtime: true,
        run_control: RunControl::stopped_by(stop_flag()),
        coil_monitor: Some(Box::new(coils)),
    }
}

/// The error for a device that cannot be opened. A graph file sets rate and channels itself: `graph`.
pub fn not_opened(error: SessionError, graph: bool) -> Failure {
    let e = match error {
        SessionError::Device(e) => e,
        SessionError::Refused(d) => return d.into(),
        other => return Failure::Machine(other.to_string()),
    };
    let option = match e.cause {
        Cause::Host => "--host",
        Cause::Device if e.input => "--input-device",
        Cause::Channel(_) if e.input && graph => "--set NODE.channel",
        Cause::Channel(_) if e.input => "--input-channel",
        Cause::Channel(_) => "--channel",
        Cause::Format => "--device-format",
        Cause::Rate(_) if graph => "--set audio_hz",
        Cause::Rate(_) => "--rate",
        _ => "--device",
    };
    let help = match &e.cause {
        Cause::Rate(there) => {
            let rate = there.iter().map(|(low, _)| *low).find(|hz| *hz >= 8000);
            let set = if graph { "--set audio_hz=" } else { "--rate " };
            rate.map(|hz| format!("any rate will do here: {set}{hz}"))
        }
        Cause::Channel(there) => (*there > 0).then(|| format!("1 to {there}")),
        Cause::Device | Cause::Host => {
            Some("`asperity devices` lists all; without a sound card: --device simulated:frames=256".into())
        }
        _ => None,
    };
    let d = Diagnostic::new(e.to_string()).in_file(option);
    help.into_iter().fold(d, Diagnostic::help).into()
}

/// Nodes that stand before every device, from amperes on: `limiter` and `out`.
pub fn output_nodes(actuator: &Actuator) -> Result<String, Failure> {
    let Actuator { profile, handle_mass_g, volts_at_full_scale, amps_per_volt } = actuator;
    self::actuator(("--profile", profile), &[("--handle-mass-g", *handle_mass_g)])?;
    let profile = absolute(profile)?;
    Ok(format!(
        r#""limiter": (kind: "limiter", params: (profile: {profile:?}, handle_mass_g: {handle_mass_g:?})),
           "out": (kind: "audio_out",
               params: (volts_at_full_scale: {volts_at_full_scale:?}, amps_per_volt: {amps_per_volt:?})),"#
    ))
}

/// The profile that an option names. The actuator must fit on handles of these masses \[g\].
pub fn actuator((option, name): (&str, &str), handles: &[(&str, f64)]) -> Result<ActuatorProfile, Failure> {
    let profile = ActuatorProfile::find(name, "".as_ref()).map_err(|d| match d.path() {
        Some(_) => Failure::from(d).named_by(option),
        None => d.in_file(option).into(),
    })?;
    for (handle, grams) in handles {
        Dynamics::new(&profile, *grams).map_err(|e| {
            let help = format!("the actuator is `{}`, of {option}", profile.name);
            Failure::from(Diagnostic::new(e.to_string()).in_file(handle).help(help))
        })?;
    }
    Ok(profile)
}

/// A profile's name, or the absolute path of its file, which a graph anywhere can use.
pub fn absolute(profile: &str) -> Result<String, Failure> {
    if !profile.ends_with(".ron") {
        return Ok(profile.to_owned());
    }
    let path = std::path::absolute(Path::new(profile));
    let path = path.map_err(|e| Failure::Machine(format!("cannot read {profile}: {e}")))?;
    Ok(path.display().to_string())
}

/// Ticks a second of the graphs that commands make.
pub const TICK_HZ: f64 = 500.0;

/// A graph from nodes and wires, called `name`. Errors show no place in its text, which no user wrote.
pub fn graph(name: &str, rate_hz: u32, nodes: &str, wires: &str) -> Result<(GraphFile, Compiled), Failure> {
    let text = format!(
        "Graph(version: 1, tick_hz: {TICK_HZ:.0}, audio_hz: {rate_hz}, nodes: {{{nodes}}}, wires: [{wires}])"
    );
    let own = |failure: Failure| failure.not_shown(Path::new(name));
    let graph = GraphFile::parse(&Source::new(name, text)).map_err(|d| own(d.into()))?;
    let compiled = compile(&graph, &kinds::registry(&[])?, asperity_graph::Options::default());
    Ok((graph, compiled.map_err(|d| own(d.into()))?))
}

/// How often a run is looked at.
const LOOK: Duration = Duration::from_millis(5);

/// Called while a graph plays.
pub struct Watching<'w> {
    /// Called some hundred times a second; answers whether to go on.
    pub view: &'w mut dyn FnMut(&View, &Listener) -> bool,
    /// Called with recorded samples: the sink's id, the number of the first sample, samples.
    pub recorded: &'w mut dyn FnMut(&str, u64, &[f32]),
}

/// Plays a graph until `ticks` have run or `watching` stops it. Answers false where it was stopped.
pub fn play(
    (graph, compiled): (GraphFile, Compiled),
    args: &DeviceArgs,
    start_s: f64,
    queues: DeviceQueues,
    ticks: u64,
    watching: Watching<'_>,
) -> Result<(Ended, bool), Failure> {
    let schedule: &Schedule = &compiled.schedule;
    let request = request(args, schedule)?;
    let coils = coils(args, schedule)?;
    let recorded = request.as_ref().map_or(0, |r| r.inputs.len());
    let (writer, reader) = mic(recorded, schedule.audio_hz, schedule.tick_hz);
    let listener = writer.listener();
    let (writer, reader) = if recorded > 0 { (Some(writer), Some(reader)) } else { (None, None) };
    let (graph_controller, player) =
        prepare_live(compiled, &graph, Default::default(), queues, reader, Vec::new());
    let not_opened = |e| not_opened(e, false);
    let stop = stop_flag();
    let options = SessionOptions { start_s, ..options(args, request, coils) };
    let mut session = Session::start(graph_controller, player, writer, options).map_err(not_opened)?;
    let mut whole = true;
    loop {
        session.poll().map_err(not_opened)?.into_iter().for_each(warn_once);
        if session.graph_controller().recorded(|r| (watching.recorded)(r.sink, r.start, r.values)) > 0 {
            return Err(Failure::Machine("the machine is too slow to record".into()));
        }
        let view = session.view();
        if !session.goes_on() {
            return Err(Failure::Machine(format!("`{}` is lost before the end", view.device)));
        }
        if view.ticks >= ticks {
            break;
        }
        if stop.load(Relaxed) || !(watching.view)(&view, &listener) {
            whole = false;
            break;
        }
        std::thread::sleep(LOOK);
    }
    let mut ended = session.stop();
    ended.graph_controller.recorded(|r| (watching.recorded)(r.sink, r.start, r.values));
    Ok((ended, whole))
}

/// Warns of each thing once: a command may open its device several times.
fn warn_once(notice: String) {
    static SAID: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let mut said = SAID.lock().unwrap_or_else(PoisonError::into_inner);
    if !said.contains(&notice) {
        warn(&notice);
        said.insert(notice);
    }
}

/// Refuses an option's value outside a range that depends on other options.
pub fn range(option: &str, x: f64, least: f64, most: f64, unit: &str) -> Result<(), Failure> {
    if x >= least && x <= most {
        return Ok(());
    }
    let message = format!("{x} {unit} is out of range");
    Err(wrong(option, message, format!("{least} to {most} {unit}")))
}
