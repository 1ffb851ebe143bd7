//! `asperity calibrate`: measures an actuator with an accelerometer on its handle, and writes its profile.
//!
//! [`sweeps`] plays and records, [`asperity_actuator::identify`] fits, and [`report`] shows the result.

mod report;
mod sweeps;
#[cfg(test)]
mod tests;

use std::io::{BufRead, IsTerminal};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use asperity_actuator::identify::{IdentifySettings, Trust, identify, write_profile};
use asperity_actuator::{ActuatorProfile, Drive};
use asperity_diagnostics::Source;
use clap::ValueEnum;

use crate::card::{OutputArgs, actuator, range};
use crate::failure::{Failure, complain, print_report, wrong};
use crate::leave::stop_flag;
use crate::number::{channel, number, whole};
use crate::output::{Pending, apart, ends_in_ron, keep_all, named};
use report::Report;
use sweeps::{Bench, Tape, refused};

/// Output of the amplifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DriveKind {
    /// A current: a transconductance amplifier of `--amps-per-volt`
    Current,
    /// A voltage: an ordinary amplifier of `--volts-per-volt`
    Voltage,
}

/// Measure an actuator with an accelerometer on its handle, and write its profile
///
/// Plays a quiet sweep, then the measurement. The limits of the base profile apply to both. Exit code 0:
/// the profile is written; 1: the measurement is wrong; 2: the arguments are wrong.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args = crate::number::may_be_negative)]
#[command(after_help = crate::commands::examples(&[
    "asperity calibrate --out mine.ron --handle-mass-g 60 --accelerometer-full-scale 100",
]))]
pub struct Args {
    #[command(flatten)]
    pub output: OutputArgs,
    /// Device to record from; by default the host's default input
    #[arg(long, value_name = "DEVICE")]
    pub input_device: Option<String>,
    /// Input channel of the accelerometer, from 1
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = channel)]
    pub input_channel: u16,
    /// Profile to write. Nothing is written if anything fails
    #[arg(long, value_name = "PROFILE.ron")]
    pub out: PathBuf,
    /// Mass of the handle with housing and accelerometer, but without the mover
    #[arg(long, value_name = "G", value_parser = number(1.0, 10_000.0, "g"))]
    pub handle_mass_g: f64,
    /// Second mass of the handle. Waits for Enter and measures again, which gives the moving mass too
    #[arg(long, value_name = "G", value_parser = number(1.0, 10_000.0, "g"))]
    pub second_mass_g: Option<f64>,
    /// Uncertainty of the handle's mass: half of the 95 % interval
    #[arg(long, default_value_t = 1.0, value_name = "PERCENT", value_parser = number(0.01, 50.0, "%"))]
    pub mass_uncertainty: f64,
    /// Acceleration at full scale of the input: its volts divided by the accelerometer's volts per m/s^2
    #[arg(long, value_name = "M/S2", value_parser = number(1e-3, 1e6, "m/s^2"))]
    pub accelerometer_full_scale: f64,
    /// Profile for the limits, and for figures that are not measured: a shipped one or a file
    #[arg(long, default_value = "hapcoil_one", value_name = "PROFILE")]
    pub base: String,
    /// Peak of the sweep's current; by default 0.1
    #[arg(long, value_name = "A", value_parser = number(1e-4, 1e4, "A"))]
    pub amps: Option<f64>,
    /// Peak of the sweep's voltage, with `--drive voltage`; by default 0.5
    #[arg(long, value_name = "V", conflicts_with = "amps", value_parser = number(1e-4, 1e5, "V"))]
    pub volts: Option<f64>,
    /// Lowest frequency
    #[arg(long, default_value_t = 10.0, value_name = "HZ", value_parser = number(1.0, 1000.0, "Hz"))]
    pub from_hz: f64,
    /// Highest frequency; above a few hundred hertz handles bend
    #[arg(long, default_value_t = 1000.0, value_name = "HZ", value_parser = number(4.0, 20_000.0, "Hz"))]
    pub to_hz: f64,
    /// Duration of the sweep
    #[arg(long, default_value_t = 8.0, value_name = "S", value_parser = number(1.0, 120.0, "s"))]
    pub seconds: f64,
    /// Audio rate
    #[arg(long, default_value_t = 48_000, value_name = "HZ", value_parser = whole(8_000_u32, 192_000, "Hz"))]
    pub rate: u32,
    /// Peak volts of the card at full scale
    #[arg(long, default_value_t = 1.0, value_name = "V", value_parser = number(1e-3, 100.0, "V"))]
    pub volts_at_full_scale: f64,
    /// Output of the amplifier
    #[arg(long, value_enum, default_value = "current")]
    pub drive: DriveKind,
    /// Gain of the current amplifier behind the card; by default 1
    #[arg(long, value_name = "A/V", value_parser = number(1e-3, 100.0, "A/V"))]
    pub amps_per_volt: Option<f64>,
    /// Gain of the voltage amplifier behind the card, with `--drive voltage`; by default 1
    #[arg(long, value_name = "V/V", value_parser = number(1e-3, 1000.0, "V/V"))]
    pub volts_per_volt: Option<f64>,
    /// Draw magnitude, phase and coherence, measured and fitted
    #[arg(long, value_name = "P.svg")]
    pub plot: Option<PathBuf>,
    /// Write the profile even if the measurement is poor
    #[arg(long)]
    pub anyway: bool,
    /// Do not wait for Enter before the second measurement
    #[arg(long, requires = "second_mass_g")]
    pub yes: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Least ratio of the masses of two handles.
const APART: f64 = 1.05;

pub fn run(args: &Args) -> Result<(), Failure> {
    if args.second_mass_g.is_some() && !args.yes && !std::io::stdin().is_terminal() {
        return Err(wrong(
            "--second-mass-g",
            "the handle's mass must be changed, and there is no terminal to wait at",
            "run it at a terminal, or say --yes where the mass changes by itself",
        ));
    }
    calibrate(args, &mut |grams| if args.yes { Ok(()) } else { wait_for_enter(grams) })
}

/// Measures and writes. Calls `change` with the mass that the handle must get \[g\].
fn calibrate(args: &Args, change: &mut dyn FnMut(f64) -> Result<(), Failure>) -> Result<(), Failure> {
    let amplifier = amplifier(args)?;
    check(args)?;
    let handles = [("--handle-mass-g", Some(args.handle_mass_g)), ("--second-mass-g", args.second_mass_g)];
    let handles: Vec<_> = handles.into_iter().filter_map(|(option, g)| Some((option, g?))).collect();
    let base = actuator(("--base", &args.base), &handles)?;
    let create = |path: &Path, option: &str| Pending::create(path).map_err(|f| f.named_by(option));
    let profile_file = create(&args.out, "--out")?;
    let plot_file = args.plot.as_deref().map(|path| create(path, "--plot")).transpose()?;

    let settings = IdentifySettings {
        drive: amplifier.drive,
        band_hz: (args.from_hz, args.to_hz),
        handle_mass_uncertainty: args.mass_uncertainty / 100.0,
        ..IdentifySettings::default()
    };
    let bench = Bench::new(args, &amplifier, &base, settings)?;
    let mut tapes = vec![bench.measure(args.handle_mass_g)?];
    if let Some(grams) = args.second_mass_g {
        change(grams)?;
        tapes.push(bench.measure(grams)?);
    }
    let recordings: Vec<_> = tapes.iter().map(Tape::recording).collect();
    let findings = identify(&recordings, &base, settings).map_err(|e| refused(e.to_string()))?;

    let written = Vec::new();
    let mut report = Report { args, amplifier, base: &base, findings: &findings, tapes: &tapes, written };
    let trusted = findings.trust > Trust::Poor || args.anyway;
    let mut files = Vec::new();
    if let Some(file) = plot_file {
        files.push(file.fill(&report.picture())?);
    }
    if trusted {
        let today = time::OffsetDateTime::now_utc().date().to_string();
        let text = write_profile(&findings, &base, Some(&today));
        // It must be possible to read it again.
        ActuatorProfile::parse(&Source::new("the measured profile", text.clone()))
            .map_err(|d| refused(format!("the measured figures do not describe a usable actuator: {d}")))?;
        files.push(profile_file.fill(&text)?);
    }
    report.written = keep_all(files)?;
    print_report(args.json, || report.json(trusted), || report.text(trusted))?;
    Failure::said(!trusted)
}

fn check(args: &Args) -> Result<(), Failure> {
    let rate = f64::from(args.rate);
    range("--from-hz", args.from_hz, 1.0, (0.45 * rate / 4.0).min(1000.0), "Hz")?;
    let (least, most) = (4.0 * args.from_hz, (0.45 * rate).min(20_000.0));
    if !(least..=most).contains(&args.to_hz) {
        let help = format!("{least} to {most} Hz: at least 4 times --from-hz, at most 0.45 of --rate");
        return Err(wrong("--to-hz", format!("{} Hz is out of range", args.to_hz), help));
    }
    let first = args.handle_mass_g;
    if let Some(grams) = args.second_mass_g.filter(|g| (g / first).max(first / g) < APART) {
        let what = format!("{grams} g and {first} g are too much alike to tell the moving mass");
        return Err(wrong("--second-mass-g", what, "the farther apart the better: 50 and 200 g"));
    }
    let written = named(&[("--out", Some(&args.out)), ("--plot", args.plot.as_ref())]);
    apart(named(&[("--base", Some(&PathBuf::from(&args.base)))]), written)?;
    ends_in_ron(&args.out, "profile")
}

/// The amplifier behind the card, and the level of the measurement.
#[derive(Clone, Copy)]
struct Amplifier {
    drive: Drive,
    unit: &'static str,
    /// Drive for a volt of the card \[A/V or V/V\].
    gain: f64,
    option: &'static str,
    level: f64,
}

/// The amplifier of the options. Refuses those of the other kind, and a level above full scale.
fn amplifier(args: &Args) -> Result<Amplifier, Failure> {
    let amps = [("--amps", args.amps, 0.1), ("--amps-per-volt", args.amps_per_volt, 1.0)];
    let volts = [("--volts", args.volts, 0.5), ("--volts-per-volt", args.volts_per_volt, 1.0)];
    let (drive, own, others, word) = match args.drive {
        DriveKind::Current => (Drive::Current, amps, volts, "voltage"),
        DriveKind::Voltage => (Drive::Voltage, volts, amps, "current"),
    };
    for ((option, given, _), (instead, ..)) in others.into_iter().zip(own) {
        if given.is_some() {
            let help = format!("{instead}, or --drive {word}");
            return Err(wrong(option, "this is an option of the other kind of amplifier", help));
        }
    }
    let [level, gain] = own.map(|(_, given, by_default)| given.unwrap_or(by_default));
    let (unit, [(option, ..), (gain_option, ..)]) = (drive.unit(), own);
    let most = gain * args.volts_at_full_scale;
    if level > most {
        let help = format!("at most {most} {unit}, by --volts-at-full-scale and {gain_option}");
        return Err(wrong(option, format!("{level} {unit} is out of range"), help));
    }
    Ok(Amplifier { drive, unit, gain, option, level })
}

/// Waits until the user presses Enter: the handle has its other mass. Ctrl-C ends it.
fn wait_for_enter(grams: f64) -> Result<(), Failure> {
    complain(&format!(
        "now make the handle weigh {grams} g, with all that is fixed to it but not the mover; \
         then press Enter\n"
    ));
    let stop = stop_flag();
    let (sent, came) = mpsc::channel();
    std::thread::spawn(move || {
        let read = std::io::stdin().lock().read_line(&mut String::new());
        // Nobody waits any more where this fails.
        let _ = sent.send(read.is_ok_and(|n| n > 0));
    });
    loop {
        match came.recv_timeout(Duration::from_millis(50)) {
            Ok(true) => return Ok(()),
            Err(RecvTimeoutError::Timeout) if !stop.load(Relaxed) => {}
            _ => return Err(refused("stopped before the second measurement".into())),
        }
    }
}
