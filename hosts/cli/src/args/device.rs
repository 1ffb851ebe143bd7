//! The sound card, and what stands behind it.

use std::path::PathBuf;

use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::number::{channel, number, whole};

/// Which sound card, and how it is opened.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct CardArgs {
    /// Audio host: alsa, jack, pulseaudio, simulated; `asperity devices` lists them
    #[arg(long, value_name = "HOST")]
    pub host: Option<String>,
    /// Device to play on: its name, its id, or HOST:ID. The host's default, unless given; never another than the one that is named
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Frames that the device is asked to want at a time; it may do as it likes
    #[arg(long, value_name = "FRAMES", value_parser = whole(1_u32, 65_536, "frames"))]
    pub period: Option<u32>,
    /// Sample format that the device is to have: f32, i16, i24, i32
    #[arg(long, value_name = "FORMAT")]
    pub device_format: Option<String>,
    /// File that says what stands behind each channel; the user's own, unless given. No graph can raise its
    /// limits
    #[arg(long, value_name = "FILE")]
    pub machine: Option<PathBuf>,
    /// Share the actuator with another run: each has half of every limit, and both must be started so
    #[arg(long)]
    pub share: bool,
}

/// The sound card of a graph, and how ticks keep time with it.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct DeviceArgs {
    #[command(flatten)]
    pub card: CardArgs,
    /// Channel of the device, from 1; one for each `audio_out` of the graph, such as 3,4
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = channel)]
    pub channel: Vec<u16>,
    /// Device to record from, for `audio_in`; the same host's default, unless given
    #[arg(long, value_name = "DEVICE")]
    pub input_device: Option<String>,
    /// What ticks keep time with, unless the device's period decides: the callback for one of at most a tick, else paced
    #[arg(long, value_enum)]
    pub clock: Option<ClockKind>,
    /// Give up when the device is lost, rather than wait for it
    #[arg(long)]
    pub no_reconnect: bool,
}

/// The sound card of a command that plays one channel of its own making, and is over where the device is lost.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct OutputArgs {
    #[command(flatten)]
    pub card: CardArgs,
    /// Channel of the device, from 1; 1 unless given
    #[arg(long, value_name = "N", value_parser = channel)]
    pub channel: Option<u16>,
    /// What ticks keep time with, unless the device's period decides: the callback for one of at most a tick, else paced
    #[arg(long, value_name = "CLOCK", value_parser = with_audio())]
    pub clock: Option<ClockKind>,
}

impl OutputArgs {
    /// The channel that is played.
    pub fn channel(&self) -> u16 {
        self.channel.unwrap_or(1)
    }

    /// The same as for a graph with one output, which records from this device.
    pub fn recording_from(&self, input_device: Option<&str>) -> DeviceArgs {
        DeviceArgs {
            card: self.card.clone(),
            channel: vec![self.channel()],
            input_device: input_device.map(str::to_owned),
            clock: self.clock,
            no_reconnect: true,
        }
    }
}

/// What ticks keep time with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClockKind {
    /// The audio callback: least latency
    Callback,
    /// A thread that is steered by the callback's clock: evenly spaced ticks on any device
    Paced,
    /// The computer's own clock: no audio device
    Timer,
}

/// Reads a clock that drives a device.
fn with_audio() -> impl TypedValueParser<Value = ClockKind> {
    PossibleValuesParser::new(["callback", "paced"])
        .map(|name| if name == "paced" { ClockKind::Paced } else { ClockKind::Callback })
}

/// The actuator, and the amplifier before it.
#[derive(Clone, Debug, clap::Args)]
pub struct ActuatorArgs {
    /// The actuator whose limits hold: a shipped profile or a .ron file
    #[arg(long, default_value = "hapcoil_one", value_name = "PROFILE")]
    pub profile: String,
    /// Mass of what it is fixed to
    #[arg(long, default_value_t = 100.0, value_name = "G", value_parser = number(1.0, 10_000.0, "g"))]
    pub handle_mass_g: f64,
    /// Peak volts that the card puts out at full scale
    #[arg(long, default_value_t = 1.0, value_name = "V", value_parser = number(1e-3, 100.0, "V"))]
    pub volts_at_full_scale: f64,
    /// Gain of the current amplifier behind the card
    #[arg(long, default_value_t = 1.0, value_name = "A/V", value_parser = number(1e-3, 100.0, "A/V"))]
    pub amps_per_volt: f64,
}
