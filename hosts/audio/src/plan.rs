//! Chooses width, rate, format and buffer of a device.

use cpal::traits::DeviceTrait;
use cpal::{
    BufferSize, StreamConfig, SupportedBufferSize, SupportedStreamConfig, SupportedStreamConfigRange,
};
use jack::{Client, ClientOptions, PortFlags};

use crate::Format;
use crate::find::Side;
use crate::hosts::{Listed, is_mixer};
use crate::request::{Cause, OpenError, Request};

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

/// Plans the device for this request; the error says what the device supports.
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
        notes.push(format!("{device} does {min} to {max} frames a period; {frames} cannot be had"));
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
