//! Chooses width, rate, format and buffer of a device.

use cpal::traits::DeviceTrait;
use cpal::{
    BufferSize, StreamConfig, SupportedBufferSize, SupportedStreamConfig, SupportedStreamConfigRange,
};

use crate::Format;
use crate::find::Side;
use crate::hosts::{Listed, is_mixer};
use crate::jack;
use crate::request::{OpenError, Request};

/// Default frames a call. A host's own default may be 2 s (PulseAudio), so it is never used.
const USUAL_PERIOD: u32 = 256;

/// Configuration of a device.
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

/// Period of a JACK server in frames.
fn only_period(range: Option<&SupportedStreamConfigRange>) -> Option<u32> {
    match range?.buffer_size() {
        SupportedBufferSize::Range { min, max } if min == max => Some(*min),
        _ => None,
    }
}

/// Plans the device for this request; the error says what the device supports.
pub(crate) fn plan(
    listed: &Listed,
    side: Side,
    channels: &[u16],
    request: &Request,
) -> Result<Plan, OpenError> {
    let device = listed.full_id();
    let refused = |reason: String| OpenError::Refused { device: device.clone(), reason };
    let (ranges, usual) = abilities(listed, side).map_err(|error| refused(error.to_string()))?;
    if ranges.is_empty() {
        return Err(refused(format!("it has no {}", side.name())));
    }
    let width = width(listed, side, channels, &ranges, usual.as_ref())?;
    let ranges: Vec<_> = ranges.into_iter().filter(|range| range.channels() == width).collect();
    let fitting: Vec<_> = ranges.iter().filter(|range| range.contains_rate(request.rate_hz)).collect();
    if fitting.is_empty() {
        let mut there: Vec<_> =
            ranges.iter().map(|range| (range.min_sample_rate(), range.max_sample_rate())).collect();
        there.sort_unstable();
        there.dedup();
        return Err(OpenError::NoRate { device, wanted: request.rate_hz, there });
    }
    let can = |format: &Format| fitting.iter().any(|range| range.sample_format() == format.to_cpal());
    let there: Vec<Format> = Format::ALL.into_iter().filter(can).collect();
    let format = match request.format {
        Some(format) => there.iter().copied().find(|one| *one == format),
        None => there.first().copied(),
    };
    let Some(format) = format else {
        return Err(OpenError::NoFormat { device, wanted: request.format, there });
    };
    let mut notes = Vec::new();
    let range = fitting.iter().copied().find(|range| range.sample_format() == format.to_cpal());
    let buffer_size = buffer(listed, request.period_frames, range, &mut notes);
    if listed.host == "jack"
        && let Some(card) = jack::card_channels(side)
    {
        notes.extend(jack::note(side, width, card));
    }
    if let Some(rate) = usual.map(|usual| usual.sample_rate())
        && is_mixer(&listed.host)
        && rate != request.rate_hz
    {
        notes
            .push(format!("{device} runs at {rate} Hz: its server resamples {} Hz to that", request.rate_hz));
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
    let device = listed.full_id();
    width.ok_or(OpenError::NoChannel { device, side: side.name(), wanted: highest, there: most })
}

/// Buffer size to request.
fn buffer(
    listed: &Listed,
    wanted: Option<u32>,
    range: Option<&SupportedStreamConfigRange>,
    notes: &mut Vec<String>,
) -> BufferSize {
    if listed.host == "jack" {
        if let (Some(wanted), Some(runs)) = (wanted, only_period(range))
            && wanted != runs
        {
            notes.push(format!(
                "the JACK server runs at {runs} frames a period; {wanted} cannot be had from here"
            ));
        }
        return BufferSize::Default;
    }
    let frames = wanted.unwrap_or(USUAL_PERIOD);
    let bounds = match range.map(SupportedStreamConfigRange::buffer_size) {
        Some(SupportedBufferSize::Range { min, max }) if min <= max => (*min, *max),
        _ => (1, u32::MAX),
    };
    let had = frames.clamp(bounds.0.max(1), bounds.1.max(1));
    if had != frames && wanted.is_some() {
        let device = listed.full_id();
        notes.push(format!(
            "{device} does {} to {} frames a period; {frames} cannot be had",
            bounds.0, bounds.1
        ));
    }
    BufferSize::Fixed(had)
}
