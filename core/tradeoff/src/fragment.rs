//! Differences of a setting from its graph's file, as RON to paste.

use std::path::{Component, Path, PathBuf};

use asperity_diagnostics::ron::{Kind, Value};
use asperity_graph::{GraphFile, NodeDecl};
use asperity_node::{ParamKind, Registry};
use asperity_scene::Scene;

use crate::knob::has;
use crate::results::Fragment;
use crate::setting::LoadedGraph;

impl Fragment {
    /// Differences of `setting` from the file of its graph. Paths are relative to the file's folder, or
    /// absolute.
    pub(crate) fn between(base: &LoadedGraph, setting: &GraphFile) -> Self {
        let file = &base.file;
        let fields = [
            ("tick_hz", u64::from(file.tick_hz), u64::from(setting.tick_hz)),
            ("audio_hz", u64::from(file.audio_hz), u64::from(setting.audio_hz)),
            ("seed", file.seed, setting.seed),
        ];
        let changed = fields.into_iter().filter(|(_, before, now)| before != now);
        let graph = changed.map(|(name, _, now)| format!("{name}: {now},")).collect();
        let home = file.source.path().parent().unwrap_or(Path::new(""));
        let text = |node: &NodeDecl| at_home(node, &base.registry, home).to_string();
        let before: Vec<String> = file.nodes.iter().map(text).collect();
        let new = setting.nodes.iter().map(|node| (node, text(node)));
        let new: Vec<(&NodeDecl, String)> = new.filter(|(_, text)| !before.contains(text)).collect();
        let mut plugins: Vec<(String, String)> = Vec::new();
        for (node, _) in &new {
            let Some(kind) = base.registry.get(&node.kind).filter(|kind| kind.build() != 0) else { continue };
            let from = Path::new(kind.origin());
            let of = (node.kind.clone(), name_of(from));
            if !file.plugins.iter().any(|decl| is_file_of(&decl.name, from)) && !plugins.contains(&of) {
                plugins.push(of);
            }
        }
        // Force outputs are removed from every graph before it is measured; in the file they stay.
        let measured = |id: &str| base.graph.node(id).is_some();
        let gone = file.nodes.iter().filter(|n| measured(&n.id) && setting.node(&n.id).is_none());
        let gone = gone.map(|n| n.id.clone()).collect();
        let wires = |g: &GraphFile| -> Vec<String> { g.wires.iter().map(ToString::to_string).collect() };
        let (before, now) = (wires(&base.graph), wires(setting));
        let apart = wires(file).into_iter().filter(|wire| !before.contains(wire));
        let wires = if before == now { Vec::new() } else { now.into_iter().chain(apart).collect() };
        let nodes = new.into_iter().map(|(_, text)| text).collect();
        Self { graph, nodes, gone, wires, plugins, scene: Scene::is_meant(&file.source) }
    }

    /// Whether there are no differences.
    pub fn is_empty(&self) -> bool {
        self.graph.is_empty() && self.nodes.is_empty() && self.gone.is_empty() && self.wires.is_empty()
    }
}

/// Name of a plugin on every machine: its file name without the prefix and suffix of this system.
fn name_of(file: &Path) -> String {
    let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let bare = name.strip_prefix(std::env::consts::DLL_PREFIX);
    let bare = bare.and_then(|bare| bare.strip_suffix(std::env::consts::DLL_SUFFIX));
    bare.map_or(name.clone(), str::to_owned)
}

/// Whether this name of a plugin in a graph means this file.
fn is_file_of(name: &str, file: &Path) -> bool {
    name_of(Path::new(name)) == name_of(file)
}

/// A node with its files named as a graph in this folder would name them.
fn at_home(node: &NodeDecl, registry: &Registry, home: &Path) -> NodeDecl {
    let mut node = node.clone();
    for setting in &mut node.params {
        // On the command line a text needs no quotes.
        let Some(text) = setting.value.text().ok().or(setting.typed.as_deref()) else { continue };
        let is_file = match has(registry, &node.kind, &setting.name) {
            Some(ParamKind::File) => true,
            // A profile is a name or a file.
            Some(ParamKind::Text) => setting.name == "profile" && text.ends_with(".ron"),
            _ => false,
        };
        // Paths on the command line are relative to the current folder.
        let from = match &setting.typed {
            Some(_) => Path::new(""),
            None => setting.value.source().path().parent().unwrap_or(Path::new("")),
        };
        if is_file && (setting.typed.is_some() || from != home) {
            // Relative to a folder that contains it; otherwise absolute.
            let path = tidy(&from.join(text));
            let path = path.strip_prefix(tidy(home)).unwrap_or(&path).display().to_string();
            setting.value = Value::made(Kind::Text(path), &setting.value.place());
        }
    }
    node
}

/// An absolute path without `FOLDER/..`.
pub(crate) fn tidy(path: &Path) -> PathBuf {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let mut out = PathBuf::new();
    for part in std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).components() {
        match part {
            Component::ParentDir => drop(out.pop()),
            Component::CurDir => {}
            part => out.push(part),
        }
    }
    out
}

/// Text to paste into a graph file, with comments that say where.
impl std::fmt::Display for Fragment {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (kind, name) in &self.plugins {
            writeln!(
                f,
                "    // `{kind}` is a plugin's: --plugin {name}, or in the graph: plugins: [{name:?}],\n    \
                 // with its folder on ASPERITY_PLUGIN_PATH"
            )?;
        }
        let mut lines: Vec<String> = self.graph.clone();
        if !self.nodes.is_empty() {
            lines.push("// in `nodes`, replacing those with the same names:".into());
        }
        lines.extend(self.nodes.iter().map(|node| format!("    {node}")));
        if !self.gone.is_empty() {
            lines.push(format!("// removed: {}", self.gone.join(", ")));
        }
        if !self.wires.is_empty() {
            let wires = self.wires.iter().map(|wire| format!("    {wire}"));
            lines.extend(["wires: [".into()].into_iter().chain(wires).chain(["],".into()]));
        }
        lines.iter().try_for_each(|line| writeln!(f, "    {line}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{graph_of, loaded};
    use asperity_diagnostics::Source;

    /// A graph of a file, changed by the command line.
    fn base(path: &str, set: &[&str]) -> LoadedGraph {
        let nodes = r#""stylus": (kind: "trajectory", params: (file: "a.csv")),
            "a": (kind: "gain", params: (gain: 2.0)), "pushes": (kind: "some_force")"#;
        let mut base = loaded(path, graph_of(path, nodes, r#"("stylus", "a"), ("a", "pushes")"#));
        base.graph.nodes.retain(|n| n.id != "pushes");
        base.graph.wires.retain(|w| w.to.node != "pushes");
        set.iter().for_each(|set| base.graph.set(set, "--set").unwrap());
        base
    }

    #[test]
    fn command_line_changes_are_in_the_fragment() {
        let base = base("g/g.ron", &["a.gain=3.0", "tick_hz=1000", "seed=7"]);
        let fragment = Fragment::between(&base, &base.graph);
        assert_eq!(fragment.nodes, [r#""a": (kind: "gain", params: (gain: 3.0)),"#]);
        assert_eq!(fragment.graph, ["tick_hz: 1000,", "seed: 7,"]);
        assert!(fragment.gone.is_empty() && fragment.wires.is_empty() && !fragment.scene, "{fragment:?}");
        let unchanged = self::base("g/g.ron", &[]);
        assert!(Fragment::between(&unchanged, &unchanged.graph).is_empty());
    }

    #[test]
    fn files_are_relative_to_the_folder_of_the_graph() {
        let here = std::env::current_dir().unwrap();
        let at = |path: &str| Some(here.join(path).display().to_string());
        let relative = |path: &str| Some(path.to_owned());
        for (graph, tradeoff, named, want) in [
            ("g/g.ron", "g/s.ron", "b.csv", relative("b.csv")),
            ("g/g.ron", "g/tradeoffs/s.ron", "b.csv", relative("tradeoffs/b.csv")),
            ("g/g.ron", "g/tradeoffs/s.ron", "../b.csv", relative("b.csv")),
            ("g/g.ron", "s.ron", "b.csv", at("b.csv")),
            ("g.ron", "x/../s.ron", "b.csv", relative("b.csv")),
            ("g/g.ron", "s.ron", "/c.csv", relative("/c.csv")),
            // The same file by another path is no difference.
            ("g/g.ron", "g/tradeoffs/s.ron", "../a.csv", None),
        ] {
            let base = base(graph, &[]);
            let value =
                asperity_diagnostics::ron::parse(&Source::new(tradeoff, format!("{named:?}"))).unwrap();
            let mut turned = crate::knob::Turned { graph: base.graph.clone(), guards: true };
            let knob = crate::knob::Knob::parse("stylus.file", value.place()).unwrap();
            knob.turn(&mut turned, &value, &base.registry).unwrap();
            let nodes = Fragment::between(&base, &turned.graph).nodes;
            let found = nodes.first().map(|n| n.split('"').nth(5).unwrap().to_owned());
            assert_eq!(found, want, "{graph} {tradeoff} {named}");
        }
        for typed in ["stylus.file=g/b.csv", "stylus.file=\"g/b.csv\""] {
            let typed = base("g/g.ron", &[typed]);
            let want = [r#""stylus": (kind: "trajectory", params: (file: "b.csv")),"#];
            assert_eq!(Fragment::between(&typed, &typed.graph).nodes, want);
        }
    }

    #[test]
    fn removed_force_outputs_keep_their_wires() {
        let base = base("g.ron", &[]);
        let mut setting = base.graph.clone();
        setting.nodes.retain(|n| n.id != "stylus");
        setting.wires.clear();
        let fragment = Fragment::between(&base, &setting);
        assert_eq!(fragment.gone, ["stylus"]);
        assert_eq!(fragment.wires, [r#"("a", "pushes"),"#]);
    }

    #[test]
    fn plugin_is_known_by_its_file_name() {
        let file = Path::new("/p/libmine.so");
        assert!(is_file_of("../x/libmine.so", file) && !is_file_of("libmine2.so", file));
        assert_eq!(is_file_of("mine", file), cfg!(target_os = "linux"));
        if cfg!(target_os = "linux") {
            assert_eq!(name_of(file), "mine");
        }
        let fragment = Fragment {
            plugins: vec![("mine".into(), "my_filters".into())],
            nodes: vec!["\"a\": (kind: \"mine\"),".into()],
            ..Fragment::default()
        };
        let said =
            "// `mine` is a plugin's: --plugin my_filters, or in the graph: plugins: [\"my_filters\"],";
        assert!(fragment.to_string().contains(said), "{fragment}");
    }
}
