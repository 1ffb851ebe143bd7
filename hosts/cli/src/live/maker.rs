//! Makes a changed graph ready to be taken over, on a thread of its own: compiling takes tenths of a second, and opening a device
//! may take ten.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use asperity_engine::SwapError;
use asperity_graph::{Compiled, GraphFile, Schedule, ScheduledNode};
use asperity_live::needs_ends;
use asperity_live::view::Materials;
use asperity_texture::Library;

use super::closing;
use super::hands::{self, Held, Holding, Opened};
use super::recordings::{Sink, left_behind, recorders};
use crate::args::GraphArgs;
use crate::failure::Failure;
use crate::kinds::Kinds;
use crate::load;
use crate::render::distinct_files;
use crate::render::record::Recorder;

/// What a person changed in a graph, beside its file.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Settings of live parameters: `NODE.PARAM=VALUE`.
    pub moved: Vec<String>,
    /// Textures: node and material.
    pub chosen: Vec<(String, String)>,
}

/// A graph that can be played.
pub struct Made {
    /// The file, with what the command line changed in it.
    pub base: GraphFile,
    /// The same with what a person changed in it.
    pub graph: GraphFile,
    /// What it compiles to.
    pub compiled: Compiled,
    /// Textures that may be chosen.
    pub materials: Vec<Materials>,
}

/// What it takes to make a graph ready in the place of a running one.
pub struct Order {
    /// The command line.
    pub args: GraphArgs,
    /// Where kinds come from.
    pub kinds: Arc<Mutex<Kinds>>,
    /// The graph to begin with; none to read its file.
    pub base: Option<GraphFile>,
    /// What is changed in it.
    pub changes: Changes,
    /// The graph that runs.
    pub running: Arc<Schedule>,
    /// Devices that are open.
    pub held: Vec<Holding>,
    /// Whether devices that could not be had are tried again.
    pub again: bool,
    /// Files that were begun.
    pub begun: Vec<Sink>,
    /// Files that the run writes at its end, by option.
    pub named: Vec<(String, Option<PathBuf>)>,
    /// Set when nobody wants it any more.
    pub over: Arc<AtomicBool>,
}

/// What came of it.
pub struct Answer {
    /// Files of the plugins that it was made with, or was to be; none where that is not known.
    pub plugins: Option<Vec<PathBuf>>,
    /// The graph, or why it cannot be had.
    pub result: Result<Ready, Failure>,
}

/// A graph that may take the place of the running one.
pub struct Ready {
    /// The graph.
    pub made: Made,
    /// What was opened for it.
    pub opened: Opened,
    /// What is recorded of it that was not before. Begun last, so that no file is left of what waits for a device.
    pub recorders: Vec<(Sink, Recorder)>,
    /// Why it is the graph of before, with its devices opened anew.
    pub refused: Option<Failure>,
}

/// A graph that has to wait for devices of the one before to be closed.
pub struct Exchange {
    /// It.
    pub ready: Ready,
    /// What is to be closed.
    pub old: Vec<Held>,
    /// The graph of before without them, for the case that they are to be opened again.
    pub back: Order,
}

/// Compiles a graph with what a person changed in it.
pub fn make(
    args: &GraphArgs,
    kinds: &mut Kinds,
    base: Option<GraphFile>,
    changes: &Changes,
) -> Result<Made, Failure> {
    let base = base.map_or_else(|| load::read(args, kinds), Ok)?;
    let mut graph = base.clone();
    for setting in &changes.moved {
        // What the file no longer has is no longer set.
        let _ = graph.set(setting, "the page");
    }
    for (node, material) in &changes.chosen {
        let _ = graph.set(&format!("{node}.material={material:?}"), "the page");
    }
    let registry = kinds.registry(Some(&graph))?;
    let compiled = load::compiled(&graph, args, &registry)?;
    let materials = materials(&compiled.schedule);
    Ok(Made { base, graph, compiled, materials })
}

/// Kinds are used by one thread at a time; one that panicked leaves them as they were.
pub fn lock(kinds: &Mutex<Kinds>) -> MutexGuard<'_, Kinds> {
    kinds.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does something on a thread of its own. Where there is none, or it panics, nobody ever answers.
pub fn elsewhere(work: impl FnOnce() -> Answer + Send + 'static) -> Receiver<Answer> {
    let (to, from) = sync_channel(1);
    let _ = std::thread::Builder::new().name("asperity-make".into()).spawn(move || {
        let _ = to.send(work());
    });
    from
}

impl Order {
    /// Makes the graph and opens what it needs beside what is open.
    pub fn carry_out(self) -> Answer {
        let (plugins, made) = self.made();
        let result = made.and_then(|made| self.ready(made, &plugins));
        Answer { plugins: Some(plugins), result }
    }

    fn made(&self) -> (Vec<PathBuf>, Result<Made, Failure>) {
        let mut kinds = lock(&self.kinds);
        if let Err(unwanted) = self.wanted() {
            return (kinds.files().to_vec(), Err(unwanted));
        }
        let made = make(&self.args, &mut kinds, self.base.clone(), &self.changes);
        (kinds.files().to_vec(), made)
    }

    fn ready(&self, made: Made, plugins: &[PathBuf]) -> Result<Ready, Failure> {
        let next = &made.compiled.schedule;
        fits(&self.running, next)?;
        let mut named = self.named.clone();
        named.extend(left_behind(next, &self.begun));
        let named: Vec<_> = named.iter().map(|(who, path)| (who.as_str(), path)).collect();
        distinct_files(&self.args, next, plugins, &named)?;
        self.wanted()?;
        // Files that cannot be written are refused before a device is touched.
        drop(recorders(next, &self.begun)?);
        let mut ids = needs_ends(&self.running, next);
        if self.again {
            ids.extend(hands::missing(next, &self.held));
        }
        let opened = self.opened(next, &ids)?;
        let recorders = if opened.in_the_way.is_empty() { recorders(next, &self.begun)? } else { Vec::new() };
        Ok(Ready { made, opened, recorders, refused: None })
    }

    fn opened(&self, schedule: &Schedule, ids: &[String]) -> Result<Opened, Failure> {
        if ids.is_empty() {
            return Ok(Opened::default());
        }
        // What is no longer wanted must have let go of its devices before another asks for them.
        closing::wait(&self.over);
        self.wanted()?;
        let opened = hands::open(schedule, ids, &self.held, &self.over)?;
        self.wanted()?;
        Ok(opened)
    }

    /// Whether somebody still wants it.
    fn wanted(&self) -> Result<(), Failure> {
        let over = self.over.load(Relaxed);
        if over { Err(Failure::Machine("it is no longer wanted".into())) } else { Ok(()) }
    }
}

impl Exchange {
    /// Closes what is in the way and opens what waited for that; where that fails, opens again what was closed.
    pub fn carry_out(self) -> Answer {
        let Self { mut ready, old, back } = self;
        let ids: Vec<String> = old.iter().map(|held: &Held| held.node.id.clone()).collect();
        closing::wait(&back.over);
        let opened = ready.opened.open_the_rest(old, &back.over).and_then(|()| {
            back.wanted()?;
            recorders(&ready.made.compiled.schedule, &back.begun)
        });
        let failure = match opened {
            Ok(recorders) => {
                ready.recorders = recorders;
                return Answer { plugins: None, result: Ok(ready) };
            }
            Err(failure) => failure,
        };
        drop(ready);
        let (_, made) = back.made();
        let again = made.and_then(|made| {
            let opened = back.opened(&made.compiled.schedule, &ids)?;
            Ok(Ready { made, opened, recorders: Vec::new(), refused: None })
        });
        let result = match again {
            Ok(again) => Ok(Ready { refused: Some(failure), ..again }),
            Err(second) => Err(Failure::Machine(format!(
                "{}\nand what it was to replace cannot be had again: {}",
                failure.reason(),
                second.reason()
            ))),
        };
        Answer { plugins: None, result }
    }
}

/// Whether a graph can take the place of another while it plays.
fn fits(running: &Schedule, next: &Schedule) -> Result<(), Failure> {
    let (tick, audio) = (running.tick_hz, running.audio_hz);
    let rates = if tick != next.tick_hz {
        Err(SwapError::TickRate { running: tick, asked: next.tick_hz })
    } else if audio != next.audio_hz {
        Err(SwapError::AudioRate { running: audio, asked: next.audio_hz })
    } else {
        Ok(())
    };
    rates.map_err(|e| Failure::Machine(format!("the graph {e}")))?;
    same_channels(running, next).map_err(Failure::Machine)
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

/// The textures that each network of a graph may be given: those of its library. Where a scene's surfaces say tick by tick which it is, there is nothing to choose.
fn materials(schedule: &Schedule) -> Vec<Materials> {
    let told = |n: &ScheduledNode| n.inputs.iter().any(|i| i.name == "material" && i.from.is_some());
    let networks = schedule.nodes.iter().filter(|n| n.kind == "texture_network" && !told(n));
    let of = |node: &ScheduledNode| {
        let library = Library::shared(node.params.file("library")).ok()?;
        let names = library.materials().iter().map(|m| m.name.clone()).collect();
        Some(Materials { node: node.id.clone(), chosen: node.params.text("material").to_owned(), names })
    };
    networks.filter_map(of).collect()
}
