//! From the command line to a request for a sound card.

use std::sync::Arc;

use asperity_audio::{Format, OpenError, Request};
use asperity_diagnostics::{Diagnostic, one_of};
use asperity_graph::Schedule;
use asperity_live::driver::Clock;
use asperity_live::{Reins, START_S, SessionError, SessionOptions};

use crate::args::{ClockKind, DeviceArgs};
use crate::failure::Failure;
use crate::machine::{Coils, Machine};
use crate::render::stop_flag;

/// What a graph asks of a sound card, with what the command line says of it; none where it has nothing to do with one.
pub fn request(args: &DeviceArgs, schedule: &Schedule) -> Result<Option<Request>, Failure> {
    let of = |kind: &str| schedule.nodes.iter().filter(move |n| n.kind == kind).collect::<Vec<_>>();
    let (outs, ins) = (of("audio_out"), of("audio_in"));
    let (card, timer) = (&args.card, args.clock == Some(ClockKind::Timer));
    if timer && !(outs.is_empty() && ins.is_empty()) {
        let id = &outs.first().or(ins.first()).map(|n| n.id.clone()).unwrap_or_default();
        return Err(wrong("--clock", format!("a timer drives no audio device, and `{id}` needs one"))
            .help("leave --clock out, or take the node out of the graph")
            .into());
    }
    if outs.is_empty() && ins.is_empty() {
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
            Some((option, _)) => Err(wrong(option, "this graph has nothing to do with a sound card".into())
                .help("it has no audio_out and no audio_in: leave the option out")
                .into()),
            None => Ok(None),
        };
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

/// One channel of the device for every `audio_out`.
fn channels(args: &DeviceArgs, outs: usize) -> Result<Vec<u16>, Failure> {
    let wanted = outs.max(1);
    if args.channel.is_empty() {
        return Ok((1..=u16::try_from(wanted).unwrap_or(u16::MAX)).collect());
    }
    if args.channel.len() != wanted {
        let message =
            format!("{} channels are named, and the graph has {outs} audio_out", args.channel.len());
        return Err(wrong("--channel", message).help("one channel for each, such as --channel 3,4").into());
    }
    if let Some(twice) = (1..wanted).find(|&i| args.channel[..i].contains(&args.channel[i])) {
        let message = format!("channel {} is named twice", args.channel[twice]);
        return Err(wrong("--channel", message)
            .help("a channel for each audio_out; `mix` adds signals")
            .into());
    }
    Ok(args.channel.clone())
}

fn format(text: &str) -> Result<Format, Failure> {
    let names = || Format::ALL.iter().map(|f| f.name());
    Format::ALL.into_iter().find(|f| f.name() == text).ok_or_else(|| {
        wrong("--device-format", format!("there is no sample format `{text}`"))
            .help(one_of(text, names()))
            .into()
    })
}

/// Keeper of the coils behind the card.
pub fn coils(args: &DeviceArgs, schedule: &Schedule) -> Result<Coils, Failure> {
    let machine = Machine::find(args.card.machine.as_deref())?;
    Ok(Coils::new(args.card.share, machine.map(Arc::new), Arc::new(schedule.clone())))
}

/// How a session is to be started: one that Ctrl-C and the signals that ask for an end stop.
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
        reins: Reins::stopped_by(stop_flag()),
        keeper: Some(Box::new(coils)),
    }
}

/// What a command calls that of which a device may have less than was asked for.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Sets the audio rate.
    pub rate: &'static str,
    /// Sets the channel of the input.
    pub input_channel: &'static str,
    /// What a person is to type to set the rate.
    pub rate_is: &'static str,
}

/// Where a graph says it.
const OF_GRAPH: Options =
    Options { rate: "--set audio_hz", input_channel: "--set NODE.channel", rate_is: "--set audio_hz=" };

/// Where options say it.
pub const OF_COMMAND: Options =
    Options { rate: "--rate", input_channel: "--input-channel", rate_is: "--rate " };

/// A device that cannot be had by a graph, in words that help.
pub fn failed(error: SessionError) -> Failure {
    not_had(error, OF_GRAPH)
}

/// A device that cannot be had, in words that help.
pub fn not_had(error: SessionError, options: Options) -> Failure {
    let e = match error {
        SessionError::Device(e) => e,
        SessionError::Refused(d) => return d.into(),
        other => return Failure::Machine(other.to_string()),
    };
    let option = match &e {
        OpenError::NoHost { .. } | OpenError::HostAway { .. } => "--host",
        OpenError::NoDevice { side: "input", .. } | OpenError::Description { side: "input", .. } => {
            "--input-device"
        }
        OpenError::NoChannel { side: "input", .. } => options.input_channel,
        OpenError::NoChannel { .. } => "--channel",
        OpenError::NoFormat { .. } => "--device-format",
        OpenError::NoRate { .. } => options.rate,
        _ => "--device",
    };
    let help = match &e {
        OpenError::NoRate { there, .. } => {
            let rate = there.iter().map(|(low, _)| *low).find(|hz| *hz >= 8000);
            rate.map(|hz| format!("any rate will do here: {}{hz}", options.rate_is))
        }
        OpenError::NoChannel { there: 0, .. } => None,
        OpenError::NoChannel { there, .. } => Some(format!("1 to {there}")),
        OpenError::NoDevice { .. }
        | OpenError::Ambiguous { .. }
        | OpenError::HostAway { .. }
        | OpenError::Refused { .. } => Some(
            "`asperity devices` lists what there is; without a sound card: --device simulated:frames=256"
                .into(),
        ),
        _ => None,
    };
    let d = wrong(option, e.to_string());
    help.map_or(d.clone(), |help| d.help(help)).into()
}

fn wrong(option: &str, message: String) -> Diagnostic {
    Diagnostic::new(message).in_file(option)
}
