//! The node kinds of a host.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::sync::Arc;

use crate::{Config, Descriptor, Diagnostic, Effect, Node, NodeKind, Ports, Processor, Role, Setup};

/// Node kinds by name.
#[derive(Clone, Default)]
pub struct Registry {
    kinds: BTreeMap<String, Arc<dyn NodeKind>>,
    /// Names in the order in which they were added.
    order: Vec<String>,
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
        self.add(Arc::new(Built { descriptor: N::descriptor(), node: PhantomData::<fn() -> N> }));
        self
    }

    /// Adds a kind, replacing one of the same name. Returns the replaced one.
    pub fn add(&mut self, kind: Arc<dyn NodeKind>) -> Option<Arc<dyn NodeKind>> {
        let name = kind.descriptor().kind.to_string();
        let before = self.kinds.insert(name.clone(), kind);
        if before.is_none() {
            self.order.push(name);
        }
        before
    }

    /// A kind by name.
    pub fn get(&self, kind: &str) -> Option<&Arc<dyn NodeKind>> {
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
    pub fn iter(&self) -> impl Iterator<Item = &Arc<dyn NodeKind>> {
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

/// A kind made from a node type of this program.
struct Built<N> {
    descriptor: Descriptor,
    node: PhantomData<fn() -> N>,
}

impl<N: Node> NodeKind for Built<N> {
    fn descriptor(&self) -> &Descriptor {
        &self.descriptor
    }

    fn ports(&self, config: &Config<'_>) -> Result<Ports, Diagnostic> {
        N::ports(
            config,
            Ports { inputs: self.descriptor.inputs.clone(), outputs: self.descriptor.outputs.clone() },
        )
    }

    fn prepare(&self, setup: &Setup<'_>) -> Result<Box<dyn Processor>, Diagnostic> {
        Ok(Box::new(N::prepare(setup)?))
    }
}
