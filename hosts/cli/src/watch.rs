//! Files that a running graph was made of, and whether they changed.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime};

use asperity_graph::Schedule;

use crate::args::GraphArgs;
use crate::load;

/// How often files are looked at. Asking works on every system and over a network, where being told does not.
pub const POLL: Duration = Duration::from_millis(100);
/// Longest wait for a file that is written all the time.
const LONGEST: Duration = Duration::from_secs(1);

/// What tells two versions of a file apart without reading it; none for a file that is not there.
type Stamp = Option<(SystemTime, u64)>;

/// Files as they were.
pub type Stamps = BTreeMap<PathBuf, Stamp>;

/// The files of a running graph.
pub struct Files {
    /// As they were when the running graph was made of them.
    known: Stamps,
    /// As they were when they were last looked at.
    before: Stamps,
    /// Since when they are other than known.
    since: Option<Instant>,
}

/// Every file that a graph is made of, those of `plugins` among them, as it is now.
pub fn stamps(args: &GraphArgs, plugins: &[PathBuf], schedule: &Schedule) -> Stamps {
    let stamp = |path: &PathBuf| std::fs::metadata(path).and_then(|m| Ok((m.modified()?, m.len()))).ok();
    let mut files: Vec<PathBuf> = plugins.to_vec();
    files.extend(load::files_read(args, schedule).into_iter().map(|f| f.0));
    files.into_iter().map(|path| (path.clone(), stamp(&path))).collect()
}

impl Files {
    /// The files as the running graph was made of them.
    pub fn new(now: Stamps) -> Self {
        Self { before: now.clone(), known: now, since: None }
    }

    /// Those that changed, once whoever writes has finished: twice in a row they look the same, and other
    /// than known. Whoever writes all the time is not waited for any longer than a second.
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

    /// The files of the graph that runs from now on, of which `seen` had been looked at before it was read: what changed
    /// meanwhile is looked at again.
    pub fn know(&mut self, after: Stamps, seen: &Stamps) {
        self.known = after;
        for (path, stamp) in seen {
            if let Some(known) = self.known.get_mut(path) {
                *known = *stamp;
            }
        }
    }
}

/// Nodes that read one of these files, though their parameters stand as they did.
pub fn readers(schedule: &Schedule, changed: &[PathBuf]) -> Vec<String> {
    load::node_files(schedule).into_iter().filter(|f| changed.contains(&f.path)).map(|f| f.node).collect()
}

/// The files in a line.
pub fn named(changed: &[PathBuf]) -> String {
    let names: Vec<String> = changed.iter().map(|p| p.display().to_string()).collect();
    if names.is_empty() { "what it is made of".to_owned() } else { names.join(", ") }
}
