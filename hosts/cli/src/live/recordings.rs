//! What the sinks of a run record, also those that come and go while it plays.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use asperity_graph::{Schedule, ScheduledNode};
use asperity_live::Conductor;
use asperity_node::PortType;

use crate::failure::Failure;
use crate::output::Pending;
use crate::render::record::{Kept, Recorder, file_of};

/// How often files and their headers are brought up to date: so much is lost where the run is killed.
const REFRESH: Duration = Duration::from_secs(1);

/// A sink that wants a file written.
#[derive(Clone, Debug, PartialEq)]
pub struct Sink {
    /// Its node.
    pub id: String,
    /// Its file.
    pub file: PathBuf,
    kind: String,
    port: Option<PortType>,
}

/// One file in the making.
struct Recording {
    sink: Sink,
    /// Number of the first graph that it is of.
    since: u64,
    recorder: Recorder,
}

/// All files in the making, in the order in which they were begun. None is given up before the end.
#[derive(Default)]
pub struct Recordings {
    all: Vec<Recording>,
    /// Ticks that were not recorded.
    lost: u64,
    /// When files were last brought up to date.
    refreshed: Option<Instant>,
}

/// What became of all recordings.
#[derive(Default)]
pub struct AllKept {
    /// Where they are.
    pub written: Vec<PathBuf>,
    /// What a person should know of them.
    pub said: Vec<String>,
    /// Which do not hold all that was recorded, and why.
    pub cut: Vec<String>,
}

impl Sink {
    fn of(node: &ScheduledNode) -> Option<Self> {
        let file = file_of(node)?.to_owned();
        let port = match node.outputs.first() {
            Some(output) => Some(output.port.clone()),
            None => node.inputs.first()?.port.clone(),
        };
        Some(Self { id: node.id.clone(), file, kind: node.kind.clone(), port })
    }
}

/// A recorder for every sink of a graph that does not go on with what was begun: it is not among these, or was another one since.
pub fn recorders(schedule: &Schedule, begun: &[Sink]) -> Result<Vec<(Sink, Recorder)>, Failure> {
    let mut new = Vec::new();
    for (i, node) in schedule.nodes.iter().enumerate() {
        let Some(sink) = Sink::of(node).filter(|sink| !goes_on(begun, sink)) else { continue };
        new.extend(
            Recorder::for_sink(i, node, Pending::recording)?
                .map(|recorder| (sink, recorder.beginning_late())),
        );
    }
    Ok(new)
}

/// Files that were begun and that this graph does not go on with, as [`distinct_files`](crate::render::distinct_files) wants them.
pub fn left_behind(schedule: &Schedule, begun: &[Sink]) -> Vec<(String, Option<PathBuf>)> {
    let sinks: Vec<Sink> = schedule.nodes.iter().filter_map(Sink::of).collect();
    let goes_on = |i: usize| {
        let newest = !begun[i + 1..].iter().any(|later| later.id == begun[i].id);
        newest && sinks.contains(&begun[i])
    };
    let left = begun.iter().enumerate().filter(|(i, _)| !goes_on(*i)).map(|(_, sink)| sink);
    left.map(|sink| (format!("`{}` before this change", sink.id), Some(sink.file.clone()))).collect()
}

/// Whether a sink's newest recording is as it wants it.
fn goes_on(begun: &[Sink], sink: &Sink) -> bool {
    begun.iter().rev().find(|b| b.id == sink.id) == Some(sink)
}

impl Recordings {
    /// Begins the files of a graph that is not playing yet.
    pub fn start(schedule: &Schedule) -> Result<Self, Failure> {
        let mut it = Self::default();
        for (i, node) in schedule.nodes.iter().enumerate() {
            if let (Some(sink), Some(recorder)) =
                (Sink::of(node), Recorder::for_sink(i, node, Pending::recording)?)
            {
                it.all.push(Recording { sink, since: 0, recorder });
            }
        }
        Ok(it)
    }

    /// Files that were begun so far.
    pub fn begun(&self) -> Vec<Sink> {
        self.all.iter().map(|r| r.sink.clone()).collect()
    }

    /// Records these too, from the graph of this number on.
    pub fn add(&mut self, since: u64, recorders: Vec<(Sink, Recorder)>) {
        self.all.extend(recorders.into_iter().map(|(sink, recorder)| Recording { sink, since, recorder }));
    }

    /// Writes down what sinks recorded since the last time. A file that cannot be written ends alone.
    pub fn drain(&mut self, conductor: &mut Conductor) {
        let tick_hz = conductor.schedule().tick_hz;
        let all = &mut self.all;
        let lost = conductor.recorded(|r| {
            let of = all.iter_mut().rev().find(|x| x.sink.id == r.sink && x.since <= r.graph);
            if let Some(of) = of {
                of.recorder.append_while_possible(r.start, r.values, tick_hz);
            }
        });
        self.lost = self.lost.max(lost);
        if self.refreshed.is_none_or(|at| at.elapsed() >= REFRESH) {
            self.refreshed = Some(Instant::now());
            self.all.iter_mut().for_each(|recording| recording.recorder.refresh());
        }
    }

    /// Which files are no longer written, and why; each once.
    pub fn complaints(&mut self) -> Vec<String> {
        self.all.iter_mut().filter_map(|r| r.recorder.complaint()).collect()
    }

    /// Completes the files.
    pub fn keep(self) -> AllKept {
        let mut all = AllKept::default();
        for Recording { recorder, .. } in self.all {
            let Kept { path, said, cut } = recorder.end();
            all.said.extend(said);
            all.written.extend(path);
            all.cut.extend(cut);
        }
        if self.lost > 0 {
            all.said.push(format!("{} ticks were not recorded: the disk was too slow", self.lost));
        }
        all
    }
}
