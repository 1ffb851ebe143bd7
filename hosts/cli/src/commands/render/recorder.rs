//! Files that grow while a graph runs: a recorder for each sink, and the file of `--out`.

use std::path::{Path, PathBuf};

use asperity_diagnostics::Diagnostic;
use asperity_engine::Engine;
use asperity_graph::{Schedule, ScheduledNode};
use asperity_live::{OutputLimits, StylusRow};
use asperity_node::{ParamValue, Role, Shape};
use asperity_offline::probe::Probe;
use asperity_offline::render::{channels, interleaved};

use crate::failure::{Failure, wrong};
use crate::output::{self, Format, PROBE, Pending, Rows, audio_ending, ending, salvage};

pub struct Recorder {
    rows: Rows,
    probe: Probe,
    /// Signals of that probe side by side: channels of a sound card.
    channels: usize,
    /// Number of the next row; `None` before the first one of a sink that begins late.
    next: Option<u64>,
    /// Rows of ticks that were left out.
    missing: u64,
    rows_written: u64,
    /// Most samples that the file holds.
    most: u64,
    stopped: bool,
    /// Why it stopped, until that is said.
    complaint: Option<String>,
}

#[derive(Debug, Default)]
pub struct Kept {
    /// Their files, where anything was kept.
    pub written: Vec<PathBuf>,
    pub said: Vec<String>,
    /// Files that are not complete, and why.
    pub cut: Vec<String>,
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
        Some(place) if is_named(place.source.path()) => Ok(()),
        place => output::permit(file, &node.id)
            .map_err(|d| place.into_iter().fold(d, |d, place| d.at(&place.source, place.span))),
    }
}

/// Whether a place is an option of the command line.
fn is_named(place: &Path) -> bool {
    place == Path::new(PROBE) || place.to_string_lossy().starts_with("--set ")
}

/// The files that sinks write, each with the node's id.
pub fn files(schedule: &Schedule) -> impl Iterator<Item = (PathBuf, String)> {
    schedule.nodes.iter().filter_map(|n| Some((file_of(n)?.to_owned(), n.id.clone())))
}

impl Recorder {
    /// Recorders for every `probe` and `file_out` that names a file.
    pub fn for_sinks(schedule: &Schedule) -> Result<Vec<Self>, Failure> {
        let nodes = 0..schedule.nodes.len();
        nodes.filter_map(|i| Self::for_sink(schedule, i, Pending::create).transpose()).collect()
    }

    /// A recorder for a node, by its index; `None` for a node that writes no file.
    pub fn for_sink(schedule: &Schedule, i: usize, open: Open) -> Result<Option<Self>, Failure> {
        let node = &schedule.nodes[i];
        let new = |file, shape, unit: &str| {
            Self::new(file, open, Probe { node: i, shape }, unit, schedule.tick_hz).map(Some)
        };
        let Some(file) = file_of(node) else { return Ok(None) };
        permit(node, file)?;
        match (node.role, node.inputs.first().and_then(|input| input.port.as_ref())) {
            (Some(Role::Probe), Some(port)) => new(file, port.shape, &port.unit.to_string()),
            (Some(Role::Recorder), _) => new(file, node.outputs[0].port.shape, "value"),
            _ => Ok(None),
        }
    }

    /// For a sink that is added to a running graph: no row before its first one is missing.
    pub fn beginning_late(self) -> Self {
        Self { next: None, ..self }
    }

    /// For the samples of all channels of a run: `--out`.
    pub fn of_played(path: &Path, schedule: &Schedule, format: Format) -> Result<Self, Failure> {
        let channels = channels(schedule).len();
        let rows = file_of_channels(path, Pending::recording, schedule, format)?;
        let shape = Shape::Audio { rate_hz: schedule.audio_hz };
        Ok(Self { channels, most: most_rows(path) / channels as u64, ..Self::of(rows, 0, shape) })
    }

    /// For the motion of the stylus: `--record`. `--input` reads the file back.
    pub fn of_stylus(path: &Path) -> Result<Self, Failure> {
        if ending(path) != "csv" {
            return Err(unknown_format(path, "a .csv file").into());
        }
        let names = ["x_mm", "y_mm", "z_mm", "force_n", "stroke"].map(str::to_owned);
        let rows = Rows::csv(Pending::recording(path)?, &names)?;
        Ok(Self::of(rows, 0, Shape::Control { count: names.len() }))
    }

    fn of(rows: Rows, node: usize, shape: Shape) -> Self {
        let most = most_rows(rows.path());
        let (next, stopped, complaint) = (Some(0), false, None);
        let probe = Probe { node, shape };
        Self { rows, probe, channels: 1, next, missing: 0, rows_written: 0, most, stopped, complaint }
    }

    fn new(path: &Path, open: Open, probe: Probe, unit: &str, tick_hz: u32) -> Result<Self, Failure> {
        let Probe { node, shape } = probe;
        let columns = probe.columns();
        let names: Vec<String> = match shape {
            Shape::Control { count: 1 } | Shape::Audio { .. } => vec![unit.to_owned()],
            Shape::Control { count } => (0..count).map(|i| format!("{i} [{unit}]")).collect(),
            Shape::Magnitude(l) => {
                (0..l.bins).map(|k| format!("{} Hz [{unit}]", f64::from(k) * l.bin_hz())).collect()
            }
            Shape::Spectrum(l) => {
                let part =
                    |k: u32| ["re", "im"].map(|p| format!("{p} {} Hz [{unit}]", f64::from(k) * l.bin_hz()));
                (0..l.bins).flat_map(part).collect()
            }
        };
        let rows = match (ending(path).as_str(), shape) {
            ("npy", _) => Rows::npy(open(path)?, (columns > 1).then_some(columns))?,
            ("npz", _) => {
                Rows::npz(open(path)?, (columns > 1).then_some(columns), probe.facts(unit, tick_hz))?
            }
            ("csv", _) => Rows::csv(open(path)?, &names)?,
            ("wav", Shape::Audio { rate_hz }) => Rows::wav(open(path)?, 1, rate_hz, Format::F32)?,
            _ => return Err(unknown_format(path, "a .csv, .npy or .npz file; .wav for audio").into()),
        };
        Ok(Self::of(rows, node, shape))
    }

    pub fn take(&mut self, engine: &Engine, tick: u64) -> Result<(), Failure> {
        let Some((start, values)) = self.probe.take(engine, tick) else { return Ok(()) };
        self.append(start, &values, engine.schedule().tick_hz)
    }

    /// Writes values from `start` on: a tick for controls, a sample of the signal for audio and frames.
    pub fn append(&mut self, start: u64, values: &[f32], tick_hz: u32) -> Result<(), Failure> {
        let (rate_hz, columns) = (self.probe.rate_hz(tick_hz), self.probe.columns() * self.channels);
        let even = matches!(self.probe.shape, Shape::Control { .. } | Shape::Audio { .. });
        // A row of a CSV file has its time. In other files, rows that were left out are counted.
        if even && ending(self.rows.path()) != "csv" {
            self.missing += start.saturating_sub(self.next.unwrap_or(start));
        }
        let rows = (values.len() / columns.max(1)) as u64;
        self.next = Some(start + rows);
        if self.rows_written + rows > self.most {
            let full =
                format!("{} is full: a WAV file holds 4 GiB, a .npy file more", self.rows.path().display());
            return Err(Failure::Machine(full));
        }
        self.rows.append(values, columns, |i| (start + i as u64) as f64 / f64::from(rate_hz))?;
        self.rows_written += rows;
        Ok(())
    }

    /// Like [`append`](Self::append), but an error ends only the recording of this file.
    pub fn append_while_possible(&mut self, start: u64, values: &[f32], tick_hz: u32) {
        if !self.stopped {
            let done = self.append(start, values, tick_hz);
            self.stop_unless(done);
        }
    }

    /// Writes a row of the stylus. An error ends only the recording of this file.
    pub fn append_stylus(&mut self, row: &StylusRow, tick_hz: u32) {
        if !self.stopped {
            let [x, y, z] = row.position;
            let time = row.tick as f64 / f64::from(tick_hz);
            let done = self.rows.line(time, &[x, y, z, row.force, row.stroke]);
            self.rows_written += 1;
            self.stop_unless(done);
        }
    }

    /// Brings the file up to date, so that it is complete if the run is killed.
    pub fn refresh(&mut self) {
        if !self.stopped && self.rows_written > 0 {
            let done = self.rows.refresh();
            self.stop_unless(done);
        }
    }

    fn stop_unless(&mut self, done: Result<(), Failure>) {
        if let Err(failure) = done {
            let said = format!("{}; no more of it is recorded, and all else goes on", failure.reason());
            (self.stopped, self.complaint) = (true, Some(said));
        }
    }

    /// Why the recording stopped; answered once.
    pub fn complaint(&mut self) -> Option<String> {
        self.complaint.take()
    }

    /// Completes the file with the rows that reached the disk, whatever happened.
    pub fn end(mut self, kept: &mut Kept) {
        let path = self.rows.path().to_owned();
        let name = path.display();
        kept.said.extend(self.complaint());
        if self.missing > 0 {
            kept.said.push(format!(
                "{name}: {} rows of ticks that were left out are missing; a .csv has times",
                self.missing
            ));
        }
        let pending = self.rows.abandon();
        let whole = pending
            .file()
            .and_then(|mut file| salvage(&mut file, &ending(&path)).map_err(|e| Failure::writing(&path, e)));
        match whole.and_then(|rows| pending.keep().map(|_| rows)) {
            Err(failure) => return kept.cut.push(format!("{}: nothing of it is kept", failure.reason())),
            Ok(Some(rows)) if rows < self.rows_written => {
                let of = self.rows_written;
                kept.cut.push(format!("{name} is not whole: the disk took {rows} of {of} rows"));
            }
            Ok(_) if self.stopped => kept.cut.push(format!("{name} is not whole")),
            Ok(_) => {}
        }
        kept.written.push(path);
    }

    pub fn follow(&mut self, moved: impl Fn(usize) -> usize) {
        self.probe.node = moved(self.probe.node);
    }

    pub fn finish(self) -> Result<Pending, Failure> {
        self.rows.finish()
    }
}

/// The file that `--out` names: every `audio_out` of the graph is a channel.
pub struct Master {
    rows: Rows,
    pub nodes: Vec<usize>,
}

impl Master {
    pub fn new(path: &Path, schedule: &Schedule, format: Format) -> Result<Self, Failure> {
        let rows = file_of_channels(path, Pending::create, schedule, format)?;
        Ok(Self { rows, nodes: channels(schedule) })
    }

    /// Records the tick that has just run, limited like the output.
    pub fn take(&mut self, engine: &Engine, output_limits: Option<&mut OutputLimits>) -> Result<(), Failure> {
        let channels = self.nodes.len();
        let mut rows = interleaved(engine, &self.nodes);
        if let Some(output_limits) = output_limits {
            output_limits.hold(&mut rows, channels);
        }
        self.rows.append(&rows, channels, |_| 0.0)
    }

    pub fn finish(self) -> Result<Pending, Failure> {
        self.rows.finish()
    }
}

/// A file in which every `audio_out` of a graph is a channel.
fn file_of_channels(path: &Path, open: Open, schedule: &Schedule, format: Format) -> Result<Rows, Failure> {
    let channels = channels(schedule).len();
    if channels == 0 {
        return Err(wrong(
            path,
            "the graph has no `audio_out`, so there is nothing to write there",
            "leave --out out, or add an `audio_out`",
        ));
    }
    match audio_ending(path).as_str() {
        "wav" => Rows::wav(open(path)?, channels, schedule.audio_hz, format),
        "npy" => Rows::npy(open(path)?, (channels > 1).then_some(channels)),
        _ => Err(unknown_format(path, "a .wav or .npy file").into()),
    }
}

/// Most rows of one sample that a file holds.
fn most_rows(path: &Path) -> u64 {
    if ending(path) == "wav" { MOST_WAV } else { u64::MAX }
}

fn unknown_format(path: &Path, wanted: &str) -> Diagnostic {
    Diagnostic::new("cannot tell the format from this name").in_file(path).help(wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorder(path: &Path, most: u64) -> Recorder {
        let shape = Shape::Audio { rate_hz: 48_000 };
        let probe = Probe { node: 0, shape };
        Recorder { most, ..Recorder::new(path, Pending::create, probe, "value", 500).expect("a file") }
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
        let mut kept = Kept::default();
        it.end(&mut kept);
        assert!(kept.written == [path.clone()] && kept.said.is_empty(), "{kept:?}");
        assert!(kept.cut[0].contains("x.wav is not whole"));
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
