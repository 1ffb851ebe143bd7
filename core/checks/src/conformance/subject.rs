//! The kind that is checked, and what the checks are given.

use std::cell::OnceCell;
use std::sync::Arc;

use asperity_node::{LayoutSpec, NodeKind, ShapeSpec};

use crate::conformance::place::{Conditions, Place};
use crate::conformance::signal::Signal;
use crate::conformance::stand::Stand;

/// Memory that the calling thread took and gave back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Touched {
    /// How often memory was allocated, or its size changed.
    pub taken: u64,
    /// How often memory was freed.
    pub freed: u64,
}

/// Counts what the calling thread does to the heap.
pub trait Heap {
    /// Counts from 0 on.
    fn begin(&self);
    /// Stops counting.
    fn end(&self) -> Touched;
}

/// Hears how a check goes on.
pub trait Witness {
    /// The node answers; called now and then.
    fn alive(&self) {}
    /// What is done next.
    fn doing(&self, _what: &str) {}
}

/// Hears nothing.
#[derive(Clone, Copy, Debug)]
pub struct Nobody;

impl Witness for Nobody {}

/// A kind to be checked.
pub struct Subject<'a> {
    pub(crate) kind: Arc<dyn NodeKind>,
    pub(crate) settings: Vec<(String, String)>,
    pub(crate) ticks: u64,
    pub(crate) heap: Option<&'a dyn Heap>,
    witness: &'a dyn Witness,
    main: OnceCell<Result<Place, String>>,
}

impl std::fmt::Debug for Subject<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Subject").field("kind", &self.kind.descriptor().kind).finish_non_exhaustive()
    }
}

impl<'a> Subject<'a> {
    /// A kind with all its parameters at their defaults, 100 000 random ticks, no heap that is counted.
    pub fn new(kind: Arc<dyn NodeKind>) -> Self {
        let main = OnceCell::new();
        Self { kind, settings: Vec::new(), ticks: 100_000, heap: None, witness: &Nobody, main }
    }

    /// Sets a parameter, as text in a graph file.
    #[must_use]
    pub fn set(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.settings.push((name.into(), value.into()));
        self
    }

    /// How many random ticks there are.
    #[must_use]
    pub fn ticks(mut self, ticks: u64) -> Self {
        self.ticks = ticks;
        self
    }

    /// What counts the heap.
    #[must_use]
    pub fn heap(mut self, heap: &'a dyn Heap) -> Self {
        self.heap = Some(heap);
        self
    }

    /// Who hears how it goes on.
    #[must_use]
    pub fn witness(mut self, witness: &'a dyn Witness) -> Self {
        self.witness = witness;
        self
    }

    /// The same kind with one more setting, in place of one of that name.
    pub(crate) fn with(&self, name: &str, value: String) -> Self {
        let mut settings = self.settings.clone();
        settings.retain(|(n, _)| n != name);
        settings.push((name.to_owned(), value));
        let (kind, main) = (self.kind.clone(), OnceCell::new());
        Self { kind, settings, ticks: self.ticks, heap: self.heap, witness: self.witness, main }
    }

    pub(crate) fn alive(&self) {
        self.witness.alive();
    }

    pub(crate) fn doing(&self, what: &str) {
        self.witness.doing(what);
    }

    /// The place where most cases put the kind: the first of a few that it takes.
    ///
    /// # Errors
    /// Why it takes none.
    pub(crate) fn main(&self) -> Result<&Place, String> {
        self.main.get_or_init(|| self.find_main()).as_ref().map_err(Clone::clone)
    }

    fn find_main(&self) -> Result<Place, String> {
        let first = Conditions::default();
        let control = Conditions { like: ShapeSpec::Control(2), ..first };
        let whole = Conditions { frames: (2500, 250, 126), ..first };
        let frames = Conditions { like: ShapeSpec::Magnitude(LayoutSpec::Of('l')), ..first };
        let settled = Place::settle(self, &first);
        match settled {
            Ok(place) => Ok(place),
            // What is said of the first is what most would have to be told.
            Err(e) => [control, whole, frames].iter().find_map(|c| Place::settle(self, c).ok()).ok_or(e),
        }
    }

    /// A new instance in the main place.
    pub(crate) fn stand(&'a self, signal: Signal) -> Result<Stand<'a>, String> {
        self.main()?.stand(self, signal, false)
    }

    /// The name of an output.
    pub(crate) fn output_name(&self, output: usize) -> String {
        let names = self.main().map(|p| p.output_names.as_slice()).unwrap_or_default();
        names.get(output).cloned().unwrap_or_default()
    }
}
