//! Changes the graph while it plays, when its files change or the user chooses a material.
//!
//! Nothing here waits. Another thread prepares the new graph ([`reloader`](super::reloader)), and
//! [`Editor::poll`] takes it over when it is ready. Of edits that come meanwhile the newest counts. If
//! files change again, the graph that is being prepared is abandoned, unless a device was closed for it.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::sync::{Arc, Mutex};

use asperity_diagnostics::Diagnostic;
use asperity_graph::{GraphFile, Schedule};
use asperity_live::GraphController;
use asperity_live::view::{By, Request};
use asperity_node::{ParamKind, Registry, Role};
use asperity_page::Map;

use super::Args;
use super::hands::{Hands, close_elsewhere};
use super::recordings::Recordings;
use super::reloader::{self, Answer, Base, Made, Order, Ready, on_thread};
use crate::commands::render::recorder;
use crate::failure::Failure;
use crate::kinds::Kinds;
use crate::load::files::{Stamps, Watched, listed, readers, stamps};
use crate::machine::Ceiling;
use crate::output::ending;

/// Prepares a new graph when something changes, and sends it to the engine.
pub struct Editor {
    args: Args,
    kinds: Arc<Mutex<Kinds>>,
    plugins: Vec<PathBuf>,
    ceiling: Option<Ceiling>,
    /// The file of the graph that runs.
    base: Option<Base>,
    /// Versions of all files that this was made of.
    made_of: Stamps,
    /// With `--watch`.
    files: Option<Watched>,
    /// Materials that the user chose: node and material. They stay when files change.
    chosen: BTreeMap<String, String>,
    /// Live parameters that the user moved, by node and name. The next change of a file resets them.
    moved: BTreeMap<(String, String), Moved>,
    moves: u64,
    /// Edits that wait.
    file: Option<FileEdit>,
    choices: BTreeMap<String, (String, By)>,
    job: Option<Job>,
}

/// The end of an edit.
pub enum News {
    /// Files changed: a text for the user, and whether the graph was taken over.
    Files(String, bool),
    /// A choice was taken over.
    Chosen(Request, By),
    /// A choice cannot be taken over, and why.
    Refused(Request, By, Failure),
}

struct Moved {
    value: f64,
    setting: String,
    at: u64,
}

/// Files that changed, and the versions of all files at that time.
struct FileEdit {
    changed: Vec<PathBuf>,
    seen: Stamps,
}

enum Edit {
    File(FileEdit),
    Choice(String, String, By),
}

struct Job {
    edit: Edit,
    /// Moves before it began.
    since: u64,
    over: Arc<AtomicBool>,
    /// Whether a device was closed for it, so that it cannot be abandoned.
    exchanges: bool,
    stage: Stage,
}

enum Stage {
    /// A thread works.
    Making(Receiver<Answer>),
    /// The graph waits until the engine can take it.
    Ready(Box<Ready>),
}

impl Job {
    /// Stops the job and closes the devices that it opened. Answers the edit.
    fn abandon(self) -> Edit {
        self.over.store(true, Relaxed);
        close_elsewhere(move || match self.stage {
            // Received here, so that its devices close where others wait for it.
            Stage::Making(from) => drop(from.recv()),
            Stage::Ready(ready) => drop(ready),
        });
        self.edit
    }
}

pub struct Playing<'p> {
    pub graph_controller: &'p mut GraphController,
    pub hands: &'p mut Hands,
    pub recordings: &'p mut Recordings,
}

impl Editor {
    pub fn new(args: &Args) -> Self {
        Self {
            args: args.clone(),
            kinds: Arc::new(Mutex::new(Kinds::new(&args.graph.plugins.plugin).apart(!args.in_place))),
            plugins: Vec::new(),
            ceiling: None,
            base: None,
            made_of: Stamps::new(),
            files: None,
            chosen: BTreeMap::new(),
            moved: BTreeMap::new(),
            moves: 0,
            file: None,
            choices: BTreeMap::new(),
            job: None,
        }
    }

    pub fn hold_to(&mut self, ceiling: Option<Ceiling>) {
        self.ceiling = ceiling;
    }

    pub fn plugins(&self) -> &[PathBuf] {
        &self.plugins
    }

    /// The scene from above, if a scene plays.
    pub fn map(&self) -> Option<&Arc<Map>> {
        self.base.as_ref()?.map.as_ref()
    }

    /// Arguments with which `asperity render` renders the running graph: its sinks write to a folder.
    pub fn render_args(&self, schedule: &Schedule, folder: &Path) -> Result<Vec<OsString>, String> {
        if self.stamps(schedule) != self.made_of {
            return Err("A file of the graph has changed since it was read, so that a render would be of \
                        another graph. Start the run again, or with --watch."
                .into());
        }
        let args = &self.args.graph;
        let mut out = vec![args.graph.clone().into()];
        out.extend(self.plugins.iter().flat_map(|file| ["--plugin".into(), file.into()]));
        // A stroke takes the place of the hand and its parameters.
        let hand = |set: &&String| {
            let node = set.split('=').next().and_then(|set| set.rsplit_once('.')).map(|(node, _)| node);
            schedule.with_role(Role::Hand).any(|(_, hand)| node == Some(hand.id.as_str()))
        };
        let moved = self.moved.values().map(|moved| &moved.setting);
        let mut sets: Vec<String> = args.set.iter().chain(moved).filter(|set| !hand(set)).cloned().collect();
        sets.extend(self.chosen.iter().map(|(node, material)| format!("{node}.material={material:?}")));
        let is_probe = |id: &String| self.base.as_ref().is_some_and(|base| base.probes.contains(id));
        let sinks = recorder::files(schedule).filter(|(_, id)| !is_probe(id));
        for (i, (path, id)) in sinks.enumerate() {
            let file = folder.join(format!("sink{i}.{}", ending(&path)));
            sets.push(format!("{id}.file={}", file.display()));
        }
        out.extend(sets.into_iter().flat_map(|set| ["--set".into(), set.into()]));
        let flags =
            [("--no-prune", args.no_prune), ("--strict", args.strict), ("--no-sleep", self.args.no_sleep)];
        out.extend(flags.iter().filter(|(_, is)| *is).map(|(flag, _)| flag.into()));
        Ok(out)
    }

    pub fn make(&mut self) -> Result<Made, Failure> {
        let mut kinds = reloader::lock(&self.kinds);
        let made =
            reloader::make(&self.args.graph, &self.args.files, &mut kinds, None, &[], &BTreeMap::new())?;
        kinds.plays();
        self.plugins = kinds.files().to_vec();
        drop(kinds);
        self.base = Some(made.base.clone());
        self.made_of = self.stamps(&made.compiled.schedule);
        Ok(made)
    }

    pub fn watch(&mut self, schedule: &Schedule) {
        self.files = Some(Watched::new(self.stamps(schedule)));
    }

    fn stamps(&self, schedule: &Schedule) -> Stamps {
        stamps(&self.args.graph, &self.plugins, schedule)
    }

    /// Gives a texture node another material, as soon as its graph is ready.
    pub fn choose(&mut self, node: String, material: String, by: By) {
        // Devices may take long to open, so a file edit is put off. A material is quick: one that is being
        // prepared is heard, and then the newest.
        if let Some(edit) = self.give_up() {
            self.file = self.file.take().or(Some(edit));
        }
        self.choices.insert(node, (material, by));
    }

    /// Sets a live parameter, also in graphs that are prepared for another material. Answers its value as a
    /// user knows it.
    pub fn set(
        &mut self,
        node: String,
        param: String,
        value: f64,
        graph_controller: &mut GraphController,
    ) -> Result<String, Failure> {
        graph_controller.set_parameter(&node, &param, value).map_err(|e| Failure::Machine(e.to_string()))?;
        let schedule = graph_controller.schedule();
        let live =
            schedule.index_of(&node).and_then(|i| schedule.nodes[i].live.iter().find(|l| l.name == param));
        let Some(live) = live else { return Ok(value.to_string()) };
        let text = match &live.kind {
            ParamKind::Flag => (value != 0.0).to_string(),
            ParamKind::Choice(words) => {
                words.get(value as usize).map(|w| format!("{w:?}")).unwrap_or_default()
            }
            ParamKind::Integer(_) => (value as i64).to_string(),
            _ => format!("{value:?}"),
        };
        self.moves += 1;
        let setting = format!("{node}.{param}={text}");
        self.moved.insert((node, param), Moved { value, setting, at: self.moves });
        Ok(text.trim_matches('"').to_owned())
    }

    /// Takes over a graph that is ready, and begins the next edit. Answers the end of an edit.
    pub fn poll(&mut self, playing: &mut Playing<'_>) -> Option<News> {
        self.look(playing.graph_controller.schedule());
        let news = self.advance(playing);
        if self.job.is_none() {
            self.begin(playing);
        }
        news
    }

    fn look(&mut self, schedule: &Schedule) {
        if !self.files.as_mut().is_some_and(Watched::due) {
            return;
        }
        let seen = self.stamps(schedule);
        let Some(files) = &mut self.files else { return };
        let Some(mut changed) = files.changed(&seen) else { return };
        files.know(seen.clone(), &seen);
        // Earlier changes that were not taken over have still to be read.
        let earlier = self.give_up().or_else(|| self.file.take());
        changed.extend(earlier.into_iter().flat_map(|edit| edit.changed));
        changed.sort();
        changed.dedup();
        self.file = Some(FileEdit { changed, seen });
    }

    /// Abandons the graph of changed files, unless a device was closed for it. Answers the edit.
    fn give_up(&mut self) -> Option<FileEdit> {
        let job = self.job.take_if(|job| matches!(job.edit, Edit::File(_)) && !job.exchanges)?;
        match job.abandon() {
            Edit::File(edit) => Some(edit),
            Edit::Choice(..) => None,
        }
    }

    /// Abandons the edit under way: the run is over. Answers the graph that ran, and its kinds.
    pub fn end(self) -> Option<(GraphFile, Registry)> {
        self.job.map(Job::abandon);
        let moved: Vec<String> = self.moved.into_values().map(|m| m.setting).collect();
        let graph = reloader::changed(&self.base?.graph, &moved, &self.chosen);
        let registry = reloader::lock(&self.kinds).registry(Some(&graph)).ok()?;
        Some((graph, registry))
    }

    /// Begins the next edit, a choice of material first.
    fn begin(&mut self, playing: &Playing<'_>) {
        let choice = self.choices.pop_first().map(|(node, (name, by))| Edit::Choice(node, name, by));
        let Some(edit) = choice.or_else(|| self.file.take().map(Edit::File)) else { return };
        let mut order = self.order(playing);
        match &edit {
            Edit::File(_) => {
                order.base = None;
                order.moved.clear();
                order.again = true;
            }
            Edit::Choice(node, material, _) => {
                order.chosen.insert(node.clone(), material.clone());
            }
        }
        let over = order.over.clone();
        let stage = Stage::Making(on_thread(move || order.carry_out()));
        self.job = Some(Job { edit, since: self.moves, over, exchanges: false, stage });
    }

    fn order(&self, playing: &Playing<'_>) -> Order {
        Order {
            args: self.args.graph.clone(),
            kinds: self.kinds.clone(),
            base: self.base.clone(),
            moved: self.moved.values().map(|m| m.setting.clone()).collect(),
            chosen: self.chosen.clone(),
            running: playing.graph_controller.schedule().clone(),
            held: playing.hands.holding(),
            again: false,
            begun: playing.recordings.begun(),
            files: self.args.files.clone(),
            record: self.args.record.clone(),
            over: Arc::default(),
        }
    }

    /// Continues the job under way with the other thread's message. Answers the end of the edit.
    fn advance(&mut self, playing: &mut Playing<'_>) -> Option<News> {
        let mut job = self.job.take()?;
        if let Stage::Making(from) = &job.stage {
            let (plugins, result) = match from.try_recv() {
                Ok(answer) => answer,
                Err(TryRecvError::Empty) => {
                    self.job = Some(job);
                    return None;
                }
                Err(TryRecvError::Disconnected) => {
                    (None, Err(Failure::Machine("the thread that makes it ready broke off".into())))
                }
            };
            if let Some(plugins) = plugins {
                self.plugins = plugins;
            }
            let allowed = result.and_then(|ready| match self.allowed(&ready, playing) {
                Ok(()) => Ok(ready),
                Err(d) => {
                    close_elsewhere(move || drop(ready));
                    Err(d.into())
                }
            });
            match allowed {
                Ok(ready) => job.stage = Stage::Ready(Box::new(ready)),
                Err(failure) => return Some(self.refused(job.edit, failure, playing)),
            }
        }
        match job.stage {
            Stage::Ready(ready) if playing.graph_controller.ready() => {
                if ready.opened.in_the_way.is_empty() {
                    return self.take_over(job.edit, job.since, *ready, playing);
                }
                let old = playing.hands.let_go(&ready.opened.in_the_way);
                let back = Order { over: job.over.clone(), ..self.order(playing) };
                let stage = Stage::Making(on_thread(move || back.exchange(*ready, old)));
                self.job = Some(Job { exchanges: true, stage, ..job });
            }
            _ => self.job = Some(job),
        }
        None
    }

    /// Refuses a graph that contradicts the machine's file, before a device is closed for it.
    fn allowed(&self, ready: &Ready, playing: &Playing<'_>) -> Result<(), Diagnostic> {
        let Some(ceiling) = &self.ceiling else { return Ok(()) };
        let schedule = &ready.made.compiled.schedule;
        ceiling.check(&playing.graph_controller.channels_after(&ready.made.graph, schedule), schedule)
    }

    /// Sends a graph to the engine. Answers what that changes.
    fn take_over(&mut self, edit: Edit, since: u64, ready: Ready, playing: &mut Playing<'_>) -> Option<News> {
        let Ready { made, mut opened, recorders, refused } = ready;
        let changed = match &edit {
            Edit::File(edit) => readers(playing.graph_controller.schedule(), &edit.changed),
            Edit::Choice(..) => Vec::new(),
        };
        let queues = std::mem::take(&mut opened.queues);
        let sent =
            playing.graph_controller.swap(made.compiled, &made.graph, &changed, queues, made.materials);
        let report = match sent {
            Ok(report) => report,
            Err(e) => {
                close_elsewhere(move || drop(opened));
                return Some(self.refused(edit, Failure::Machine(e.to_string()), playing));
            }
        };
        playing.hands.go_on_with(opened, playing.graph_controller.schedule());
        playing.recordings.add(playing.graph_controller.layout().number, recorders);
        // Parameters that were moved while the graph was prepared are moved in it too.
        for ((node, param), m) in self.moved.iter().filter(|(_, m)| m.at > since) {
            let _ = playing.graph_controller.set_parameter(node, param, m.value);
        }
        if let Some(failure) = refused {
            return Some(self.refused(edit, failure, playing));
        }
        self.base = Some(made.base);
        match edit {
            Edit::File(edit) => {
                self.moved.retain(|_, m| m.at > since);
                self.know(playing.graph_controller.schedule(), &edit.seen);
                self.made_of = self.stamps(playing.graph_controller.schedule());
                let report =
                    if report.is_nothing() { "nothing that is heard".into() } else { report.to_string() };
                Some(News::Files(format!("{} changed: {report}", listed(&edit.changed)), true))
            }
            Edit::Choice(node, name, by) => {
                self.chosen.insert(node.clone(), name.clone());
                Some(News::Chosen(Request::Material { node, name }, by))
            }
        }
    }

    /// Ends an edit that cannot be taken over. Answers why.
    fn refused(&mut self, edit: Edit, failure: Failure, playing: &Playing<'_>) -> News {
        match edit {
            Edit::File(edit) => {
                self.know(playing.graph_controller.schedule(), &edit.seen);
                let text = format!(
                    "{} changed, and cannot be taken over:\n{}the running graph goes on",
                    listed(&edit.changed),
                    failure.text()
                );
                News::Files(text, false)
            }
            Edit::Choice(node, name, by) => News::Refused(Request::Material { node, name }, by, failure),
        }
    }

    fn know(&mut self, schedule: &Schedule, seen: &Stamps) {
        let after = self.stamps(schedule);
        if let Some(files) = &mut self.files {
            files.know(after, seen);
        }
    }
}
