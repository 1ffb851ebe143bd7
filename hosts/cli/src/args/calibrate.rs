//! `asperity calibrate`

use std::path::PathBuf;

use clap::ValueEnum;

use super::OutputArgs;
use super::number::{channel, number, whole};

/// What the amplifier puts out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DriveKind {
    /// A current: a transconductance amplifier of `--amps-per-volt`
    Current,
    /// A voltage: an ordinary amplifier of `--volts-per-volt`
    Voltage,
}

/// `asperity calibrate`
#[derive(Clone, Debug, clap::Args)]
pub struct Calibrate {
    #[command(flatten)]
    pub output: OutputArgs,
    /// Device to record from; the same host's default, unless given
    #[arg(long, value_name = "DEVICE")]
    pub input_device: Option<String>,
    /// Channel of the input that the accelerometer is on, from 1
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = channel)]
    pub input_channel: u16,
    /// Where the profile goes; nothing is written unless all succeeds
    #[arg(long, value_name = "PROFILE.ron")]
    pub out: PathBuf,
    /// Mass of the handle with all that is fixed to it, the actuator's housing and the accelerometer included, but not the mover
    #[arg(long, value_name = "G", value_parser = number(1.0, 10_000.0, "g"))]
    pub handle_mass_g: f64,
    /// Measure a second time, with the handle at this mass, which tells the moving mass, too; waits for Enter in between
    #[arg(long, value_name = "G", value_parser = number(1.0, 10_000.0, "g"))]
    pub second_mass_g: Option<f64>,
    /// How well the handle's mass is known: half of the 95 % interval
    #[arg(long, default_value_t = 1.0, value_name = "PERCENT", value_parser = number(0.01, 50.0, "%"))]
    pub mass_uncertainty: f64,
    /// Acceleration in m/s^2 at which the card's input is at full scale: its volts there over the accelerometer's volts per m/s^2
    #[arg(long, value_name = "M/S2", value_parser = number(1e-3, 1e6, "m/s^2"))]
    pub accelerometer_full_scale: f64,
    /// The actuator whose limits hold, and whose figures stand for what is not measured: a shipped profile or a .ron file
    #[arg(long, default_value = "hapcoil_one", value_name = "PROFILE")]
    pub base: String,
    /// Peak of the sweep's current; 0.1 unless given
    #[arg(long, value_name = "A", value_parser = number(1e-4, 1e4, "A"))]
    pub amps: Option<f64>,
    /// Peak of the sweep's voltage, with `--drive voltage`; 0.5 unless given
    #[arg(long, value_name = "V", conflicts_with = "amps", value_parser = number(1e-4, 1e5, "V"))]
    pub volts: Option<f64>,
    /// Lowest frequency
    #[arg(long, default_value_t = 10.0, value_name = "HZ", value_parser = number(1.0, 1000.0, "Hz"))]
    pub from_hz: f64,
    /// Highest frequency; above a few hundred hertz handles bend
    #[arg(long, default_value_t = 1000.0, value_name = "HZ", value_parser = number(4.0, 20_000.0, "Hz"))]
    pub to_hz: f64,
    /// How long the sweep takes
    #[arg(long, default_value_t = 8.0, value_name = "S", value_parser = number(1.0, 120.0, "s"))]
    pub seconds: f64,
    /// Audio rate
    #[arg(long, default_value_t = 48_000, value_name = "HZ", value_parser = whole(8_000_u32, 192_000, "Hz"))]
    pub rate: u32,
    /// Peak volts that the card puts out at full scale
    #[arg(long, default_value_t = 1.0, value_name = "V", value_parser = number(1e-3, 100.0, "V"))]
    pub volts_at_full_scale: f64,
    /// What the amplifier puts out
    #[arg(long, value_enum, default_value = "current")]
    pub drive: DriveKind,
    /// Gain of the current amplifier behind the card; 1 unless given
    #[arg(long, value_name = "A/V", value_parser = number(1e-3, 100.0, "A/V"))]
    pub amps_per_volt: Option<f64>,
    /// Gain of the voltage amplifier behind the card, with `--drive voltage`; 1 unless given
    #[arg(long, value_name = "V/V", value_parser = number(1e-3, 1000.0, "V/V"))]
    pub volts_per_volt: Option<f64>,
    /// Draw magnitude, phase and coherence, measured and fitted
    #[arg(long, value_name = "P.svg")]
    pub plot: Option<PathBuf>,
    /// Write the profile also where it is not to be trusted
    #[arg(long)]
    pub anyway: bool,
    /// Do not wait for Enter before the second measurement
    #[arg(long, requires = "second_mass_g")]
    pub yes: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
