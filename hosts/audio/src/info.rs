//! Lists devices for a user.

use std::time::{Duration, Instant};

use cpal::{SupportedBufferSize, SupportedStreamConfigRange};
use serde::Serialize;

use crate::Format;
use crate::bounded::bounded;
use crate::hosts::{Listed, PATIENCE, Side, is_mixer, list, names};
use crate::request::{abilities, jack_ports};

/// Rates that devices are asked for [Hz].
pub const RATES_HZ: [u32; 3] = [44_100, 48_000, 96_000];

/// Longest time that a device may take to report its abilities.
const EACH: Duration = Duration::from_millis(1500);

/// A host and its devices.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HostInfo {
    /// Its name, as a user types it.
    pub name: String,
    /// Why it has no devices: no server runs, or one hangs.
    pub note: Option<String>,
    /// Its devices.
    pub devices: Vec<DeviceInfo>,
}

/// A device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceInfo {
    /// Name of its host.
    pub host: String,
    /// Id to type; `host:id` is unambiguous.
    pub id: String,
    /// A name for people; several may share it.
    pub name: String,
    /// Whether it is its host's default output.
    pub default_output: bool,
    /// Whether it is its host's default input.
    pub default_input: bool,
    /// Output side, if any.
    pub output: Option<SideInfo>,
    /// Input side, if any.
    pub input: Option<SideInfo>,
    /// Why it reports no abilities: it is busy, or exists only in name.
    pub note: Option<String>,
}

/// Abilities of one side of a device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SideInfo {
    /// Most channels. JACK says 64 whatever its card has (see `card_channels`); a mixing server says its
    /// device's own number.
    pub channels: u16,
    /// How many of them, from the first, lead to a card; `None` if the host does not tell. JACK does.
    pub card_channels: Option<u16>,
    /// Supported ones of 44100, 48000 and 96000 [Hz].
    pub rates_hz: Vec<u32>,
    /// Lowest and highest rate [Hz].
    pub rate_range_hz: (u32, u32),
    /// Current or default rate [Hz].
    pub rate_hz: Option<u32>,
    /// Supported formats.
    pub formats: Vec<Format>,
    /// Fewest and most frames a call, if it says; equal for JACK.
    pub buffer_frames: Option<(u32, u32)>,
}

/// Every host of this build, with its devices. Never fails as a whole: a host that does not answer says so
/// in its note. Asks all servers at once, and opens devices; takes four seconds if one hangs. The simulated
/// host lists devices that tests made; those described by their id ([`simulated`](crate::simulated)) need
/// no listing.
pub fn hosts() -> Vec<HostInfo> {
    std::thread::scope(|scope| {
        // All at once, so that one that hangs delays no other.
        let asked = names().into_iter().map(|name| (name.clone(), scope.spawn(move || host(name))));
        let asked: Vec<_> = asked.collect();
        let panicked =
            |name| HostInfo { name, note: Some("the query failed".to_owned()), devices: Vec::new() };
        asked.into_iter().map(|(name, host)| host.join().unwrap_or_else(|_| panicked(name))).collect()
    })
}

/// A host and its answers within [`PATIENCE`].
fn host(name: String) -> HostInfo {
    let began = Instant::now();
    let listed = match list(&name) {
        Ok(listed) => listed,
        Err(reason) => return HostInfo { name, note: Some(reason), devices: Vec::new() },
    };
    let devices = details(listed, PATIENCE.saturating_sub(began.elapsed()));
    HostInfo { name, note: None, devices }
}

/// Abilities of a host's devices within `limit`. If one hangs, so would the next: ALSA opens one at a time.
/// So devices that lead to another server, which may hang, are asked last.
fn details(listed: Vec<Listed>, limit: Duration) -> Vec<DeviceInfo> {
    let began = Instant::now();
    let mut order: Vec<_> = listed.into_iter().enumerate().collect();
    order.sort_by_key(|(_, one)| distance(&one.id));
    let mut hangs: Option<String> = None;
    let mut said = Vec::new();
    for (at, one) in order {
        let left = limit.saturating_sub(began.elapsed());
        let bare = |note: String| DeviceInfo { note: Some(note), ..bare(&one) };
        let info = match &hangs {
            Some(first) => bare(format!("not asked, since `{first}` does not answer")),
            None => {
                let asked = one.clone();
                bounded(&one.full_id(), EACH.min(left), move || detail(&asked)).unwrap_or_else(|| {
                    hangs = Some(one.id.clone());
                    bare("no answer".to_owned())
                })
            }
        };
        said.push((at, info));
    }
    said.sort_by_key(|(at, _)| *at);
    said.into_iter().map(|(_, info)| info).collect()
}

/// Rank of an ALSA device by its distance from the hardware.
fn distance(id: &str) -> u8 {
    match id {
        "default" => 1,
        "pulse" | "pipewire" => 2,
        "jack" => 3,
        _ => 0,
    }
}

fn detail(listed: &Listed) -> DeviceInfo {
    let mut note = None;
    let mut ask = |side: Side| {
        if !side.fits(listed) {
            return None;
        }
        match abilities(listed, side) {
            Ok((ranges, usual)) => {
                let rate_hz = usual.as_ref().map(|usual| usual.sample_rate());
                let own = usual.filter(|_| is_mixer(&listed.host)).map(|usual| usual.channels());
                let card_channels = if listed.host == "jack" { jack_ports(side) } else { None };
                Some(SideInfo { card_channels, ..summary(&ranges, rate_hz, own)? })
            }
            Err(error) => {
                note = Some(format!("{}: {error}", side.name()));
                None
            }
        }
    };
    let (output, input) = (ask(Side::Output), ask(Side::Input));
    // One side that answers is enough.
    let note = note.filter(|_| output.is_none() && input.is_none());
    DeviceInfo { output, input, note, ..bare(listed) }
}

/// A device without its abilities.
fn bare(listed: &Listed) -> DeviceInfo {
    let Listed { host, id, name, default_output, default_input, .. } = listed.clone();
    DeviceInfo { host, id, name, default_output, default_input, output: None, input: None, note: None }
}

fn summary(
    ranges: &[SupportedStreamConfigRange],
    rate_hz: Option<u32>,
    own_channels: Option<u16>,
) -> Option<SideInfo> {
    let channels = own_channels.or(ranges.iter().map(|range| range.channels()).max())?;
    let low = ranges.iter().map(|range| range.min_sample_rate()).min()?;
    let high = ranges.iter().map(|range| range.max_sample_rate()).max()?;
    let rates = RATES_HZ.into_iter().filter(|rate| ranges.iter().any(|range| range.contains_rate(*rate)));
    let has = |format: &Format| ranges.iter().any(|range| range.sample_format() == format.to_cpal());
    let buffers = ranges.iter().filter_map(|range| match range.buffer_size() {
        SupportedBufferSize::Range { min, max } => Some((*min, *max)),
        SupportedBufferSize::Unknown => None,
    });
    let buffer_frames = buffers.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    Some(SideInfo {
        channels,
        card_channels: None,
        rates_hz: rates.collect(),
        rate_range_hz: (low, high),
        rate_hz,
        formats: Format::ALL.into_iter().filter(has).collect(),
        buffer_frames,
    })
}
