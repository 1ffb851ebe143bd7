//! Writes a graph as a file, ready to edit.

use std::fmt;

use asperity_diagnostics::ron::quoted;

use crate::{GraphFile, NodeDecl, WireDecl};

/// The graph in its file format. Reading it back gives the same graph.
impl fmt::Display for GraphFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { tick_hz, audio_hz, seed, .. } = self;
        writeln!(f, "Graph(\n    version: 1,\n    tick_hz: {tick_hz},\n    audio_hz: {audio_hz},")?;
        writeln!(f, "    seed: {seed},")?;
        if !self.plugins.is_empty() {
            let names: Vec<_> = self.plugins.iter().map(|p| quoted(&p.name)).collect();
            writeln!(f, "    plugins: [{}],", names.join(", "))?;
        }
        writeln!(f, "    nodes: {{")?;
        self.nodes.iter().try_for_each(|node| writeln!(f, "        {node}"))?;
        writeln!(f, "    }},\n    wires: [")?;
        self.wires.iter().try_for_each(|wire| writeln!(f, "        {wire}"))?;
        writeln!(f, "    ],\n)")
    }
}

/// The node's entry in a graph's map of nodes, with a comma.
impl fmt::Display for NodeDecl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: (kind: {:?}", self.id, self.kind)?;
        if self.every != 1 {
            write!(f, ", every: {}", self.every)?;
        }
        if !self.params.is_empty() {
            let settings: Vec<_> = self.params.iter().map(|s| format!("{}: {}", s.name, s.value)).collect();
            write!(f, ", params: ({})", settings.join(", "))?;
        }
        f.write_str("),")
    }
}

/// The wire's entry in a graph's list of wires, with a comma.
impl fmt::Display for WireDecl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = |e: &crate::Endpoint| match &e.port {
            Some(port) => format!("{}.{port}", e.node),
            None => e.node.clone(),
        };
        write!(f, "({:?}, {:?}),", end(&self.from), end(&self.to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_diagnostics::Source;

    #[test]
    fn written_graph_reads_back_the_same() {
        let text = r#"Graph(version: 1, tick_hz: 1000, plugins: ["a", "../b.so"], nodes: {
            "a b": (kind: "k", every: 2,
                    params: (x: 1.5, t: "q\"\n\u{7f}é", l: [1, 2.0], m: {"k": (y: zig)})),
            "c": (kind: "d")}, wires: [("a b.out", "c")])"#;
        let first = GraphFile::parse(&Source::new("a", text)).unwrap();
        let written = first.to_string();
        let again = GraphFile::parse(&Source::new("b", written.as_str())).unwrap();
        assert_eq!(written, again.to_string());
        assert_eq!(again.nodes[0].params[1].value.text().unwrap(), "q\"\n\u{7f}é");
        assert_eq!(again.plugins.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["a", "../b.so"]);
        assert_eq!((again.tick_hz, again.nodes[0].every), (1000, 2));
    }
}
