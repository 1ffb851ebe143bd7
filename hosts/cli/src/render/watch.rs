//! `--watch`: a thread that compiles what changed and hands it to the running engine.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use asperity_engine::{Controller, SwapError};
use asperity_graph::{Schedule, ScheduledNode};
use asperity_live::Outlet;
use indicatif::ProgressBar;

use super::report::Swapped;
use super::{compiled, record};
use crate::args::Render;
use crate::failure::{Failure, complain};
use crate::kinds::Kinds;
use crate::load::OfScene;
use crate::watch::{Files, POLL, Stamps, named, readers, stamps};

/// Scene and guards of a graph.
#[derive(Default)]
pub struct Beside {
    /// The picture is to show what is heard.
    pub scene: Option<OfScene>,
    /// Guards of its channels.
    pub outlet: Outlet,
}

/// Scenes and guards of the graphs that were sent, in their order.
#[derive(Clone, Default)]
pub struct Sent(Arc<Mutex<VecDeque<Beside>>>);

impl Sent {
    /// That of the next graph, which is taken over.
    pub fn take(&self) -> Option<Beside> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop_front()
    }

    fn put(&self, beside: Beside) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push_back(beside);
    }

    /// The newest is not to be taken over.
    fn drop_last(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop_back();
    }
}

/// The thread that watches.
pub struct Watch {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Vec<Swapped>>,
}

impl Watch {
    /// Begins to watch.
    pub fn start(
        args: &Render,
        kinds: Kinds,
        controller: Controller,
        beside: Sent,
        bar: &ProgressBar,
    ) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let files = Files::new(stamps(&args.graph, kinds.files(), controller.schedule()));
        let outs = outs_of(controller.schedule());
        let (args, bar, sent) = (args.clone(), bar.clone(), BTreeMap::new());
        let watcher = Watcher { args, kinds, controller, beside, bar, files, outs, sent };
        let flag = stop.clone();
        Self { stop, thread: std::thread::spawn(move || watcher.run(&flag)) }
    }

    /// Ends, and answers what was taken over.
    pub fn finish(self) -> Vec<Swapped> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.thread().unpark();
        self.thread.join().unwrap_or_default()
    }
}

struct Watcher {
    args: Render,
    kinds: Kinds,
    controller: Controller,
    beside: Sent,
    bar: ProgressBar,
    files: Files,
    /// The nodes that are channels of the file, in its order.
    outs: Vec<String>,
    sent: BTreeMap<u64, Swapped>,
}

impl Watcher {
    /// Looks until it is told to stop.
    fn run(mut self, stop: &AtomicBool) -> Vec<Swapped> {
        while !stop.load(Ordering::Relaxed) {
            std::thread::park_timeout(POLL);
            self.collect();
            let now = self.stamps();
            if self.controller.ready()
                && let Some(changed) = self.files.changed(&now)
            {
                self.take_over(&changed, &now);
            }
        }
        self.collect();
        self.sent.into_values().collect()
    }

    /// Every file that the graph is made of, as it is now.
    fn stamps(&self) -> Stamps {
        stamps(&self.args.graph, self.kinds.files(), self.controller.schedule())
    }

    /// Drops what the engine gave back, and takes down when it took over.
    fn collect(&mut self) {
        for done in self.controller.collect() {
            if let Some(swapped) = self.sent.get_mut(&done.number) {
                swapped.tick = Some(done.tick);
            }
            for id in done.anew {
                self.say(&format!("`{id}` could not go on from its state, and began anew\n"));
            }
        }
    }

    fn take_over(&mut self, changed: &[PathBuf], now: &Stamps) {
        let nodes = readers(self.controller.schedule(), changed);
        let what = named(changed);
        match self.change(&nodes) {
            Ok(Some(report)) => self.say(&format!("{what} changed: {report}\n")),
            Ok(None) => {}
            Err(failure) => {
                let text = failure.text();
                self.say(&format!(
                    "{what} changed, and cannot be taken over:\n{text}the running graph goes on\n"
                ));
            }
        }
        self.files.know(self.stamps(), now);
    }

    /// Compiles the graph anew and sends it. `None` where it is what is running.
    fn change(&mut self, nodes: &[String]) -> Result<Option<String>, Failure> {
        let (compiled, scene) = compiled(&self.args, &mut self.kinds)?;
        same_sinks(self.controller.schedule(), &compiled.schedule).map_err(Failure::Machine)?;
        // It may be taken over before `swap` returns.
        let outlet = Outlet::new(&compiled, outs(&compiled.schedule, &self.outs));
        self.beside.put(Beside { scene, outlet });
        let swapped = self.controller.swap(compiled, nodes);
        if swapped.is_err() {
            self.beside.drop_last();
        }
        let report = swapped.map_err(|e| {
            let start_anew = matches!(e, SwapError::TickRate { .. } | SwapError::AudioRate { .. });
            Failure::Machine(if start_anew { format!("the graph {e}") } else { e.to_string() })
        })?;
        if report.is_nothing() {
            return Ok(Some("nothing that is heard".into()));
        }
        let what = report.to_string();
        self.sent.insert(report.number, Swapped { tick: None, what: what.clone() });
        Ok(Some(what))
    }

    /// Says something beside the progress bar.
    fn say(&self, text: &str) {
        if !self.args.quiet {
            self.bar.suspend(|| complain(text));
        }
    }
}

/// The nodes that are channels of the file.
fn outs_of(schedule: &Schedule) -> Vec<String> {
    schedule.nodes.iter().filter(|n| n.kind == "audio_out").map(|n| n.id.clone()).collect()
}

/// Their places in another graph.
fn outs(schedule: &Schedule, ids: &[String]) -> Vec<usize> {
    ids.iter().map(|id| schedule.index_of(id).unwrap_or(usize::MAX)).collect()
}

/// A render's files cannot change while it writes them: what is recorded must stay.
fn same_sinks(old: &Schedule, new: &Schedule) -> Result<(), String> {
    let recorded = |s: &Schedule| -> Vec<(String, String)> {
        s.nodes.iter().filter(|n| is_recorded(n)).map(|n| (n.id.clone(), shape(n))).collect()
    };
    let (mut before, mut after) = (recorded(old), recorded(new));
    // Channels of one file keep their order; other files are each for themselves.
    before.sort();
    after.sort();
    if before == after && outs_of(old).len() == outs_of(new).len() {
        return Ok(());
    }
    let other = before.iter().find(|b| !after.contains(b)).or(after.iter().find(|a| !before.contains(a)));
    let id = other.map_or("", |(id, _)| id.as_str());
    Err(format!("what this render writes would change: `{id}`. Stop it and start again"))
}

fn is_recorded(node: &ScheduledNode) -> bool {
    node.kind == "audio_out" || record::file_of(node).is_some()
}

fn shape(node: &ScheduledNode) -> String {
    let ports = node.inputs.iter().map(|i| &i.port).map(|p| format!("{p:?}"));
    format!("{} {:?} {}", node.kind, record::file_of(node), ports.collect::<Vec<_>>().join(" "))
}
