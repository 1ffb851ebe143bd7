//! What a setting differs in from its graph, as RON to be pasted.

use asperity_graph::GraphFile;

use crate::result::Fragment;

impl Fragment {
    /// What of `setting` is not in `base`.
    pub fn between(base: &GraphFile, setting: &GraphFile) -> Self {
        let mut graph = Vec::new();
        for (name, before, now) in
            [("tick_hz", base.tick_hz, setting.tick_hz), ("audio_hz", base.audio_hz, setting.audio_hz)]
        {
            if before != now {
                graph.push(format!("{name}: {now},"));
            }
        }
        let texts = |g: &GraphFile| -> Vec<String> { g.nodes.iter().map(ToString::to_string).collect() };
        let before = texts(base);
        let nodes = texts(setting).into_iter().filter(|node| !before.contains(node)).collect();
        let gone =
            base.nodes.iter().filter(|n| setting.node(&n.id).is_none()).map(|n| n.id.clone()).collect();
        let wires = |g: &GraphFile| -> Vec<String> { g.wires.iter().map(ToString::to_string).collect() };
        let (before, now) = (wires(base), wires(setting));
        Self { graph, nodes, gone, wires: if before == now { Vec::new() } else { now } }
    }

    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// As it would be pasted into a graph file, with comments that say where.
impl std::fmt::Display for Fragment {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for line in &self.graph {
            writeln!(f, "    {line}")?;
        }
        if !self.nodes.is_empty() {
            writeln!(f, "    // within `nodes`, in the place of those of the same names:")?;
        }
        for node in &self.nodes {
            writeln!(f, "        {node}")?;
        }
        if !self.gone.is_empty() {
            writeln!(f, "    // no longer there: {}", self.gone.join(", "))?;
        }
        if !self.wires.is_empty() {
            writeln!(f, "    wires: [")?;
            for wire in &self.wires {
                writeln!(f, "        {wire}")?;
            }
            writeln!(f, "    ],")?;
        }
        Ok(())
    }
}
