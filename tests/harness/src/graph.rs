//! Graphs from texts, compiled for this process. Whatever is wrong panics with all that the compiler says.

use std::path::Path;

use asperity_diagnostics::Source;
use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, GraphFile, compile};
use asperity_node::Registry;
use asperity_scene::{Lowering, Scene, lower};

/// A graph from a file's text.
pub fn parsed(text: impl Into<String>) -> GraphFile {
    GraphFile::parse(&Source::new("test.ron", text.into())).unwrap_or_else(|e| panic!("{e}"))
}

/// A graph from its nodes and wires, as a file has them between the braces.
pub fn of(nodes: &str, wires: &str) -> GraphFile {
    parsed(format!("Graph(version: 1, nodes: {{{nodes}}}, wires: [{wires}])"))
}

/// A graph of `id: kind(params) every 2` and `from -> to -> on`, each on a line or before a semicolon.
pub fn of_lines(lines: &str) -> GraphFile {
    let (mut nodes, mut wires) = (String::new(), String::new());
    for line in lines.split(['\n', ';']).map(str::trim).filter(|l| !l.is_empty()) {
        let ends: Vec<&str> = line.split(" -> ").collect();
        if let [_, _, ..] = ends[..] {
            wires.extend(ends.windows(2).map(|w| format!("({:?}, {:?}), ", w[0], w[1])));
        } else {
            let (id, rest) = line.split_once(": ").expect("id: kind");
            let (rest, every) = rest.split_once(" every ").unwrap_or((rest, "1"));
            let (kind, params) = rest.split_once('(').map_or((rest, ""), |(k, p)| (k, &p[..p.len() - 1]));
            nodes += &format!("{id:?}: (kind: {kind:?}, params: ({params}), every: {every}), ");
        }
    }
    of(&nodes, &wires)
}

/// The graph of a scene in a file.
pub fn lowered(scene: &Path) -> GraphFile {
    let scene = Scene::read(scene).unwrap_or_else(|e| panic!("{e}"));
    lower(&scene, &crate::registry(), Lowering::default()).expect("a graph").graph
}

/// The graph's schedule and nodes.
pub fn compiled(graph: &GraphFile, registry: &Registry) -> Compiled {
    compile(graph, registry, asperity_graph::Options::default())
        .unwrap_or_else(|e| panic!("{}", e.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")))
}

/// An engine that runs the graph.
pub fn engine(graph: &GraphFile, registry: &Registry) -> Engine {
    Engine::new(compiled(graph, registry), Options::default())
}
