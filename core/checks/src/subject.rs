//! The kinds and the graph that cases look at.

use std::cell::OnceCell;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, ron};
use asperity_graph::{Compiled, GraphFile, compile};
use asperity_node::{Descriptor, NodeKind, Registry};

use crate::case::{Stop, not_applicable};
use crate::node::Place;

/// How long a case may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effort {
    /// A second or less.
    Quick,
    /// Some seconds.
    Full,
    /// Minutes and more.
    Long,
}

/// How often the calling thread used the heap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Touched {
    /// Allocations and changes of size.
    pub taken: u64,
    /// Frees.
    pub freed: u64,
}

/// Counts the allocations of the calling thread.
pub trait Heap {
    /// Starts to count, from 0.
    fn begin(&self);
    /// Stops, and answers the counts.
    fn end(&self) -> Touched;
}

/// Hears about the progress of a case over one kind.
pub trait Witness {
    /// The node answers. Called now and then.
    fn alive(&self) {}
    /// The next step.
    fn doing(&self, _what: &str) {}
}

/// The list of an effect with the examples of its forms.
fn examples(d: &Descriptor) -> Vec<(String, String)> {
    let Some(effect) = &d.effect else { return Vec::new() };
    let complete = |text: &&str| {
        let value = ron::parse(&Source::new("example", *text)).ok();
        let settings = value.and_then(|value| effect.read(&d.kind, &value).ok());
        settings.is_some_and(|settings| settings.files().is_empty())
    };
    let texts = effect.forms.iter().map(|form| form.example.as_ref()).filter(complete);
    let list = texts.map(ron::quoted).collect::<Vec<_>>().join(", ");
    vec![(effect.list.to_string(), format!("[{list}]"))]
}

/// Kinds of nodes, and perhaps a graph of them. Cases of the family `node` look at one kind only.
#[derive(Clone)]
pub struct Subject<'a> {
    /// All kinds.
    pub registry: Registry,
    /// A graph of these kinds.
    pub graph: Option<&'a GraphFile>,
    /// How long a case may take.
    pub effort: Effort,
    /// Number of random ticks.
    pub ticks: u64,
    /// Counts allocations.
    pub heap: Option<&'a dyn Heap>,
    /// Hears about the progress.
    pub witness: Option<&'a dyn Witness>,
    one: Option<Arc<NodeKind>>,
    pub(crate) settings: Vec<(String, String)>,
    pub(crate) main: OnceCell<Result<Place, String>>,
}

impl std::fmt::Debug for Subject<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let one = self.one.as_ref().map(|kind| &kind.descriptor().kind);
        f.debug_struct("Subject").field("graph", &self.graph).field("one", &one).finish_non_exhaustive()
    }
}

impl<'a> Subject<'a> {
    /// Kinds without a graph. Each case takes a second or less, and 100 000 random ticks.
    pub fn new(registry: Registry) -> Self {
        Self {
            registry,
            graph: None,
            effort: Effort::Quick,
            ticks: 100_000,
            heap: None,
            witness: None,
            one: None,
            settings: Vec::new(),
            main: OnceCell::new(),
        }
    }

    /// One kind, for the cases of [`node_cases`](crate::node_cases). Its parameters have their defaults.
    /// An effect has a slot for each form whose example names no file.
    pub fn one(kind: Arc<NodeKind>) -> Self {
        let settings = examples(kind.descriptor());
        Self { one: Some(kind), settings, ..Self::new(Registry::new()) }
    }

    /// Sets the effort.
    #[must_use]
    pub fn effort(self, effort: Effort) -> Self {
        Self { effort, ..self }
    }

    /// Adds a kind, or replaces the one of its name.
    #[must_use]
    pub fn with(mut self, kind: Arc<NodeKind>) -> Self {
        self.registry.add(kind);
        self
    }

    /// Sets a parameter of the one kind, as text of a graph file. It replaces an earlier value.
    #[must_use]
    pub fn set(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        let name = name.into();
        self.settings.retain(|(known, _)| *known != name);
        self.settings.push((name, value.into()));
        self.main = OnceCell::new();
        self
    }

    /// A kind by its name.
    ///
    /// # Errors
    /// There is no such kind.
    pub fn kind(&self, name: &str) -> Result<Arc<NodeKind>, Stop> {
        let kind = self.registry.get(name).cloned();
        kind.ok_or_else(|| Stop::NotApplicable(format!("there is no kind `{name}`")))
    }

    /// The one kind.
    pub(crate) fn its_kind(&self) -> Result<&Arc<NodeKind>, Stop> {
        self.one.as_ref().map_or_else(|| not_applicable("no kind was given"), Ok)
    }

    /// The graph.
    ///
    /// # Errors
    /// None was given.
    pub fn its_graph(&self) -> Result<&'a GraphFile, Stop> {
        self.graph.map_or_else(|| not_applicable("no graph was given"), Ok)
    }

    /// One of three values, by the effort.
    pub fn by_effort<T>(&self, quick: T, full: T, long: T) -> T {
        match self.effort {
            Effort::Quick => quick,
            Effort::Full => full,
            Effort::Long => long,
        }
    }

    pub(crate) fn alive(&self) {
        self.witness.iter().for_each(|w| w.alive());
    }

    pub(crate) fn doing(&self, what: &str) {
        self.witness.iter().for_each(|w| w.doing(what));
    }

    /// Compiles a graph of these kinds and of `more`.
    ///
    /// # Errors
    /// Those of the compiler.
    pub fn compile(&self, graph: &GraphFile, more: &[Arc<NodeKind>]) -> Result<Compiled, Vec<Diagnostic>> {
        let mut registry = self.registry.clone();
        for kind in more {
            registry.add(kind.clone());
        }
        compile(graph, &registry, Default::default())
    }

    /// The same, with the compiler's errors in one line.
    ///
    /// # Errors
    /// That line.
    pub fn compiled(&self, graph: &GraphFile, more: &[Arc<NodeKind>]) -> Result<Compiled, String> {
        let text = |errors: Vec<Diagnostic>| errors.iter().map(ToString::to_string).collect::<Vec<_>>();
        self.compile(graph, more).map_err(|errors| text(errors).join("; "))
    }
}
