//! A graph that changes while it is played: its files, and what a person chooses.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use asperity_engine::SwapError;
use asperity_graph::{Compiled, GraphFile, Schedule};
use asperity_live::Conductor;
use asperity_live::view::Materials;
use asperity_node::ParamKind;
use asperity_world::material::Library;

use super::hands::{Hands, Opened};
use crate::args::GraphArgs;
use crate::failure::Failure;
use crate::kinds::Kinds;
use crate::load;
use crate::watch::{Files, POLL, Stamps, named, readers, stamps};

/// Makes the graph anew when something changes, and sends it to where it is played.
pub struct Editor {
    args: GraphArgs,
    kinds: Kinds,
    /// The files, where they are watched, and when they were last looked at.
    files: Option<(Files, Instant)>,
    /// Textures that a person chose: node and material. They stay while files change.
    chosen: Vec<(String, String)>,
    /// Live parameters that a person moved, as settings of the graph. The next change of a file sets them back.
    moved: Vec<(String, String)>,
}

/// A graph that is ready to be played.
pub struct Made {
    /// The file, with what the command line and a person changed in it.
    pub graph: GraphFile,
    /// What it compiles to.
    pub compiled: Compiled,
    /// Textures that may be chosen.
    pub materials: Vec<Materials>,
}

impl Editor {
    /// An editor of the graph that the command line names.
    pub fn new(args: &GraphArgs) -> Self {
        let kinds = Kinds::new(&args.plugins.plugin);
        Self { args: args.clone(), kinds, files: None, chosen: Vec::new(), moved: Vec::new() }
    }

    /// The kinds of nodes that the graph may use.
    pub fn kinds(&self) -> &Kinds {
        &self.kinds
    }

    /// Reads and compiles the graph.
    pub fn make(&mut self) -> Result<Made, Failure> {
        let mut graph = load::read(&self.args)?;
        for (target, value) in &self.moved {
            // What the file no longer has is no longer set.
            let _ = graph.set(&format!("{target}={value}"), "the page");
        }
        for (node, material) in &self.chosen {
            let _ = graph.set(&format!("{node}.material={material:?}"), "the page");
        }
        let registry = self.kinds.registry(Some(&graph))?;
        let compiled = load::compiled(&graph, &self.args, &registry)?;
        let materials = materials(&compiled.schedule);
        Ok(Made { graph, compiled, materials })
    }

    /// Begins to watch the files that the graph is made of.
    pub fn watch(&mut self, schedule: &Schedule) {
        self.files = Some((Files::new(stamps(&self.args, &self.kinds, schedule)), Instant::now()));
    }

    /// Takes changed files over. Answers what a person should know.
    pub fn look(&mut self, conductor: &mut Conductor, hands: &mut Hands) -> Option<String> {
        let due = self.files.as_ref().is_some_and(|(_, at)| at.elapsed() >= POLL);
        if !due || !conductor.ready() {
            return None;
        }
        let now = stamps(&self.args, &self.kinds, conductor.schedule());
        let (files, at) = self.files.as_mut()?;
        *at = Instant::now();
        let changed = files.changed(&now)?;
        self.moved.clear();
        let said = self.take_over(&changed, conductor, hands);
        self.know(conductor.schedule(), &now);
        said
    }

    fn know(&mut self, schedule: &Schedule, seen: &Stamps) {
        let after = stamps(&self.args, &self.kinds, schedule);
        if let Some((files, _)) = &mut self.files {
            files.know(after, seen);
        }
    }

    fn take_over(
        &mut self,
        changed: &[PathBuf],
        conductor: &mut Conductor,
        hands: &mut Hands,
    ) -> Option<String> {
        let nodes = readers(conductor.schedule(), changed);
        let what = named(changed);
        Some(match self.send(&nodes, conductor, hands) {
            Ok(report) => format!("{what} changed: {report}"),
            Err(failure) => {
                format!(
                    "{what} changed, and cannot be taken over:\n{}the running graph goes on",
                    failure.text()
                )
            }
        })
    }

    /// Makes the graph and sends it. Answers what that changes.
    fn send(
        &mut self,
        nodes: &[String],
        conductor: &mut Conductor,
        hands: &mut Hands,
    ) -> Result<String, Failure> {
        let Made { graph, compiled, materials } = self.make()?;
        let schedule = conductor.schedule();
        same_channels(schedule, &compiled.schedule).map_err(Failure::Machine)?;
        let rates = |s: &Schedule| (s.tick_hz, s.audio_hz);
        if rates(schedule) == rates(&compiled.schedule) && !conductor.ready() {
            return Err(Failure::Machine("earlier changes are still under way: try again".into()));
        }
        let new_ends = conductor.needs_ends(&compiled.schedule);
        let schedule = compiled.schedule.clone();
        let mut opened = if rates(&schedule) == rates(conductor.schedule()) {
            hands.open(&schedule, &new_ends)?
        } else {
            Opened::default()
        };
        let ends = std::mem::take(&mut opened.ends);
        let report = conductor.swap(compiled, &graph, nodes, ends, materials).map_err(|e| {
            let anew = matches!(e, SwapError::TickRate { .. } | SwapError::AudioRate { .. });
            Failure::Machine(if anew { format!("the graph {e}") } else { e.to_string() })
        })?;
        hands.go_on_with(opened, &schedule)?;
        Ok(if report.is_nothing() { "nothing that is heard".into() } else { report.to_string() })
    }

    /// Gives a texture node another material.
    pub fn choose(
        &mut self,
        node: &str,
        material: &str,
        conductor: &mut Conductor,
        hands: &mut Hands,
    ) -> Result<(), Failure> {
        let before = self.chosen.clone();
        self.chosen.retain(|(n, _)| n != node);
        self.chosen.push((node.to_owned(), material.to_owned()));
        let sent = self.send(&[], conductor, hands);
        if sent.is_err() {
            self.chosen = before;
        }
        sent.map(drop)
    }

    /// Sets a live parameter, and keeps it set when the graph is made anew for another material.
    pub fn set(
        &mut self,
        node: &str,
        param: &str,
        value: f64,
        conductor: &mut Conductor,
    ) -> Result<(), Failure> {
        conductor.set_parameter(node, param, value).map_err(|e| Failure::Machine(e.to_string()))?;
        let schedule = conductor.schedule();
        let live =
            schedule.index_of(node).and_then(|i| schedule.nodes[i].live.iter().find(|l| l.name == param));
        let Some(live) = live else { return Ok(()) };
        let text = match &live.kind {
            ParamKind::Flag => (value != 0.0).to_string(),
            ParamKind::Choice(words) => {
                words.get(value as usize).map(|w| format!("{w:?}")).unwrap_or_default()
            }
            ParamKind::Integer(_) => (value as i64).to_string(),
            _ => format!("{value:?}"),
        };
        let target = format!("{node}.{param}");
        self.moved.retain(|(t, _)| *t != target);
        self.moved.push((target, text));
        Ok(())
    }
}

/// A device has the channels it was opened with.
fn same_channels(old: &Schedule, new: &Schedule) -> Result<(), String> {
    let of = |s: &Schedule, kind: &str| -> BTreeMap<String, Option<i64>> {
        let nodes = s.nodes.iter().filter(|n| n.kind == kind);
        nodes.map(|n| (n.id.clone(), n.params.get_integer("channel"))).collect()
    };
    let (outs, were) = (of(new, "audio_out"), of(old, "audio_out"));
    // One that goes by another name goes on where it was; of several nobody could say which is which.
    let gone = were.keys().filter(|id| !outs.contains_key(*id)).count();
    let kind = if outs.len() != were.len() || gone > 1 {
        "audio_out"
    } else if of(new, "audio_in") != of(old, "audio_in") {
        "audio_in"
    } else {
        return Ok(());
    };
    Err(format!("the channels of the device would change (`{kind}`): stop the run and start it again"))
}

/// The textures that each network of a graph may be given: those of its library.
fn materials(schedule: &Schedule) -> Vec<Materials> {
    let networks = schedule.nodes.iter().filter(|n| n.kind == "texture_network");
    let of = |node: &asperity_graph::ScheduledNode| {
        let library = Library::read(node.params.file("library")).ok()?;
        let names = library.materials().iter().map(|m| m.name.clone()).collect();
        Some(Materials { node: node.id.clone(), chosen: node.params.text("material").to_owned(), names })
    };
    networks.filter_map(of).collect()
}
