//! `asperity setup`

use std::path::PathBuf;

use super::number::{channel, number};

/// `asperity setup`
#[derive(Clone, Debug, clap::Args)]
pub struct Setup {
    /// Device: its name or id, as `asperity devices` lists it
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Channel of the device, from 1
    #[arg(long, value_name = "N", value_parser = channel)]
    pub channel: Option<u16>,
    /// The actuator on it: a shipped profile or a .ron file
    #[arg(long, value_name = "PROFILE")]
    pub profile: Option<String>,
    /// Mass of what it is fixed to
    #[arg(long, value_name = "G", value_parser = number(1.0, 10_000.0, "g"))]
    pub handle_mass_g: Option<f64>,
    /// Peak volts that the card puts out at full scale
    #[arg(long, value_name = "V", value_parser = number(1e-3, 100.0, "V"))]
    pub volts_at_full_scale: Option<f64>,
    /// Gain of the current amplifier behind the card
    #[arg(long, value_name = "A/V", value_parser = number(1e-3, 100.0, "A/V"))]
    pub amps_per_volt: Option<f64>,
    /// Gain of the voltage amplifier behind the card, where it is one
    #[arg(long, value_name = "V/V", conflicts_with = "amps_per_volt")]
    #[arg(value_parser = number(1e-3, 1000.0, "V/V"))]
    pub volts_per_volt: Option<f64>,
    /// Most volts that the card may put out; full scale, unless given
    #[arg(long, value_name = "V", value_parser = number(1e-3, 100.0, "V"))]
    pub most_volts: Option<f64>,
    /// File to write; the user's own, unless given
    #[arg(long, value_name = "FILE")]
    pub machine: Option<PathBuf>,
    /// Replace what the file says of this channel
    #[arg(long)]
    pub overwrite: bool,
}
