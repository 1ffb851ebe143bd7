//! What is looked at.

use std::sync::Arc;

use asperity_graph::{Compiled, GraphFile, compile};
use asperity_node::{NodeKind, Registry};

use crate::case::{Not, not_applicable};

/// How long a case may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effort {
    /// A second or less: as often as one likes.
    Quick,
    /// Some seconds: with the other tests.
    Full,
    /// As long as it takes: minutes and more.
    Long,
}

/// Kinds of nodes, and the graph that they stand in.
#[derive(Clone, Debug)]
pub struct Subject<'a> {
    registry: Registry,
    graph: Option<&'a GraphFile>,
    effort: Effort,
}

impl<'a> Subject<'a> {
    /// Kinds alone.
    pub fn new(registry: Registry) -> Self {
        Self { registry, graph: None, effort: Effort::Quick }
    }

    /// With a graph, of these kinds.
    #[must_use]
    pub fn graph(mut self, graph: &'a GraphFile) -> Self {
        self.graph = Some(graph);
        self
    }

    /// How long a case may take; [`Effort::Quick`] unless this says otherwise.
    #[must_use]
    pub fn effort(mut self, effort: Effort) -> Self {
        self.effort = effort;
        self
    }

    /// The same with another kind in the place of one of its name: what a mutant is made of.
    #[must_use]
    pub fn with(mut self, kind: Arc<dyn NodeKind>) -> Self {
        self.registry.add(kind);
        self
    }

    /// All kinds.
    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    /// A kind by its name.
    ///
    /// # Errors
    /// There is no such kind.
    pub fn kind(&self, name: &str) -> Result<Arc<dyn NodeKind>, Not> {
        self.registry.get(name).cloned().ok_or_else(|| Not::Applicable(format!("there is no kind `{name}`")))
    }

    /// The graph.
    ///
    /// # Errors
    /// There is none: the case says nothing.
    pub fn its_graph(&self) -> Result<&'a GraphFile, Not> {
        self.graph.map_or_else(|| not_applicable("no graph was given"), Ok)
    }

    /// How long it may take.
    pub fn allowed(&self) -> Effort {
        self.effort
    }

    /// One of three numbers, by how long it may take.
    pub fn by_effort<T>(&self, quick: T, full: T, long: T) -> T {
        match self.effort {
            Effort::Quick => quick,
            Effort::Full => full,
            Effort::Long => long,
        }
    }

    /// Compiles a graph of these kinds, and of more where a case brings its own.
    ///
    /// # Errors
    /// What the compiler says.
    pub fn compile(
        &self,
        graph: &GraphFile,
        more: &[Arc<dyn NodeKind>],
    ) -> Result<Compiled, Vec<asperity_diagnostics::Diagnostic>> {
        let mut registry = self.registry.clone();
        for kind in more {
            registry.add(kind.clone());
        }
        compile(graph, &registry, Default::default())
    }

    /// The same, with what the compiler says in one line.
    ///
    /// # Errors
    /// That line.
    pub fn compiled(&self, graph: &GraphFile, more: &[Arc<dyn NodeKind>]) -> Result<Compiled, String> {
        let told = |errors: Vec<asperity_diagnostics::Diagnostic>| {
            errors.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
        };
        self.compile(graph, more).map_err(told)
    }
}
