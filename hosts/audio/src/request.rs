//! The request for a device, and the reasons why it is refused.

use std::fmt;

use crate::Format;

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
        let wrong = |text: String| Err(OpenError::Request(text));
        if self.channels.is_empty() {
            return wrong("no output channel is asked for".to_owned());
        }
        for (list, what) in [(&self.channels, "output"), (&self.inputs, "input")] {
            if list.contains(&0) {
                return wrong(format!("{what} channels count from 1"));
            }
            if let Some(twice) = list.iter().enumerate().find(|(at, one)| list[..*at].contains(one)) {
                return wrong(format!("{what} channel {} is asked for twice", twice.1));
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
#[non_exhaustive]
pub enum OpenError {
    /// The request is invalid for any device.
    Request(String),
    /// The description of a simulated device is invalid.
    Description {
        /// `host:id` as given.
        device: String,
        /// `output` or `input`.
        side: &'static str,
        /// The fault.
        reason: String,
    },
    /// There is no host of that name in this build.
    NoHost {
        /// The requested name.
        wanted: String,
        /// Names of the hosts there are.
        there: Vec<String>,
    },
    /// The host does not answer: its server does not run, or hangs.
    HostAway {
        /// The host.
        host: String,
        /// The reason, in its own words.
        reason: String,
    },
    /// No such device.
    NoDevice {
        /// The requested name; `None` for a default device.
        wanted: Option<String>,
        /// `output` or `input`.
        side: &'static str,
        /// The devices there are, as `host:id (name)`.
        there: Vec<String>,
        /// Hosts that do not answer, each with its reason.
        away: Vec<String>,
    },
    /// The name fits several devices.
    Ambiguous {
        /// The requested name.
        wanted: String,
        /// Matching devices, as `host:id (name)`.
        fits: Vec<String>,
    },
    /// The device does not have that channel.
    NoChannel {
        /// `host:id` of the device.
        device: String,
        /// `output` or `input`.
        side: &'static str,
        /// The channel, from 1.
        wanted: u16,
        /// How many there are.
        there: u16,
    },
    /// The device cannot run at that rate.
    NoRate {
        /// `host:id` of the device.
        device: String,
        /// The rate [Hz].
        wanted: u32,
        /// Supported rates and ranges [Hz].
        there: Vec<(u32, u32)>,
    },
    /// The device does not support that format, or none that is known here.
    NoFormat {
        /// `host:id` of the device.
        device: String,
        /// Requested format.
        wanted: Option<Format>,
        /// Supported formats.
        there: Vec<Format>,
    },
    /// The device is there and refuses.
    Refused {
        /// `host:id` of the device.
        device: String,
        /// The reason, in its own words.
        reason: String,
    },
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Request(text) => f.write_str(text),
            Self::Description { device, reason, .. } => write!(f, "`{device}`: {reason}"),
            Self::NoHost { wanted, there } => {
                write!(f, "there is no audio host `{wanted}`; there are {}", there.join(", "))
            }
            Self::HostAway { host, reason } => write!(f, "the audio host `{host}` does not answer: {reason}"),
            Self::NoDevice { wanted, side, there, away } => {
                match wanted {
                    Some(wanted) => write!(f, "there is no {side} device `{wanted}`; there ")?,
                    None => write!(f, "there is no default {side} device; there ")?,
                }
                match there.as_slice() {
                    [] => f.write_str("is none at all")?,
                    [one] => write!(f, "is {one}")?,
                    all => write!(f, "are {}", all.join(", "))?,
                }
                away.iter().try_for_each(|away| write!(f, "; {away}"))
            }
            Self::Ambiguous { wanted, fits } => {
                write!(f, "`{wanted}` could be any of {}; say which", fits.join(", "))
            }
            Self::NoChannel { device, side, wanted, there } => {
                write!(f, "`{device}` has no {side} channel {wanted}, it has {there}")
            }
            Self::NoRate { device, wanted, there } => {
                let ranges: Vec<_> = there
                    .iter()
                    .map(|(low, high)| if low == high { low.to_string() } else { format!("{low} to {high}") })
                    .collect();
                write!(f, "`{device}` cannot run at {wanted} Hz; it can at {} Hz", ranges.join(", "))
            }
            Self::NoFormat { device, wanted, there } => {
                let there: Vec<_> = there.iter().map(|format| format.name()).collect();
                let wanted = wanted.map_or("a known sample format", Format::name);
                match there.as_slice() {
                    [] => write!(f, "`{device}` cannot do {wanted}"),
                    all => write!(f, "`{device}` cannot do {wanted}; it can do {}", all.join(", ")),
                }
            }
            Self::Refused { device, reason } => write!(f, "`{device}` cannot be opened: {reason}"),
        }
    }
}

impl std::error::Error for OpenError {}
