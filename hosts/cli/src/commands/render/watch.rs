//! `--watch`: a thread that compiles what changed and hands it to the running engine.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use asperity_engine::{Controller, SwapError};
use asperity_graph::{Schedule, ScheduledNode};
use asperity_live::OutputLimits;
use asperity_node::Role;
use indicatif::ProgressBar;

use super::recorder::{Master, file_of};
use super::report::Swapped;
use super::{Args, load_with_probes};
use crate::failure::{Failure, complain};
use crate::kinds::Kinds;
use crate::load::files::{POLL, Stamps, Watched, listed, readers, stamps};
use crate::load::{Loaded, OfScene};

/// Scene and guards of a graph.
#[derive(Default)]
pub struct Extras {
    /// The scene that the plot shows.
    pub scene: Option<OfScene>,
    /// Guards of the file's channels.
    pub output_limits: OutputLimits,
}

/// Scenes and guards of the graphs that were sent to the engine, in their order.
#[derive(Clone, Default)]
pub struct Sent(Arc<Mutex<VecDeque<Extras>>>);

impl Sent {
    fn lock(&self) -> MutexGuard<'_, VecDeque<Extras>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Those of the graph that the engine takes over next.
    pub fn take(&self) -> Option<Extras> {
        self.lock().pop_front()
    }
}

/// The thread that watches.
pub struct Watch {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Vec<Swapped>>,
}

impl Watch {
    /// Begins to watch.
    pub fn start(args: &Args, kinds: Kinds, controller: Controller, sent: Sent, bar: &ProgressBar) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let files = Watched::new(stamps(&args.graph, kinds.files(), controller.schedule()));
        let outs = outs_of(controller.schedule());
        let (args, bar, swaps) = (args.clone(), bar.clone(), BTreeMap::new());
        let watcher = Watcher { args, kinds, controller, sent, bar, files, outs, swaps };
        let flag = stop.clone();
        Self { stop, thread: std::thread::spawn(move || watcher.run(&flag)) }
    }

    /// Stops watching. Answers the changes that were sent.
    pub fn finish(self) -> Vec<Swapped> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.thread().unpark();
        self.thread.join().unwrap_or_default()
    }
}

struct Watcher {
    args: Args,
    kinds: Kinds,
    controller: Controller,
    sent: Sent,
    bar: ProgressBar,
    files: Watched,
    /// Ids of the nodes that are channels of the file, in its order.
    outs: Vec<String>,
    /// Graphs that were sent, by their number.
    swaps: BTreeMap<u64, Swapped>,
}

impl Watcher {
    /// Watches until it is told to stop.
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
        self.swaps.into_values().collect()
    }

    /// Versions of the files that the graph is made of.
    fn stamps(&self) -> Stamps {
        stamps(&self.args.graph, self.kinds.files(), self.controller.schedule())
    }

    /// Drops graphs that the engine gave back, and notes when it took over.
    fn collect(&mut self) {
        for done in self.controller.collect() {
            if let Some(swapped) = self.swaps.get_mut(&done.number) {
                swapped.tick = Some(done.tick);
            }
            for id in done.anew {
                self.say(&format!("`{id}` could not go on from its state, and began anew\n"));
            }
        }
    }

    fn take_over(&mut self, changed: &[PathBuf], now: &Stamps) {
        let nodes = readers(self.controller.schedule(), changed);
        let what = listed(changed);
        match self.change(&nodes) {
            Ok(report) => self.say(&format!("{what} changed: {report}\n")),
            Err(failure) => {
                let text = failure.text();
                self.say(&format!(
                    "{what} changed, and cannot be taken over:\n{text}the running graph goes on\n"
                ));
            }
        }
        self.files.know(self.stamps(), now);
    }

    /// Compiles the graph and sends it to the engine. Answers what changed.
    fn change(&mut self, nodes: &[String]) -> Result<String, Failure> {
        let Loaded { compiled, scene, .. } = load_with_probes(&self.args, &mut self.kinds)?;
        same_sinks(self.controller.schedule(), &compiled.schedule).map_err(Failure::Machine)?;
        // The engine may take it over before `swap` returns.
        let place = |id: &String| compiled.schedule.index_of(id).unwrap_or(usize::MAX);
        let outs: Vec<usize> = self.outs.iter().map(place).collect();
        let output_limits = OutputLimits::new(&compiled, outs);
        self.sent.lock().push_back(Extras { scene, output_limits });
        let swapped = self.controller.swap(compiled, nodes);
        if swapped.is_err() {
            self.sent.lock().pop_back();
        }
        let report = swapped.map_err(|e| {
            let start_anew = matches!(e, SwapError::TickRate { .. } | SwapError::AudioRate { .. });
            Failure::Machine(if start_anew { format!("the graph {e}") } else { e.to_string() })
        })?;
        if report.is_nothing() {
            return Ok("nothing that is heard".into());
        }
        let what = report.to_string();
        self.swaps.insert(report.number, Swapped { tick: None, what: what.clone() });
        Ok(what)
    }

    /// Prints a message above the progress bar.
    fn say(&self, text: &str) {
        if !self.args.quiet {
            self.bar.suspend(|| complain(text));
        }
    }
}

/// Ids of the nodes that are channels of the file.
fn outs_of(schedule: &Schedule) -> Vec<String> {
    Master::channels(schedule).into_iter().map(|i| schedule.nodes[i].id.clone()).collect()
}

/// Refuses a change of what the render writes while it runs.
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
    node.role == Some(Role::AudioOutput) || file_of(node).is_some()
}

fn shape(node: &ScheduledNode) -> String {
    let ports = node.inputs.iter().map(|i| &i.port).map(|p| format!("{p:?}"));
    format!("{} {:?} {}", node.kind, file_of(node), ports.collect::<Vec<_>>().join(" "))
}
