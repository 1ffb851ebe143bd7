//! The kinds of nodes there are: built in, and from plugins.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, Place};
use asperity_graph::{GraphFile, PluginDecl};
use asperity_live::apart;
use asperity_live::realtime::PRIORITY;
use asperity_loader::{Found, Loader, PATH_VARIABLE, Plugin, find, search};
use asperity_node::Registry;

use crate::commands::plugin::survives;
use crate::failure::{Failure, warn};
use crate::phase::OFFLINE;
use crate::trust::{ask, is_trusted};

/// Where kinds come from. Kept while a graph is watched, so that a plugin is loaded again only when its file changed.
#[derive(Debug, Default)]
pub struct Kinds {
    loader: Loader,
    /// What `--plugin` names.
    named: Vec<PathBuf>,
    /// Files of the plugins that the last registry was made of, or was to be.
    files: Vec<PathBuf>,
    /// Whether a graph plays with what was loaded.
    plays: bool,
    /// Whether nodes of plugins run on threads of their own.
    apart: bool,
    /// Whether the graph is only looked at.
    looks: bool,
    /// Why plugins of the graph were left out of the last registry.
    left_out: Vec<Diagnostic>,
    /// Folders that the person was asked about.
    asked: HashSet<PathBuf>,
}

/// Why a plugin is left out.
fn untrusted(path: &Path, decl: &PluginDecl) -> Diagnostic {
    let folder = path.parent().unwrap_or(Path::new("."));
    Diagnostic::new(format!("the plugin `{}` was not loaded: its folder is not trusted", decl.name))
        .at(&decl.place.source, decl.place.span)
        .help(format!(
            "a plugin may do whatever you may. To allow those of this folder: asperity trust {}. To allow this one: --plugin {}",
            folder.display(),
            path.display()
        ))
}

impl Kinds {
    /// Kinds with the plugins that a command line names.
    pub fn new(named: &[PathBuf]) -> Self {
        Self { named: named.to_vec(), ..Self::default() }
    }

    /// The same, with nodes of plugins on threads of their own or not: there, one that never returns does not keep
    /// the graph.
    pub fn apart(self, apart: bool) -> Self {
        Self { apart, ..self }
    }

    /// The same, for a graph that is only looked at: plugins that may not be loaded are left out.
    pub fn looking(self) -> Self {
        Self { looks: true, ..self }
    }

    /// What came of a graph that was looked at, with what was left out.
    pub fn judge<T>(&self, found: Result<T, Failure>) -> Result<T, Failure> {
        match found {
            _ if self.left_out.is_empty() => found,
            Err(Failure::Machine(what)) => Err(Failure::Machine(what)),
            Err(Failure::Input(errors)) => Err([self.left_out.clone(), errors].concat().into()),
            Ok(_) => Err(self.left_out.clone().into()),
        }
    }

    /// Whether a plugin that a graph names may be loaded: the command line or the plugin path names it too, or its
    /// folder is trusted.
    fn may_load(&mut self, path: &Path, place: &Place) -> bool {
        let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let is_it = |other: &Path| other.canonicalize().is_ok_and(|other| whole == other);
        let list = || std::env::var_os(PATH_VARIABLE);
        let named = self.named.iter().filter_map(|n| find(&n.to_string_lossy(), Path::new(""), list()).ok());
        let found = search(list()).0.into_iter().map(|found| found.path);
        if named.chain(found).any(|other| is_it(&other)) || is_trusted(path) {
            return true;
        }
        // Nobody is asked while a graph plays, and nobody twice. What is not there is told where it is loaded.
        let folder = whole.parent().unwrap_or(Path::new("")).to_owned();
        !whole.exists() || (!self.plays && self.asked.insert(folder) && ask(place.source.path(), &whole))
    }

    /// Files of the plugins that the last registry was made of, or was to be.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// From here on a graph plays: what is loaded comes into a run.
    pub fn plays(&mut self) {
        self.plays = true;
    }

    /// Loads a plugin. While a graph plays, one that is new or was rebuilt is tried in another process first:
    /// its code, damaged perhaps, could end the run.
    fn load(&mut self, path: &Path) -> Result<Plugin, Diagnostic> {
        let plays = self.plays;
        self.loader.load_tried(path, |copy| if plays { survives(path, copy.path()) } else { Ok(()) })
    }

    /// All kinds that a graph may use: built in, from its own plugins, from `--plugin`, and along the plugin path. What a graph or a
    /// command line names must load and must not be there twice; what merely lies on the path is left out with a warning.
    pub fn registry(&mut self, graph: Option<&GraphFile>) -> Result<Registry, Failure> {
        let mut made = Made::new(self.apart);
        self.files.clear();
        self.left_out.clear();
        let list = || std::env::var_os(PATH_VARIABLE);
        for decl in graph.map_or(&[][..], |g| &g.plugins) {
            let place = &decl.place;
            let base = place.source.path().parent().unwrap_or(Path::new(""));
            let path = find(&decl.name, base, list()).map_err(|e| match e.path() {
                Some(_) => e.related(&place.source, place.span, "looked for on behalf of this"),
                None => e.at(&place.source, place.span),
            })?;
            // One that does not load is watched all the same: it may be mended.
            self.files.push(path.clone());
            if !self.may_load(&path, place) {
                self.left_out.push(untrusted(&path, decl));
                continue;
            }
            let added = self.load(&path).and_then(|p| made.add(&p));
            added.map_err(|e| e.related(&place.source, place.span, "named here"))?;
        }
        if !self.left_out.is_empty() && !self.looks {
            return Err(self.left_out.clone().into());
        }
        for named in &self.named.clone() {
            let name = named.to_string_lossy();
            let path = find(&name, Path::new(""), list()).map_err(|e| e.in_file("--plugin"))?;
            self.files.push(path.clone());
            made.add(&self.load(&path)?)?;
        }
        let (found, problems) = search(list());
        problems.iter().for_each(|p| warn(&p.to_string()));
        for Found { path, .. } in found {
            self.files.push(path.clone());
            match self.load(&path).and_then(|p| made.add_where_new(&p)) {
                Ok(()) => {}
                Err(e) => warn(&format!("left out of {PATH_VARIABLE}: {e}")),
            }
        }
        Ok(made.registry)
    }
}

/// The kinds that are there without a graph.
pub fn registry(plugins: &[PathBuf]) -> Result<Registry, Failure> {
    Kinds::new(plugins).registry(None)
}

/// A registry in the making, and which file each kind of a plugin came from.
struct Made {
    registry: Registry,
    from: HashMap<String, Plugin>,
    apart: bool,
}

impl Made {
    fn new(apart: bool) -> Self {
        Self { registry: asperity_nodes::registry(), from: HashMap::new(), apart }
    }

    /// Adds a plugin that was asked for.
    fn add(&mut self, plugin: &Plugin) -> Result<(), Diagnostic> {
        self.take(plugin, true)
    }

    /// Adds a plugin that merely lies on the path; kinds that were asked for from another file are not replaced.
    fn add_where_new(&mut self, plugin: &Plugin) -> Result<(), Diagnostic> {
        self.take(plugin, false)
    }

    fn take(&mut self, plugin: &Plugin, asked: bool) -> Result<(), Diagnostic> {
        let refuse = |kind: &str, other: &str| {
            Diagnostic::new(format!("its kind `{kind}` is there already: {other}"))
                .in_file(plugin.path())
                .help("name the kind otherwise, or leave one of the two out")
        };
        let mut kinds = Vec::new();
        for kind in plugin.kinds() {
            let name = kind.descriptor().kind.to_string();
            // What a command line means by these is no node.
            if name == "default" || OFFLINE.contains(&name.as_str()) {
                let message =
                    format!("its kind cannot be called `{name}`, which `--phase` knows as something else");
                return Err(Diagnostic::new(message).in_file(plugin.path()).help("name the kind otherwise"));
            }
            match (self.from.get(&name), self.registry.get(&name)) {
                (Some(other), _) if other.build() == plugin.build() || !asked => continue,
                (Some(other), _) => return Err(refuse(&name, &other.path().display().to_string())),
                (None, Some(_)) => return Err(refuse(&name, "it is built in")),
                (None, None) => kinds.push((name, kind.clone())),
            }
        }
        for (name, kind) in kinds {
            self.registry.add(if self.apart { apart(kind, Some(PRIORITY)) } else { kind });
            self.from.insert(name, plugin.clone());
        }
        Ok(())
    }
}
