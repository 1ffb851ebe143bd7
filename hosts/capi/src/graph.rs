//! Graphs: read, set, and made ready to run.

use std::cell::RefCell;
use std::ffi::c_char;
use std::path::PathBuf;
use std::sync::{Arc, Once};

use asperity_diagnostics::Source;
use asperity_graph::{Compiled, GraphFile, Schedule};
use asperity_hand::{HOST_INPUT, host_input};
use asperity_node::{Role, time};
use asperity_offline::failure::{Failure, wrong};
use asperity_offline::host::{self, Host};
use asperity_offline::kinds::Kinds;
use asperity_offline::load::{self, Loaded, Request, stylus};
use asperity_offline::probe::{self, Probe};
use asperity_offline::render::channels;
use asperity_offline::shipped;
use parking_lot::Mutex;

use crate::handles::{IN_USE, Table};
use crate::status::{Answer, AsperityStatus, Refusal, call, given, place, text};

/// A graph or scene with its settings. One thread at a time.
#[derive(Debug)]
pub struct AsperityGraph {
    _private: [u8; 0],
}

/// The stylus goes on as the graph says: by its own stroke, or that of `asperity_graph_stroke`.
pub const ASPERITY_STROKE: u32 = 0;
/// The caller moves the stylus.
pub const ASPERITY_HAND: u32 = 1;

/// Figures of a graph.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AsperityGraphInfo {
    /// Ticks a second, 100 to 4000.
    pub tick_hz: u32,
    /// Samples a second of each channel.
    pub audio_hz: u32,
    /// Channels of the output, at least 1. A graph without an output is silent on one.
    pub channels: u32,
    /// Most frames (samples of each channel) of a tick.
    pub tick_frames: u32,
    /// Duration of the stroke in ticks; 0 if nothing has a duration.
    pub stroke_ticks: u64,
    /// Number from which all random numbers follow.
    pub seed: u64,
    /// 1 if a stylus moves in the graph, else 0.
    pub has_stylus: u32,
    /// 1 if a node pushes back, so that there are forces to read, else 0.
    pub has_force: u32,
}

pub(crate) static GRAPHS: Table<Mutex<Graph>> = Table::new(1);

/// A graph as its user wants it.
#[derive(Clone)]
pub(crate) struct Graph {
    request: Request,
    /// The graph itself, if it is no file.
    text: Option<Arc<Source>>,
    probes: Vec<String>,
    info: AsperityGraphInfo,
    warnings: String,
}

/// A graph that is ready to run, its probes, and the warnings about it.
pub(crate) struct Ready {
    pub(crate) graph: GraphFile,
    pub(crate) compiled: Compiled,
    pub(crate) probes: Vec<(String, Probe)>,
    warnings: String,
}

thread_local! {
    /// Warnings about the graph that this thread reads.
    static WARNINGS: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// All kinds that a graph of this library may use.
pub(crate) fn kinds() -> Kinds {
    static HOST: Once = Once::new();
    let warn = |message: &str| WARNINGS.with_borrow_mut(|all| all.push(message.to_owned()));
    HOST.call_once(|| {
        #[cfg(feature = "tract")]
        asperity_texture::run_graphs_by(asperity_tract::compile);
        host::set(Host { warn, ask: |_, _| false, survives: |_, _| Ok(()) });
    });
    Kinds::new(&[]).with(vec![Arc::new(host_input())])
}

/// Who moves the stylus.
pub(crate) fn by_hand(stylus: u32) -> Answer<bool> {
    match stylus {
        ASPERITY_STROKE => Ok(false),
        ASPERITY_HAND => Ok(true),
        _ => Err(Refusal::invalid("`stylus` is neither ASPERITY_STROKE nor ASPERITY_HAND")),
    }
}

impl Graph {
    fn new(request: Request, text: Option<Arc<Source>>) -> Answer<Self> {
        let (probes, info, warnings) = Default::default();
        Self { request, text, probes, info, warnings }.checked()
    }

    /// Reads and compiles it once, so that its errors come now.
    fn checked(mut self) -> Answer<Self> {
        let Ready { compiled, warnings, .. } = self.ready(&mut kinds(), false)?;
        let schedule = &compiled.schedule;
        let is = |role| u32::from(schedule.with_role(role).next().is_some());
        self.info = AsperityGraphInfo {
            tick_hz: schedule.tick_hz,
            audio_hz: schedule.audio_hz,
            channels: channels(schedule).len().max(1) as u32,
            tick_frames: time::max_samples(schedule.audio_hz, schedule.tick_hz) as u32,
            stroke_ticks: schedule.duration_ticks().unwrap_or(0),
            seed: schedule.seed,
            has_stylus: is(Role::Hand) | is(Role::Stroke),
            has_force: is(Role::Force),
        };
        self.warnings = warnings;
        Ok(self)
    }

    /// The same with another setting, such as `texture.material=oak`.
    pub(crate) fn with(&self, setting: String) -> Self {
        let mut it = self.clone();
        it.request.set.push(setting);
        it
    }

    /// Reads and compiles it. With `hand`, the caller moves its stylus.
    pub(crate) fn ready(&self, kinds: &mut Kinds, hand: bool) -> Result<Ready, Failure> {
        WARNINGS.take();
        let (mut graph, scene) = match &self.text {
            Some(text) => load::read_text(text, &self.request, kinds)?,
            None => load::read(&self.request, kinds)?,
        };
        let registry = kinds.registry(Some(&graph))?;
        let moves = |kind: &str| matches!(registry.role(kind), Some(Role::Stroke | Role::Hand));
        if hand && graph.nodes.iter().any(|node| moves(&node.kind)) {
            stylus::take_in_hand(&mut graph, &registry, HOST_INPUT)?;
        }
        let mut ids = Vec::new();
        for port in &self.probes {
            ids.push(probe::add(&mut graph, port, &[], "asperity_graph_probe")?);
        }
        let Loaded { graph, compiled, .. } = load::compile(&self.request, kinds, graph, scene)?;
        load::warn_about(&compiled.schedule);
        let probes = self.probes.iter().zip(&ids).filter_map(|(name, id)| {
            let node = compiled.schedule.index_of(id)?;
            let port = compiled.schedule.nodes[node].inputs.first()?.port.clone()?;
            Some((name.clone(), Probe { node, shape: port.shape }))
        });
        let probes = probes.collect();
        Ok(Ready { graph, compiled, probes, warnings: WARNINGS.take().join("\n") })
    }

    /// Refuses a graph whose inputs nobody would feed.
    pub(crate) fn fed(&self, schedule: &Schedule, hand: bool) -> Result<(), Failure> {
        let moved = |node: usize| hand && schedule.nodes[node].role == Some(Role::Hand);
        let Some((node, _)) = schedule.host_fed().find(|(node, _)| !moved(*node)) else { return Ok(()) };
        let node = &schedule.nodes[node];
        let what = format!("`{}` ({}) needs a device, and this has none", node.id, node.kind);
        let help = match node.role {
            Some(Role::Hand) => {
                "move the stylus yourself: ASPERITY_HAND; or give a stroke: asperity_graph_stroke"
            }
            _ => "take the node out",
        };
        Err(wrong(self.text.as_ref().map_or(&*self.request.graph, |text| text.path()), what, help))
    }
}

/// Uses a graph on this thread alone.
pub(crate) fn with<R>(
    graph: *const AsperityGraph,
    function: impl FnOnce(&mut Graph) -> Answer<R>,
) -> Answer<R> {
    GRAPHS.with(graph as usize, |graph| function(&mut *graph.try_lock().ok_or(IN_USE)?))
}

/// Changes a graph, unless the change is refused.
fn change(graph: *const AsperityGraph, change: impl FnOnce(&mut Graph) -> Answer) -> AsperityStatus {
    call(|| {
        with(graph, |graph| {
            let mut changed = graph.clone();
            change(&mut changed)?;
            *graph = changed.checked()?;
            Ok(())
        })
    })
}

/// A path. One that begins with `graphs/` may name a shipped file.
fn found(path: &str) -> Answer<PathBuf> {
    if load::is_standard(path.as_ref()) {
        return Err(Refusal::invalid(
            "the standard input is the program's: read it, and use asperity_graph_parse",
        ));
    }
    shipped::found(path.into()).map_err(|e| Refusal::failed(&e.to_string()))
}

/// Opens a graph file or scene file. A path that begins with `graphs/` and does not exist names a file that
/// ships with the library. `graph` gets the handle, or NULL.
///
/// Any thread. Blocks: reads files, compiles, allocates.
///
/// # Safety
/// `path` ends with a zero byte, and `graph` may be written. Either may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_graph_open(
    path: *const c_char,
    graph: *mut *mut AsperityGraph,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let (path, to) = unsafe { (given(path, "path"), place(graph, "graph")?) };
        *to = std::ptr::null_mut();
        let request = Request { graph: found(path?)?, ..Request::default() };
        *to = GRAPHS.insert(Mutex::new(Graph::new(request, None)?))? as *mut AsperityGraph;
        Ok(())
    })
}

/// Reads a graph or scene from a text. `path` stands for its file in errors, and files that it names are
/// relative to its folder; NULL for the working folder. `graph` gets the handle, or NULL.
///
/// Any thread. Blocks: reads files, compiles, allocates.
///
/// # Safety
/// `text` and `path` end with a zero byte, and `graph` may be written. Each may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_graph_parse(
    text: *const c_char,
    path: *const c_char,
    graph: *mut *mut AsperityGraph,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let (text, to) = unsafe { (given(text, "text"), place(graph, "graph")?) };
        *to = std::ptr::null_mut();
        // SAFETY: as above.
        let path = if path.is_null() { "<text>" } else { unsafe { given(path, "path")? } };
        let request = Request { graph: path.into(), ..Request::default() };
        let text = Source::new(path, text?);
        *to = GRAPHS.insert(Mutex::new(Graph::new(request, Some(text))?))? as *mut AsperityGraph;
        Ok(())
    })
}

/// Frees a graph. Engines and runs that were made of it go on. NULL is nothing to free.
///
/// Any thread. Waits up to 2 s for a call of another thread with this handle.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_graph_free(graph: *mut AsperityGraph) -> AsperityStatus {
    call(|| GRAPHS.free(graph as usize))
}

/// Sets a parameter, such as `texture.material` to `oak`, or `tick_hz`, `audio_hz`, `seed`. Engines and runs
/// that were made of the graph stay as they are.
///
/// One thread at a time. Blocks: compiles, allocates.
///
/// # Safety
/// `name` and `value` are NULL or end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_graph_set(
    graph: *mut AsperityGraph,
    name: *const c_char,
    value: *const c_char,
) -> AsperityStatus {
    change(graph, |graph| {
        // SAFETY: the caller's promise.
        let (name, value) = unsafe { (given(name, "name")?, given(value, "value")?) };
        graph.request.set.push(format!("{name}={value}"));
        Ok(())
    })
}

/// Plays a recorded stroke in place of the graph's own: a CSV file with times in s and positions in mm.
///
/// One thread at a time. Blocks: reads files, compiles, allocates.
///
/// # Safety
/// `path` is NULL or ends with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_graph_stroke(
    graph: *mut AsperityGraph,
    path: *const c_char,
) -> AsperityStatus {
    change(graph, |graph| {
        // SAFETY: the caller's promise.
        graph.request.input = Some(found(unsafe { given(path, "path")? })?);
        Ok(())
    })
}

/// Makes a port readable in engines that are made later, such as `floor.force`: see `asperity_engine_read`.
///
/// One thread at a time. Blocks: compiles, allocates.
///
/// # Safety
/// `port` is NULL or ends with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_graph_probe(
    graph: *mut AsperityGraph,
    port: *const c_char,
) -> AsperityStatus {
    change(graph, |graph| {
        // SAFETY: the caller's promise.
        let port = unsafe { given(port, "port")? };
        if !graph.probes.iter().any(|probe| probe == port) {
            graph.probes.push(port.to_owned());
        }
        Ok(())
    })
}

/// Writes the figures of a graph.
///
/// One thread at a time. Never blocks.
///
/// # Safety
/// `info` is NULL or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn asperity_graph_info(
    graph: *mut AsperityGraph,
    info: *mut AsperityGraphInfo,
) -> AsperityStatus {
    call(|| {
        // SAFETY: the caller's promise.
        let info = unsafe { place(info, "info")? };
        *info = with(graph, |graph| Ok(graph.info))?;
        Ok(())
    })
}

/// Warnings about a graph: settings that are probably mistakes. One a line; empty for none. NULL after an
/// error. The text is valid until this thread asks for another text.
///
/// One thread at a time. Allocates.
#[unsafe(no_mangle)]
pub extern "C" fn asperity_graph_warnings(graph: *mut AsperityGraph) -> *const c_char {
    text(|| with(graph, |graph| Ok(graph.warnings.clone())))
}
