//! `asperity encode`, `asperity materials`

use std::path::PathBuf;

use clap::ValueEnum;

use super::number::whole;

/// Which vector a new material gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum As {
    /// The nearest stored one, which a network was trained on
    Nearest,
    /// Its own
    Raw,
    /// The mean of the nearest stored ones, each weighted by one over its distance
    Blend,
}

/// `asperity encode`
#[derive(Clone, Debug, clap::Args)]
pub struct Encode {
    /// Tactile images of one material, PNG, JPEG or BMP; of several the mean vector is taken
    #[arg(required = true, value_name = "IMAGE")]
    pub images: Vec<PathBuf>,
    /// The library that is searched, and gets the material
    #[arg(long, value_name = "L.ron")]
    pub library: PathBuf,
    /// The encoder; the one that the library names, unless given
    #[arg(long, value_name = "FILE.onnx")]
    pub encoder: Option<PathBuf>,
    /// Name of the material; that of the first image's file, unless given
    #[arg(long)]
    pub name: Option<String>,
    /// What it feels like, in a sentence
    #[arg(long, value_name = "TEXT")]
    pub description: Option<String>,
    /// What it is one of, such as a weave
    #[arg(long, value_name = "TEXT", value_parser = family)]
    pub family: Option<String>,
    /// Which vector it gets
    #[arg(long = "as", value_enum, default_value = "nearest")]
    pub how: As,
    /// How many of the nearest materials are listed, 5 unless given, and blended by `--as blend`, 3 unless given
    #[arg(long, value_name = "N", value_parser = whole(1_usize, 4096, ""))]
    pub neighbours: Option<usize>,
    /// Only tell; add nothing to the library
    #[arg(long)]
    pub dry_run: bool,
}

fn family(text: &str) -> Result<String, String> {
    if text.trim().is_empty() { Err("an empty text".into()) } else { Ok(text.to_owned()) }
}

/// `asperity materials`
#[derive(Clone, Debug, clap::Args)]
pub struct Materials {
    /// The library
    #[arg(long, value_name = "L.ron", default_value = "graphs/models/surfaces/materials.ron")]
    pub library: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
