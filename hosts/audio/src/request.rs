//! The request for a device, why it is refused, and the width, rate, format and buffer that fit it.

use std::fmt;

use cpal::traits::DeviceTrait;
use cpal::{
    BufferSize, StreamConfig, SupportedBufferSize, SupportedStreamConfig, SupportedStreamConfigRange,
};
use jack::{Client, ClientOptions, PortFlags};

use crate::Format;
use crate::hosts::{Listed, Side, is_mixer};

/// Request for an output device, and an input device beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Name of the host (`alsa`, `jack`, `pulseaudio`, `pipewire`, `simulated`); then only that host is
    /// searched. `None`: a named
    /// device is searched in all hosts; a default device is that of the first host that answers.
    pub host: Option<String>,
    /// The device: its id, `host:id`, or its name in any case. `None`: the host's default.
    pub device: Option<String>,
    /// Output channels of the device, from 1, one for every channel of a block, in order. The others stay
    /// silent.
    pub channels: Vec<u16>,
    /// The input device, as `device`. `None`: the host's default input; on the simulated host, the same
    /// device.
    pub input_device: Option<String>,
    /// Channels of the input device, from 1, one for every channel of a recorded block. Empty: no
    /// recording.
    pub inputs: Vec<u16>,
    /// Frames a second [Hz]. An unsupported rate is an error.
    pub rate_hz: u32,
    /// Requested frames a call. The device may choose another number: see
    /// [`Stream::period`](crate::Stream::period). `None`: 256, or the server's own on JACK.
    pub period_frames: Option<u32>,
    /// Sample format. `None`: the first of [`Format::ALL`] that the device supports.
    pub format: Option<Format>,
}

impl Default for Request {
    /// The default device, its first channel, at 48 kHz.
    fn default() -> Self {
        Self {
            host: None,
            device: None,
            channels: vec![1],
            input_device: None,
            inputs: Vec::new(),
            rate_hz: 48_000,
            period_frames: None,
            format: None,
        }
    }
}

impl Request {
    /// Checks the request without any device.
    pub(crate) fn check(&self) -> Result<(), OpenError> {
        let wrong = |text: String| Err(OpenError::new(Cause::Request, text));
        if self.channels.is_empty() {
            return wrong("no output channel is asked for".to_owned());
        }
        for (list, side) in [(&self.channels, "output"), (&self.inputs, "input")] {
            if list.contains(&0) {
                return wrong(format!("{side} channels count from 1"));
            }
            if let Some(twice) = list.iter().enumerate().find(|(at, one)| list[..*at].contains(one)) {
                return wrong(format!("{side} channel {} is asked for twice", twice.1));
            }
        }
        if self.rate_hz == 0 || self.period_frames == Some(0) {
            return wrong("rate and period must be more than 0".to_owned());
        }
        Ok(())
    }
}

/// Why a device was not opened. No other device is opened instead.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenError {
    /// The part of the request that cannot be met.
    pub cause: Cause,
    /// Whether it is about the input device.
    pub input: bool,
    /// The reason and the alternatives, for a user.
    pub reason: String,
}

/// The part of a [`Request`] that cannot be met.
#[derive(Clone, Debug, PartialEq)]
pub enum Cause {
    /// The request contradicts itself.
    Request,
    /// There is no such host, or it does not answer.
    Host,
    /// There is no such device, there are several, or it refuses.
    Device,
    /// The device has fewer channels: so many.
    Channel(u16),
    /// The device has other rates: these ranges [Hz].
    Rate(Vec<(u32, u32)>),
    /// The device has other sample formats.
    Format,
}

impl OpenError {
    pub(crate) fn new(cause: Cause, reason: impl Into<String>) -> Self {
        Self { cause, input: false, reason: reason.into() }
    }

    /// The device is there and refuses.
    pub fn refused(device: &str, reason: impl fmt::Display) -> Self {
        Self::new(Cause::Device, format!("`{device}` cannot be opened: {reason}"))
    }
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason)
    }
}

impl std::error::Error for OpenError {}

/// Default frames a call. A host's own default may be 2 s (PulseAudio), so it is never used.
const USUAL_PERIOD: u32 = 256;

pub(crate) struct Plan {
    pub(crate) config: StreamConfig,
    pub(crate) format: Format,
    /// Notes for a user, as sentences.
    pub(crate) notes: Vec<String>,
}

/// Supported configurations of one side, and the default one.
pub(crate) fn abilities(
    listed: &Listed,
    side: Side,
) -> Result<(Vec<SupportedStreamConfigRange>, Option<SupportedStreamConfig>), cpal::Error> {
    let device = &listed.device;
    Ok(match side {
        Side::Output => (device.supported_output_configs()?.collect(), device.default_output_config().ok()),
        Side::Input => (device.supported_input_configs()?.collect(), device.default_input_config().ok()),
    })
}

/// Plans the device for this request; the error lists the formats that the device supports.
pub(crate) fn plan(
    listed: &Listed,
    side: Side,
    channels: &[u16],
    request: &Request,
) -> Result<Plan, OpenError> {
    let device = listed.full_id();
    let (ranges, usual) = abilities(listed, side).map_err(|error| OpenError::refused(&device, error))?;
    if ranges.is_empty() {
        return Err(OpenError::refused(&device, format!("it has no {}", side.name())));
    }
    let width = width(listed, side, channels, &ranges, usual.as_ref())?;
    let ranges: Vec<_> = ranges.into_iter().filter(|range| range.channels() == width).collect();
    let fitting: Vec<_> = ranges.iter().filter(|range| range.contains_rate(request.rate_hz)).collect();
    if fitting.is_empty() {
        let mut there: Vec<_> =
            ranges.iter().map(|range| (range.min_sample_rate(), range.max_sample_rate())).collect();
        there.sort_unstable();
        there.dedup();
        let words = |(low, high): &(u32, u32)| {
            if low == high { low.to_string() } else { format!("{low} to {high}") }
        };
        let rates = there.iter().map(words).collect::<Vec<_>>().join(", ");
        let text = format!("`{device}` cannot run at {} Hz; it can at {rates} Hz", request.rate_hz);
        return Err(OpenError::new(Cause::Rate(there), text));
    }
    let of = |format: Format| fitting.iter().find(|range| range.sample_format() == format.to_cpal());
    let there: Vec<Format> = Format::ALL.into_iter().filter(|format| of(*format).is_some()).collect();
    let wanted = request.format.or(there.first().copied());
    let Some(format) = wanted.filter(|format| there.contains(format)) else {
        let wanted = request.format.map_or("a known sample format".to_owned(), Format::name);
        let can = there.iter().map(|format| format.name()).collect::<Vec<_>>().join(", ");
        let can = if can.is_empty() { can } else { format!("; it can do {can}") };
        return Err(OpenError::new(Cause::Format, format!("`{device}` cannot do {wanted}{can}")));
    };
    let mut notes = Vec::new();
    let buffer_size = buffer(listed, request.period_frames, of(format).map(|r| r.buffer_size()), &mut notes);
    if listed.host == "jack"
        && let Some(card) = jack_ports(side).filter(|card| *card < width)
    {
        notes.push(format!(
            "JACK offers 64 {} channels whatever is behind them; its card has {card} {}: channel {width} \
             leads nowhere unless something is patched to it",
            side.name(),
            if card == 1 { "port" } else { "ports" },
        ));
    }
    if let Some(rate) = usual.map(|usual| usual.sample_rate())
        && is_mixer(&listed.host)
        && rate != request.rate_hz
    {
        let wanted = request.rate_hz;
        notes.push(format!("{device} runs at {rate} Hz: its server resamples {wanted} Hz to that"));
    }
    let config = StreamConfig { channels: width, sample_rate: request.rate_hz, buffer_size };
    Ok(Plan { config, format, notes })
}

/// Channels to open the device with. A mixing server: its own number, since it spreads or folds any other.
/// JACK: as many ports as needed. Others: the smallest number with room, but not one, which ALSA's
/// converters copy to all channels.
fn width(
    listed: &Listed,
    side: Side,
    channels: &[u16],
    ranges: &[SupportedStreamConfigRange],
    usual: Option<&SupportedStreamConfig>,
) -> Result<u16, OpenError> {
    let highest = channels.iter().copied().max().unwrap_or(1);
    let all = || ranges.iter().map(SupportedStreamConfigRange::channels);
    let most = match usual {
        Some(usual) if is_mixer(&listed.host) => usual.channels(),
        _ => all().max().unwrap_or(0),
    };
    let least = |floor: u16| all().filter(|count| *count >= floor).min();
    let width = match listed.host.as_str() {
        _ if highest > most => None,
        _ if is_mixer(&listed.host) => Some(most),
        "jack" => Some(highest),
        _ => least(highest.max(2)).or_else(|| least(highest)),
    };
    width.ok_or_else(|| {
        let (device, side) = (listed.full_id(), side.name());
        let text = format!("`{device}` has no {side} channel {highest}, it has {most}");
        OpenError::new(Cause::Channel(most), text)
    })
}

fn buffer(
    listed: &Listed,
    wanted: Option<u32>,
    range: Option<&SupportedBufferSize>,
    notes: &mut Vec<String>,
) -> BufferSize {
    let (min, max) = match range {
        Some(SupportedBufferSize::Range { min, max }) if min <= max => (*min, *max),
        _ => (1, u32::MAX),
    };
    let frames = wanted.unwrap_or(USUAL_PERIOD);
    let had = frames.clamp(min.max(1), max.max(1));
    if had != frames && wanted.is_some() {
        let device = listed.full_id();
        notes.push(format!("{device} does {min} to {max} frames a period; {frames} is out of range"));
    }
    // A JACK server has one period.
    if listed.host == "jack" { BufferSize::Default } else { BufferSize::Fixed(had) }
}

/// Ports of a JACK server's card on one side. JACK connects as many channels to them; the channels above
/// lead nowhere, though cpal offers 64. `None` if no server answers. Asks the server.
pub(crate) fn jack_ports(side: Side) -> Option<u16> {
    let name = format!("asperity_look_{}", std::process::id());
    let (client, _) = Client::new(&name, ClientOptions::NO_START_SERVER).ok()?;
    // cpal looks for these names too.
    let ports = if side == Side::Output { "^system:playback_" } else { "^system:capture_" };
    u16::try_from(client.ports(Some(ports), None, PortFlags::empty()).len()).ok()
}
