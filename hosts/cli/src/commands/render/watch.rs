//! `--watch`: takes over changes of the graph's files between two ticks of a render.

use std::collections::BTreeMap;

use asperity_engine::{Controller, SwapError};
use asperity_graph::{Schedule, ScheduledNode};
use asperity_live::OutputLimits;
use asperity_node::Role;
use asperity_offline::render::{Swapped, channels};
use indicatif::ProgressBar;

use super::recorder::file_of;
use super::{Args, load_with_probes};
use crate::failure::{Failure, complain};
use crate::kinds::Kinds;
use crate::load::files::{Stamps, Watched, listed, readers, stamps};
use crate::load::{Loaded, OfScene};

/// Scene and guards of a graph that the engine takes over in the next tick.
pub struct Extras {
    pub scene: Option<OfScene>,
    pub output_limits: OutputLimits,
}

pub struct Watch<'a> {
    args: &'a Args,
    kinds: Kinds,
    controller: Controller,
    bar: &'a ProgressBar,
    files: Watched,
    /// Ids of the nodes that are channels of the file, in its order.
    outs: Vec<String>,
    /// Graphs that were sent, by their number.
    swaps: BTreeMap<u64, Swapped>,
}

impl<'a> Watch<'a> {
    pub fn new(args: &'a Args, kinds: Kinds, controller: Controller, bar: &'a ProgressBar) -> Self {
        let files = Watched::new(stamps(&args.graph, kinds.files(), controller.schedule()));
        let outs = outs_of(controller.schedule());
        Self { args, kinds, controller, bar, files, outs, swaps: BTreeMap::new() }
    }

    /// Looks at the files some times a second, and sends what changed to the engine.
    pub fn poll(&mut self) -> Option<Extras> {
        if !self.files.due() {
            return None;
        }
        self.collect();
        let now = self.stamps();
        let changed = if self.controller.ready() { self.files.changed(&now)? } else { return None };
        let what = listed(&changed);
        let sent = self.change(&readers(self.controller.schedule(), &changed));
        self.files.know(self.stamps(), &now);
        match sent {
            Ok((report, extras)) => {
                self.say(&format!("{what} changed: {report}\n"));
                Some(extras)
            }
            Err(failure) => {
                let text = failure.text();
                self.say(&format!(
                    "{what} changed, and cannot be taken over:\n{text}the running graph goes on\n"
                ));
                None
            }
        }
    }

    pub fn finish(mut self) -> Vec<Swapped> {
        self.collect();
        self.swaps.into_values().collect()
    }

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

    /// Compiles the graph and sends it to the engine. Answers what changed.
    fn change(&mut self, nodes: &[String]) -> Result<(String, Extras), Failure> {
        let Loaded { compiled, scene, .. } = load_with_probes(self.args, &mut self.kinds)?;
        same_sinks(self.controller.schedule(), &compiled.schedule).map_err(Failure::Machine)?;
        let place = |id: &String| compiled.schedule.index_of(id).unwrap_or(usize::MAX);
        let outs: Vec<usize> = self.outs.iter().map(place).collect();
        let output_limits = OutputLimits::new(&compiled, outs);
        let report = self.controller.swap(compiled, nodes).map_err(|e| {
            let start_anew = matches!(e, SwapError::TickRate { .. } | SwapError::AudioRate { .. });
            Failure::Machine(if start_anew { format!("the graph {e}") } else { e.to_string() })
        })?;
        let what = if report.is_nothing() { "nothing that is heard".into() } else { report.to_string() };
        if !report.is_nothing() {
            self.swaps.insert(report.number, Swapped { tick: None, what: what.clone() });
        }
        Ok((what, Extras { scene, output_limits }))
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
    channels(schedule).into_iter().map(|i| schedule.nodes[i].id.clone()).collect()
}

/// Refuses a change of the written files while the render runs.
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
