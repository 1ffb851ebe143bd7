//! Trains the shipped texture network on the made materials' law and writes it as ONNX, with the library of
//! materials it knows and a card of what it is and how good.

mod card;
mod evaluation;
mod files;
mod network;
mod onnx;
mod training;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use asperity_source::Diagnostic;
use asperity_world::material::{Library, made_materials};
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};

/// Trains the texture network on the made materials and writes it as ONNX.
#[derive(Parser, Debug)]
#[command(name = "asperity-train", version)]
struct Arguments {
    /// The ONNX file to write; its card is written beside it as .md.
    #[arg(long, value_name = "FILE.onnx")]
    out: PathBuf,
    /// The materials library to write.
    #[arg(long, value_name = "FILE.ron")]
    library: PathBuf,
    /// Steps of the optimiser (Adam).
    #[arg(long, default_value_t = 30_000, value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    steps: u32,
    /// Histories a step.
    #[arg(long, default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    batch: u32,
    /// Seed of weights and histories.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Largest learning rate; it falls to a hundredth by half a cosine.
    #[arg(long, default_value_t = 1e-3, value_parser = positive)]
    learning_rate: f64,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 && x <= 1.0 => Ok(x),
        _ => Err("a number above 0 and at most 1".to_owned()),
    }
}

/// Why a run ended early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// A file, a name or a range.
    Input(Diagnostic),
    /// Our own output could not be run again.
    Model(String),
}

impl Failure {
    fn model(e: &dyn std::fmt::Display) -> Self {
        Self::Model(format!("the written network does not run: {e:#}"))
    }
}

impl From<Diagnostic> for Failure {
    fn from(e: Diagnostic) -> Self {
        Self::Input(e)
    }
}

impl From<asperity_dsp::filter::FilterError> for Failure {
    fn from(e: asperity_dsp::filter::FilterError) -> Self {
        Self::Model(e.to_string())
    }
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Input(e)) => {
            eprintln!("error: {e}");
            ExitCode::from(2)
        }
        Err(Failure::Model(e)) => {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    let card_path = arguments.out.with_extension("md");
    for path in [&arguments.out, &arguments.library, &card_path] {
        files::check_folder(path)?;
    }
    let materials = made_materials()?;
    let library = Library::made(&materials);
    let settings = training::Settings {
        steps: arguments.steps as usize,
        batch: arguments.batch as usize,
        seed: arguments.seed,
        learning_rate: arguments.learning_rate,
    };

    let start = Instant::now();
    let bar = bar(settings.steps as u64);
    let lines = !std::io::stderr().is_terminal();
    let mut next_line = 0;
    let weights = training::train(&materials, &settings, |p| {
        bar.set_position(p.step as u64);
        bar.set_message(format!("{:.4}", p.loss));
        if lines && (p.step >= next_line || p.step == settings.steps) {
            next_line = p.step + settings.steps / 50;
            let rate = p.step as f64 / start.elapsed().as_secs_f64();
            let left = Duration::from_secs(((settings.steps - p.step) as f64 / rate) as u64);
            eprintln!(
                "step {} of {}, loss {:.4}, {rate:.0} steps/s, {left:?} left",
                p.step, settings.steps, p.loss
            );
        }
    })?;
    bar.finish_and_clear();
    let seconds = start.elapsed().as_secs_f64();

    let about = [
        ("seed", settings.seed.to_string()),
        ("steps", settings.steps.to_string()),
        ("batch", settings.batch.to_string()),
    ];
    let onnx = onnx::encode(&weights, &about);
    eprintln!("trained in {seconds:.0} s; evaluating on held-out strokes");
    let evaluation = evaluation::evaluate(&onnx, &library, &materials)?;
    let card = card::write(&settings, &weights, &evaluation, name(&arguments.out), name(&arguments.library));
    files::write_whole(&arguments.library, library.to_ron().as_bytes())?;
    files::write_whole(&arguments.out, &onnx)?;
    files::write_whole(&card_path, card.as_bytes())?;
    print!("{}", card::table(&evaluation));
    for path in [&arguments.out, &arguments.library, &card_path] {
        println!("wrote {}", path.display());
    }
    Ok(())
}

fn name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

fn bar(steps: u64) -> ProgressBar {
    let style = ProgressStyle::with_template(
        "{bar:30} step {pos}/{len}  loss {msg}  {per_sec}  {elapsed} gone, {eta} left",
    );
    ProgressBar::new(steps).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
