//! Hosts, their devices, and the one that is requested.

use std::time::Duration;

use cpal::traits::{DeviceTrait, HostTrait};
use cpal::{Device, HostId};

use crate::bounded::bounded;
use crate::request::{Cause, OpenError};
use crate::simulated;

/// Longest time that a host may take to list its devices.
pub(crate) const PATIENCE: Duration = Duration::from_secs(4);

/// The host of simulated cards.
pub(crate) const SIMULATED: &str = "simulated";

#[derive(Clone)]
pub(crate) struct Listed {
    pub(crate) host: String,
    pub(crate) id: String,
    pub(crate) name: String,
    pub(crate) device: Device,
    pub(crate) default_output: bool,
    pub(crate) default_input: bool,
}

impl Listed {
    pub(crate) fn new(host: &str, device: Device) -> Self {
        let id = device.id().map(|id| id.id().to_owned());
        let name = device.description().map_or_else(|_| String::new(), |about| about.name().to_owned());
        let id = id.unwrap_or_else(|_| name.clone());
        Self { host: host.to_owned(), id, name, device, default_output: false, default_input: false }
    }

    /// Id that opens exactly this device: `host:id`.
    pub(crate) fn full_id(&self) -> String {
        format!("{}:{}", self.host, self.id)
    }

    /// For a message: `host:id (name)`.
    pub(crate) fn label(&self) -> String {
        format!("{} ({})", self.full_id(), self.name)
    }
}

/// Names of all hosts of this build; the first ones are asked first for a default device.
pub(crate) fn names() -> Vec<String> {
    let real = cpal::ALL_HOSTS.iter().filter(|id| **id != HostId::Custom).map(ToString::to_string);
    real.chain([SIMULATED.to_owned()]).collect()
}

/// Whether a host is a mixing server: it takes any width and rate, and converts to those of its device. It
/// also moves a stream whose device goes away to another one.
pub(crate) fn is_mixer(host: &str) -> bool {
    matches!(host, "pulseaudio" | "pipewire")
}

pub(crate) fn host_id(name: &str) -> Option<HostId> {
    cpal::ALL_HOSTS.iter().copied().find(|id| id.to_string() == name)
}

/// Devices of a host; the error says why there are none.
pub(crate) fn list(host: &str) -> Result<Vec<Listed>, String> {
    if host == SIMULATED {
        return Ok(simulated::devices().into_iter().map(|device| Listed::new(SIMULATED, device)).collect());
    }
    let id = host_id(host).ok_or_else(|| "there is no such host".to_owned())?;
    let name = host.to_owned();
    let found = bounded(host, PATIENCE, move || look(id, &name));
    found.unwrap_or_else(|| Err(format!("no answer in {} s", PATIENCE.as_secs())))
}

fn look(id: HostId, name: &str) -> Result<Vec<Listed>, String> {
    let host = cpal::host_from_id(id).map_err(|error| error.to_string())?;
    let devices = host.devices().map_err(|error| error.to_string())?;
    let mut listed: Vec<_> = devices.map(|device| Listed::new(name, device)).collect();
    let mut mark = |device: Option<Device>, output: bool| {
        let Some(device) = device.map(|device| Listed::new(name, device)) else { return };
        let at = listed.iter().position(|one| one.id == device.id).unwrap_or_else(|| {
            listed.push(device);
            listed.len() - 1
        });
        let flag = if output { &mut listed[at].default_output } else { &mut listed[at].default_input };
        *flag = true;
    };
    mark(host.default_output_device(), true);
    mark(host.default_input_device(), false);
    // JACK has no devices: cpal makes one of each direction while a server answers.
    if id == HostId::Jack && listed.is_empty() {
        return Err("no JACK server answers".to_owned());
    }
    Ok(listed)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Output,
    Input,
}

impl Side {
    pub(crate) fn name(self) -> &'static str {
        if self == Self::Output { "output" } else { "input" }
    }

    fn is_default(self, listed: &Listed) -> bool {
        if self == Self::Output { listed.default_output } else { listed.default_input }
    }

    /// Whether a device may have this side. ALSA knows only when its default device is opened.
    pub(crate) fn fits(self, listed: &Listed) -> bool {
        let supports = match self {
            Self::Output => DeviceTrait::supports_output,
            Self::Input => DeviceTrait::supports_input,
        };
        self.is_default(listed) || supports(&listed.device)
    }
}

/// Finds the requested device, and never another one.
pub(crate) fn find(host: Option<&str>, device: Option<&str>, side: Side) -> Result<Listed, OpenError> {
    let names = names();
    // `host:id`, where the part before the colon is a host.
    let bare = device.filter(|device| *device == SIMULATED).map(|device| (device, ""));
    let parts = device.and_then(|device| device.split_once(':')).or(bare);
    let parts = parts
        .filter(|(name, _)| names.iter().any(|one| one == name) && host.is_none_or(|host| host == *name));
    let (host, wanted) = parts.map_or((host, device), |(name, id)| (Some(name), Some(id)));
    if let Some(host) = host.filter(|host| !names.iter().any(|name| name == host)) {
        let text = format!("there is no audio host `{host}`; there are {}", names.join(", "));
        return Err(OpenError::new(Cause::Host, text));
    }
    let id = wanted.unwrap_or_default();
    if host == Some(SIMULATED) && (id.is_empty() || id.contains('=')) {
        let wrong = |e| OpenError::new(Cause::Device, format!("`{SIMULATED}:{id}`: {e}"));
        return Ok(Listed::new(SIMULATED, simulated::described(id).map_err(wrong)?));
    }
    let (mut there, mut away) = (Vec::new(), String::new());
    for name in names.iter().filter(|name| host.is_none_or(|host| host == *name)) {
        match list(name) {
            Ok(listed) => there.extend(listed.into_iter().filter(|one| side.fits(one))),
            Err(reason) if host.is_some() => {
                let text = format!("the audio host `{name}` does not answer: {reason}");
                return Err(OpenError::new(Cause::Host, text));
            }
            Err(reason) => away += &format!("; {name}: {reason}"),
        }
        // The first host that answers provides the default.
        if wanted.is_none()
            && let Some(at) = there.iter().position(|one| side.is_default(one))
        {
            return Ok(there.swap_remove(at));
        }
    }
    let by_id = |one: &&Listed| wanted == Some(&one.id);
    let by_name = |one: &&Listed| wanted.is_some_and(|w| w.to_lowercase() == one.name.to_lowercase());
    let mut fits: Vec<_> = there.iter().filter(by_id).collect();
    if fits.is_empty() {
        fits = there.iter().filter(by_name).collect();
    }
    let labels = |all: Vec<&Listed>| all.iter().map(|one| one.label()).collect::<Vec<_>>().join(", ");
    let text = match (&fits[..], &there[..]) {
        ([one], _) => return Ok((*one).clone()),
        ([_, ..], _) => format!("`{id}` matches several: {}; name one", labels(fits)),
        ([], all) => {
            let (side, default) = (side.name(), wanted.is_none());
            let no = if default { format!("default {side} device") } else { format!("{side} device `{id}`") };
            let are = match all {
                [] => "is none at all".to_owned(),
                [one] => format!("is {}", one.label()),
                all => format!("are {}", labels(all.iter().collect())),
            };
            format!("there is no {no}; there {are}{away}")
        }
    };
    Err(OpenError::new(Cause::Device, text))
}
