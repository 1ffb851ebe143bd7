//! `asperity fit-ar`

use std::path::PathBuf;

use clap::ValueEnum;

use super::number::{number, whole};

/// By what orders are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum By {
    /// Akaike's criterion, corrected: what predicts best
    Aicc,
    /// Schwarz's criterion: what is right, if any order is; lower orders
    Bic,
}

/// `asperity fit-ar`
#[derive(Clone, Debug, clap::Args)]
pub struct FitAr {
    /// What was recorded: a CSV table, a WAV file or a .npy array
    pub recording: PathBuf,
    /// The texture to write
    #[arg(long, value_name = "M.ron")]
    pub out: PathBuf,
    /// What it feels like, in a sentence
    #[arg(long, value_name = "TEXT")]
    pub description: Option<String>,
    /// The models' order; the best, unless given
    #[arg(long, value_name = "P", conflicts_with_all = ["max_order", "by"], value_parser = whole(1_usize, 64, ""))]
    pub order: Option<usize>,
    /// The highest order that is tried
    #[arg(long, default_value_t = 24, value_name = "P", value_parser = whole(1_usize, 64, ""))]
    pub max_order: usize,
    /// By what the best order is chosen
    #[arg(long, value_enum, default_value = "aicc")]
    pub by: By,
    /// Rate of the models
    #[arg(long, default_value_t = 1000, value_name = "HZ", value_parser = whole(500_u32, 10_000, "Hz"))]
    pub model_hz: u32,
    /// Corner of the high-pass against gravity and the hand's motion, to a tenth of the models' rate; 0 for none
    #[arg(long, default_value_t = 10.0, value_name = "HZ", value_parser = number(0.0, 1000.0, "Hz"))]
    pub high_pass_hz: f64,
    /// Shortest piece of constant speed and force that is fitted
    #[arg(long, default_value_t = 0.2, value_name = "S", value_parser = number(0.05, 10.0, "s"))]
    pub shortest_s: f64,
    /// Slower than this is no stroke
    #[arg(long, default_value_t = 5.0, value_name = "MM/S", value_parser = number(0.0, 10_000.0, "mm/s"))]
    pub least_speed_mm_s: f64,
    /// Less force than this is no contact
    #[arg(long, default_value_t = 0.05, value_name = "N", value_parser = number(0.0, 100.0, "N"))]
    pub least_force_n: f64,
    /// How far a constant speed may stray, and how near equal ones are
    #[arg(long, default_value_t = 10.0, value_name = "MM/S", value_parser = number(0.01, 10_000.0, "mm/s"))]
    pub speed_tolerance_mm_s: f64,
    /// How far a constant force may stray, and how near equal ones are
    #[arg(long, default_value_t = 0.1, value_name = "N", value_parser = number(1e-4, 100.0, "N"))]
    pub force_tolerance_n: f64,
    /// The same as a part of either, where that is more
    #[arg(long, default_value_t = 20.0, value_name = "PERCENT", value_parser = number(0.0, 100.0, "%"))]
    pub tolerance_percent: f64,
    /// Most models; where there would be more, more pieces become one
    #[arg(long, default_value_t = 64, value_name = "N", value_parser = whole(1_usize, 256, ""))]
    pub most_models: usize,
    /// What the columns of a .npy array are, such as force_n,speed_mm_s,ax_m_s2; `none` for one to be left out
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', requires = "rate_hz")]
    pub columns: Vec<String>,
    /// Rate of a .npy array
    #[arg(long, value_name = "HZ", requires = "columns", value_parser = number(1000.0, 10_000.0, "Hz"))]
    pub rate_hz: Option<f64>,
    /// Draw the models over speed and force, and their spectra beside those recorded
    #[arg(long, value_name = "P.svg")]
    pub plot: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
