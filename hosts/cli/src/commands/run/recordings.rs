//! Files that a run records: those of its sinks, also of sinks that come and go while it plays, and those of
//! `--out` and `--record`.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use asperity_graph::{Schedule, ScheduledNode};
use asperity_live::{GraphController, Player, StylusReader, TapeReader};
use asperity_node::{PortType, Role};

use super::Args;
use crate::commands::render::recorder::{Kept, Recorder, file_of};
use crate::failure::{Failure, wrong};
use crate::output::{Named, Pending, is_standard};

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
    /// Files of `--out` and `--record`, each with its queue from the ticks.
    played: Option<(Recorder, Option<TapeReader>)>,
    stylus: Option<(Recorder, Option<StylusReader>)>,
    /// Ticks that the queues of sinks lost.
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
    /// Opens all files, before the run.
    pub fn open(args: &Args, schedule: &Schedule) -> Result<Self, Failure> {
        let of = |(sink, recorder)| Recording { sink, since: 0, recorder };
        if let Some(path) = args.files.out.as_deref().filter(|path| is_standard(path)) {
            return Err(wrong(path, "a run writes its samples to a file", "name one: --out played.wav"));
        }
        let moves = |role| schedule.with_role(role).next().is_some();
        if let Some(path) = args.record.as_deref().filter(|_| !moves(Role::Hand) && !moves(Role::Stroke)) {
            let help = "leave --record out, or add a hand, a trajectory or a stroke";
            return Err(wrong(path, "the graph has no stylus, so there is nothing to write there", help));
        }
        let out = args.files.out.as_deref();
        let played = out.map(|path| Recorder::of_played(path, schedule, args.files.format)).transpose()?;
        let stylus = args.record.as_deref().map(Recorder::of_stylus).transpose()?;
        Ok(Self {
            all: recorders(schedule, &[])?.into_iter().map(of).collect(),
            played: played.map(|recorder| (recorder, None)),
            stylus: stylus.map(|recorder| (recorder, None)),
            ..Self::default()
        })
    }

    /// Begins to listen to a player, before it plays.
    pub fn listen(&mut self, player: &mut Player) {
        if let Some((_, reader)) = &mut self.played {
            *reader = Some(player.record_played());
        }
        if let Some((_, reader)) = &mut self.stylus {
            *reader = Some(player.record_stylus());
        }
    }

    fn recorders(&mut self) -> impl Iterator<Item = &mut Recorder> {
        let all = self.all.iter_mut().map(|recording| &mut recording.recorder);
        let played = self.played.iter_mut().map(|(recorder, _)| recorder);
        all.chain(played).chain(self.stylus.iter_mut().map(|(recorder, _)| recorder))
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

    /// Writes the rows that were recorded since the last call. An error ends only its own file.
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
        if let Some((recorder, Some(reader))) = &mut self.played {
            let mut values = Vec::new();
            while let Some(start) = reader.next(&mut values) {
                recorder.append_while_possible(start, &values, tick_hz);
            }
        }
        if let Some((recorder, Some(reader))) = &mut self.stylus {
            while let Some(row) = reader.take() {
                recorder.append_stylus(&row, tick_hz);
            }
        }
        if self.refreshed.is_none_or(|at| at.elapsed() >= REFRESH) {
            self.refreshed = Some(Instant::now());
            self.recorders().for_each(Recorder::refresh);
        }
    }

    /// Files that are no longer written, and why; each is answered once.
    pub fn complaints(&mut self) -> Vec<String> {
        self.recorders().filter_map(Recorder::complaint).collect()
    }

    pub fn keep(self) -> Kept {
        let mut kept = Kept::default();
        let mut lost = self.lost;
        self.all.into_iter().for_each(|recording| recording.recorder.end(&mut kept));
        if let Some((recorder, reader)) = self.played {
            lost = lost.max(reader.map_or(0, |reader| reader.lost()));
            recorder.end(&mut kept);
        }
        if let Some((recorder, reader)) = self.stylus {
            lost = lost.max(reader.map_or(0, |reader| reader.lost()));
            recorder.end(&mut kept);
        }
        if lost > 0 {
            kept.said.push(format!("{lost} ticks were not recorded: the disk was too slow"));
        }
        kept
    }
}
