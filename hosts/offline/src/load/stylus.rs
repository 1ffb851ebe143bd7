//! `--input`, `--hand` and `--loop`: replaces or changes the node that moves the stylus.

use std::path::Path;

use asperity_diagnostics::one_of;
use asperity_diagnostics::ron::quoted;
use asperity_graph::GraphFile;
use asperity_node::{Registry, Role};

use crate::failure::{Failure, wrong};

/// Name of a hand for `--hand`: that of its kind without `_input`.
pub fn hand_name(kind: &str) -> &str {
    kind.strip_suffix("_input").unwrap_or(kind)
}

/// Plays a recorded stroke in place of the graph's own: `--input TRAJ.csv`; without a file, one in memory.
///
/// # Errors
/// A graph without exactly one node that moves the stylus, or whose node does not fit.
pub fn play(graph: &mut GraphFile, registry: &Registry, file: Option<&Path>) -> Result<(), Failure> {
    let i = only(graph, registry, "--input", "name the one you mean: --set NODE.file=TRAJ.csv")?;
    replace(graph, registry, i, "trajectory", "--input");
    // They belong to the stroke before.
    graph.nodes[i].params.retain(|setting| !matches!(setting.name.as_str(), "map" | "loop" | "file"));
    if let Some(file) = file {
        graph.set(&format!("{}.file={}", graph.nodes[i].id, file.display()), "--input")?;
    }
    Ok(())
}

/// Repeats the recorded stroke: `--loop`.
///
/// # Errors
/// A graph without exactly one node that moves the stylus, or whose node does not fit.
pub fn repeat(graph: &mut GraphFile, registry: &Registry) -> Result<(), Failure> {
    let i = only(graph, registry, "--loop", "name the one you mean: --set NODE.loop=true")?;
    let (id, kind) = (&graph.nodes[i].id, &graph.nodes[i].kind);
    if kind != "trajectory" {
        let what = format!("--loop repeats a recorded stroke, and `{id}` ({kind}) is none");
        let help =
            format!("play a recorded one: --input STROKE.csv; or a longer one: --set {id}.duration_s=S");
        return Err(wrong(graph.source.path(), what, help));
    }
    graph.set(&format!("{id}.loop=true"), "--loop")?;
    Ok(())
}

/// Names the columns of the stroke that is played: `--map force_n=Fz:N`.
///
/// # Errors
/// A graph without exactly one node that moves the stylus, or whose node does not fit.
pub fn map(graph: &mut GraphFile, registry: &Registry, map: &[String]) -> Result<(), Failure> {
    let i = only(graph, registry, "--map", "name the one you mean: --set 'NODE.map=[\"force_n=Fz:N\"]'")?;
    if graph.nodes[i].kind != "trajectory" {
        let what = "no file is played whose columns could be mapped";
        return Err(wrong("--map", what, "play one: --input TRAJ.csv"));
    }
    let list: Vec<String> = map.iter().map(|text| quoted(text)).collect();
    graph.set(&format!("{}.map=[{}]", graph.nodes[i].id, list.join(", ")), "--map")?;
    Ok(())
}

/// Lets a hand move the stylus: `--hand KIND[:param=value,...]`, where KIND may lack its `_input`.
///
/// # Errors
/// A graph without exactly one node that moves the stylus, or whose node does not fit.
pub fn take_in_hand(graph: &mut GraphFile, registry: &Registry, text: &str) -> Result<(), Failure> {
    let (name, settings) = text.split_once(':').unwrap_or((text, ""));
    let mut hands = registry.with_role(Role::Hand);
    let names = hands.clone().map(hand_name);
    let Some(kind) = hands.find(|kind| *kind == name || hand_name(kind) == name) else {
        return Err(wrong("--hand", format!("there is no hand `{name}`"), one_of(name, names)));
    };
    let i = only(graph, registry, "--hand", "edit the graph: make the node you mean of that kind")?;
    replace(graph, registry, i, kind, "--hand");
    let id = graph.nodes[i].id.clone();
    let mut before = "PARAM";
    for setting in settings.split(',').map(str::trim).filter(|s| !s.is_empty()) {
        let Some((param, _)) = setting.split_once('=') else {
            // Probably the rest of a value with commas.
            let what = format!("there is no `=` in `{setting}`: commas stand between settings");
            let set = format!("--set {id}.{before}=VALUE");
            return Err(wrong(
                "--hand",
                what,
                format!("KIND:param=value,param=value; a value with commas goes by {set}"),
            ));
        };
        graph.set(&format!("{id}.{setting}"), "--hand")?;
        before = param;
    }
    Ok(())
}

fn only(graph: &GraphFile, registry: &Registry, option: &str, help: &str) -> Result<usize, Failure> {
    let moves = |kind: &str| matches!(registry.role(kind), Some(Role::Stroke | Role::Hand));
    let found: Vec<usize> = (0..graph.nodes.len()).filter(|&i| moves(&graph.nodes[i].kind)).collect();
    if let &[i] = found.as_slice() {
        return Ok(i);
    }
    let names: Vec<String> = found.iter().map(|&i| format!("`{}`", graph.nodes[i].id)).collect();
    let found = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let message = format!("{option} takes the place of one trajectory, stroke or hand; found {found}");
    Err(wrong(graph.source.path(), message, help))
}

/// Gives the node that moves the stylus another kind, without the parameters of its old kind. `option` asked
/// for it.
fn replace(graph: &mut GraphFile, registry: &Registry, i: usize, kind: &str, option: &str) {
    let (id, before) = (graph.nodes[i].id.clone(), graph.nodes[i].kind.clone());
    if before == kind {
        return;
    }
    graph.nodes[i].kind = kind.into();
    graph.nodes[i].params.clear();
    // A stroke has one output, which needs no name; the other kinds have several.
    for wire in graph.wires.iter_mut().filter(|w| w.from.node == id) {
        wire.from.port.get_or_insert_with(|| "position".to_owned());
    }
    let outputs = registry.get(kind).map(|kind| &kind.descriptor().outputs);
    if !outputs.is_some_and(|all| all.iter().any(|output| output.name == "stroke")) {
        graph.wires.retain(|w| w.from.node != id || w.from.port.as_deref() != Some("stroke"));
        return;
    }
    // A stylus may be put down elsewhere: its port `stroke` tells the nodes below that this is no motion.
    let positions = graph.wires.iter().filter(|w| w.from.node == id && wired(&w.from.port, "position"));
    let followers: Vec<(String, String)> = positions
        .filter_map(|w| {
            let kind = registry.get(&graph.node(&w.to.node)?.kind)?;
            let inputs = &kind.descriptor().inputs;
            inputs.iter().any(|input| input.name == "stroke").then_some(())?;
            Some((w.to.node.clone(), inputs.first()?.name.to_string()))
        })
        .collect();
    for (follower, first) in followers {
        if !graph.wires.iter().any(|w| w.to.node == follower && wired(&w.to.port, "stroke")) {
            graph.add_wire(&format!("{id}.stroke"), &format!("{follower}.stroke"), option);
        }
        // With a second input, the first needs its name.
        for wire in graph.wires.iter_mut().filter(|w| w.from.node == id && w.to.node == follower) {
            wire.to.port.get_or_insert_with(|| first.clone());
        }
    }
}

fn wired(port: &Option<String>, name: &str) -> bool {
    port.as_deref() == Some(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinds::built_in;
    use asperity_diagnostics::Source;

    fn graph(text: &str) -> GraphFile {
        GraphFile::parse(&Source::new("test.ron", text)).expect("a graph")
    }

    fn wires(graph: &GraphFile) -> Vec<String> {
        let end = |e: &asperity_graph::Endpoint| match &e.port {
            Some(port) => format!("{}.{port}", e.node),
            None => e.node.clone(),
        };
        graph.wires.iter().map(|w| format!("{} -> {}", end(&w.from), end(&w.to))).collect()
    }

    const STROKE: &str = r#"Graph(version: 1, nodes: {"s": (kind: "stroke", params: (speed_mm_s: 80.0)),
        "v": (kind: "velocity"), "f": (kind: "virtual_floor")}, wires: [("s", "v"), ("s", "f")])"#;

    #[test]
    fn hand_replaces_stroke_and_back() {
        let mut it = graph(STROKE);
        take_in_hand(&mut it, &built_in(), "pointer:depth_mm=3, lift_mm=1").expect("it fits");
        assert_eq!(it.nodes[0].kind, "pointer_input");
        let set: Vec<&str> = it.nodes[0].params.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(set, ["depth_mm", "lift_mm"]);
        assert_eq!(wires(&it), ["s.position -> v.position", "s.position -> f", "s.stroke -> v.stroke"]);
        play(&mut it, &built_in(), Some(Path::new("a.csv"))).expect("it fits");
        assert_eq!(it.nodes[0].kind, "trajectory");
        assert_eq!(wires(&it), ["s.position -> v.position", "s.position -> f", "s.stroke -> v.stroke"]);
        assert_eq!(it.nodes[0].params.len(), 1);
    }

    #[test]
    fn hand_in_scene_wires_stroke_to_contact() {
        let text = r#"Graph(version: 1,
            nodes: {"s": (kind: "stroke"), "v": (kind: "velocity"), "c": (kind: "contact")},
            wires: [("s.position", "v.position"), ("s.position", "c.position"),
                ("v.spatial", "c.velocity")])"#;
        let mut it = graph(text);
        take_in_hand(&mut it, &built_in(), "pointer").expect("it fits");
        let all = wires(&it);
        assert!(
            ["s.stroke -> v.stroke", "s.stroke -> c.stroke"].iter().all(|w| all.iter().any(|a| a == w)),
            "{all:?}"
        );
    }

    #[test]
    fn unknown_hand_or_graph_without_stylus_is_refused() {
        let e = take_in_hand(&mut graph(STROKE), &built_in(), "pointr").expect_err("no such hand");
        assert!(e.text().contains("pointer"), "{}", e.text());
        let mut empty = graph(r#"Graph(version: 1, nodes: {})"#);
        let e = take_in_hand(&mut empty, &built_in(), "pointer").expect_err("no stylus");
        assert!(e.text().contains("found none"), "{}", e.text());
    }
}
