//! The kinds of nodes: built in, and from plugins.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Place};
use asperity_graph::{GraphFile, PluginDecl};
use asperity_live::apart;
use asperity_live::realtime::PRIORITY;
use asperity_loader::{Found, Loader, PATH_VARIABLE, Plugin, find, search};
use asperity_node::{NodeKind, Registry};

use crate::failure::Failure;
use crate::host::{host, warn};
use crate::phase::OFFLINE;
use crate::trust::is_trusted;

/// Makes registries. Kept while a graph is watched: a plugin is loaded again only when its file changed.
#[derive(Default)]
pub struct Kinds {
    loader: Loader,
    named: Vec<PathBuf>,
    /// Kinds of the host.
    own: Vec<Arc<NodeKind>>,
    files: Vec<PathBuf>,
    plays: bool,
    /// Whether nodes of plugins run on threads of their own.
    apart: bool,
    /// Whether the graph is inspected, not run.
    looks: bool,
    /// Untrusted plugins that the last registry lacks.
    left_out: Vec<Diagnostic>,
    /// Folders about which the user was asked.
    asked: HashSet<PathBuf>,
}

impl std::fmt::Debug for Kinds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Kinds").field("files", &self.files).finish_non_exhaustive()
    }
}

impl Kinds {
    /// Kinds with those of the plugins that the user names.
    pub fn new(named: &[PathBuf]) -> Self {
        Self { named: named.to_vec(), ..Self::default() }
    }

    /// Adds kinds of the host.
    #[must_use]
    pub fn with(self, own: Vec<Arc<NodeKind>>) -> Self {
        Self { own, ..self }
    }

    /// Runs nodes of plugins on threads of their own: a call that never returns does not stop the graph.
    #[must_use]
    pub fn apart(self, apart: bool) -> Self {
        Self { apart, ..self }
    }

    /// For a graph that is only inspected: untrusted plugins are left out, and `judge` reports them.
    #[must_use]
    pub fn looking(self) -> Self {
        Self { looks: true, ..self }
    }

    /// Adds the plugins that were left out to the result of an inspection.
    ///
    /// # Errors
    /// Those of the inspection, and a plugin that was left out.
    pub fn judge<T>(&self, found: Result<T, Failure>) -> Result<T, Failure> {
        match found {
            _ if self.left_out.is_empty() => found,
            Err(Failure::Input(errors)) => Err([self.left_out.clone(), errors].concat().into()),
            Ok(_) => Err(self.left_out.clone().into()),
            failed => failed,
        }
    }

    /// Files of the plugins that the last registry has, or would have.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// From now on a graph plays: new code is tried in another process first, and nobody is asked.
    pub fn plays(&mut self) {
        self.plays = true;
    }

    /// All kinds that a graph may use. A bad plugin on the plugin path is left out with a warning.
    ///
    /// # Errors
    /// A plugin that the graph or the user names, and that does not load or is not trusted. A kind of the
    /// host whose name is taken.
    pub fn registry(&mut self, graph: Option<&GraphFile>) -> Result<Registry, Failure> {
        let mut registry = built_in();
        for kind in &self.own {
            let name = kind.descriptor().kind.to_string();
            if registry.add(kind.clone()).is_some() || OFFLINE.contains(&name.as_str()) || name == "default" {
                let what = format!("there is a kind `{name}` already");
                return Err(Diagnostic::new(what).help("give yours another name").into());
            }
        }
        let mut merged = Merged { registry, from: HashMap::new(), apart: self.apart };
        self.files.clear();
        self.left_out.clear();
        for decl in graph.map_or(&[][..], |g| &g.plugins) {
            let place = &decl.place;
            let base = place.source.path().parent().unwrap_or(Path::new(""));
            let path =
                find(&decl.name, base, std::env::var_os(PATH_VARIABLE)).map_err(|e| match e.path() {
                    Some(_) => e.related(&place.source, place.span, "needed by this"),
                    None => e.at(&place.source, place.span),
                })?;
            // One that does not load is watched as well: it may be mended.
            self.files.push(path.clone());
            if !self.may_load(&path, place) {
                self.left_out.push(untrusted(&path, decl));
                continue;
            }
            let added = self.load(&path).and_then(|p| merged.add(&p, true));
            added.map_err(|e| e.related(&place.source, place.span, "named here"))?;
        }
        if !self.left_out.is_empty() && !self.looks {
            return Err(self.left_out.clone().into());
        }
        for name in self.named.clone() {
            let path = named_plugin(&name)?;
            self.files.push(path.clone());
            merged.add(&self.load(&path)?, true)?;
        }
        for Found { path, .. } in plugins_on_path() {
            self.files.push(path.clone());
            if let Err(e) = self.load(&path).and_then(|p| merged.add(&p, false)) {
                warn(&format!("left out of {PATH_VARIABLE}: {e}"));
            }
        }
        Ok(merged.registry)
    }

    /// Whether a graph may load a plugin: its folder is trusted, or the user names it.
    fn may_load(&mut self, path: &Path, place: &Place) -> bool {
        let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let is_it = |other: PathBuf| other.canonicalize().is_ok_and(|other| whole == other);
        let named = self.named.iter().filter_map(|name| named_plugin(name).ok());
        let found = search(std::env::var_os(PATH_VARIABLE)).0.into_iter().map(|found| found.path);
        if named.chain(found).any(is_it) || is_trusted(path) {
            return true;
        }
        // Nobody is asked while a graph plays, or twice. Loading reports a file that does not exist.
        let folder = whole.parent().unwrap_or(Path::new("")).to_owned();
        !whole.exists()
            || (!self.plays && self.asked.insert(folder) && (host().ask)(place.source.path(), &whole))
    }

    /// Loads a plugin. While a graph plays, its code is tried in another process first.
    fn load(&mut self, path: &Path) -> Result<Plugin, Diagnostic> {
        let plays = self.plays;
        self.loader.load_tried(path, |copy| if plays { (host().survives)(path, copy.path()) } else { Ok(()) })
    }
}

/// The built-in kinds, with those of hand devices.
pub fn built_in() -> Registry {
    asperity_hand::register(asperity_nodes::registry()).with_shipped_files(crate::shipped::file)
}

/// The kinds that exist without a graph.
///
/// # Errors
/// See [`Kinds::registry`].
pub fn registry(plugins: &[PathBuf]) -> Result<Registry, Failure> {
    Kinds::new(plugins).registry(None)
}

/// File of the plugin that `--plugin` names.
///
/// # Errors
/// There is none.
pub fn named_plugin(name: &Path) -> Result<PathBuf, Diagnostic> {
    let list = std::env::var_os(PATH_VARIABLE);
    find(&name.to_string_lossy(), Path::new(""), list).map_err(|e| e.in_file("--plugin"))
}

/// Plugins along the plugin path. Folders that cannot be read cause warnings.
pub fn plugins_on_path() -> Vec<Found> {
    let (found, problems) = search(std::env::var_os(PATH_VARIABLE));
    problems.iter().for_each(|p| warn(&p.to_string()));
    found
}

fn untrusted(path: &Path, decl: &PluginDecl) -> Diagnostic {
    let folder = path.parent().unwrap_or(Path::new("."));
    Diagnostic::new(format!("the plugin `{}` was not loaded: its folder is not trusted", decl.name))
        .at(&decl.place.source, decl.place.span)
        .help(format!(
            "a plugin may do whatever you may. To allow those of this folder: asperity trust {}. \
             To allow this one: --plugin {}",
            folder.display(),
            path.display()
        ))
}

/// A registry that grows, and the plugin of each kind that is not built in.
struct Merged {
    registry: Registry,
    from: HashMap<String, Plugin>,
    apart: bool,
}

impl Merged {
    /// Adds a plugin. One that was not asked for replaces no kind of another plugin.
    fn add(&mut self, plugin: &Plugin, asked: bool) -> Result<(), Diagnostic> {
        let refuse = |what: String, help: &str| Err(Diagnostic::new(what).in_file(plugin.path()).help(help));
        let mut kinds = Vec::new();
        for kind in plugin.kinds() {
            let name = kind.descriptor().kind.to_string();
            // `--phase` gives these names another meaning.
            if name == "default" || OFFLINE.contains(&name.as_str()) {
                let what =
                    format!("its kind cannot be called `{name}`, which `--phase` knows as something else");
                return refuse(what, "rename the kind");
            }
            let other = match (self.from.get(&name), self.registry.get(&name)) {
                (Some(other), _) if other.build() == plugin.build() || !asked => continue,
                (Some(other), _) => other.path().display().to_string(),
                (None, Some(_)) => "it is built in".to_owned(),
                (None, None) => {
                    kinds.push((name, kind.clone()));
                    continue;
                }
            };
            let what = format!("its kind `{name}` is there already: {other}");
            return refuse(what, "rename the kind, or leave one of the two out");
        }
        for (name, kind) in kinds {
            self.registry.add(if self.apart { apart(kind, Some(PRIORITY)) } else { kind });
            self.from.insert(name, plugin.clone());
        }
        Ok(())
    }
}
