//! The values of a port, tick by tick, and their meaning.

use std::io::{self, Read, Seek, Write};

use asperity_accuracy::npy::Packer;
use asperity_diagnostics::{Diagnostic, one_of};
use asperity_engine::Engine;
use asperity_graph::GraphFile;
use asperity_node::{Buffer, FrameLayout, Shape, time};

/// Adds a node that records a port, such as `texture.magnitude`, and answers its id. `origin` stands for the
/// file in errors.
///
/// # Errors
/// A node that the graph does not have, and parameters that do not fit.
pub fn add(
    graph: &mut GraphFile,
    port: &str,
    params: &[(&str, &str)],
    origin: &str,
) -> Result<String, Diagnostic> {
    let node = port.split('.').next().unwrap_or(port);
    if graph.node(node).is_none() {
        let ids = graph.nodes.iter().map(|n| n.id.as_str());
        let what = format!("the graph has no node `{node}`");
        return Err(Diagnostic::new(what).in_file(origin).help(one_of(node, ids)));
    }
    let id = (1..).map(|n| format!("probe {n}")).find(|id| graph.node(id).is_none()).unwrap_or_default();
    graph.add_node(&id, "probe", params, origin)?;
    graph.add_wire(port, &id, origin);
    Ok(id)
}

/// A port of a node: its first output, or its first input if it has none, as probes do.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    /// Index of the node.
    pub node: usize,
    /// Shape of the port.
    pub shape: Shape,
}

impl Probe {
    /// Values in a row: a control's count, 1 for audio, bins of a frame; a complex bin has two.
    pub fn columns(&self) -> usize {
        match self.shape {
            Shape::Control { count } => count,
            Shape::Audio { .. } => 1,
            Shape::Magnitude(l) => l.bins as usize,
            Shape::Spectrum(l) => 2 * l.bins as usize,
        }
    }

    /// Rate of the numbers that [`take`](Self::take) answers \[Hz\].
    pub fn rate_hz(&self, tick_hz: u32) -> u32 {
        match self.shape {
            Shape::Control { .. } => tick_hz,
            Shape::Audio { rate_hz } => rate_hz,
            Shape::Magnitude(l) | Shape::Spectrum(l) => l.rate_hz,
        }
    }

    /// The meaning of the values, to be said in a file. Their unit is `unit`.
    pub fn facts(&self, unit: &str, tick_hz: u32) -> Facts {
        let (array, frames) = match self.shape {
            Shape::Control { .. } => ("values", None),
            Shape::Audio { .. } => ("signal", None),
            Shape::Magnitude(layout) => ("magnitudes", Some(layout)),
            Shape::Spectrum(layout) => ("spectrum", Some(layout)),
        };
        Facts { array, rate_hz: self.rate_hz(tick_hz), frames, unit: unit.to_owned() }
    }

    /// Values of a tick that has run, and the number of the first. That is a tick for controls, and a sample
    /// of the signal for audio and frames. `None` in a tick without a frame.
    pub fn take(&self, engine: &Engine, tick: u64) -> Option<(u64, Vec<f32>)> {
        let buffer = engine.output(self.node, 0).or_else(|| engine.input(self.node, 0));
        Some(match (buffer?, self.shape) {
            (Buffer::Control { values, .. }, _) => (tick, values.iter().map(|x| *x as f32).collect()),
            (Buffer::Audio { samples, len, .. }, Shape::Audio { rate_hz }) => {
                (time::first_sample(tick, rate_hz, engine.schedule().tick_hz), samples[..*len].to_vec())
            }
            (Buffer::Magnitude { bins, frame: Some((_, start)), .. }, Shape::Magnitude(_)) => {
                (*start, bins.to_vec())
            }
            (Buffer::Spectrum { bins, frame: Some((_, start)), .. }, Shape::Spectrum(_)) => {
                (*start, bins.iter().flat_map(|z| [z.re, z.im]).collect())
            }
            _ => return None,
        })
    }
}

/// Meaning of recorded values. `rate_hz` is that of the samples, and of the ticks for a control.
#[derive(Clone, Debug)]
pub struct Facts {
    array: &'static str,
    rate_hz: u32,
    frames: Option<FrameLayout>,
    unit: String,
}

impl Facts {
    /// Writes a `.npz` archive of the rows of a `.npy` file: the array, `rate` and `unit`. Frames have also
    /// `hop` and `window_length` \[samples\], `window` and `scale`, as
    /// [`Frames::read`](crate::phase::Frames::read) takes them.
    ///
    /// # Errors
    /// Errors of the files.
    pub fn pack(&self, rows: &mut (impl Read + Seek), to: impl Write + Seek) -> io::Result<()> {
        let mut packer = Packer::new(to);
        packer.rows(self.array, self.array == "spectrum", rows)?;
        packer.number("rate", f64::from(self.rate_hz))?;
        packer.text("unit", &self.unit)?;
        if let Some(layout) = self.frames {
            packer.number("hop", f64::from(layout.rate_hz) / layout.frame_rate.hz())?;
            packer.number("window_length", f64::from(layout.length))?;
            packer.text("window", "hann")?;
            packer.text("scale", "amplitude")?;
        }
        packer.finish()?.flush()
    }
}
