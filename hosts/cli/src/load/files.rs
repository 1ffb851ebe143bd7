//! Files that a graph is made of: what reads them, what would overwrite them, and when they change.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use asperity_graph::Schedule;
use asperity_node::ParamValue;

use super::GraphArgs;
use crate::commands::render::recorder;
use crate::failure::Failure;
use crate::output::{Named, apart};

pub struct NodeFile {
    pub path: PathBuf,
    pub node: String,
    /// The parameter that names the file; empty where another file of the node names it.
    pub param: String,
}

pub fn node_files(schedule: &Schedule) -> Vec<NodeFile> {
    let mut files = Vec::new();
    for node in &schedule.nodes {
        let mut add = |path: PathBuf, param: &str| {
            files.push(NodeFile { path, node: node.id.clone(), param: param.to_owned() });
        };
        for (name, value) in node.params.iter() {
            match value {
                ParamValue::File(path) => add(path.clone(), name),
                // A profile is a name or a file, relative to where it stands.
                ParamValue::Text(text) if name == "profile" && text.ends_with(".ron") => {
                    let place = node.params.place(name).and_then(|p| p.source.path().parent());
                    add(place.unwrap_or(Path::new("")).join(text), name);
                }
                _ => {}
            }
        }
        node.files.iter().for_each(|path| add(path.clone(), ""));
    }
    files
}

/// Files that a graph is made of, each with its reader in words.
pub fn files_read(args: &GraphArgs, schedule: &Schedule, plugins: &[PathBuf]) -> Vec<Named> {
    let mut files = vec![(args.graph.clone(), "the graph".to_owned())];
    files.extend(node_files(schedule).into_iter().map(|f| {
        let reader = if f.param.is_empty() { f.node } else { format!("{}.{}", f.node, f.param) };
        (f.path, format!("`{reader}`"))
    }));
    files.extend(plugins.iter().map(|path| (path.clone(), "the graph, as a plugin,".to_owned())));
    files
}

/// Refuses two outputs in one file, or in a file that is read; `written` are outputs beside the sinks'.
pub fn distinct_files(
    args: &GraphArgs,
    schedule: &Schedule,
    plugins: &[PathBuf],
    mut written: Vec<Named>,
) -> Result<(), Failure> {
    written.extend(recorder::files(schedule).map(|(path, id)| (path, format!("`{id}`"))));
    apart(files_read(args, schedule, plugins), written)
}

/// How often files are looked at. Polling works on every system and over a network; notifications do not.
const POLL: Duration = Duration::from_millis(100);
/// Longest wait for a file that is written all the time.
const LONGEST: Duration = Duration::from_secs(1);

/// Tells two versions of a file apart without reading it: time and length; `None` for a missing file.
type Stamp = Option<(SystemTime, u64)>;

pub type Stamps = BTreeMap<PathBuf, Stamp>;

pub fn stamps(args: &GraphArgs, plugins: &[PathBuf], schedule: &Schedule) -> Stamps {
    let files: Vec<PathBuf> = files_read(args, schedule, plugins).into_iter().map(|(path, _)| path).collect();
    stamps_of(&files)
}

pub fn stamps_of<'p>(files: impl IntoIterator<Item = &'p PathBuf>) -> Stamps {
    let stamp = |path: &PathBuf| std::fs::metadata(path).and_then(|m| Ok((m.modified()?, m.len()))).ok();
    files.into_iter().map(|path| (path.clone(), stamp(path))).collect()
}

pub struct Watched {
    /// Versions of which the running graph was made.
    known: Stamps,
    /// Versions when they were last looked at.
    before: Stamps,
    since: Option<Instant>,
    looked: Instant,
}

impl Watched {
    pub fn new(now: Stamps) -> Self {
        Self { before: now.clone(), known: now, since: None, looked: Instant::now() }
    }

    /// Whether it is time to look again.
    pub fn due(&mut self) -> bool {
        let due = self.looked.elapsed() >= POLL;
        self.looked = if due { Instant::now() } else { self.looked };
        due
    }

    /// Files that changed and look the same twice in a row, or that are written for a second.
    pub fn changed(&mut self, now: &Stamps) -> Option<Vec<PathBuf>> {
        let changed = *now != self.known;
        self.since = if changed { self.since.or_else(|| Some(Instant::now())) } else { None };
        let waited = self.since.is_some_and(|since| since.elapsed() >= LONGEST);
        let settled = changed && (*now == self.before || waited);
        if settled {
            self.since = None;
        }
        self.before.clone_from(now);
        let differs = |(path, stamp): &(&PathBuf, &Stamp)| self.known.get(*path) != Some(*stamp);
        settled.then(|| now.iter().filter(differs).map(|(path, _)| path.clone()).collect())
    }

    /// Watches the files of a new graph. A change since `seen`, before the file was read, is reported again.
    pub fn know(&mut self, after: Stamps, seen: &Stamps) {
        self.known = after;
        for (path, stamp) in seen {
            if let Some(known) = self.known.get_mut(path) {
                *known = *stamp;
            }
        }
    }
}

pub fn readers(schedule: &Schedule, changed: &[PathBuf]) -> Vec<String> {
    node_files(schedule).into_iter().filter(|f| changed.contains(&f.path)).map(|f| f.node).collect()
}

pub fn listed(changed: &[PathBuf]) -> String {
    let names: Vec<String> = changed.iter().map(|p| p.display().to_string()).collect();
    if names.is_empty() { "a file of the graph".to_owned() } else { names.join(", ") }
}
