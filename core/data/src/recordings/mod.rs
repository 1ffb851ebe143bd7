//! A user's own recordings: a folder with one folder for each material, which holds pictures of it and
//! strokes over it. Or one stroke by itself ([`recorded`]).
//!
//! # Strokes
//!
//! A stroke is a measurement while a tool was dragged, at 1 to 10 kHz, in one of two forms.
//!
//! A table ([`asperity_motion::Table`]) has a header that names columns in any order, then a row for each
//! sample of a steady clock. Other columns are ignored.
//!
//! | column | |
//! |---|---|
//! | `t_s` or `time_s` | time in seconds |
//! | `force_n` | normal force in N |
//! | `vx_mm_s`, `vy_mm_s` | velocity along the surface in mm/s |
//! | or `x_mm`, `y_mm` | place on the surface in mm |
//! | or `speed_mm_s` | speed along the surface in mm/s |
//! | `ax_m_s2`, `ay_m_s2`, `az_m_s2` | acceleration of the tool in m/s^2, one axis or more |
//! | or `acceleration_m_s2` | the same of one axis |
//!
//! Of several kinds of motion the velocity counts before the place, and the place before the speed.
//!
//! A WAV file has 16 to 32 bits. `recording.ron` in the same folder names its channels in order; a
//! channel `none` is left out. `full_scale` is the value at full scale in the quantity's unit:
//!
//! ```text
//! Recording(channels: [
//!     (quantity: "force_n", full_scale: 20.0),
//!     (quantity: "speed_mm_s", full_scale: 500.0),
//!     (quantity: "acceleration_m_s2", full_scale: 50.0),
//! ])
//! ```
//!
//! # Examples
//!
//! There is an example every 20 ms. Its history is as the chain would measure it at 500 Hz: the mean force
//! of each 2 ms, and the difference of places 2 ms apart, or the mean velocity between, through the chain's
//! velocity filter. A negative force counts as 0. A speed alone has no direction: each example gets one, a
//! golden angle from the last.
//!
//! Its magnitudes are those of the 0.1 s that follow, at the file's rate, with several axes as one. A
//! second-order high-pass of 5 Hz comes first: gravity turns with the tool, and the window would put a
//! constant into the 10 Hz bin. It takes 0.3 dB from that bin. For a recording below 2 kHz the bins
//! above half its rate are 0.
//!
//! The last fifth of each stroke is held apart. With five or more strokes of a material it is the last
//! fifth of them, sorted by name. No sample counts in both parts.

mod read;
mod stroke;

use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, Source};
use asperity_dsp::frame::WINDOW_S;
use asperity_motion::ColumnMap;

use crate::example::{Parts, Subject, Truth};
use crate::felt::{Felt, force_n};
use crate::folder;
use crate::history::RATE_HZ;
use crate::pattern;

pub use read::parse;
pub use stroke::Recorded;

/// Reads one stroke: a WAV file by its extension, with the file that names its channels, else a table with
/// this map of its columns.
///
/// # Errors
/// A file that is not as the [module](self) says. CSV and RON errors have line and column. A map of a WAV
/// file's columns.
pub fn recorded(path: &Path, map: &ColumnMap) -> Result<Recorded, Diagnostic> {
    if !folder::ends_with(path, &["wav"]) {
        return parse(&Source::read(path)?, map);
    }
    let channels = channels_file(path);
    if !map.is_empty() {
        let what = "a WAV file has no columns to map";
        return Err(folder::refused(path, what, &format!("{} names its channels", channels.display())));
    }
    read::wav(path, &channels)
}

/// A recorded stroke that a graph can play, with the tool's accelerations.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// x, y, z in mm, every 2 ms from the first sample, as the chain would have measured them (see the
    /// [module](self)). z is 2 mm below 0 for each newton, as on a floor of 0.5 N/mm, and 0 without
    /// force. From velocities the place begins at 0; a speed alone goes along x.
    pub position_mm: Vec<[f64; 3]>,
    /// Acceleration of all axes at the recording's rate, without gravity: behind a second-order
    /// high-pass of 5 Hz.
    pub felt: Felt,
}

impl Recording {
    /// Place at a time in s: x, y, z in mm, interpolated linearly. The first and the last place hold.
    pub fn place_mm(&self, t_s: f64) -> [f64; 3] {
        let last = self.position_mm.len().saturating_sub(1);
        let at = (t_s * RATE_HZ).clamp(0.0, last as f64);
        let place = |i: usize| self.position_mm.get(i.min(last)).copied().unwrap_or_default();
        let (a, b) = (place(at as usize), place(at as usize + 1));
        std::array::from_fn(|axis| a[axis] + at.fract() * (b[axis] - a[axis]))
    }

    /// The stroke as a CSV file for the `trajectory` node, with a column `force_n`.
    pub fn csv(&self) -> String {
        let mut text = String::from("t_s,x_mm,y_mm,z_mm,force_n\n");
        for (tick, [x, y, z]) in self.position_mm.iter().enumerate() {
            let (t, force) = (tick as f64 / RATE_HZ, force_n(*z));
            text.push_str(&format!("{t:.3},{x:.4},{y:.4},{z:.4},{force:.4}\n"));
        }
        text
    }
}

/// Reads one stroke, to compare a rendering with the tool's accelerations. The file is as for [`recorded`].
///
/// # Errors
/// As [`recorded`].
pub fn recording(path: &Path, map: &ColumnMap) -> Result<Recording, Diagnostic> {
    recorded(path, map)?.recording().map_err(|e| e.in_file(path))
}

/// Path of the file that names a WAV file's channels.
pub fn channels_file(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(CHANNELS_FILE)
}

/// Name of the file that names a WAV file's channels.
const CHANNELS_FILE: &str = "recording.ron";

/// Reads a folder of materials, in the order of their folders' names.
///
/// # Errors
/// A folder that cannot be read or has no folders; a material without a picture or a stroke; a file
/// that is not as the [module](self) says, with line and column for CSV and RON; all of
/// [`asperity_texture::picture::read`].
pub fn read(folder: &Path) -> Result<Vec<Subject>, Diagnostic> {
    let materials: Vec<PathBuf> = folder::entries(folder)?.into_iter().filter(|p| p.is_dir()).collect();
    if materials.is_empty() {
        let help = "a folder for each material, with its pictures and strokes";
        return Err(folder::refused(folder, "no materials in this folder", help));
    }
    materials.iter().map(|material| subject(material)).collect()
}

fn subject(folder: &Path) -> Result<Subject, Diagnostic> {
    let files = folder::entries(folder)?;
    let pictures: Vec<PathBuf> = files.iter().filter(|f| folder::is_picture(f)).cloned().collect();
    let strokes = of_strokes(&files);
    for (none, what, help) in [
        (pictures.is_empty(), "no picture of this material", "a PNG, JPEG or BMP file, one at least"),
        (strokes.is_empty(), "no stroke over this material", "a CSV or WAV file, one at least"),
    ] {
        if none {
            return Err(folder::refused(folder, what, help));
        }
    }
    let mut examples = Parts::default();
    for (path, part) in strokes {
        let stroke = recorded(path, &ColumnMap::default())?;
        let split_s = if part == WHOLE { f64::INFINITY } else { stroke.duration_s() * part };
        for mut timed in stroke.examples().map_err(|e| e.in_file(path))? {
            // Data to judge by is not trained on.
            let span = timed.span_s();
            if span.start < split_s && span.end + WINDOW_S > split_s {
                timed.example.other = None;
            }
            if span.end <= split_s {
                examples.train.push(timed.example);
            } else if span.start >= split_s {
                examples.held.push(timed.example);
            }
        }
    }
    let name = folder::name(folder);
    let (images, notes) = folder::pictures(&pictures)?;
    Ok(Subject {
        description: format!("Recordings of {name}."),
        name,
        family: None,
        images,
        image_mm: None,
        notes,
        examples,
        truth: Truth::Draws,
    })
}

/// The strokes of a material's folder that have places or velocities, to find its
/// [pattern](crate::pattern): those to train on. All count as strokes over one piece.
///
/// # Errors
/// As [`read`], of strokes.
pub fn strokes(folder: &Path) -> Result<Vec<pattern::Stroke>, Diagnostic> {
    let mut strokes = Vec::new();
    for (path, part) in of_strokes(&folder::entries(folder)?) {
        if part == 0.0 {
            continue;
        }
        let stroke = recorded(path, &ColumnMap::default())?;
        if !stroke.directed {
            continue;
        }
        let recording = stroke.recording().map_err(|e| e.in_file(path))?;
        let axes = recording.felt.axes();
        let axes: Vec<&[f64]> = axes.iter().map(|a| &a[..(a.len() as f64 * part) as usize]).collect();
        let place = |t: f64| {
            let [x, y, _] = recording.place_mm(t);
            [x, y]
        };
        strokes.push(pattern::Stroke::new(recording.felt.rate_hz, &axes, place));
    }
    Ok(strokes)
}

/// All of a stroke.
const WHOLE: f64 = 1.0;

/// Files of strokes among others, and the part of each to train on. Five or more are divided as a whole.
fn of_strokes(files: &[PathBuf]) -> Vec<(&PathBuf, f64)> {
    let strokes: Vec<&PathBuf> = files.iter().filter(|f| folder::ends_with(f, &["csv", "wav"])).collect();
    let (count, seen) = (strokes.len(), strokes.len() - folder::held_of(strokes.len()));
    let part = |number: usize| match number < seen {
        _ if count < 5 => 0.8,
        true => WHOLE,
        false => 0.0,
    };
    strokes.into_iter().enumerate().map(|(number, path)| (path, part(number))).collect()
}

#[cfg(test)]
mod tests;
