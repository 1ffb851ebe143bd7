//! Files that the sinks of a run record, also of sinks that come and go while it plays.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use asperity_graph::{Schedule, ScheduledNode};
use asperity_live::GraphController;
use asperity_node::PortType;

use crate::commands::render::recorder::{Kept, Recorder, file_of};
use crate::failure::Failure;
use crate::output::{Named, Pending};

/// How often files and their headers are brought up to date: a killed run loses that much.
const REFRESH: Duration = Duration::from_secs(1);

#[derive(Clone, Debug, PartialEq)]
pub struct Sink {
    pub id: String,
    pub file: PathBuf,
    kind: String,
    port: Option<PortType>,
}

struct Recording {
    sink: Sink,
    /// Number of the first graph that it records.
    since: u64,
    recorder: Recorder,
}

/// All files that grow, in the order in which they were begun. All are kept until the end.
#[derive(Default)]
pub struct Recordings {
    all: Vec<Recording>,
    lost: u64,
    refreshed: Option<Instant>,
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

/// A recorder for each sink of a graph that does not continue a file of `begun`.
pub fn recorders(schedule: &Schedule, begun: &[Sink]) -> Result<Vec<(Sink, Recorder)>, Failure> {
    let mut new = Vec::new();
    for (i, node) in schedule.nodes.iter().enumerate() {
        let Some(sink) = Sink::of(node).filter(|sink| !goes_on(begun, sink)) else { continue };
        new.extend(Recorder::for_sink(schedule, i, Pending::recording)?.map(|recorder| (sink, recorder)));
    }
    Ok(new)
}

/// Files of `begun` that this graph does not continue.
pub fn left_behind(schedule: &Schedule, begun: &[Sink]) -> Vec<Named> {
    let sinks: Vec<Sink> = schedule.nodes.iter().filter_map(Sink::of).collect();
    let goes_on = |i: usize| {
        let newest = !begun[i + 1..].iter().any(|later| later.id == begun[i].id);
        newest && sinks.contains(&begun[i])
    };
    let left = begun.iter().enumerate().filter(|(i, _)| !goes_on(*i)).map(|(_, sink)| sink);
    left.map(|sink| (sink.file.clone(), format!("`{}` before this change", sink.id))).collect()
}

/// Whether a sink continues its newest recording.
fn goes_on(begun: &[Sink], sink: &Sink) -> bool {
    begun.iter().rev().find(|b| b.id == sink.id) == Some(sink)
}

impl Recordings {
    pub fn start(schedule: &Schedule) -> Result<Self, Failure> {
        let of = |(sink, recorder)| Recording { sink, since: 0, recorder };
        Ok(Self { all: recorders(schedule, &[])?.into_iter().map(of).collect(), ..Self::default() })
    }

    pub fn begun(&self) -> Vec<Sink> {
        self.all.iter().map(|r| r.sink.clone()).collect()
    }

    /// Adds recorders, from the graph of this number on.
    pub fn add(&mut self, since: u64, recorders: Vec<(Sink, Recorder)>) {
        let late = |(sink, recorder): (Sink, Recorder)| (sink, recorder.beginning_late());
        let all = recorders.into_iter().map(late);
        self.all.extend(all.map(|(sink, recorder)| Recording { sink, since, recorder }));
    }

    /// Writes the rows that sinks recorded since the last call. An error ends only its own file.
    pub fn drain(&mut self, graph_controller: &mut GraphController) {
        let tick_hz = graph_controller.schedule().tick_hz;
        let all = &mut self.all;
        let lost = graph_controller.recorded(|r| {
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

    /// Files that are no longer written, and why; each is answered once.
    pub fn complaints(&mut self) -> Vec<String> {
        self.all.iter_mut().filter_map(|r| r.recorder.complaint()).collect()
    }

    pub fn keep(self) -> Kept {
        let mut kept = Kept::default();
        self.all.into_iter().for_each(|recording| recording.recorder.end(&mut kept));
        if self.lost > 0 {
            kept.said.push(format!("{} ticks were not recorded: the disk was too slow", self.lost));
        }
        kept
    }
}
