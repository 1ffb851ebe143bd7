//! Methods of phase retrieval, as the command line names them.

use asperity_diagnostics::{Source, one_of};
use asperity_graph::{GraphFile, NodeDecl};
use asperity_node::{Descriptor, NodeKind, Registry};

use super::offline::{OFFLINE, Offline};
use crate::failure::{Failure, wrong};

/// The graph whose phase-retrieval node is `default`, and its name in errors.
const SHIPPED: (&str, &str) = ("texture.ron (shipped)", include_str!("../../../../graphs/texture.ron"));

/// The option that names methods, for errors.
pub(super) const OPTION: &str = "--phase";

/// The node's id in a chain.
pub(super) const ID: &str = "phase";

/// Kinds of a registry that retrieve phase, by name.
pub fn retrievers(registry: &Registry) -> Vec<&Descriptor> {
    registry.iter().map(|k| NodeKind::descriptor(k)).filter(|d| d.retrieval().is_some()).collect()
}

/// A way to retrieve phase, with its settings.
#[derive(Clone, Debug)]
pub struct Method {
    /// The text that names it.
    pub label: String,
    /// The node or the offline method.
    pub how: How,
}

/// A node or an offline method.
#[derive(Clone, Debug)]
pub enum How {
    /// A node, as a graph declares it.
    Node(Box<NodeDecl>),
    /// A method that needs all frames at once.
    Offline(Offline),
}

impl Method {
    /// Parses `KIND` or `KIND:param=value,...`. KIND may be an offline method, or `default`: the node of
    /// the shipped graph, with its settings. [`Chain::new`](super::Chain::new) checks the parameters of a
    /// node.
    ///
    /// # Errors
    /// The kind does not exist or does not retrieve phase; a setting has no `=`.
    pub fn parse(text: &str, registry: &Registry) -> Result<Self, Failure> {
        let (kind, settings) = text.split_once(':').unwrap_or((text, ""));
        if let Some(offline) = Offline::parse(kind, settings) {
            return Ok(Self { label: text.to_owned(), how: How::Offline(offline?) });
        }
        let kinds: Vec<&str> = retrievers(registry).into_iter().map(|d| d.kind.as_ref()).collect();
        let mut graph = GraphFile::empty(OPTION);
        if kind == "default" {
            let shipped = GraphFile::parse(&Source::new(SHIPPED.0, SHIPPED.1))?;
            let node = shipped.nodes.iter().find(|n| kinds.contains(&n.kind.as_str()));
            let node =
                node.ok_or_else(|| Failure::Machine("the shipped graph has no phase retrieval".into()))?;
            graph.nodes.push(NodeDecl { id: ID.into(), ..node.clone() });
        } else if kinds.contains(&kind) {
            graph.add_node(ID, kind, &[], OPTION)?;
        } else {
            let names = kinds.iter().copied().chain(["default"]).chain(OFFLINE);
            return Err(wrong(OPTION, format!("`{kind}` is no phase-retrieval node"), one_of(kind, names)));
        }
        for setting in settings.split(',').filter(|s| !s.trim().is_empty()) {
            graph.set(&format!("{ID}.{}", setting.trim()), OPTION)?;
        }
        let node = graph.nodes.pop().ok_or_else(|| Failure::Machine("the node is gone".into()))?;
        Ok(Self { label: text.to_owned(), how: How::Node(Box::new(node)) })
    }

    /// Kind of the node, or name of the offline method.
    pub fn kind(&self) -> &str {
        match &self.how {
            How::Node(node) => &node.kind,
            How::Offline(_) => self.label.split(':').next().unwrap_or(&self.label),
        }
    }
}
