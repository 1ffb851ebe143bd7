//! Prepares a changed graph on a thread of its own: compiling takes tenths of a second, and opening a
//! device may take ten seconds.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use asperity_engine::SwapError;
use asperity_graph::{Compiled, GraphFile, Schedule, ScheduledNode};
use asperity_live::needs_queues;
use asperity_live::view::{Material, Materials};
use asperity_node::Role;
use asperity_page::Map;
use asperity_scene::Rendered;
use asperity_texture::{Library, LibraryMaterial};

use super::hands::{self, Held, Holding, Opened};
use super::recordings::{Sink, left_behind, recorders};
use crate::commands::render::recorder::Recorder;
use crate::failure::Failure;
use crate::kinds::Kinds;
use crate::load::files::distinct_files;
use crate::load::{self, GraphArgs, Loaded, OfScene};
use crate::output::{Named, OutputArgs, named};

/// A graph or scene as its file and the command line have it.
#[derive(Clone)]
pub struct Base {
    pub graph: GraphFile,
    /// The scene from above, where it was one.
    pub map: Option<Arc<Map>>,
    /// Ids of the nodes of `--probe`.
    pub probes: Vec<String>,
}

pub struct Made {
    pub base: Base,
    /// The same, with the changes of the user.
    pub graph: GraphFile,
    pub compiled: Compiled,
    pub materials: Vec<Materials>,
}

/// All that is needed to prepare a graph in place of the running one.
pub struct Order {
    pub args: GraphArgs,
    pub kinds: Arc<Mutex<Kinds>>,
    /// The graph to start from; `None` to read its file.
    pub base: Option<Base>,
    /// Live parameters that the user moved: `NODE.PARAM=VALUE`.
    pub moved: Vec<String>,
    /// Materials that the user chose: node and material.
    pub chosen: BTreeMap<String, String>,
    pub running: Arc<Schedule>,
    pub held: Vec<Holding>,
    /// Whether devices that could not be opened are tried again.
    pub again: bool,
    pub begun: Vec<Sink>,
    /// Files that the command line names.
    pub files: OutputArgs,
    pub record: Option<PathBuf>,
    pub over: Arc<AtomicBool>,
}

/// Files of the graph's plugins, if known, and the graph or why it cannot be prepared.
pub type Answer = (Option<Vec<PathBuf>>, Result<Ready, Failure>);

pub struct Ready {
    pub made: Made,
    pub opened: Opened,
    /// New recordings. Begun last, so that a graph that waits for a device leaves no file.
    pub recorders: Vec<(Sink, Recorder)>,
    /// Set if this is the old graph with its devices opened again: why the new one was refused.
    pub refused: Option<Failure>,
}

/// Compiles a graph with the changes of the user, from its file unless there is a `base`.
pub fn make(
    args: &GraphArgs,
    files: &OutputArgs,
    kinds: &mut Kinds,
    base: Option<Base>,
    moved: &[String],
    chosen: &BTreeMap<String, String>,
) -> Result<Made, Failure> {
    let (mut base, scene) = match base {
        Some(base) => (base, None),
        None => {
            let (mut graph, scene) = load::read(args, kinds)?;
            let probes = files.add_probes(&mut graph)?;
            (Base { graph, map: None, probes }, scene)
        }
    };
    let graph = changed(&base.graph, moved, chosen);
    let Loaded { graph, compiled, .. } = load::compile(args, kinds, graph, None)?;
    if let Some(OfScene { scene, mut rendered, .. }) = scene {
        for Rendered { texture, nodes, .. } in &mut rendered {
            // Called just while the effect acts: textures sleep behind gates, others by themselves.
            nodes.retain(|id| {
                let node = compiled.schedule.index_of(id).map(|i| &compiled.schedule.nodes[i]);
                node.is_some_and(|node| node.gate.is_none() && !(*texture && node.gate_sets.is_empty()))
            });
        }
        base.map = Some(Arc::new(Map::new(&scene, &rendered)));
    }
    let materials = materials(&compiled.schedule);
    Ok(Made { base, graph, compiled, materials })
}

/// A graph with the changes of the user. A parameter that the file no longer has is skipped.
pub fn changed(base: &GraphFile, moved: &[String], chosen: &BTreeMap<String, String>) -> GraphFile {
    let mut graph = base.clone();
    for setting in moved {
        let _ = graph.set(setting, "the page");
    }
    for (node, material) in chosen {
        let _ = graph.set(&format!("{node}.material={material:?}"), "the page");
    }
    graph
}

/// Files that the command line of a run names.
pub fn written(files: &OutputArgs, record: Option<&PathBuf>) -> Vec<Named> {
    let (report, out) = (files.report.as_ref(), files.out.as_ref());
    named(&[("--report", report), ("--out", out), ("--record", record)])
}

/// Locks the kinds. A thread that panicked has left them usable.
pub fn lock(kinds: &Mutex<Kinds>) -> MutexGuard<'_, Kinds> {
    kinds.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Works on a thread of its own. If none starts, or it panics, the receiver is disconnected.
pub fn on_thread(work: impl FnOnce() -> Answer + Send + 'static) -> Receiver<Answer> {
    let (to, from) = sync_channel(1);
    let _ = std::thread::Builder::new().name("asperity-make".into()).spawn(move || {
        let _ = to.send(work());
    });
    from
}

impl Order {
    /// Compiles the graph and opens the devices that it needs in addition.
    pub fn carry_out(self) -> Answer {
        let (plugins, made) = self.made();
        let result = made.and_then(|made| self.ready(made, &plugins));
        (Some(plugins), result)
    }

    fn made(&self) -> (Vec<PathBuf>, Result<Made, Failure>) {
        let mut kinds = lock(&self.kinds);
        if let Err(unwanted) = self.wanted() {
            return (kinds.files().to_vec(), Err(unwanted));
        }
        let made = make(&self.args, &self.files, &mut kinds, self.base.clone(), &self.moved, &self.chosen);
        (kinds.files().to_vec(), made)
    }

    fn ready(&self, made: Made, plugins: &[PathBuf]) -> Result<Ready, Failure> {
        let next = &made.compiled.schedule;
        fits(&self.running, next)?;
        let mut written = written(&self.files, self.record.as_ref());
        written.extend(left_behind(next, &self.begun));
        distinct_files(&self.args, next, plugins, written)?;
        self.wanted()?;
        // Files that cannot be written are refused before a device is opened.
        drop(recorders(next, &self.begun)?);
        let mut ids = needs_queues(&self.running, next);
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
        // Devices of abandoned graphs must be closed before these are opened.
        hands::wait(|| self.over.load(Relaxed));
        self.wanted()?;
        let opened = hands::open(schedule, ids, &self.held, &self.over)?;
        self.wanted()?;
        Ok(opened)
    }

    fn wanted(&self) -> Result<(), Failure> {
        let over = self.over.load(Relaxed);
        if over { Err(Failure::Machine("it is no longer wanted".into())) } else { Ok(()) }
    }

    /// Closes old devices and opens new ones; if that fails, the old ones, of which this is the order.
    pub fn exchange(self, mut ready: Ready, old: Vec<Held>) -> Answer {
        let ids: Vec<String> = old.iter().map(|held: &Held| held.node.id.clone()).collect();
        hands::wait(|| self.over.load(Relaxed));
        let opened = ready.opened.open_the_rest(old, &self.over).and_then(|()| {
            self.wanted()?;
            recorders(&ready.made.compiled.schedule, &self.begun)
        });
        let result = match opened {
            Ok(recorders) => Ok(Ready { recorders, ..ready }),
            Err(failure) => {
                drop(ready);
                let again = self.made().1.and_then(|made| {
                    let opened = self.opened(&made.compiled.schedule, &ids)?;
                    Ok((made, opened))
                });
                let (first, second) = (failure.reason(), again.as_ref().err().map(Failure::reason));
                let what = "the graph before it cannot be restored";
                let lost = format!("{first}\nand {what}: {}", second.unwrap_or_default());
                again
                    .map(|(made, opened)| Ready {
                        made,
                        opened,
                        recorders: Vec::new(),
                        refused: Some(failure),
                    })
                    .map_err(|_| Failure::Machine(lost))
            }
        };
        (None, result)
    }
}

/// Refuses a graph that cannot replace the running one while it plays.
pub fn fits(running: &Schedule, next: &Schedule) -> Result<(), Failure> {
    let (tick, audio) = (running.tick_hz, running.audio_hz);
    let refused = |e: SwapError| Err(Failure::Machine(format!("the graph {e}")));
    if tick != next.tick_hz {
        return refused(SwapError::TickRate { running: tick, asked: next.tick_hz });
    }
    if audio != next.audio_hz {
        return refused(SwapError::AudioRate { running: audio, asked: next.audio_hz });
    }
    // The channels of the device stay as it was opened.
    let of = |s: &Schedule, role| -> BTreeMap<String, Option<i64>> {
        s.with_role(role).map(|(_, n)| (n.id.clone(), n.params.get_integer("channel"))).collect()
    };
    let (outs, were) = (of(next, Role::AudioOutput), of(running, Role::AudioOutput));
    // One renamed node keeps its channel. With several, it is not known which is which.
    let gone = were.keys().filter(|id| !outs.contains_key(*id)).count();
    let kind = if outs.len() != were.len() || gone > 1 {
        "audio_out"
    } else if of(next, Role::AudioInput) != of(running, Role::AudioInput) {
        "audio_in"
    } else {
        return Ok(());
    };
    let what = format!("the channels of the device would change (`{kind}`): stop the run and start it again");
    Err(Failure::Machine(what))
}

/// The materials of each network's library; none where a scene's surfaces choose.
fn materials(schedule: &Schedule) -> Vec<Materials> {
    let told = |n: &ScheduledNode| n.inputs.iter().any(|i| i.name == "material" && i.from.is_some());
    let networks = schedule.with_role(Role::TextureNetwork).map(|(_, n)| n).filter(|n| !told(n));
    let of = |node: &ScheduledNode| {
        let library = Library::shared(node.params.file("library")).ok()?;
        let names = library.materials().iter().map(|m| m.name.clone()).collect();
        let shown = |m: &LibraryMaterial| Material {
            name: m.name.clone(),
            family: m.family.clone().unwrap_or_default(),
            description: m.description.clone(),
            picture: m.images.first().map(|image| library.beside(image)),
            picture_mm: m.image_mm,
        };
        let gallery = library.materials().iter().map(shown).collect();
        let chosen = node.params.text("material").to_owned();
        Some(Materials { node: node.id.clone(), chosen, names, gallery })
    };
    networks.filter_map(of).collect()
}
