//! Finds the requested device.

use cpal::traits::DeviceTrait;

use crate::hosts::{Listed, SIMULATED, list, names};
use crate::request::{Cause, OpenError};
use crate::simulated;

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
    let parts = device.and_then(|device| device.split_once(':'));
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
        ([_, ..], _) => format!("`{id}` could be any of {}; say which", labels(fits)),
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
