//! Small graphs that a case builds itself: of the subject's kinds, and of what the case plays into them.

use std::sync::Arc;

use asperity_graph::GraphFile;
use asperity_node::{Descriptor, NodeKind};

use crate::case::Not;
use crate::rig::Rig;
use crate::subject::Subject;

/// What errors call it.
const ORIGIN: &str = "the case";

/// Whether a graph has to set a parameter of a kind beside these: no case knows to what.
pub(crate) fn has_to_be_set(d: &Descriptor, beside: &[&str]) -> bool {
    d.params.iter().any(|p| p.default.is_none() && !p.optional && !beside.contains(&&*p.name))
}

/// A graph in the making.
#[derive(Clone)]
pub struct Small {
    /// What there is of it.
    pub graph: GraphFile,
    /// Kinds of the case's own.
    pub kinds: Vec<Arc<dyn NodeKind>>,
}

impl Small {
    /// An empty graph of these rates \[Hz\].
    pub fn new(tick_hz: u32, audio_hz: u32) -> Self {
        let mut graph = GraphFile::empty(ORIGIN);
        (graph.tick_hz, graph.audio_hz) = (tick_hz, audio_hz);
        Self { graph, kinds: Vec::new() }
    }

    /// A node of the subject's, with parameters as RON texts.
    ///
    /// # Errors
    /// A text that is no value, an id that is taken.
    pub fn node(mut self, id: &str, kind: &str, params: &[(&str, &str)]) -> Result<Self, Not> {
        self.graph.add_node(id, kind, params, ORIGIN)?;
        Ok(self)
    }

    /// A node that plays what the case wants.
    ///
    /// # Errors
    /// An id that is taken.
    pub fn plays(mut self, id: &str, kind: Arc<dyn NodeKind>) -> Result<Self, Not> {
        self.graph.add_node(id, &kind.descriptor().kind, &[], ORIGIN)?;
        self.kinds.push(kind);
        Ok(self)
    }

    /// A wire.
    #[must_use]
    pub fn wire(mut self, from: &str, to: &str) -> Self {
        self.graph.add_wire(from, to, ORIGIN);
        self
    }

    /// Wires from each to the next.
    #[must_use]
    pub fn chain(self, ends: &[&str]) -> Self {
        ends.windows(2).fold(self, |all, pair| all.wire(pair[0], pair[1]))
    }

    /// Compiles it.
    ///
    /// # Errors
    /// What the compiler says.
    pub fn rig(&self, subject: &Subject<'_>) -> Result<Rig, Not> {
        Rig::of(subject, &self.graph, &self.kinds)
    }
}
