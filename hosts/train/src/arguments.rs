//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, value_parser};
use serde::{Deserialize, Serialize};

use crate::data::Origin;
use crate::encoder::Preset;
use crate::loss::{Aim, Target};
use crate::pattern::FindPatterns;

/// Trains texture models, and says how good they are.
#[derive(Parser, Debug)]
#[command(name = "asperity-train", version)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    /// Trains a model. Ctrl-C keeps what was done; the same command goes on.
    Train(Train),
    /// Trains the network of every tick of a model anew; its encoder and its materials stay as they are.
    Network(Network),
    /// Judges a trained model by data it was not trained on, and writes its card anew.
    Evaluate(Evaluate),
    /// Finds anew how a model's materials vibrate over place: the fields `waves` and `events` of its library.
    Pattern(FindPatterns),
}

/// A model whose network is trained anew, with the settings of the model.
#[derive(Args, Clone, Debug)]
pub(crate) struct Network {
    /// Folder of the model.
    pub folder: PathBuf,
    /// Folder for checkpoints; by default FOLDER with `.run` after its name.
    #[arg(long, value_name = "FOLDER")]
    pub run: Option<PathBuf>,
    /// Where the data are now, if they have moved: `hatt:FOLDER` or `recordings:FOLDER`.
    #[arg(long, value_name = "SOURCE")]
    pub data: Option<Origin>,
    /// Steps before settling; by default those of the model's stage two.
    #[arg(long, value_parser = value_parser!(u32).range(1..=100_000_000))]
    pub steps: Option<u32>,
}

/// What is judged.
#[derive(Args, Clone, Debug)]
pub(crate) struct Evaluate {
    /// The model's folder.
    pub folder: PathBuf,
    /// The folder of its checkpoints, which has the classifier; by default FOLDER with `.run` after its name.
    #[arg(long, value_name = "FOLDER")]
    pub run: Option<PathBuf>,
    /// Where the data are now, if not where they were: `hatt:FOLDER` or `recordings:FOLDER`.
    #[arg(long, value_name = "SOURCE")]
    pub data: Option<Origin>,
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

/// What a run's result follows from.
#[derive(Args, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Settings {
    /// Where images and strokes come from: `made`, `hatt:FOLDER` or `recordings:FOLDER`.
    #[arg(long, default_value = "made", value_name = "SOURCE")]
    pub data: Origin,
    /// Sizes: the paper's, or small enough to ship.
    #[arg(long, default_value = "compact")]
    pub preset: Preset,
    /// What the network answers of a random texture.
    #[arg(long, default_value = "rms")]
    pub target: Target,
    /// How errors are weighed.
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
    /// Steps in which the network then settles on vectors that no longer change, for each target.
    #[arg(long, default_value_t = 6_000, value_parser = value_parser!(u32).range(1..=100_000_000))]
    pub settling_steps: u32,
    /// Of stage two: weight of naming the material, and of telling the family of surfaces that are not
    /// known, beside vibration. The paper has none.
    #[arg(long, default_value_t = 0.2, value_parser = weight)]
    pub naming_weight: f64,
    /// Of data that are read: how many materials are held apart whole, drawn by the seed.
    #[arg(long, default_value_t = 0)]
    pub unseen: u32,
    /// Of made data: every so-manieth surface only, 1 to 16.
    #[arg(long, default_value_t = 1, value_parser = value_parser!(u32).range(1..=16))]
    pub every: u32,
    /// Of made data: pieces of each surface to train on, 1 to 1000.
    #[arg(long, default_value_t = 12, value_parser = value_parser!(u32).range(1..=1000))]
    pub pieces: u32,
    /// Steps before settling of a network that was trained anew on a finished encoder, by `asperity-train
    /// network`.
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
