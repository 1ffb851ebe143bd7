//! Tells whether a picture is unlike those that an encoder was trained on.
//!
//! The picture itself and some layers of the encoder have features. Those of a layer are the mean and the
//! standard deviation of each channel over the picture. Those of the picture are the mean of its
//! brightness and of two colour differences, and the logarithms of their deviations in each octave. Each
//! feature is divided by its deviation over the training pictures. A picture's distance is Mahalanobis's
//! from the nearest centre (Lee et al. 2018, "A simple unified framework for detecting out-of-distribution
//! samples and adversarial attacks"). Centres are the materials' means or the mean of all.
//! All have one covariance, that of probabilistic principal components: some axes, and one variance for
//! all other directions (Tipping and Bishop 1999). A picture is unlike the training pictures if any
//! distance is above its limit.
//!
//! `asperity-train statistics` fits and calibrates them. Those of `encoder.onnx` are the file
//! `encoder.statistics.ron` beside it:
//!
//! ```text
//! Statistics(
//!     version: 1,
//!     encoder: "0123456789abcdef",            // FNV-1a of the encoder's file
//!     layers: {
//!         "picture": (                        // always the first
//!             limit: 14.1,
//!             mean: [...], deviation: [...],  // of each feature
//!             rest: 0.2,                      // variance in all other directions
//!             axes: [(variance: 30.0, axis: [...])],
//!             centres: [[...]],               // scaled features
//!         ),
//!         "image.0.relu": (...),              // a value in the encoder's graph
//!     },
//! )
//! ```

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use asperity_diagnostics::ron::{self, Value, quoted};
use asperity_diagnostics::{Diagnostic, Source, fnv};
use asperity_numbers::Elementary as _;

use crate::picture::{Image, plane::Plane};

/// Name of the picture among the layers.
pub const PICTURE: &str = "picture";
/// Most layers, features of a layer, and axes or centres.
const MOST: [usize; 3] = [16, 8192, 4096];
/// Octaves of a picture.
const OCTAVES: usize = 5;
/// Levels of 255 that are added to each deviation, so that its logarithm is finite: about those of rounding.
const ROUNDING: f64 = 0.3;
/// Largest number of any kind.
const LARGEST: f64 = 1e9;

/// Statistics of an encoder's features over the pictures that it was trained on.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistics {
    /// Hash of the encoder's file.
    pub encoder: u64,
    /// The layers that are looked at.
    pub layers: Vec<Layer>,
}

/// Statistics of a layer's features.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// [`PICTURE`], or a value in the encoder's graph.
    pub name: String,
    /// Largest distance of a picture that is like the training pictures.
    pub limit: f64,
    /// Mean of each feature.
    pub mean: Vec<f64>,
    /// Standard deviation of each feature, above 0.
    pub deviation: Vec<f64>,
    /// Variance of the scaled features in the directions without an axis, above 0.
    pub rest: f64,
    /// Axes of unit length at right angles, each with the variance along it, above 0.
    pub axes: Vec<(f64, Vec<f64>)>,
    /// Centres in scaled features, at least one.
    pub centres: Vec<Vec<f64>>,
}

/// A picture's largest distance over its layer's limit, and that layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Strangeness {
    /// The layer with the largest ratio.
    pub layer: String,
    /// Distance in that layer.
    pub distance: f64,
    /// That layer's limit.
    pub limit: f64,
}

impl Strangeness {
    /// Whether the picture is unlike the training pictures.
    pub fn is_unlike(&self) -> bool {
        self.distance.is_nan() || self.distance > self.limit
    }
}

impl Layer {
    /// Features as parts of their deviations from the mean.
    pub fn scaled(&self, features: &[f64]) -> Vec<f64> {
        features.iter().zip(&self.mean).zip(&self.deviation).map(|((x, m), d)| (x - m) / d).collect()
    }

    /// Distance of a picture by its features.
    pub fn distance(&self, features: &[f64]) -> f64 {
        let scaled = self.scaled(features);
        let square = |centre: &Vec<f64>| {
            let apart: Vec<f64> = scaled.iter().zip(centre).map(|(x, c)| x - c).collect();
            let dot = |a: &[f64]| a.iter().zip(&apart).map(|(a, x)| a * x).sum::<f64>();
            let along = |(variance, axis): &(f64, Vec<f64>)| {
                dot(axis).powi(2) * (variance.recip() - self.rest.recip())
            };
            dot(&apart) / self.rest + self.axes.iter().map(along).sum::<f64>()
        };
        self.centres.iter().map(square).fold(f64::INFINITY, f64::min).max(0.0).sqrt()
    }

    fn read(name: &str, value: &Value) -> Result<Self, Diagnostic> {
        let mut record = value.record("Layer")?;
        let positive = |value: &Value| value.f64_in(1.0 / LARGEST..=LARGEST, "");
        let limit = positive(record.required("limit")?)?;
        let mean = record.required("mean")?;
        let deviation = record.required("deviation")?;
        let rest = positive(record.required("rest")?)?;
        let axes = record.required("axes")?;
        let centres = record.required("centres")?;
        record.finish()?;
        let len = mean.list()?.len();
        let fits = if name == PICTURE { len == picture_len() } else { len > 0 && len % 2 == 0 };
        if !fits || len > MOST[1] {
            let help = format!("a mean and a deviation of each channel; {} of the picture", picture_len());
            return Err(mean.error(format!("a list of {len}")).help(help));
        }
        let numbers = |value: &Value| -> Result<Vec<f64>, Diagnostic> {
            let list = value.list()?;
            if list.len() != len {
                return Err(value.error(format!("a list of {}", list.len())).help(format!("{len} numbers")));
            }
            list.iter().map(|x| x.f64_in(-LARGEST..=LARGEST, "")).collect()
        };
        for list in [axes, centres] {
            if let Some(more) = list.list()?.get(MOST[2]) {
                return Err(more.error(format!("more than {} entries", MOST[2])));
            }
        }
        let axis = |value: &Value| -> Result<(f64, Vec<f64>), Diagnostic> {
            let mut record = value.record("Axis")?;
            let variance = positive(record.required("variance")?)?;
            let axis = numbers(record.required("axis")?)?;
            record.finish()?;
            Ok((variance, axis))
        };
        let axes = axes.list()?.iter().map(axis).collect::<Result<_, _>>()?;
        deviation.list()?.iter().try_for_each(|x| positive(x).map(drop))?;
        if centres.list()?.is_empty() {
            return Err(centres.error("no centre"));
        }
        let centres = centres.list()?.iter().map(numbers).collect::<Result<_, _>>()?;
        let [mean, deviation] = [numbers(mean)?, numbers(deviation)?];
        Ok(Self { name: name.to_owned(), limit, mean, deviation, rest, axes, centres })
    }
}

impl Statistics {
    /// The file beside an encoder that holds its statistics.
    pub fn beside(encoder: &Path) -> PathBuf {
        encoder.with_extension("statistics.ron")
    }

    /// Statistics of an encoder with these bytes.
    ///
    /// # Errors
    /// Text that is not RON, an unknown or missing field, lists of unequal lengths, numbers out of range; the
    /// statistics of another encoder.
    pub fn parse(source: &std::sync::Arc<Source>, encoder: &[u8]) -> Result<Self, Diagnostic> {
        let whole = ron::parse(source)?;
        let mut record = whole.record("Statistics")?;
        record.required("version")?.i64_in(1..=1, "")?;
        let of = record.required("encoder")?;
        let layers = record.required("layers")?;
        record.finish()?;
        let hash = fnv(encoder);
        if of.text()? != format!("{hash:016x}") {
            let what = format!("these are statistics of another encoder; this one's hash is {hash:016x}");
            return Err(of.error(what).help("`asperity-train statistics FOLDER` makes them anew"));
        }
        let entries = layers.map()?;
        if !(1..=MOST[0]).contains(&entries.len()) {
            return Err(layers.error(format!("{} layers", entries.len())).help(format!("1 to {}", MOST[0])));
        }
        if entries[0].0.name != PICTURE {
            return Err(layers.error(format!("the first layer is not `{PICTURE}`")));
        }
        let layers =
            entries.iter().map(|(key, value)| Layer::read(&key.name, value)).collect::<Result<_, _>>()?;
        Ok(Self { encoder: hash, layers })
    }

    /// The text of the file, with numbers of five digits.
    pub fn to_ron(&self) -> String {
        let hash = format!("{:016x}", self.encoder);
        let mut text = "// Made by `asperity-train statistics`.\nStatistics(\n    version: 1,\n".to_owned();
        text += &format!("    encoder: \"{hash}\",\n    layers: {{\n");
        let list =
            |numbers: &[f64]| numbers.iter().map(|x| format!("{x:.4e}")).collect::<Vec<_>>().join(", ");
        // Writing to a String cannot fail.
        for layer in &self.layers {
            let _ =
                writeln!(text, "        {}: (\n            limit: {:.4e},", quoted(&layer.name), layer.limit);
            let _ = writeln!(text, "            mean: [{}],", list(&layer.mean));
            let _ = writeln!(text, "            deviation: [{}],", list(&layer.deviation));
            let _ = writeln!(text, "            rest: {:.4e},\n            axes: [", layer.rest);
            for (variance, axis) in &layer.axes {
                let _ = writeln!(text, "                (variance: {variance:.4e}, axis: [{}]),", list(axis));
            }
            text.push_str("            ],\n            centres: [\n");
            for centre in &layer.centres {
                let _ = writeln!(text, "                [{}],", list(centre));
            }
            text.push_str("            ],\n        ),\n");
        }
        text + "    },\n)\n"
    }

    /// The strangeness of a picture by its [features](features) in each layer.
    pub fn strangeness(&self, features: &[Vec<f64>]) -> Option<Strangeness> {
        let all = self.layers.iter().zip(features).map(|(layer, features)| Strangeness {
            layer: layer.name.clone(),
            distance: layer.distance(features),
            limit: layer.limit,
        });
        all.max_by(|a, b| (a.distance / a.limit).total_cmp(&(b.distance / b.limit)))
    }
}

/// Number of features of a picture.
const fn picture_len() -> usize {
    3 * (OCTAVES + 2)
}

/// Features of a picture.
pub(crate) fn of_picture(image: &Image) -> Vec<f64> {
    let opponents: [fn(f64, f64, f64) -> f64; 3] = [
        |r, g, b| (r + g + b) / 3.0,
        |r, g, _| (r - g) * std::f64::consts::FRAC_1_SQRT_2,
        |r, g, b| (2.0 * b - r - g) / 6.0_f64.sqrt(),
    ];
    let mut features = Vec::with_capacity(picture_len());
    for opponent in opponents {
        let level = |p: &[u8]| opponent(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
        let values = image.pixels.chunks_exact(3).map(level).collect();
        let mut plane = Plane { width: image.size[1], values };
        features.push(plane.mean());
        for _ in 0..OCTAVES {
            let blurred = plane.blurred(1);
            features.push((plane.without(&blurred, 1).deviation() + ROUNDING).log_e());
            plane = blurred.halved();
        }
        features.push((plane.deviation() + ROUNDING).log_e());
    }
    features
}

/// Features of a layer's values, which are channels of equally many places each: each channel's mean, then
/// each one's standard deviation.
pub(crate) fn features(values: &[f32], channels: usize) -> Option<Vec<f64>> {
    let places = values.len() / channels.max(1);
    if places == 0 || places * channels != values.len() {
        return None;
    }
    let mean = |of: &dyn Fn(f64) -> f64, channel: &[f32]| {
        channel.iter().map(|x| of(f64::from(*x))).sum::<f64>() / places as f64
    };
    let means: Vec<f64> = values.chunks_exact(places).map(|channel| mean(&|x| x, channel)).collect();
    let deviation = |(channel, m): (&[f32], &f64)| mean(&|x| (x - m).powi(2), channel).sqrt();
    let deviations: Vec<f64> = values.chunks_exact(places).zip(&means).map(deviation).collect();
    Some([means, deviations].concat())
}
