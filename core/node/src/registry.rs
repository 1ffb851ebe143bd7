//! The node kinds of a host.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::{Effect, Node, NodeKind, Role};

/// Node kinds by name.
#[derive(Clone, Default)]
pub struct Registry {
    kinds: BTreeMap<String, Arc<NodeKind>>,
    shipped: Option<fn(&Path) -> Option<PathBuf>>,
    /// Names in the order in which they were added, with their stages.
    order: Vec<(String, &'static str)>,
    stage: &'static str,
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

    /// Names the stage of the chain to which the kinds that follow belong.
    #[must_use]
    pub fn stage(self, stage: &'static str) -> Self {
        Self { stage, ..self }
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
            self.order.push((name, self.stage));
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
        self.in_order().filter_map(move |(_, kind)| {
            let d = kind.descriptor();
            (d.role == Some(role)).then_some(d.kind.as_ref())
        })
    }

    /// All kinds, by name.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<NodeKind>> {
        self.kinds.values()
    }

    /// All kinds with their stages, in the order in which they were added.
    pub fn in_order(&self) -> impl Iterator<Item = (&'static str, &Arc<NodeKind>)> + Clone {
        self.order.iter().filter_map(|(name, stage)| Some((*stage, self.kinds.get(name)?)))
    }

    /// Kinds that render an effect of surfaces, in the order in which they were added.
    pub fn effects(&self) -> impl Iterator<Item = (&str, &Effect)> {
        self.in_order().filter_map(|(_, kind)| {
            let descriptor = kind.descriptor();
            Some((descriptor.kind.as_ref(), descriptor.effect.as_ref()?))
        })
    }

    /// The names of all kinds.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.kinds.keys().map(String::as_str)
    }
}
