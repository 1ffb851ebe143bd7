//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, value_parser};
use serde::{Deserialize, Serialize};

use crate::data::Origin;
use crate::encoder::Preset;
use crate::loss::{Aim, Target};
use crate::pattern::FindPatterns;
use crate::statistics::FindStatistics;

/// Trains and evaluates texture models.
#[derive(Parser, Debug)]
#[command(name = "asperity-train", version)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    /// Trains a model. After Ctrl-C the same command continues.
    Train(Train),
    /// Retrains the tick network of a model; its encoder and materials stay.
    Network(Network),
    /// Evaluates a trained model on held-out data and rewrites its model report.
    Evaluate(Trained),
    /// Finds the patterns of a model's materials again: the fields `waves` and `events` of its library.
    Pattern(FindPatterns),
    /// Makes the statistics by which `asperity encode` tells pictures unlike the training pictures.
    Statistics(FindStatistics),
}

/// A trained model, and its data and settings.
#[derive(Args, Clone, Debug)]
pub(crate) struct Trained {
    /// Folder of the model.
    pub folder: PathBuf,
    /// Folder of its checkpoints with the classifier; by default FOLDER with `.run` after its name.
    #[arg(long, value_name = "FOLDER")]
    pub run: Option<PathBuf>,
    /// Present place of the data if they have moved: `hatt:FOLDER` or `recordings:FOLDER`.
    #[arg(long, value_name = "SOURCE")]
    pub data: Option<Origin>,
}

/// Arguments of retraining a network, with the settings of the model.
#[derive(Args, Clone, Debug)]
pub(crate) struct Network {
    #[command(flatten)]
    pub model: Trained,
    /// Steps before settling; by default those of the model's stage two.
    #[arg(long, value_parser = value_parser!(u32).range(1..=100_000_000))]
    pub steps: Option<u32>,
}

/// A training run.
#[derive(Args, Clone, Debug)]
pub(crate) struct Train {
    /// Folder for the model: encoder.onnx, texture.onnx, materials.ron, pictures, curves.
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,
    /// Folder for checkpoints; by default OUT with `.run` after its name.
    #[arg(long, value_name = "FOLDER")]
    pub run: Option<PathBuf>,
    #[command(flatten)]
    pub settings: Settings,
}

/// Settings that determine a run's result.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Settings {
    /// Source of images and strokes: `made`, `hatt:FOLDER` or `recordings:FOLDER`.
    #[arg(long, default_value = "made", value_name = "SOURCE")]
    pub data: Origin,
    /// Sizes: the paper's, or small ones to ship.
    #[arg(long, default_value = "compact")]
    pub preset: Preset,
    /// Target of the network for a random texture.
    #[arg(long, default_value = "rms")]
    pub target: Target,
    /// Weighting of errors.
    #[arg(long, default_value = "relative")]
    pub error: Aim,
    /// Seed of data, weights and batches.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Steps of stage one, which names textures.
    #[arg(long, default_value_t = 5_000, value_parser = value_parser!(u32).range(1..=100_000_000))]
    pub naming_steps: u32,
    /// Images a step of stage one.
    #[arg(long, default_value_t = 32, value_parser = value_parser!(u32).range(1..=4096))]
    pub naming_batch: u32,
    /// Largest learning rate of stage one.
    #[arg(long, default_value_t = 7e-4, value_parser = rate)]
    pub naming_rate: f64,
    /// Steps of stage two, which predicts vibration.
    #[arg(long, default_value_t = 20_000, value_parser = value_parser!(u32).range(1..=100_000_000))]
    pub feeling_steps: u32,
    /// Materials a step of stage two.
    #[arg(long, default_value_t = 32, value_parser = value_parser!(u32).range(1..=4096))]
    pub feeling_groups: u32,
    /// Touches of each of them.
    #[arg(long, default_value_t = 8, value_parser = value_parser!(u32).range(1..=4096))]
    pub feeling_each: u32,
    /// Largest learning rate of stage two.
    #[arg(long, default_value_t = 6e-4, value_parser = rate)]
    pub feeling_rate: f64,
    /// Steps for the network to settle on fixed vectors, for each target.
    #[arg(long, default_value_t = 6_000, value_parser = value_parser!(u32).range(1..=100_000_000))]
    pub settling_steps: u32,
    /// Stage two's weight of naming materials and telling unknown surfaces' families, beside vibration.
    /// The paper has none.
    #[arg(long, default_value_t = 0.2, value_parser = weight)]
    pub naming_weight: f64,
    /// Number of materials to hold out whole from read data, drawn by the seed.
    #[arg(long, default_value_t = 0)]
    pub unseen: u32,
    /// Use every N-th surface of made data, 1 to 16.
    #[arg(long, default_value_t = 1, value_parser = value_parser!(u32).range(1..=16))]
    pub every: u32,
    /// Training pieces of each surface of made data, 1 to 1000.
    #[arg(long, default_value_t = 12, value_parser = value_parser!(u32).range(1..=1000))]
    pub pieces: u32,
    /// Steps before settling for a network retrained by `asperity-train network`.
    #[arg(skip)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub network_steps: Option<u32>,
}

fn weight(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (0.0..=100.0).contains(&x) => Ok(x),
        _ => Err("a number from 0 to 100".to_owned()),
    }
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 && x <= 1.0 => Ok(x),
        _ => Err("a number above 0 and at most 1".to_owned()),
    }
}
