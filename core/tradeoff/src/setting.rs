//! Settings: graphs with some knobs changed.

use std::collections::HashMap;
use std::path::PathBuf;

use asperity_diagnostics::Diagnostic;
use asperity_diagnostics::ron::Value;
use asperity_graph::{GraphFile, NodeDecl};
use asperity_node::{ParamValue, Registry, Role};

use crate::file::{DEFAULT, Grid, Tradeoff};
use crate::fragment::tidy;
use crate::knob::Turned;
use crate::results::{Fragment, Row};

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
pub(crate) struct Setting<'a> {
    /// Its results, before anything is measured. The key is its number, the same in all shards.
    pub row: Row,
    /// The graph that it is a setting of.
    pub base: &'a LoadedGraph,
    /// The graph.
    pub graph: GraphFile,
    /// Whether outputs of nodes are checked for NaN and infinities.
    pub guards: bool,
}

/// All settings of a trade-off.
#[derive(Clone, Debug, Default)]
pub(crate) struct Settings<'a> {
    /// Settings, each once. The defaults come first.
    pub all: Vec<Setting<'a>>,
    /// Knobs and kinds that were left out, each with the reason.
    pub left_out: Vec<(String, String)>,
    /// Indices by file and text.
    known: HashMap<String, usize>,
}

impl<'a> Settings<'a> {
    /// All settings of a trade-off over these graphs, and the baselines.
    ///
    /// # Errors
    /// A knob that no graph has, a value that its knob cannot take.
    pub(crate) fn new(
        tradeoff: &Tradeoff,
        bases: &'a [LoadedGraph],
        baselines: &'a [LoadedGraph],
    ) -> Result<Self, Diagnostic> {
        let mut it = Self::default();
        // With the name of the graph where there are several.
        let named = |base: &LoadedGraph, name: &str| match bases {
            [_] => name.to_owned(),
            _ => format!("{}: {name}", base.name),
        };
        for base in bases {
            let mut setting = Setting::of(base, named(base, DEFAULT), base.graph.clone(), true);
            setting.row.default = true;
            it.add(setting);
        }
        for grid in &tradeoff.grids {
            for (knob, _) in &grid.knobs {
                let lacks = |base: &&LoadedGraph| !knob.fits(&base.graph, &base.registry);
                if bases.iter().all(|base| lacks(&base)) && !bases.is_empty() && !tradeoff.lenient {
                    let graphs: Vec<&str> = bases.iter().map(|b| b.name.as_str()).collect();
                    let message = format!("no graph has the knob `{}`: {}", knob.name, graphs.join(", "));
                    let near = knob.nearest(bases);
                    return Err(Diagnostic::new(message).at_place(&knob.place).help(near));
                }
                for base in bases.iter().filter(lacks) {
                    it.leave_out(&knob.name, &format!("{} has no such knob", base.name));
                }
            }
            for base in bases {
                it.add_grid(base, grid, tradeoff.lenient, |name| named(base, name))?;
            }
        }
        for base in baselines {
            let mut setting = Setting::of(base, base.name.clone(), base.graph.clone(), true);
            setting.row.baseline = true;
            setting.row.graph = base.graph.source.path().display().to_string();
            setting.row.fragment = Fragment::default();
            it.add(setting);
        }
        Ok(it)
    }

    fn leave_out(&mut self, what: &str, why: &str) {
        let left = (what.to_owned(), why.to_owned());
        if !self.left_out.contains(&left) {
            self.left_out.push(left);
        }
    }

    fn add_grid(
        &mut self,
        base: &'a LoadedGraph,
        grid: &Grid,
        lenient: bool,
        named: impl Fn(&str) -> String,
    ) -> Result<(), Diagnostic> {
        let LoadedGraph { graph, registry, .. } = base;
        let mut knobs = Vec::new();
        for (knob, values) in grid.knobs.iter().filter(|(knob, _)| knob.fits(graph, registry)) {
            let mut known = values.clone();
            known.retain(|value| match knob.unknown_kind(value, registry) {
                Some(kind) => {
                    self.leave_out(kind, "there is no such kind of node; --plugin loads one");
                    false
                }
                None => true,
            });
            knobs.push((knob, known));
        }
        if knobs.is_empty() {
            return Ok(());
        }
        'combinations: for mut number in 0..knobs.iter().map(|(_, values)| values.len()).product() {
            let mut turned = Turned { graph: graph.clone(), guards: true };
            let mut changes = Vec::new();
            for (knob, values) in &knobs {
                let value = &values[number % values.len()];
                number /= values.len();
                let before = (text(&turned.graph, registry), turned.guards);
                match knob.turn(&mut turned, value, registry) {
                    Err(e) if lenient => {
                        self.leave_out(&format!("{}={}", knob.name, shown(value)), &e.message);
                        continue 'combinations;
                    }
                    done => done?,
                }
                if (text(&turned.graph, registry), turned.guards) != before {
                    changes.push((knob.name.clone(), shown(value)));
                }
            }
            let words: Vec<String> = changes.iter().map(|(k, v)| format!("{k}={v}")).collect();
            let mut setting = Setting::of(base, named(&words.join(" ")), turned.graph, turned.guards);
            (setting.row.turned, setting.row.grids) = (changes, vec![grid.name.clone()]);
            self.add(setting);
        }
        Ok(())
    }

    /// Adds a setting. One that is known gets another grid, and the name of a baseline.
    fn add(&mut self, mut setting: Setting<'a>) {
        // Graphs in several folders may have the same text, each with files of its own.
        let path = setting.graph.source.path();
        let file = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let text = text(&setting.graph, &setting.base.registry);
        let known = format!("{} {} {}\n{text}", file.display(), setting.guards, setting.base.strength);
        let at = *self.known.entry(known).or_insert(self.all.len());
        let Some(Setting { row: there, .. }) = self.all.get_mut(at) else {
            setting.row.key = at.to_string();
            return self.all.push(setting);
        };
        let Row { name, mut grids, baseline, .. } = setting.row;
        grids.retain(|grid| !there.grids.contains(grid));
        there.grids.append(&mut grids);
        if baseline {
            there.baseline = true;
            there.name = format!("{} ({name})", there.name);
        }
    }
}

impl<'a> Setting<'a> {
    fn of(base: &'a LoadedGraph, name: String, graph: GraphFile, guards: bool) -> Self {
        let mut row = Row {
            name,
            graph: base.name.clone(),
            tick_hz: graph.tick_hz,
            fragment: Fragment::between(base, &graph),
            ..Row::default()
        };
        let mut fails = |case: &str, why: &str| row.fails.insert(case.to_owned(), why.to_owned());
        if !guards {
            let why =
                "guards are off: this can only be measured, since no graph or command can turn them off";
            fails("guards", why);
        }
        let plays = |n: &&NodeDecl| base.registry.role(&n.kind) == Some(Role::AudioOutput);
        let cards = |g: &GraphFile| g.nodes.iter().filter(plays).count();
        if cards(&base.graph) > cards(&graph) {
            fails("limiter", "the limiter before the coil is gone: nothing is played without one");
        }
        Self { row, base, graph, guards }
    }
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
/// defaults are left out.
fn text(graph: &GraphFile, registry: &Registry) -> String {
    let mut nodes: Vec<String> = graph.nodes.iter().map(|n| node_text(n, registry)).collect();
    nodes.sort();
    let plain = GraphFile { nodes: Vec::new(), ..graph.clone() };
    format!("{plain}\n{}", nodes.join("\n"))
}

fn node_text(node: &NodeDecl, registry: &Registry) -> String {
    let text = |s: &asperity_graph::Setting| {
        let declared = registry.get(&node.kind).map(|kind| &kind.descriptor().params);
        let param = declared.and_then(|all| all.iter().find(|p| p.name == s.name));
        let value = match param.and_then(|p| Some((p, p.read(&s.value).ok()?))) {
            Some((p, value)) if p.default.as_ref() == Some(&value) => return None,
            Some((_, ParamValue::File(path))) => ParamValue::File(tidy(&path)).to_string(),
            Some((_, value)) => value.to_string(),
            // On the command line a text needs no quotes.
            None => s.typed.clone().unwrap_or_else(|| s.value.to_string()),
        };
        Some(format!("{}: {value}", s.name))
    };
    let mut params: Vec<String> = node.params.iter().filter_map(text).collect();
    params.sort();
    format!("{:?} {} every {}: {}", node.id, node.kind, node.every, params.join(", "))
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

    fn names<'s>(settings: &'s Settings<'_>) -> Vec<&'s str> {
        settings.all.iter().map(|s| s.row.name.as_str()).collect()
    }

    #[test]
    fn each_combination_is_one_setting() {
        let grids = of_grids(
            r#"(name: "g", knobs: {"a.gain": [1.0, 2.0], "tick_hz": [500, 1000]}),
            (name: "h", knobs: {"tick_hz": [1000, 250]})"#,
        );
        let bases = [base("x")];
        let settings = Settings::new(&grids, &bases, &[]).unwrap();
        let mut found: Vec<(&str, String)> =
            settings.all.iter().map(|s| (s.row.name.as_str(), s.row.grids.join("+"))).collect();
        found.sort();
        let want = [
            ("a.gain=1.0", "g"),
            ("a.gain=1.0 tick_hz=1000", "g"),
            ("default", "g"),
            ("tick_hz=1000", "g+h"),
            ("tick_hz=250", "h"),
        ];
        assert_eq!(found, want.map(|(n, g)| (n, g.to_owned())));
        assert!(settings.all[0].row.default && settings.all[1..].iter().all(|s| !s.row.default));
        let keys: BTreeSet<&str> = settings.all.iter().map(|s| s.row.key.as_str()).collect();
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
            let bases = [loaded("x", graph_of("x", &nodes, ""))];
            let settings = Settings::new(&grids, &bases, &[]).unwrap();
            assert_eq!(names(&settings), ["default", &format!("r.phase={other}"), "g.gain=1.0"], "{params}");
        }
    }

    #[test]
    fn baseline_equal_to_the_default_keeps_its_name() {
        let (bases, mine) = ([base("x")], [LoadedGraph { name: "mine".into(), ..base("x") }]);
        let settings = Settings::new(&of_grids(""), &bases, &mine).unwrap();
        assert_eq!(names(&settings), ["default (mine)"]);
        assert!(settings.all[0].row.baseline && settings.all[0].row.default);
    }

    #[test]
    fn unknown_knobs_are_an_error_or_left_out() {
        let mut grids = of_grids(
            r#"(name: "g", knobs: {"a.gian": [1.0, 3.0], "tick_hz": [1000]}),
            (name: "h", knobs: {"nothing": [kept]}), (name: "i", knobs: {"a": [bypassed]})"#,
        );
        let bases = [base("x")];
        let e = Settings::new(&grids, &bases, &[]).unwrap_err().to_string();
        assert!(e.contains("did you mean `a.gain`?"), "{e}");
        grids.lenient = true;
        let settings = Settings::new(&grids, &bases, &[]).unwrap();
        assert_eq!(names(&settings), ["default", "tick_hz=1000"]);
        let left: Vec<&str> = settings.left_out.iter().map(|(what, _)| what.as_str()).collect();
        assert_eq!(left, ["a.gian", "nothing", "a=bypassed"]);
    }

    #[test]
    fn several_graphs_each_have_settings() {
        let grids = of_grids(r#"(name: "g", knobs: {"tick_hz": [500, 1000]})"#);
        let (bases, mine) = ([base("x"), base("y")], [base("mine")]);
        let settings = Settings::new(&grids, &bases, &mine).unwrap();
        let want = ["x: default", "y: default", "x: tick_hz=1000", "y: tick_hz=1000", "mine"];
        assert_eq!(names(&settings), want);
        assert!(settings.all[4].row.baseline);
    }

    #[test]
    fn files_of_several_folders_are_several_settings() {
        let nodes = r#""s": (kind: "trajectory", params: (file: "../t/a.csv"))"#;
        let bases = ["g/g.ron", "h/g.ron"].map(|file| loaded(file, graph_of(file, nodes, "")));
        let grids =
            r#"strokes: [(name: "s")], grids: [(name: "g", knobs: {"s.file": ["b.csv", "../../t/a.csv"]})]"#;
        let settings = Settings::new(&tradeoff("g/t/s.ron", grids), &bases, &[]).unwrap();
        // `../../t/a.csv` is what both graphs name.
        assert_eq!(settings.all.iter().map(|s| s.row.key.as_str()).collect::<Vec<_>>(), ["0", "1", "2", "3"]);
    }
}
