//! Finds the requested device.

use cpal::traits::DeviceTrait;

use crate::hosts::{Listed, SIMULATED, list, names};
use crate::request::OpenError;
use crate::simulated;

/// A direction of sound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Output,
    Input,
}

impl Side {
    /// Its name in a message.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Output => "output",
            Self::Input => "input",
        }
    }

    fn is_default(self, listed: &Listed) -> bool {
        match self {
            Self::Output => listed.default_output,
            Self::Input => listed.default_input,
        }
    }

    /// Whether a device may have this side. ALSA knows only when its default device is opened.
    pub(crate) fn fits(self, listed: &Listed) -> bool {
        self.is_default(listed)
            || match self {
                Self::Output => listed.device.supports_output(),
                Self::Input => listed.device.supports_input(),
            }
    }
}

/// Splits `host:id`, where the part before the colon is a host.
fn split<'a>(host: Option<&'a str>, device: Option<&'a str>) -> (Option<&'a str>, Option<&'a str>) {
    let parts = device.and_then(|device| device.split_once(':'));
    match parts {
        Some((prefix, id))
            if names().iter().any(|name| name == prefix) && host.is_none_or(|host| host == prefix) =>
        {
            (Some(prefix), Some(id))
        }
        _ => (host, device),
    }
}

/// Finds the requested device, and never another one.
pub(crate) fn find(host: Option<&str>, device: Option<&str>, side: Side) -> Result<Listed, OpenError> {
    let (host, wanted) = split(host, device);
    let hosts = match host {
        Some(host) if !names().iter().any(|name| name == host) => {
            return Err(OpenError::NoHost { wanted: host.to_owned(), there: names() });
        }
        Some(host) => vec![host.to_owned()],
        None => names(),
    };
    if host == Some(SIMULATED) {
        let id = wanted.unwrap_or_default();
        if id.is_empty() || id.contains('=') {
            let device = simulated::described(id).map_err(|reason| OpenError::Description {
                device: format!("{SIMULATED}:{id}"),
                side: side.name(),
                reason,
            })?;
            return Ok(Listed::new(SIMULATED, device));
        }
    }
    let mut there = Vec::new();
    let mut away = Vec::new();
    for name in &hosts {
        match list(name) {
            Ok(listed) => there.extend(listed.into_iter().filter(|one| side.fits(one))),
            Err(reason) if host.is_some() => {
                return Err(OpenError::HostAway { host: name.clone(), reason });
            }
            Err(reason) => away.push(format!("{name}: {reason}")),
        }
        // The first host that answers provides the default.
        if wanted.is_none()
            && let Some(at) = there.iter().position(|one| side.is_default(one))
        {
            return Ok(there.swap_remove(at));
        }
    }
    choose(wanted, side, there, away)
}

/// Chooses a device by id, or else by name.
fn choose(
    wanted: Option<&str>,
    side: Side,
    there: Vec<Listed>,
    away: Vec<String>,
) -> Result<Listed, OpenError> {
    if let Some(wanted) = wanted {
        let by_id = |one: &&Listed| one.id == wanted;
        let by_name = |one: &&Listed| one.name.to_lowercase() == wanted.to_lowercase();
        let mut fits: Vec<&Listed> = there.iter().filter(by_id).collect();
        if fits.is_empty() {
            fits = there.iter().filter(by_name).collect();
        }
        match fits.as_slice() {
            [] => {}
            [one] => return Ok((*one).clone()),
            all => {
                let fits = all.iter().map(|one| one.label()).collect();
                return Err(OpenError::Ambiguous { wanted: wanted.to_owned(), fits });
            }
        }
    }
    let there = there.iter().map(Listed::label).collect();
    Err(OpenError::NoDevice { wanted: wanted.map(str::to_owned), side: side.name(), there, away })
}
