//! Settings: graphs with some knobs changed.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use asperity_diagnostics::ron::{Kind, Value};
use asperity_diagnostics::{Diagnostic, fnv};
use asperity_graph::{GraphFile, NodeDecl};
use asperity_node::{ParamKind, ParamValue, Registry};

use crate::file::{DEFAULT, Grid, Tradeoff, beside};
use crate::fragment::across;
use crate::knob::Turned;

/// A graph with the kinds that it may use.
#[derive(Clone, Debug)]
pub struct LoadedGraph {
    /// Path as it was given, or the name of a baseline.
    pub name: String,
    /// The graph; of a scene, the graph that it lowers to.
    pub graph: GraphFile,
    /// The graph as its file has it: fragments are differences from this.
    pub file: GraphFile,
    /// Kinds that it may use.
    pub registry: Registry,
    /// Share of the physical acceleration that it renders.
    pub strength: f64,
    /// Files of the plugins that some kinds come from.
    pub plugins: Vec<PathBuf>,
}

/// A setting.
#[derive(Clone, Debug)]
pub struct Setting {
    /// Name: the changed knobs, `default`, or the name of a baseline.
    pub name: String,
    /// Unique key: a digest of the graph, with files named relative to the graph's folder. So it is the same
    /// wherever that folder lies. Contents of files are not in it.
    pub key: String,
    /// Index of its graph among those that are varied; out of range for a baseline.
    pub base: usize,
    /// Changed knobs with their values. Those without effect are left out.
    pub turned: Vec<(String, String)>,
    /// Names of the grids that contain it.
    pub grids: Vec<String>,
    /// Whether it is an unchanged graph.
    pub default: bool,
    /// Whether it is a baseline.
    pub baseline: bool,
    /// The graph.
    pub graph: GraphFile,
    /// Whether outputs of nodes are checked for NaN and infinities.
    pub guards: bool,
    /// Share of the physical acceleration that it renders.
    pub strength: f64,
}

/// All settings of a trade-off.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// Settings, each once. The defaults come first.
    pub all: Vec<Setting>,
    /// Knobs and kinds that were left out, each with the reason.
    pub left_out: Vec<(String, String)>,
    /// Indices by key, and by file and text.
    known: HashMap<String, usize>,
}

impl Settings {
    /// All settings of a trade-off over these graphs, and the baselines.
    ///
    /// # Errors
    /// A knob that no graph has, a value that its knob cannot take.
    pub fn new(
        tradeoff: &Tradeoff,
        bases: &[LoadedGraph],
        baselines: &[LoadedGraph],
    ) -> Result<Self, Diagnostic> {
        let mut it = Self::default();
        for (b, base) in bases.iter().enumerate() {
            it.add(base, Setting { default: true, ..Setting::of(base, b, named(bases, b, DEFAULT)) });
        }
        for grid in &tradeoff.grids {
            for (knob, _) in &grid.knobs {
                let lacks = |base: &&LoadedGraph| !knob.fits(&base.graph, &base.registry);
                if bases.iter().all(|base| lacks(&base)) && !bases.is_empty() && !tradeoff.lenient {
                    let graphs: Vec<&str> = bases.iter().map(|b| b.name.as_str()).collect();
                    let near = knob.nearest(bases.iter().map(|b| (&b.graph, &b.registry)));
                    return Err(Diagnostic::new(format!(
                        "no graph has the knob `{knob}`: {}",
                        graphs.join(", ")
                    ))
                    .at(&knob.place().source, knob.place().span)
                    .help(near));
                }
                for base in bases.iter().filter(lacks) {
                    it.leave_out(&knob.to_string(), &format!("{} has no such knob", base.name));
                }
            }
            for b in 0..bases.len() {
                it.add_grid(bases, b, grid, tradeoff.lenient)?;
            }
        }
        for baseline in baselines {
            let setting = Setting::of(baseline, bases.len(), baseline.name.clone());
            it.add(baseline, Setting { baseline: true, ..setting });
        }
        Ok(it)
    }

    fn leave_out(&mut self, what: &str, why: &str) {
        let left = (what.to_owned(), why.to_owned());
        if !self.left_out.contains(&left) {
            self.left_out.push(left);
        }
    }

    /// Adds all combinations of a grid.
    fn add_grid(
        &mut self,
        bases: &[LoadedGraph],
        b: usize,
        grid: &Grid,
        lenient: bool,
    ) -> Result<(), Diagnostic> {
        let base = &bases[b];
        let mut knobs = Vec::new();
        for (knob, values) in grid.knobs.iter().filter(|(knob, _)| knob.fits(&base.graph, &base.registry)) {
            let mut known = Vec::new();
            for value in values {
                match knob.unknown_kind(value, &base.registry) {
                    Some(kind) => self.leave_out(kind, "there is no such kind of node; --plugin loads one"),
                    None => known.push(value),
                }
            }
            knobs.push((knob, known));
        }
        let count: usize = knobs.iter().map(|(_, values)| values.len()).product();
        let combinations = if knobs.is_empty() { 0..0 } else { 0..count };
        'combinations: for mut number in combinations {
            let mut turned = Turned { graph: base.graph.clone(), guards: true };
            let mut changes = Vec::new();
            for (knob, values) in &knobs {
                let value = values[number % values.len()];
                number /= values.len();
                let before = (text(&turned.graph, &base.registry), turned.guards);
                match knob.turn(&mut turned, value, &base.registry) {
                    Err(e) if lenient => {
                        self.leave_out(&format!("{knob}={}", shown(value)), &e.message);
                        continue 'combinations;
                    }
                    done => done?,
                }
                if (text(&turned.graph, &base.registry), turned.guards) != before {
                    changes.push((knob.to_string(), shown(value)));
                }
            }
            let words: Vec<String> = changes.iter().map(|(k, v)| format!("{k}={v}")).collect();
            let Turned { graph, guards } = turned;
            let grids = vec![grid.name.clone()];
            let setting = Setting::of(base, b, named(bases, b, &words.join(" ")));
            self.add(base, Setting { graph, guards, turned: changes, grids, ..setting });
        }
        Ok(())
    }

    /// Adds a setting. One that is known gets another grid, and the name of a baseline.
    fn add(&mut self, of: &LoadedGraph, mut setting: Setting) {
        let path = setting.graph.source.path();
        let text = format!("{} {}\n{}", setting.guards, setting.strength, text(&setting.graph, &of.registry));
        // Graphs in several folders may have the same text, each with files of its own.
        let file = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let at = *self.known.entry(format!("{}\n{text}", file.display())).or_insert(self.all.len());
        if let Some(there) = self.all.get_mut(at) {
            there
                .grids
                .extend(setting.grids.into_iter().filter(|g| !there.grids.contains(g)).collect::<Vec<_>>());
            if setting.baseline {
                there.baseline = true;
                there.name = format!("{} ({})", there.name, setting.name);
            }
            return;
        }
        let numbers = std::iter::once(String::new()).chain((2..).map(|n: u32| format!("\n{n}")));
        let mut keys = numbers.map(|number| format!("{:016x}", fnv(format!("{text}{number}").as_bytes())));
        setting.key = keys.find(|key| !self.known.contains_key(key)).unwrap_or_default();
        self.known.insert(setting.key.clone(), self.all.len());
        self.all.push(setting);
    }
}

impl Setting {
    /// A graph, unchanged.
    fn of(base: &LoadedGraph, number: usize, name: String) -> Self {
        Self {
            name,
            key: String::new(),
            base: number,
            turned: Vec::new(),
            grids: Vec::new(),
            default: false,
            baseline: false,
            graph: base.graph.clone(),
            guards: true,
            strength: base.strength,
        }
    }
}

/// A name; with the name of its graph where there are several.
fn named(bases: &[LoadedGraph], b: usize, name: &str) -> String {
    if bases.len() > 1 { format!("{}: {name}", bases[b].name) } else { name.to_owned() }
}

/// A value for people: of a node its kind and parameters.
fn shown(value: &Value) -> String {
    let text = value.to_string();
    let Some(rest) = text.strip_prefix("(kind: \"") else { return text.trim_matches('"').to_owned() };
    let Some((kind, rest)) = rest.split_once('"') else { return text };
    let params = rest.strip_prefix(", params: (").and_then(|r| r.strip_suffix("))"));
    match params {
        Some(params) if !params.is_empty() => format!("{kind}({params})"),
        _ => kind.to_owned(),
    }
}

/// Canonical text of a graph. Nodes and parameters are sorted by name, values are as nodes read them, and
/// defaults are left out. Files are named relative to the graph's folder, unless the graph names them
/// absolutely.
fn text(graph: &GraphFile, registry: &Registry) -> String {
    let home = graph.source.path().parent().unwrap_or(Path::new(""));
    let mut nodes: Vec<String> = graph.nodes.iter().map(|n| node_text(n, registry, home)).collect();
    nodes.sort();
    let plain = GraphFile { nodes: Vec::new(), ..graph.clone() };
    format!("{plain}\n{}", nodes.join("\n"))
}

fn node_text(node: &NodeDecl, registry: &Registry, home: &Path) -> String {
    let declared = registry.get(&node.kind).map(|kind| &kind.descriptor().params);
    let param = |name: &str| declared.and_then(|all| all.iter().find(|p| p.name == name));
    let relative = |named: &str, value: ParamValue| match value {
        ParamValue::File(_) if Path::new(named).is_absolute() => ParamValue::File(named.into()),
        ParamValue::File(path) => ParamValue::File(across(&path, home)),
        value => value,
    };
    let text = |s: &asperity_graph::Setting| {
        let value = param(&s.name).and_then(|p| Some((p, read(s, &p.kind)?)));
        match value {
            Some((p, value)) if p.default.as_ref() == Some(&value) => None,
            Some((_, value)) => {
                Some(format!("{}: {}", s.name, relative(s.value.text().unwrap_or(""), value)))
            }
            None => Some(format!("{}: {}", s.name, s.typed.clone().unwrap_or_else(|| s.value.to_string()))),
        }
    };
    let mut params: Vec<String> = node.params.iter().filter_map(text).collect();
    params.sort();
    format!("{:?} {} every {}: {}", node.id, node.kind, node.every, params.join(", "))
}

/// A value as a parameter of this kind reads it; none where it refuses it.
fn read(setting: &asperity_graph::Setting, kind: &ParamKind) -> Option<ParamValue> {
    let value = &setting.value;
    let word = |value: &Value| match value.kind() {
        Kind::Text(text) | Kind::Word(text) => Some(text.clone()),
        _ => None,
    };
    Some(match kind {
        ParamKind::Number(_) => ParamValue::Number(value.f64().ok()?),
        ParamKind::Integer(_) => ParamValue::Integer(value.i64().ok()?),
        ParamKind::Flag => ParamValue::Flag(value.bool().ok()?),
        // On the command line a text needs no quotes.
        ParamKind::Text => {
            ParamValue::Text(value.text().ok().map(str::to_owned).or_else(|| setting.typed.clone())?)
        }
        ParamKind::Choice(_) => ParamValue::Text(word(value)?),
        ParamKind::File => ParamValue::File(beside(value).ok()?),
        ParamKind::Numbers(_) => {
            ParamValue::Numbers(value.list().ok()?.iter().map(|v| v.f64().ok()).collect::<Option<_>>()?)
        }
        ParamKind::Texts => ParamValue::Texts(value.list().ok()?.iter().map(word).collect::<Option<_>>()?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{graph_of, loaded, tradeoff};
    use std::collections::BTreeSet;

    fn base(name: &str) -> LoadedGraph {
        let nodes = r#""a": (kind: "gain", params: (gain: 2.0)), "b": (kind: "mix")"#;
        loaded(name, graph_of(&format!("{name}.ron"), nodes, ""))
    }

    fn of_grids(grids: &str) -> Tradeoff {
        tradeoff("s.ron", &format!(r#"strokes: [(name: "s")], grids: [{grids}]"#))
    }

    fn names(settings: &Settings) -> Vec<&str> {
        settings.all.iter().map(|s| s.name.as_str()).collect()
    }

    #[test]
    fn each_combination_is_one_setting() {
        let grids = of_grids(
            r#"(name: "g", knobs: {"a.gain": [1.0, 2.0], "tick_hz": [500, 1000]}),
            (name: "h", knobs: {"tick_hz": [1000, 250]})"#,
        );
        let settings = Settings::new(&grids, &[base("x")], &[]).unwrap();
        let mut found: Vec<(&str, String)> =
            settings.all.iter().map(|s| (s.name.as_str(), s.grids.join("+"))).collect();
        found.sort();
        let want = [
            ("a.gain=1.0", "g"),
            ("a.gain=1.0 tick_hz=1000", "g"),
            ("default", "g"),
            ("tick_hz=1000", "g+h"),
            ("tick_hz=250", "h"),
        ];
        assert_eq!(found, want.map(|(n, g)| (n, g.to_owned())));
        assert!(settings.all[0].default && settings.all[1..].iter().all(|s| !s.default));
        let keys: BTreeSet<&str> = settings.all.iter().map(|s| s.key.as_str()).collect();
        assert_eq!(keys.len(), 5);
    }

    #[test]
    fn equal_parameters_are_one_setting_however_written() {
        let grids = of_grids(
            r#"(name: "word", knobs: {"r.phase": ["minimum", "linear"]}),
            (name: "number", knobs: {"g.gain": [2, 2.0, 1.0]}),
            (name: "both", knobs: {"g.gain": [2], "r.phase": [linear]})"#,
        );
        // "linear" is the default.
        for (params, other) in
            [("phase: minimum", "linear"), ("", "minimum"), ("phase: \"linear\"", "minimum")]
        {
            let nodes = format!(
                r#""r": (kind: "resample", params: ({params})), "g": (kind: "gain", params: (gain: 2.0))"#
            );
            let base = loaded("x", graph_of("x", &nodes, ""));
            let settings = Settings::new(&grids, &[base], &[]).unwrap();
            assert_eq!(names(&settings), ["default", &format!("r.phase={other}"), "g.gain=1.0"], "{params}");
        }
    }

    #[test]
    fn baseline_equal_to_the_default_keeps_its_name() {
        let mine = LoadedGraph { name: "mine".into(), ..base("x") };
        let settings = Settings::new(&of_grids(""), &[base("x")], &[mine]).unwrap();
        assert_eq!(names(&settings), ["default (mine)"]);
        assert!(settings.all[0].baseline && settings.all[0].default);
    }

    #[test]
    fn unknown_knobs_are_an_error_or_left_out() {
        let mut grids = of_grids(
            r#"(name: "g", knobs: {"a.gian": [1.0, 3.0], "tick_hz": [1000]}),
            (name: "h", knobs: {"nothing": [kept]}), (name: "i", knobs: {"a": [bypassed]})"#,
        );
        let e = Settings::new(&grids, &[base("x")], &[]).unwrap_err().to_string();
        assert!(e.contains("did you mean `a.gain`?"), "{e}");
        grids.lenient = true;
        let settings = Settings::new(&grids, &[base("x")], &[]).unwrap();
        assert_eq!(names(&settings), ["default", "tick_hz=1000"]);
        let left: Vec<&str> = settings.left_out.iter().map(|(what, _)| what.as_str()).collect();
        assert_eq!(left, ["a.gian", "nothing", "a=bypassed"]);
    }

    #[test]
    fn several_graphs_each_have_settings() {
        let grids = of_grids(r#"(name: "g", knobs: {"tick_hz": [500, 1000]})"#);
        let settings = Settings::new(&grids, &[base("x"), base("y")], &[base("mine")]).unwrap();
        let want = ["x: default", "y: default", "x: tick_hz=1000", "y: tick_hz=1000", "mine"];
        assert_eq!(names(&settings), want);
        assert!(settings.all[4].baseline);
    }

    #[test]
    fn key_does_not_depend_on_the_folder() {
        let keys = |folder: &str, files: &[&str]| -> Vec<String> {
            let nodes = r#""s": (kind: "trajectory", params: (file: "../t/a.csv")),
                "o": (kind: "trajectory", params: (file: "/o.csv"))"#;
            let base = |file: &&str| loaded(file, graph_of(&format!("{folder}/{file}"), nodes, ""));
            let bases: Vec<LoadedGraph> = files.iter().map(base).collect();
            let grids = r#"strokes: [(name: "s")], grids: [(name: "g", knobs: {"s.file": ["b.csv"]})]"#;
            let grids = tradeoff(&format!("{folder}/g/tradeoffs/s.ron"), grids);
            Settings::new(&grids, &bases, &[]).unwrap().all.into_iter().map(|s| s.key).collect()
        };
        let there = keys("/a/b", &["g/g.ron"]);
        assert_eq!(there.len(), 2);
        for folder in ["x", "../y", "/c"] {
            assert_eq!(keys(folder, &["g/g.ron"]), there, "{folder}");
        }
        // Another place relative to the graph is another file. Equal texts with different files differ.
        let other = keys("/a/b", &["n/g.ron"]);
        assert_eq!((&other[0], other[1] == there[1]), (&there[0], false));
        let two = keys("/a/b", &["g/g.ron", "h/g.ron"]);
        let different: BTreeSet<&String> = two.iter().collect();
        assert_eq!((two.len(), different.len()), (4, 4));
        assert_eq!(two[0], there[0]);
    }
}
