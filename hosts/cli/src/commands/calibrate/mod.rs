//! `asperity calibrate`: measures an actuator with an accelerometer on its handle, and writes its profile.
//!
//! [`sweeps`] plays and records, [`asperity_actuator::identify`] fits, and [`report`] shows the result.

mod report;
mod sweeps;
#[cfg(test)]
mod tests;

use std::io::{BufRead, IsTerminal};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use asperity_actuator::ActuatorProfile;
use asperity_actuator::identify::{Findings, IdentifySettings, Trust, identify, write_profile};
use asperity_diagnostics::Source;
use clap::ValueEnum;

use crate::card::{OutputArgs, actuator, range};
use crate::failure::{Failure, complain, print, warn, wrong};
use crate::leave::stop_flag;
use crate::number::{channel, number, whole};
use crate::output::{Pending, keep_all, resolved};
use report::Report;
use sweeps::{Bench, Outcome, Tape};

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
/// It plays a quiet sweep, then the measurement, both behind the limiter of the base profile. Exit code 0:
/// the profile is written; 1: the measurement is wrong; 2: the arguments are wrong.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args = crate::number::may_be_negative)]
pub struct Args {
    #[command(flatten)]
    pub output: OutputArgs,
    /// Device to record from; by default the same host's default
    #[arg(long, value_name = "DEVICE")]
    pub input_device: Option<String>,
    /// Input channel of the accelerometer, from 1
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = channel)]
    pub input_channel: u16,
    /// Profile to write; nothing is written unless all succeeds
    #[arg(long, value_name = "PROFILE.ron")]
    pub out: PathBuf,
    /// Mass of the handle with all that is fixed to it: the actuator's housing and the accelerometer, but
    /// not the mover
    #[arg(long, value_name = "G", value_parser = number(1.0, 10_000.0, "g"))]
    pub handle_mass_g: f64,
    /// Measure a second time, with the handle at this mass: this gives the moving mass too. Waits for Enter
    /// in between
    #[arg(long, value_name = "G", value_parser = number(1.0, 10_000.0, "g"))]
    pub second_mass_g: Option<f64>,
    /// Uncertainty of the handle's mass: half of the 95 % interval
    #[arg(long, default_value_t = 1.0, value_name = "PERCENT", value_parser = number(0.01, 50.0, "%"))]
    pub mass_uncertainty: f64,
    /// Acceleration in m/s^2 at full scale of the card's input: its volts there, divided by the
    /// accelerometer's volts per m/s^2
    #[arg(long, value_name = "M/S2", value_parser = number(1e-3, 1e6, "m/s^2"))]
    pub accelerometer_full_scale: f64,
    /// The actuator whose limits hold, and whose figures are used where none is measured: a shipped profile
    /// or a .ron file
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
    /// Write the profile also if the measurement is poor
    #[arg(long)]
    pub anyway: bool,
    /// Do not wait for Enter before the second measurement
    #[arg(long, requires = "second_mass_g")]
    pub yes: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Longest quiet sweep \[s\].
const QUIET_S: f64 = 2.0;
/// Least ratio of the masses of two handles.
const APART: f64 = 1.05;

/// Runs the command.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
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
fn calibrate(args: &Args, change: &mut dyn FnMut(f64) -> Result<(), Failure>) -> Result<ExitCode, Failure> {
    let bench = Bench::new(args)?;
    let level = check(args, &bench)?;
    let handles = [("--handle-mass-g", Some(args.handle_mass_g)), ("--second-mass-g", args.second_mass_g)];
    let handles: Vec<_> = handles.into_iter().filter_map(|(option, g)| Some((option, g?))).collect();
    let base = actuator(("--base", &args.base), &handles)?;
    let create = |path: &Path, option: &str| Pending::create(path).map_err(|f| f.named_by(option));
    let profile_file = create(&args.out, "--out")?;
    let plot_file = args.plot.as_deref().map(|path| create(path, "--plot")).transpose()?;

    let settings = IdentifySettings {
        drive: bench.drive(),
        band_hz: (args.from_hz, args.to_hz),
        handle_mass_uncertainty: args.mass_uncertainty / 100.0,
        ..IdentifySettings::default()
    };
    let session = Session { args, bench: &bench, base: &base, settings };
    let mut tapes = vec![session.measure(args.handle_mass_g, level)?];
    if let Some(grams) = args.second_mass_g {
        change(grams)?;
        tapes.push(session.measure(grams, level)?);
    }
    let recordings: Vec<_> = tapes.iter().map(Tape::recording).collect();
    let findings = identify(&recordings, &base, settings)
        .map_err(|e| Failure::Machine(format!("{e}\nnothing was written")))?;

    let mut report = Report { args, base: &base, findings: &findings, tapes: &tapes, written: Vec::new() };
    let trusted = findings.trust > Trust::Poor || args.anyway;
    let text = trusted.then(|| profile(&findings, &base)).transpose()?;
    let mut files = Vec::new();
    if let Some(file) = plot_file {
        files.push(file.fill(&report.picture())?);
    }
    if let Some(text) = text {
        files.push(profile_file.fill(&text)?);
    }
    report.written = keep_all(files)?;
    print(&if args.json { report.json(trusted) } else { report.text(trusted) })?;
    Ok(if trusted { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Settings that the measurements of a run share.
struct Session<'a> {
    args: &'a Args,
    bench: &'a Bench<'a>,
    base: &'a ActuatorProfile,
    settings: IdentifySettings,
}

impl Session<'_> {
    /// Plays a quiet sweep and, if the input follows it without clipping, the measurement.
    fn measure(&self, handle_mass_g: f64, level: f64) -> Result<Tape, Failure> {
        let (args, unit) = (self.args, unit(self.args));
        let quiet = sweeps::QUIET * level;
        complain(&format!("quiet sweep: {quiet:.3} {unit}, on {handle_mass_g} g\n"));
        let heard = match self.bench.play(quiet, args.seconds.min(QUIET_S), handle_mass_g)? {
            Outcome::Whole(tape) => tape,
            Outcome::Clipped(hz) => return Err(sweeps::clips_already(args, quiet, hz)),
        };
        let chosen = sweeps::level(args, &heard, level, self.base, self.settings)?;
        if let Some(note) = &chosen.note {
            warn(note);
        }
        let amplitude = chosen.amplitude;
        complain(&format!(
            "heard; measuring: {amplitude:.3} {unit}, {} to {} Hz in {} s, on {}\n",
            args.from_hz, args.to_hz, args.seconds, heard.device
        ));
        match self.bench.play(amplitude, args.seconds, handle_mass_g)? {
            Outcome::Whole(tape) => Ok(tape),
            Outcome::Clipped(hz) => Err(sweeps::clipped(args, amplitude, hz)),
        }
    }
}

/// Refuses options that contradict each other. Answers the requested level \[A or V\].
fn check(args: &Args, bench: &Bench<'_>) -> Result<f64, Failure> {
    let rate = f64::from(args.rate);
    range("--from-hz", args.from_hz, 1.0, (0.45 * rate / 4.0).min(1000.0), "Hz")?;
    let (least, most) = (4.0 * args.from_hz, (0.45 * rate).min(20_000.0));
    if !(least..=most).contains(&args.to_hz) {
        let help = format!("{least} to {most} Hz: at least 4 times --from-hz, at most 0.45 of --rate");
        return Err(wrong("--to-hz", format!("{} Hz is out of range", args.to_hz), &help));
    }
    if let Some(grams) = args.second_mass_g {
        let ratio = (grams / args.handle_mass_g).max(args.handle_mass_g / grams);
        if ratio < APART {
            let what =
                format!("{grams} g and {} g are too much alike to tell the moving mass", args.handle_mass_g);
            return Err(wrong("--second-mass-g", what, "the farther apart the better: 50 and 200 g"));
        }
    }
    let level = level(args, bench)?;
    let out = resolved(&args.out);
    if args.base.ends_with(".ron") && resolved(Path::new(&args.base)) == out {
        let help = "give the new profile a name of its own";
        return Err(wrong("--out", "the base profile is read, and would be overwritten", help));
    }
    if args.out.extension().is_none_or(|e| e != "ron") {
        let what = format!("{} would not be found as a profile", args.out.display());
        return Err(wrong("--out", what, "a profile's name ends in .ron"));
    }
    if let Some(plot) = &args.plot {
        let plot = resolved(plot);
        if plot == out || plot == resolved(Path::new(&args.base)) {
            return Err(wrong("--plot", "this file is the profile", "give the picture a name of its own"));
        }
    }
    Ok(level)
}

/// The requested level \[A or V\]. Refuses options of the other kind of amplifier.
fn level(args: &Args, bench: &Bench<'_>) -> Result<f64, Failure> {
    let voltage = args.drive == DriveKind::Voltage;
    let (amps, gain) = (args.amps.is_some(), args.amps_per_volt.is_some());
    let (volts, volts_gain) = (args.volts.is_some(), args.volts_per_volt.is_some());
    let others = [
        ("--amps", voltage && amps, "a voltage is measured in volts", "--volts, or --drive current"),
        (
            "--amps-per-volt",
            voltage && gain,
            "a voltage amplifier has none",
            "--volts-per-volt, or --drive current",
        ),
        ("--volts", !voltage && volts, "a current is measured in amperes", "--amps, or --drive voltage"),
        (
            "--volts-per-volt",
            !voltage && volts_gain,
            "a current amplifier has none",
            "--amps-per-volt, or --drive voltage",
        ),
    ];
    if let Some((option, _, what, help)) = others.into_iter().find(|(_, given, ..)| *given) {
        return Err(wrong(option, what, help));
    }
    let level = if voltage { args.volts.unwrap_or(0.5) } else { args.amps.unwrap_or(0.1) };
    let most = bench.most();
    if level > most {
        let (option, unit) = (option(args), unit(args));
        let gain = if voltage { "--volts-per-volt" } else { "--amps-per-volt" };
        let help = format!("at most {most} {unit}, by --volts-at-full-scale and {gain}");
        return Err(wrong(option, format!("{level} {unit} is out of range"), help));
    }
    Ok(level)
}

/// Unit of the drive.
fn unit(args: &Args) -> &'static str {
    if args.drive == DriveKind::Current { "A" } else { "V" }
}

/// The option that sets the level.
fn option(args: &Args) -> &'static str {
    if args.drive == DriveKind::Current { "--amps" } else { "--volts" }
}

/// Gain of a current amplifier \[A/V\].
fn amps_per_volt(args: &Args) -> f64 {
    args.amps_per_volt.unwrap_or(1.0)
}

/// Gain of a voltage amplifier.
fn volts_per_volt(args: &Args) -> f64 {
    args.volts_per_volt.unwrap_or(1.0)
}

/// The profile's text. It must be possible to read it again.
fn profile(findings: &Findings, base: &ActuatorProfile) -> Result<String, Failure> {
    let text = write_profile(findings, base, Some(&today()));
    ActuatorProfile::parse(&Source::new("the measured profile", text.clone())).map_err(|d| {
        Failure::Machine(format!(
            "the measured figures are those of no usable actuator: {d}\nnothing was written"
        ))
    })?;
    Ok(text)
}

/// The date in UTC, such as 2026-03-01.
fn today() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    date(i64::try_from(seconds / 86_400).unwrap_or(0))
}

/// The date this many days after 1 January 1970, by years of 365.2425 days that begin in March.
fn date(days: i64) -> String {
    let days = days + 719_468;
    let (era, day) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let of_year = day - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let of_month = of_year - (153 * month + 2) / 5 + 1;
    let (year, month) =
        (era * 400 + year + i64::from(month >= 10), if month < 10 { month + 3 } else { month - 9 });
    format!("{year:04}-{month:02}-{of_month:02}")
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
    let ended = || Failure::Machine("stopped before the second measurement; nothing was written".into());
    loop {
        match came.recv_timeout(Duration::from_millis(50)) {
            Ok(true) => return Ok(()),
            Ok(false) | Err(RecvTimeoutError::Disconnected) => return Err(ended()),
            Err(RecvTimeoutError::Timeout) if stop.load(Relaxed) => return Err(ended()),
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}
