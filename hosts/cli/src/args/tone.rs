//! `asperity tone`

use super::number::{number, whole};
use super::{ActuatorArgs, OutputArgs};

/// `asperity tone`
#[derive(Clone, Debug, clap::Args)]
pub struct Tone {
    #[command(flatten)]
    pub output: OutputArgs,
    /// Frequency, at most 0.45 of the audio rate
    #[arg(long, default_value_t = 80.0, value_name = "HZ", value_parser = number(1.0, 20_000.0, "Hz"))]
    pub hz: f64,
    /// Peak current, behind an amplifier of `--amps-per-volt`
    #[arg(long, default_value_t = 0.05, value_name = "A", value_parser = number(1e-4, 100.0, "A"))]
    pub amps: f64,
    /// How long
    #[arg(long, default_value_t = 3.0, value_name = "S", value_parser = number(0.01, 86_400.0, "s"))]
    pub seconds: f64,
    /// Audio rate
    #[arg(long, default_value_t = 48_000, value_name = "HZ", value_parser = whole(8_000_u32, 192_000, "Hz"))]
    pub rate: u32,
    #[command(flatten)]
    pub actuator: ActuatorArgs,
    /// Say nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}
