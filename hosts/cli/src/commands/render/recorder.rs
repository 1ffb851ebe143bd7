//! Files that grow while a graph runs: a recorder for each sink, and the file of `--out`.

use std::path::{Path, PathBuf};

use asperity_diagnostics::Diagnostic;
use asperity_engine::Engine;
use asperity_graph::{Schedule, ScheduledNode};
use asperity_live::OutputLimits;
use asperity_node::{Buffer, ParamValue, Role, Shape, time};

use crate::failure::{Failure, wrong};
use crate::output::{self, Format, Pending, Rows, ending, salvage};

/// Writes a sink's buffer after each tick.
pub struct Recorder {
    rows: Rows,
    from: From,
    columns: usize,
    shape: Shape,
    scratch: Vec<f32>,
    /// Number of the next row; `None` before the first one of a sink that begins late.
    next: Option<u64>,
    /// Rows of ticks that were left out.
    missing: u64,
    rows_written: u64,
    /// Most samples that the file holds.
    most: u64,
    /// Why the recording stopped, and whether that was said.
    stopped: Option<(String, bool)>,
}

/// A recording that ended.
#[derive(Debug)]
pub struct Kept {
    /// Its file, if anything was kept.
    pub path: Option<PathBuf>,
    /// Messages for the user.
    pub said: Vec<String>,
    /// Why the file is not complete.
    pub cut: Option<String>,
}

/// Opens a recording's file: [`Pending::create`], or [`Pending::recording`] for a run that may be killed.
pub type Open = fn(&Path) -> Result<Pending, Failure>;

/// Most samples of a mono WAV file of 32-bit floats, with room for its head.
const MOST_WAV: u64 = (1 << 30) - 1024;

/// The file that a sink writes, if it names one.
pub fn file_of(node: &ScheduledNode) -> Option<&Path> {
    match node.params.get("file") {
        Some(ParamValue::Text(file)) if node.sink && !file.is_empty() => Some(Path::new(file)),
        _ => None,
    }
}

/// Whether a sink may have its file written.
fn permit(node: &ScheduledNode, file: &Path) -> Result<(), Diagnostic> {
    match node.params.place("file") {
        // The user named it.
        Some(place) if place.source.path().to_string_lossy().starts_with("--set ") => Ok(()),
        place => output::permit(file).map_err(|d| {
            let d = match d.help.clone() {
                Some(help) => d.help(help.replace("NODE", &node.id)),
                None => d,
            };
            place.into_iter().fold(d, |d, place| d.at(&place.source, place.span))
        }),
    }
}

/// The files that sinks write, each with the node's id.
pub fn files(schedule: &Schedule) -> impl Iterator<Item = (PathBuf, String)> {
    schedule.nodes.iter().filter_map(|n| Some((file_of(n)?.to_owned(), n.id.clone())))
}

#[derive(Clone, Copy, Debug)]
enum From {
    Input(usize),
    Output(usize),
}

impl Recorder {
    /// Recorders for every `probe` and `file_out` that names a file.
    pub fn for_sinks(schedule: &Schedule) -> Result<Vec<Self>, Failure> {
        let nodes = schedule.nodes.iter().enumerate();
        nodes.filter_map(|(i, node)| Self::for_sink(i, node, Pending::create).transpose()).collect()
    }

    /// A recorder for a node, by its index; `None` for a node that writes no file.
    pub fn for_sink(i: usize, node: &ScheduledNode, open: Open) -> Result<Option<Self>, Failure> {
        let Some(file) = file_of(node) else { return Ok(None) };
        permit(node, file)?;
        match node.role {
            Some(Role::Probe) => {
                let Some(port) = &node.inputs[0].port else { return Ok(None) };
                Self::new(file, open, From::Input(i), port.shape, &port.unit.to_string()).map(Some)
            }
            Some(Role::Recorder) => {
                Self::new(file, open, From::Output(i), node.outputs[0].port.shape, "value").map(Some)
            }
            _ => Ok(None),
        }
    }

    /// For a sink that is added to a running graph: no row before its first one is missing.
    pub fn beginning_late(self) -> Self {
        Self { next: None, ..self }
    }

    fn new(path: &Path, open: Open, from: From, shape: Shape, unit: &str) -> Result<Self, Failure> {
        let (columns, names): (usize, Vec<String>) = match shape {
            Shape::Control { count: 1 } | Shape::Audio { .. } => (1, vec![unit.to_owned()]),
            Shape::Control { count } => (count, (0..count).map(|i| format!("{i} [{unit}]")).collect()),
            Shape::Magnitude(l) => {
                let hz = |k: u32| format!("{} Hz [{unit}]", f64::from(k) * l.bin_hz());
                (l.bins as usize, (0..l.bins).map(hz).collect())
            }
            Shape::Spectrum(l) => {
                let part =
                    |k: u32| ["re", "im"].map(|p| format!("{p} {} Hz [{unit}]", f64::from(k) * l.bin_hz()));
                (2 * l.bins as usize, (0..l.bins).flat_map(part).collect())
            }
        };
        let rows = match (ending(path).as_str(), shape) {
            ("npy", _) => Rows::npy(open(path)?, (columns > 1).then_some(columns))?,
            ("csv", _) => Rows::csv(open(path)?, &names)?,
            ("wav", Shape::Audio { rate_hz }) => Rows::wav(open(path)?, 1, rate_hz, Format::F32)?,
            _ => return Err(unknown_format(path, "a .csv or .npy file; .wav for audio").into()),
        };
        let most = if ending(path) == "wav" { MOST_WAV } else { u64::MAX };
        Ok(Self {
            rows,
            from,
            columns,
            shape,
            scratch: Vec::new(),
            next: Some(0),
            missing: 0,
            rows_written: 0,
            most,
            stopped: None,
        })
    }

    /// Records the tick that has just run.
    pub fn take(&mut self, engine: &Engine, tick: u64) -> Result<(), Failure> {
        let buffer = match self.from {
            From::Input(node) => engine.input(node, 0),
            From::Output(node) => engine.output(node, 0),
        };
        let tick_hz = engine.schedule().tick_hz;
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.clear();
        let start = match (buffer, self.shape) {
            (Some(Buffer::Control { values, .. }), _) => {
                scratch.extend(values.iter().map(|x| *x as f32));
                Some(tick)
            }
            (Some(Buffer::Audio { samples, len, .. }), Shape::Audio { rate_hz }) => {
                scratch.extend_from_slice(&samples[..*len]);
                Some(time::first_sample(tick, rate_hz, tick_hz))
            }
            (Some(Buffer::Magnitude { bins, frame: Some((_, start)), .. }), Shape::Magnitude(_)) => {
                scratch.extend_from_slice(bins);
                Some(*start)
            }
            (Some(Buffer::Spectrum { bins, frame: Some((_, start)), .. }), Shape::Spectrum(_)) => {
                scratch.extend(bins.iter().flat_map(|z| [z.re, z.im]));
                Some(*start)
            }
            _ => None,
        };
        let done = start.map_or(Ok(()), |start| self.append(start, &scratch, tick_hz));
        self.scratch = scratch;
        done
    }

    /// Writes values that begin at `start`: a tick for controls, a sample at the signal's rate for audio
    /// and frames.
    pub fn append(&mut self, start: u64, values: &[f32], tick_hz: u32) -> Result<(), Failure> {
        let rate_hz = match self.shape {
            Shape::Control { .. } => tick_hz,
            Shape::Audio { rate_hz } => rate_hz,
            Shape::Magnitude(l) | Shape::Spectrum(l) => l.rate_hz,
        };
        let even = matches!(self.shape, Shape::Control { .. } | Shape::Audio { .. });
        // A row of a CSV file has its time. In other files, rows that were left out are counted.
        if even && ending(self.rows.path()) != "csv" {
            self.missing += start.saturating_sub(self.next.unwrap_or(start));
        }
        let rows = (values.len() / self.columns.max(1)) as u64;
        self.next = Some(start + rows);
        if self.rows_written + rows > self.most {
            let path = self.rows.path().display();
            return Err(Failure::Machine(format!(
                "{path} is full: a WAV file holds 4 GiB, a .npy file more"
            )));
        }
        self.rows.append(values, self.columns, |i| (start + i as u64) as f64 / f64::from(rate_hz))?;
        self.rows_written += rows;
        Ok(())
    }

    /// Like [`append`](Self::append), but an error ends only the recording of this file.
    pub fn append_while_possible(&mut self, start: u64, values: &[f32], tick_hz: u32) {
        if self.stopped.is_some() {
            return;
        }
        if let Err(failure) = self.append(start, values, tick_hz) {
            self.stop(&failure);
        }
    }

    /// Brings the file up to date, so that it is complete if the run is killed.
    pub fn refresh(&mut self) {
        if self.stopped.is_none()
            && self.rows_written > 0
            && let Err(failure) = self.rows.refresh()
        {
            self.stop(&failure);
        }
    }

    /// Stops recording.
    fn stop(&mut self, failure: &Failure) {
        let said = format!("{}; no more of it is recorded, and all else goes on", failure.reason());
        self.stopped = Some((said, false));
    }

    /// Why the recording stopped; answered once.
    pub fn complaint(&mut self) -> Option<String> {
        let (said, told) = self.stopped.as_mut()?;
        (!std::mem::replace(told, true)).then(|| said.clone())
    }

    /// Completes the file with the rows that reached the disk, whatever happened.
    pub fn end(mut self) -> Kept {
        let path = self.rows.path().to_owned();
        let name = path.display().to_string();
        let mut said: Vec<String> = self.complaint().into_iter().collect();
        let mut cut = self.stopped.as_ref().map(|_| format!("{name} is not whole"));
        if self.missing > 0 {
            let missing = self.missing;
            said.push(format!(
                "{name}: {missing} rows of ticks that were left out are missing; a .csv has times"
            ));
        }
        let pending = self.rows.abandon();
        let whole = pending
            .file()
            .and_then(|mut file| salvage(&mut file, &ending(&path)).map_err(|e| Failure::writing(&path, e)));
        match whole.and_then(|rows| pending.keep().map(|_| rows)) {
            Ok(Some(rows)) if rows < self.rows_written => {
                cut =
                    Some(format!("{name} is not whole: the disk took {rows} of {} rows", self.rows_written));
            }
            Ok(_) => {}
            Err(failure) => {
                let cut = Some(format!("{}: nothing of it is kept", failure.reason()));
                return Kept { path: None, said, cut };
            }
        }
        Kept { path: Some(path), said, cut }
    }

    /// Continues with the same node in a new graph.
    pub fn follow(&mut self, moved: impl Fn(usize) -> usize) {
        match &mut self.from {
            From::Input(node) | From::Output(node) => *node = moved(*node),
        }
    }

    /// Completes the file.
    pub fn finish(self) -> Result<Pending, Failure> {
        self.rows.finish()
    }
}

/// The file that `--out` names: every `audio_out` of the graph is a channel.
pub struct Master {
    rows: Rows,
    nodes: Vec<usize>,
    scratch: Vec<f32>,
}

impl Master {
    /// Opens the file.
    pub fn new(path: &Path, schedule: &Schedule, format: Format) -> Result<Self, Failure> {
        let nodes = Self::channels(schedule);
        if nodes.is_empty() {
            return Err(wrong(
                path,
                "the graph has no `audio_out`, so there is nothing to write there",
                "leave --out out, or add an `audio_out`",
            ));
        }
        let rows = match ending(path).as_str() {
            "wav" => Rows::wav(Pending::create(path)?, nodes.len(), schedule.audio_hz, format)?,
            "npy" => Rows::npy(Pending::create(path)?, (nodes.len() > 1).then_some(nodes.len()))?,
            _ => return Err(unknown_format(path, "a .wav or .npy file").into()),
        };
        Ok(Self { rows, nodes, scratch: Vec::new() })
    }

    /// Indices of the nodes that are its channels.
    pub fn channels(schedule: &Schedule) -> Vec<usize> {
        schedule.with_role(Role::AudioOutput).map(|(i, _)| i).collect()
    }

    /// Continues with the same nodes in a new graph.
    pub fn follow(&mut self, moved: impl Fn(usize) -> usize) {
        self.nodes.iter_mut().for_each(|node| *node = moved(*node));
    }

    /// Records the tick that has just run, held to its limits.
    pub fn take(&mut self, engine: &Engine, output_limits: Option<&mut OutputLimits>) -> Result<(), Failure> {
        let channels = self.nodes.len();
        self.scratch.clear();
        for (c, &node) in self.nodes.iter().enumerate() {
            if let Some(Buffer::Audio { samples, len, .. }) = engine.output(node, 0) {
                self.scratch.resize(len * channels, 0.0);
                for (i, x) in samples[..*len].iter().enumerate() {
                    self.scratch[i * channels + c] = *x;
                }
            }
        }
        if let Some(output_limits) = output_limits {
            output_limits.hold(&mut self.scratch, channels);
        }
        self.rows.append(&self.scratch, channels, |_| 0.0)
    }

    /// Completes the file.
    pub fn finish(self) -> Result<Pending, Failure> {
        self.rows.finish()
    }
}

fn unknown_format(path: &Path, wanted: &str) -> Diagnostic {
    Diagnostic::new("cannot tell the format from this name").in_file(path).help(wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorder(path: &Path, most: u64) -> Recorder {
        let shape = Shape::Audio { rate_hz: 48_000 };
        Recorder {
            most,
            ..Recorder::new(path, Pending::create, From::Output(0), shape, "value").expect("a file")
        }
    }

    #[test]
    fn full_wav_file_is_said_once_and_stays_valid() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("x.wav");
        let mut it = recorder(&path, 250);
        let mut said = Vec::new();
        for n in 0..10 {
            it.append_while_possible(n * 100, &[0.25; 100], 500);
            said.extend(it.complaint());
        }
        assert!(said.len() == 1 && said[0].contains("4 GiB") && said[0].contains("goes on"), "{said:?}");
        let Kept { path: kept, said, cut } = it.end();
        assert!(kept.as_deref() == Some(&*path) && said.is_empty(), "{said:?}");
        assert!(cut.is_some_and(|cut| cut.contains("x.wav is not whole")));
        let samples: Vec<f32> =
            hound::WavReader::open(&path).expect("a WAV file").samples().map(|s| s.expect("one")).collect();
        assert_eq!(samples, [0.25; 200]);
    }

    #[test]
    fn recording_on_failed_disk_ends_after_last_whole_row() {
        for name in ["x.wav", "x.npy", "x.csv"] {
            let dir = tempfile::tempdir().expect("a folder");
            let path = dir.path().join(name);
            let mut it = recorder(&path, u64::MAX);
            it.append_while_possible(0, &[0.5; 5000], 500);
            // The last 1001 bytes did not fit on the disk.
            let pending = it.rows.abandon();
            let mut file = pending.file().expect("a handle");
            file.set_len(file.metadata().expect("a size").len() - 1001).expect("it is cut");
            salvage(&mut file, &ending(&path)).expect("a header");
            pending.keep().expect("a name");
            match name {
                "x.wav" => assert_eq!(hound::WavReader::open(&path).expect("a WAV file").len(), 5000 - 251),
                "x.npy" => {
                    let array = asperity_accuracy::npy::read(&path).expect("an array");
                    assert_eq!(array.shape, [5000 - 251]);
                }
                _ => {
                    let text = std::fs::read_to_string(&path).expect("a text");
                    assert!(text.ends_with(",0.5\n") && text.lines().count() > 4000);
                }
            }
        }
    }
}
