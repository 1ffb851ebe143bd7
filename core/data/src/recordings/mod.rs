//! Anyone's own recordings: a folder with a folder for each material, in it pictures of the material and
//! strokes over it; or one stroke by itself ([`recorded`]).
//!
//! # Strokes
//!
//! A stroke is what was measured while a tool was dragged, at 1 to 10 kHz, in one of two forms.
//!
//! A CSV file: a header that names columns in any order, then a row for each sample of a steady clock.
//! Lines that start with `#` and blank lines are skipped.
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
//! Where there are several kinds of motion the velocity counts before the place, and the place before the
//! speed.
//!
//! A WAV file of 16 to 32 bits, whose channels are named in `recording.ron` in the same folder, in order; a
//! channel of `none` is left out. `full_scale` is the value in the quantity's unit at which the file is
//! full:
//!
//! ```text
//! Recording(channels: [
//!     (quantity: "force_n", full_scale: 20.0),
//!     (quantity: "speed_mm_s", full_scale: 500.0),
//!     (quantity: "acceleration_m_s2", full_scale: 50.0),
//! ])
//! ```
//!
//! # What examples are
//!
//! An example every 20 ms. Its history is what the chain would have measured at 500 Hz: the mean force of
//! each 2 ms, and the difference of places 2 ms apart, or else the mean velocity between, through the
//! chain's velocity filter. Below 0 a force counts as 0. Of a speed alone the direction is not known: each
//! example has another, a golden angle on from the one before.
//!
//! Its magnitudes are those of the 0.1 s that follow, at the file's own rate, several axes as one. A
//! high-pass of 5 Hz and second order goes before: gravity turns with the tool, and of what is constant the
//! window puts all of its size into the 10 Hz bin. It takes 0.3 dB from that bin. Of a recording at less
//! than 2 kHz the bins above half its rate are 0: it says nothing there.
//!
//! The last fifth of each stroke is held apart, or of five or more strokes of a material the last fifth of
//! them, sorted by name. No sample counts in both.

mod channels;
mod stroke;
mod table;
mod wav;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source};
use asperity_dsp::frame::WINDOW_S;

use crate::example::{Parts, Subject, Truth};
use crate::felt::{Felt, force_n};
use crate::folder;
use crate::history::RATE_HZ;
use crate::pattern;

use stroke::Stroke;

/// One stroke as it was recorded, all channels at one rate and of one length.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Samples a second: 1 to 10 kHz, or off by no more than clocks are.
    pub rate_hz: f64,
    /// Normal force in N.
    pub force_n: Vec<f64>,
    /// Speed along the surface in mm/s. From velocities or places it is the length of their mean change
    /// over 20 ms: of single samples noise would count as speed.
    pub speed_mm_s: Vec<f64>,
    /// Acceleration of the tool in m/s^2 by axes, one to three.
    pub acceleration_m_s2: Vec<Vec<f64>>,
}

impl Recorded {
    /// A stroke from columns by name, where a file says no names: `force_n`, `ax_m_s2` and the others of
    /// the [table](self), but no clock. A column `none` is left out.
    ///
    /// # Errors
    /// A name that is unknown or there twice, quantities that are missing, columns of different lengths, a
    /// number out of range, a rate that is not 1 to 10 kHz, less than 0.5 s.
    pub fn from_columns(rate_hz: f64, columns: Vec<(&str, Vec<f64>)>) -> Result<Self, Diagnostic> {
        channels::named(columns, channels::rate(rate_hz)?).map(Stroke::recorded)
    }
}

/// Reads one stroke: a WAV file by its name's ending, with the file that names its channels beside it, else
/// a table.
///
/// # Errors
/// A file that is not as the [module](self) says, in a CSV or RON file with line and column.
pub fn recorded(path: &Path) -> Result<Recorded, Diagnostic> {
    let folder = path.parent().unwrap_or(Path::new(""));
    stroke(path, folder).map(Stroke::recorded)
}

/// A recorded stroke as a graph can play it, and what the tool felt of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// x, y, z in mm, every 2 ms from the first sample on, as the chain would have measured them (see the
    /// [module](self)): z is 2 mm below 0 for each newton, as on a floor of 0.5 N/mm, and 0 where there is
    /// no force. Of velocities the place begins at 0; of a speed alone the way goes along x.
    pub position_mm: Vec<[f64; 3]>,
    /// The acceleration of all axes at the recording's rate, without gravity: a high-pass of 5 Hz and
    /// second order.
    pub felt: Felt,
}

impl Recording {
    /// Where it is at a time in s, x, y, z in mm: on the line between two places; before the first and
    /// behind the last it stays there.
    pub fn place_mm(&self, t_s: f64) -> [f64; 3] {
        let last = self.position_mm.len().saturating_sub(1);
        let at = (t_s * RATE_HZ).clamp(0.0, last as f64);
        let place = |i: usize| self.position_mm.get(i.min(last)).copied().unwrap_or_default();
        let (a, b) = (place(at as usize), place(at as usize + 1));
        std::array::from_fn(|axis| a[axis] + at.fract() * (b[axis] - a[axis]))
    }

    /// The stroke as a CSV file of the `trajectory` node, with the column `force_n` beside the places.
    pub fn csv(&self) -> String {
        let mut text = String::from("t_s,x_mm,y_mm,z_mm,force_n\n");
        for (tick, [x, y, z]) in self.position_mm.iter().enumerate() {
            let (t, force) = (tick as f64 / RATE_HZ, force_n(*z));
            text.push_str(&format!("{t:.3},{x:.4},{y:.4},{z:.4},{force:.4}\n"));
        }
        text
    }
}

/// Reads one stroke to hold what is rendered of it against what the tool felt: a WAV file by its name's
/// ending, with the file that names its channels beside it, else a table.
///
/// # Errors
/// As [`recorded`].
pub fn recording(path: &Path) -> Result<Recording, Diagnostic> {
    let folder = path.parent().unwrap_or(Path::new(""));
    stroke(path, folder)?.recording().map_err(|e| Diagnostic::new(e.to_string()).in_file(path))
}

/// Reads one stroke from the text of a table.
///
/// # Errors
/// As [`recorded`] of a CSV file.
pub fn parse(source: &Arc<Source>) -> Result<Recorded, Diagnostic> {
    table::parse(source).map(Stroke::recorded)
}

/// The file that says what the channels of a WAV file are.
pub fn channels_file(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(CHANNELS_FILE)
}

/// The name of the file that says what a WAV file's channels are.
const CHANNELS_FILE: &str = "recording.ron";

/// Reads a folder of materials, in the order of their folders' names.
///
/// # Errors
/// A folder that cannot be read or holds no folder; a material without a picture or a stroke; a file that
/// is not as the [module](self) says, in a CSV or RON file with line and column; all of
/// [`asperity_texture::picture::read`].
pub fn read(folder: &Path) -> Result<Vec<Subject>, Diagnostic> {
    let materials: Vec<PathBuf> = folder::entries(folder)?.into_iter().filter(|p| p.is_dir()).collect();
    if materials.is_empty() {
        return Err(Diagnostic::new("no materials in this folder")
            .in_file(folder)
            .help("a folder for each material, with its pictures and strokes"));
    }
    materials.iter().map(|material| subject(material)).collect()
}

fn subject(folder: &Path) -> Result<Subject, Diagnostic> {
    let files = folder::entries(folder)?;
    let pictures: Vec<PathBuf> = files.iter().filter(|f| folder::is_picture(f)).cloned().collect();
    let recordings: Vec<&PathBuf> = files.iter().filter(|f| folder::ends_with(f, &["csv", "wav"])).collect();
    if pictures.is_empty() {
        return Err(Diagnostic::new("no picture of this material")
            .in_file(folder)
            .help("a PNG, JPEG or BMP file, one at least"));
    }
    if recordings.is_empty() {
        return Err(Diagnostic::new("no stroke over this material")
            .in_file(folder)
            .help("a CSV or WAV file, one at least"));
    }
    let whole = recordings.len() >= 5;
    let seen = recordings.len() - folder::held_of(recordings.len());
    let mut examples = Parts::default();
    for (number, path) in recordings.into_iter().enumerate() {
        let stroke = stroke(path, folder)?;
        let made = stroke.examples().map_err(|e| e.in_file(path))?;
        let split_s = match whole {
            true if number < seen => f64::INFINITY,
            true => f64::NEG_INFINITY,
            false => stroke.duration_s() * 0.8,
        };
        for mut timed in made {
            // What is judged by is not trained on.
            if timed.begin_s() < split_s && timed.end_s() + WINDOW_S > split_s {
                timed.example.other = None;
            }
            if timed.end_s() <= split_s {
                examples.train.push(timed.example);
            } else if timed.begin_s() >= split_s {
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
        notes,
        examples,
        truth: Truth::Draws,
    })
}

/// The strokes of a material's folder to find its [pattern](crate::pattern) from: those to train on, as far
/// as they have places or velocities. All of them are taken as strokes over one piece.
///
/// # Errors
/// As [`read`], of strokes.
pub fn strokes(folder: &Path) -> Result<Vec<pattern::Stroke>, Diagnostic> {
    let files = folder::entries(folder)?;
    let paths: Vec<&PathBuf> = files.iter().filter(|f| folder::ends_with(f, &["csv", "wav"])).collect();
    let whole = paths.len() >= 5;
    let seen = if whole { paths.len() - folder::held_of(paths.len()) } else { paths.len() };
    let mut strokes = Vec::new();
    for path in paths.into_iter().take(seen) {
        let stroke = stroke(path, folder)?;
        if !stroke.has_places() {
            continue;
        }
        let part = if whole { 1.0 } else { 0.8 };
        let recording = stroke.recording().map_err(|e| Diagnostic::new(e.to_string()).in_file(path))?;
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

fn stroke(path: &Path, folder: &Path) -> Result<Stroke, Diagnostic> {
    if folder::ends_with(path, &["wav"]) {
        wav::read(path, &folder.join(CHANNELS_FILE))
    } else {
        table::read(path)
    }
}

#[cfg(test)]
mod tests;
