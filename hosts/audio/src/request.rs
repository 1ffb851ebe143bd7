//! The request for a device, and why it is refused.

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
    /// The part of the request that cannot be had.
    pub cause: Cause,
    /// Whether it is about the input device.
    pub input: bool,
    /// The reason and what there is instead, for a user.
    pub reason: String,
}

/// The part of a [`Request`] that cannot be had.
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
