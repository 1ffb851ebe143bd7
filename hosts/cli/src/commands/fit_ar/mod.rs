//! `asperity fit-ar`: fits a texture of autoregressive models to a recording.

mod report;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_accuracy::npy;
use asperity_autoregressive::TextureFile;
use asperity_autoregressive::fit::{Band, Criterion, Order, Recording, Settings, Tolerance};
use asperity_data::recordings::{self, Recorded};
use asperity_diagnostics::Diagnostic;
use clap::ValueEnum;

use crate::failure::{Failure, print_report, warn, wrong};
use crate::load::ColumnArgs;
use crate::number::{number, whole};
use crate::output::{Pending, apart, ending, ends_in_ron, keep_all, named};
use report::Report;

/// Criterion for the order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum By {
    /// Akaike's criterion, corrected: the best prediction
    Aicc,
    /// Schwarz's criterion: the true order, if there is one; gives lower orders
    Bic,
}

/// Fit a texture of autoregressive models to a recording of force, speed and acceleration
///
/// RECORDING is a table, a WAV file or a NumPy array, at 1 to 10 kHz. The first line of a table names its
/// columns: t_s; force_n; vx_mm_s and vy_mm_s, or x_mm and y_mm, or speed_mm_s; at least one of ax_m_s2,
/// ay_m_s2, az_m_s2, or acceleration_m_s2. --map gives other names. recording.ron beside a WAV file names its
/// channels. A NumPy array has a row for each sample. Hold several speeds and forces, a second each.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args = crate::number::may_be_negative)]
#[command(after_help = crate::commands::examples(&[
    "asperity fit-ar rough.csv --out rough.ron --plot rough.svg",
]))]
pub struct Args {
    /// Recording: a CSV table, a WAV file or a .npy array
    pub recording: PathBuf,
    #[command(flatten)]
    pub map: ColumnArgs,
    /// Texture to write
    #[arg(long, value_name = "M.ron")]
    pub out: PathBuf,
    /// Sentence that describes how it feels
    #[arg(long, value_name = "TEXT")]
    pub description: Option<String>,
    /// Order of the models; by default the best up to --max-order
    #[arg(long, value_name = "P", conflicts_with_all = ["max_order", "by"])]
    #[arg(value_parser = whole(1_usize, 64, ""))]
    pub order: Option<usize>,
    /// Highest order to try
    #[arg(long, default_value_t = 24, value_name = "P", value_parser = whole(1_usize, 64, ""))]
    pub max_order: usize,
    /// Criterion for the best order
    #[arg(long, value_enum, default_value = "aicc")]
    pub by: By,
    /// Rate of the models
    #[arg(long, default_value_t = 1000, value_name = "HZ", value_parser = whole(500_u32, 10_000, "Hz"))]
    pub model_hz: u32,
    /// Cutoff of the high-pass that removes slow motion, at most a tenth of the models' rate; 0 for none
    #[arg(long, default_value_t = 10.0, value_name = "HZ", value_parser = number(0.0, 1000.0, "Hz"))]
    pub high_pass_hz: f64,
    /// Shortest segment of constant speed and force to fit
    #[arg(long, default_value_t = 0.2, value_name = "S", value_parser = number(0.05, 10.0, "s"))]
    pub shortest_s: f64,
    /// Lowest speed that counts as a stroke
    #[arg(long, default_value_t = 5.0, value_name = "MM/S", value_parser = number(0.0, 10_000.0, "mm/s"))]
    pub least_speed_mm_s: f64,
    /// Lowest force that counts as contact
    #[arg(long, default_value_t = 0.05, value_name = "N", value_parser = number(0.0, 100.0, "N"))]
    pub least_force_n: f64,
    /// Largest change of a speed that counts as constant, and between equal speeds
    #[arg(long, default_value_t = 10.0, value_name = "MM/S", value_parser = number(0.01, 10_000.0, "mm/s"))]
    pub speed_tolerance_mm_s: f64,
    /// Largest change of a force that counts as constant, and between equal forces
    #[arg(long, default_value_t = 0.1, value_name = "N", value_parser = number(1e-4, 100.0, "N"))]
    pub force_tolerance_n: f64,
    /// The same, in percent of the speed or force; the larger of the two applies
    #[arg(long, default_value_t = 20.0, value_name = "PERCENT", value_parser = number(0.0, 100.0, "%"))]
    pub tolerance_percent: f64,
    /// Largest number of models. Beyond it, more segments share a model
    #[arg(long, default_value_t = 64, value_name = "N", value_parser = whole(1_usize, 256, ""))]
    pub most_models: usize,
    /// Columns of a .npy array, such as force_n,speed_mm_s,ax_m_s2; `none` for a column to skip
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', requires = "rate_hz")]
    pub columns: Vec<String>,
    /// Sample rate of a .npy array
    #[arg(long, value_name = "HZ", requires = "columns", value_parser = number(1000.0, 10_000.0, "Hz"))]
    pub rate_hz: Option<f64>,
    /// Picture file: the models over speed and force, and their spectra beside the recorded ones
    #[arg(long, value_name = "P.svg")]
    pub plot: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// A band with a larger error than this \[dB\] causes a warning, ..
const FAR_OFF_DB: f64 = 3.0;
/// .. if the error is also this many times the one expected by chance.
const CHANCES: f64 = 4.0;

/// A larger part of the power above half the models' rate causes a warning.
const MUCH_ABOVE: f64 = 0.05;

/// Using a smaller part of the recording than this causes a warning.
const LITTLE: f64 = 0.25;

pub fn run(args: &Args) -> Result<(), Failure> {
    let channels = recordings::channels_file(&args.recording);
    let written = named(&[("--out", Some(&args.out)), ("--plot", args.plot.as_ref())]);
    apart(named(&[("RECORDING", Some(&args.recording)), ("RECORDING", Some(&channels))]), written)?;
    ends_in_ron(&args.out, "texture")?;
    let create = |path: &Path, option: &str| Pending::create(path).map_err(|f| f.named_by(option));
    let texture_file = create(&args.out, "--out")?;
    let plot_file = args.plot.as_deref().map(|path| create(path, "--plot")).transpose()?;

    let recorded = read(args)?;
    let settings = settings(args);
    let recording = Recording {
        // Clocks are not exact: a rate just outside the range counts as its end.
        rate_hz: recorded.rate_hz.clamp(1000.0, 10_000.0),
        force_n: &recorded.force_n,
        speed_mm_s: &recorded.speed_mm_s,
        acceleration_m_s2: recorded.acceleration_m_s2.iter().map(Vec::as_slice).collect(),
    };
    let fail = |e: Diagnostic| e.in_file(&args.recording);
    let (texture, fitted) = recording.fit(&settings).map_err(fail)?;
    let texture = Arc::new(texture);
    let compared = recording.compare(&settings, &texture, &fitted).map_err(fail)?;

    let name = args.recording.file_name().unwrap_or_default().to_string_lossy();
    let seconds: f64 = fitted.segments.iter().map(|s| s.length_s).sum();
    let file = TextureFile {
        description: args.description.clone().unwrap_or_else(|| format!("Texture of the recording {name}.")),
        origin: format!("Fitted by `asperity fit-ar` to {seconds:.1} s of {name}."),
        texture: (*texture).clone(),
    };
    let text = file.to_ron().map_err(fail)?;
    let all = &compared.all;
    let far_off = |band: &&Band| band.off_db().abs() > FAR_OFF_DB.max(CHANCES * band.chance_db(all.seconds));
    if let Some(worst) = all.worst().filter(far_off) {
        let (hz, off) = (worst.centre_hz, worst.off_db());
        warn(&format!("the band at {hz:.0} Hz is rendered {off:+.1} dB off the recording"));
    }
    let whole_s = recorded.force_n.len() as f64 / recorded.rate_hz;
    if seconds < LITTLE * whole_s {
        warn(&format!(
            "only {seconds:.1} s of {whole_s:.1} s are used; the report lists the dropped seconds and the \
             reasons"
        ));
    }
    if fitted.above > MUCH_ABOVE {
        let (percent, half_hz) = (100.0 * fitted.above, f64::from(args.model_hz) / 2.0);
        let hz = (2 * args.model_hz).min(recording.rate_hz as u32);
        warn(&format!(
            "{percent:.0} % of the vibration's power is above {half_hz:.0} Hz, and the texture leaves it \
             out; --model-hz {hz} keeps more"
        ));
    }
    let (recorded, texture, fitted) = (&recorded, &texture, &fitted);
    let mut report = Report { args, recorded, texture, fitted, compared: &compared, written: Vec::new() };
    let plot = plot_file.map(|file| file.fill(&report::svg(&report))).transpose()?;
    report.written = keep_all(plot.into_iter().chain([texture_file.fill(&text)?]).collect())?;
    print_report(args.json, || report.json(), || report.text())
}

fn settings(args: &Args) -> Settings {
    let by = match args.by {
        By::Aicc => Criterion::Aicc,
        By::Bic => Criterion::Bic,
    };
    Settings {
        model_hz: args.model_hz,
        high_pass_hz: args.high_pass_hz,
        order: args.order.map_or(Order::Best { most: args.max_order, by }, Order::Given),
        shortest_s: args.shortest_s,
        least_speed_mm_s: args.least_speed_mm_s,
        least_force_n: args.least_force_n,
        tolerance: Tolerance {
            speed_mm_s: args.speed_tolerance_mm_s,
            force_n: args.force_tolerance_n,
            part: args.tolerance_percent / 100.0,
        },
        most_models: args.most_models,
    }
}

/// Reads the recording, by the ending of its name.
fn read(args: &Args) -> Result<Recorded, Failure> {
    let (path, map) = (&args.recording, args.map.parsed()?);
    let is_array = ending(path) == "npy";
    let Some(rate_hz) = args.rate_hz else {
        if is_array {
            let what = "the columns of this array have no names";
            return Err(wrong(
                path,
                what,
                "--columns force_n,speed_mm_s,ax_m_s2 --rate-hz 1000, for example",
            ));
        }
        let known = ["csv", "wav"].contains(&ending(path).as_str());
        return Ok(recordings::recorded(path, &map).map_err(|e| match &e.help {
            None if !known => e.help("a recording is a table (.csv), a WAV file (.wav) or an array (.npy)"),
            _ => e,
        })?);
    };
    if !map.is_empty() {
        return Err(wrong("--map", "an array has no columns to map", "--columns names them"));
    }
    if !is_array {
        let what = "a table names its own columns and has a clock, and a WAV file's are in recording.ron";
        return Err(wrong("--columns", what, "for a .npy array only"));
    }
    let (array, count) = (npy::read(path)?, args.columns.len());
    let [_, columns] = array.shape[..] else {
        let what = "an array of one dimension, where a row of several columns is a sample";
        return Err(Diagnostic::new(what).in_file(path).into());
    };
    if columns != count {
        let what = format!("{columns} columns, and {count} are named");
        return Err(wrong(path, what, "--columns names all, those to be left out as `none`"));
    }
    let values = array.values.into_f64();
    let of = |(i, name)| (name, values.iter().skip(i).step_by(count).copied().collect());
    let named = args.columns.iter().map(String::as_str).enumerate().map(of).collect();
    Ok(Recorded::from_columns(rate_hz, named).map_err(|e| e.in_file(path))?)
}
