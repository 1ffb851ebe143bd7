//! The node kinds of a host.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::{Effect, Node, NodeKind, Role};

/// Node kinds by name.
#[derive(Clone, Default)]
pub struct Registry {
    kinds: BTreeMap<String, Arc<NodeKind>>,
    /// Names in the order in which they were added.
    order: Vec<String>,
    shipped: Option<fn(&Path) -> Option<PathBuf>>,
}

impl std::fmt::Debug for Registry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_set().entries(self.kinds.keys()).finish()
    }
}

impl Registry {
    /// Makes an empty registry.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a node type.
    #[must_use]
    pub fn with<N: Node>(mut self) -> Self {
        self.add(Arc::new(NodeKind::of::<N>()));
        self
    }

    /// Adds a kind, replacing one of the same name. Returns the replaced one.
    pub fn add(&mut self, kind: Arc<NodeKind>) -> Option<Arc<NodeKind>> {
        let name = kind.descriptor().kind.to_string();
        let before = self.kinds.insert(name.clone(), kind);
        if before.is_none() {
            self.order.push(name);
        }
        before
    }

    /// Sets a function that finds files which ship with the host. Graph files name them by a path.
    #[must_use]
    pub fn with_shipped_files(mut self, find: fn(&Path) -> Option<PathBuf>) -> Self {
        self.shipped = Some(find);
        self
    }

    /// The shipped file of a path that a graph file gives, if there is one.
    pub fn shipped_file(&self, path: &Path) -> Option<PathBuf> {
        self.shipped?(path)
    }

    /// A kind by name.
    pub fn get(&self, kind: &str) -> Option<&Arc<NodeKind>> {
        self.kinds.get(kind)
    }

    /// Role of a kind, by its name.
    pub fn role(&self, kind: &str) -> Option<Role> {
        self.get(kind)?.descriptor().role
    }

    /// Names of the kinds with a role, in the order in which they were added.
    pub fn with_role(&self, role: Role) -> impl Iterator<Item = &str> + Clone {
        self.order.iter().map(String::as_str).filter(move |kind| self.role(kind) == Some(role))
    }

    /// All kinds, by name.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<NodeKind>> {
        self.kinds.values()
    }

    /// Kinds that render an effect of surfaces, in the order in which they were added.
    pub fn effects(&self) -> impl Iterator<Item = (&str, &Effect)> {
        let kinds = self.order.iter().filter_map(|name| self.kinds.get(name));
        kinds.filter_map(|kind| {
            let descriptor = kind.descriptor();
            Some((descriptor.kind.as_ref(), descriptor.effect.as_ref()?))
        })
    }

    /// The names of all kinds.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.kinds.keys().map(String::as_str)
    }
}
