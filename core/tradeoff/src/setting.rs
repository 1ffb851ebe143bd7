//! Settings: a graph, and what was turned about it.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use asperity_diagnostics::ron::{Kind, Value};
use asperity_diagnostics::{Diagnostic, fnv};
use asperity_graph::{GraphFile, NodeDecl};
use asperity_node::{ParamKind, ParamValue, Registry};

use crate::file::{DEFAULT, Grid, Study, beside};
use crate::fragment::across;
use crate::knob::Turned;

/// A graph that settings are made of.
#[derive(Clone, Debug)]
pub struct Base {
    /// What it is called: how its file was named.
    pub name: String,
    /// It; of a scene, what that lowers to.
    pub graph: GraphFile,
    /// The graph as its file has it: what fragments differ from.
    pub file: GraphFile,
    /// All kinds that it may use.
    pub registry: Registry,
    /// The part of the physics at which it is set to render.
    pub strength: f64,
    /// Files of plugins that kinds came from.
    pub plugins: Vec<PathBuf>,
}

/// What a setting is.
#[derive(Clone, Debug)]
pub struct Setting {
    /// What it is called: what it differs in from its base, or the name of a mark.
    pub name: String,
    /// What tells it from every other of its study: what its graph says, with files named as seen from the graph's folder, so that it is the same wherever
    /// that lies. What is in the files is in the names of parts and in the study's digest, and not in this.
    pub key: String,
    /// Number of its base.
    pub base: usize,
    /// Knobs and what they were turned to, as texts; those only that change anything.
    pub turned: Vec<(String, String)>,
    /// Names of the grids that it stands in.
    pub grids: Vec<String>,
    /// Whether it is its base as it stands.
    pub default: bool,
    /// Whether it stands beside the others under a name of its own.
    pub mark: bool,
    /// The graph.
    pub graph: GraphFile,
    /// Whether what nodes put out is looked at for NaN and infinities.
    pub guards: bool,
    /// The part of the physics at which it is set to render.
    pub strength: f64,
}

/// Settings, and knobs that some base does not have.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// All of them; those that are the same but for their names stand here once. The default of each base comes first.
    pub all: Vec<Setting>,
    /// What was left out, and why.
    pub left_out: Vec<(String, String)>,
}

impl Settings {
    /// All settings of a study over these bases, with marks that are read already.
    ///
    /// # Errors
    /// A knob that no base has, a value that means nothing where it is turned to.
    pub fn new(study: &Study, bases: &[Base], marks: &[Base]) -> Result<Self, Diagnostic> {
        let mut it = Self::default();
        let mut known = HashMap::new();
        for (b, base) in bases.iter().enumerate() {
            let turned = Turned { graph: base.graph.clone(), guards: true };
            let name = named(bases, b, DEFAULT);
            it.take(&mut known, (b, base), turned, Vec::new(), None, (name, true, false));
        }
        for grid in &study.grids {
            for (knob, _) in &grid.knobs {
                let lacks = |base: &&Base| !knob.fits(&base.graph, &base.registry);
                if bases.iter().all(|base| lacks(&base)) && !bases.is_empty() && !study.lenient {
                    let graphs: Vec<&str> = bases.iter().map(|b| b.name.as_str()).collect();
                    let near = knob.nearest(bases.iter().map(|b| (&b.graph, &b.registry)));
                    return Err(Diagnostic::new(format!(
                        "no graph has `{knob}` to turn: {}",
                        graphs.join(", ")
                    ))
                    .at(&knob.place().source, knob.place().span)
                    .help(near));
                }
                for base in bases.iter().filter(lacks) {
                    it.leave_out(
                        &knob.to_string(),
                        &format!("{} has nothing of that name to turn", base.name),
                    );
                }
            }
            for b in 0..bases.len() {
                it.grid(&mut known, bases, b, grid, study.lenient)?;
            }
        }
        for mark in marks {
            let turned = Turned { graph: mark.graph.clone(), guards: true };
            it.take(
                &mut known,
                (bases.len(), mark),
                turned,
                Vec::new(),
                None,
                (mark.name.clone(), false, true),
            );
        }
        Ok(it)
    }

    fn leave_out(&mut self, what: &str, why: &str) {
        let left = (what.to_owned(), why.to_owned());
        if !self.left_out.contains(&left) {
            self.left_out.push(left);
        }
    }

    /// All combinations of a grid.
    fn grid(
        &mut self,
        known: &mut HashMap<String, usize>,
        bases: &[Base],
        b: usize,
        grid: &Grid,
        lenient: bool,
    ) -> Result<(), Diagnostic> {
        let Some(base) = bases.get(b) else { return Ok(()) };
        let mut knobs = Vec::new();
        for (knob, values) in grid.knobs.iter().filter(|(knob, _)| knob.fits(&base.graph, &base.registry)) {
            let mut there = Vec::new();
            for value in values {
                match knob.lacks(value, &base.registry) {
                    Some(kind) => self.leave_out(kind, "no such kind of node is there; --plugin loads one"),
                    None => there.push(value),
                }
            }
            knobs.push((knob, there));
        }
        let count: usize = knobs.iter().map(|(_, values)| values.len()).product();
        // Where nothing of it is there to be turned, it is about nothing.
        let numbers = if knobs.is_empty() { 0..0 } else { 0..count };
        'settings: for mut number in numbers {
            let mut turned = Turned { graph: base.graph.clone(), guards: true };
            let mut changes = Vec::new();
            for (knob, values) in &knobs {
                let value = values[number % values.len()];
                number /= values.len();
                let before = (same(&turned.graph, &base.registry), turned.guards);
                match knob.turn(&mut turned, value, &base.registry) {
                    Err(e) if lenient => {
                        self.leave_out(&format!("{knob}={}", shown(value)), &e.message);
                        continue 'settings;
                    }
                    done => done?,
                }
                if (same(&turned.graph, &base.registry), turned.guards) != before {
                    changes.push((knob.to_string(), shown(value)));
                }
            }
            let words: Vec<String> = changes.iter().map(|(k, v)| format!("{k}={v}")).collect();
            let name = named(bases, b, &words.join(" "));
            self.take(known, (b, base), turned, changes, Some(grid.name.clone()), (name, false, false));
        }
        Ok(())
    }

    /// Adds a setting, or another name and grid to one that is the same.
    fn take(
        &mut self,
        known: &mut HashMap<String, usize>,
        (base, of): (usize, &Base),
        Turned { graph, guards }: Turned,
        turned: Vec<(String, String)>,
        grid: Option<String>,
        (name, default, mark): (String, bool, bool),
    ) {
        let strength = of.strength;
        let path = graph.source.path();
        let same = same(&graph, &of.registry);
        // However it is named, it is one file.
        let file = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let at = *known
            .entry(format!("{}\n{guards} {strength}\n{same}", file.display()))
            .or_insert(self.all.len());
        if let Some(there) = self.all.get_mut(at) {
            there.grids.extend(grid.filter(|g| !there.grids.contains(g)));
            if mark {
                there.mark = true;
                there.name = format!("{} ({name})", there.name);
            }
            return;
        }
        let home = path.parent().unwrap_or(Path::new(""));
        let text = format!("{guards} {strength}\n{}", seen_from(home, &graph, &of.registry));
        // Graphs of several folders may say the same, each of files of its own.
        let numbers = std::iter::once(String::new()).chain((2..).map(|n: u32| format!("\n{n}")));
        let keys = numbers.map(|number| format!("{:016x}", fnv(format!("{text}{number}").as_bytes())));
        let key = keys.into_iter().find(|key| !known.contains_key(key)).unwrap_or_default();
        known.insert(key.clone(), self.all.len());
        let grids = grid.into_iter().collect();
        self.all.push(Setting { name, key, base, turned, grids, default, mark, graph, guards, strength });
    }
}

/// A name among those of all bases.
fn named(bases: &[Base], b: usize, name: &str) -> String {
    if bases.len() > 1 { format!("{}: {name}", bases[b].name) } else { name.to_owned() }
}

/// A value as a person would call it: a node by its kind and what is set.
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

/// A graph's text by which it is the same as another: nodes and parameters in order of their names, values as the nodes read them, defaults left out.
fn same(graph: &GraphFile, registry: &Registry) -> String {
    text(graph, registry, |_, value| value)
}

/// The same, with files by their paths as seen from a folder; as they are named where that is an absolute path.
fn seen_from(home: &Path, graph: &GraphFile, registry: &Registry) -> String {
    text(graph, registry, |named, value| match value {
        ParamValue::File(_) if Path::new(named).is_absolute() => ParamValue::File(named.into()),
        ParamValue::File(path) => ParamValue::File(across(&path, home)),
        value => value,
    })
}

fn text(
    graph: &GraphFile,
    registry: &Registry,
    shown: impl Fn(&str, ParamValue) -> ParamValue + Copy,
) -> String {
    let mut nodes: Vec<String> = graph.nodes.iter().map(|n| node_text(n, registry, shown)).collect();
    nodes.sort();
    let plain = GraphFile { nodes: Vec::new(), ..graph.clone() };
    format!("{plain}\n{}", nodes.join("\n"))
}

fn node_text(node: &NodeDecl, registry: &Registry, shown: impl Fn(&str, ParamValue) -> ParamValue) -> String {
    let declared = registry.get(&node.kind).map(|kind| &kind.descriptor().params);
    let param = |name: &str| declared.and_then(|all| all.iter().find(|p| p.name == name));
    let text = |s: &asperity_graph::Setting| {
        let value = param(&s.name).and_then(|p| Some((p, read(s, &p.kind)?)));
        match value {
            Some((p, value)) if p.default.as_ref() == Some(&value) => None,
            Some((_, value)) => Some(format!("{}: {}", s.name, shown(s.value.text().unwrap_or(""), value))),
            None => Some(format!("{}: {}", s.name, s.typed.clone().unwrap_or_else(|| s.value.to_string()))),
        }
    };
    let mut params: Vec<String> = node.params.iter().filter_map(text).collect();
    params.sort();
    format!("{:?} {} every {}: {}", node.id, node.kind, node.every, params.join(", "))
}

/// A value as a node of some kind reads it; none where it does not.
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
        // A command line needs no quotes.
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
    use asperity_diagnostics::Source;

    fn base(name: &str) -> Base {
        let text = r#"Graph(version: 1, nodes: {"a": (kind: "gain", params: (gain: 2.0)), "b": (kind: "mix")}, wires: [])"#;
        let graph = GraphFile::parse(&Source::new(format!("{name}.ron"), text)).unwrap();
        Base {
            name: name.into(),
            file: graph.clone(),
            graph,
            registry: asperity_nodes::registry(),
            strength: 1.0,
            plugins: Vec::new(),
        }
    }

    fn study(grids: &str) -> Study {
        let text = format!(r#"Study(version: 1, strokes: [(name: "s")], grids: [{grids}])"#);
        Study::parse(&Source::new("s.ron", text)).unwrap()
    }

    #[test]
    fn all_combinations_are_there_once_by_what_they_differ_in() {
        let study = study(
            r#"(name: "g", knobs: {"a.gain": [1.0, 2.0], "tick_hz": [500, 1000]}), (name: "h", knobs: {"tick_hz": [1000, 250]})"#,
        );
        let settings = Settings::new(&study, &[base("x")], &[]).unwrap();
        let names: Vec<(&str, String)> =
            settings.all.iter().map(|s| (s.name.as_str(), s.grids.join("+"))).collect();
        let want = [
            ("default", "g"),
            ("a.gain=1.0", "g"),
            ("a.gain=1.0 tick_hz=1000", "g"),
            ("tick_hz=1000", "g+h"),
            ("tick_hz=250", "h"),
        ];
        let mut sorted = names.clone();
        sorted.sort();
        let mut wanted = want.map(|(n, g)| (n, g.to_owned()));
        wanted.sort();
        assert_eq!(sorted, wanted);
        assert!(settings.all[0].default && settings.all[1..].iter().all(|s| !s.default));
        let keys: std::collections::BTreeSet<&str> = settings.all.iter().map(|s| s.key.as_str()).collect();
        assert_eq!(keys.len(), 5);
    }

    #[test]
    fn what_comes_to_the_same_parameters_is_one_setting_however_it_is_written() {
        let of = |name: &str, params: &str| {
            let text = format!(
                r#"Graph(version: 1, nodes: {{"r": (kind: "resample", params: ({params})), "g": (kind: "gain", params: (gain: 2.0))}}, wires: [])"#
            );
            Base { graph: GraphFile::parse(&Source::new(name, text)).unwrap(), ..base(name) }
        };
        let study = study(
            r#"(name: "word", knobs: {"r.phase": ["minimum", "linear"]}), (name: "number", knobs: {"g.gain": [2, 2.0, 1.0]}),
                (name: "both", knobs: {"g.gain": [2], "r.phase": [linear]})"#,
        );
        // "linear" is what it is where nothing is said.
        for (params, other) in
            [("phase: minimum", "linear"), ("", "minimum"), ("phase: \"linear\"", "minimum")]
        {
            let settings = Settings::new(&study, &[of("x", params)], &[]).unwrap();
            let names: Vec<&str> = settings.all.iter().map(|s| s.name.as_str()).collect();
            assert_eq!(names, ["default", &format!("r.phase={other}"), "g.gain=1.0"], "{params}");
        }
    }

    #[test]
    fn a_mark_that_is_the_default_keeps_its_name_beside_it() {
        let settings =
            Settings::new(&study(""), &[base("x")], &[Base { name: "mine".into(), ..base("x") }]).unwrap();
        assert_eq!(settings.all.len(), 1);
        assert_eq!(settings.all[0].name, "default (mine)");
        assert!(settings.all[0].mark && settings.all[0].default);
    }

    #[test]
    fn knobs_that_no_graph_has_are_an_error_with_the_nearest_or_left_out() {
        let mut study = study(
            r#"(name: "g", knobs: {"a.gian": [1.0, 3.0], "tick_hz": [1000]}), (name: "h", knobs: {"nothing": [kept]}),
            (name: "i", knobs: {"a": [bypassed]})"#,
        );
        let e = Settings::new(&study, &[base("x")], &[]).unwrap_err().to_string();
        assert!(e.contains("did you mean `a.gain`?"), "{e}");
        study.lenient = true;
        let settings = Settings::new(&study, &[base("x")], &[]).unwrap();
        let names: Vec<&str> = settings.all.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["default", "tick_hz=1000"]);
        let left: Vec<&str> = settings.left_out.iter().map(|(what, _)| what.as_str()).collect();
        assert_eq!(left, ["a.gian", "nothing", "a=bypassed"]);
    }

    #[test]
    fn several_graphs_have_each_their_settings_and_a_mark_is_as_it_is() {
        let study = study(r#"(name: "g", knobs: {"tick_hz": [500, 1000]})"#);
        let settings = Settings::new(&study, &[base("x"), base("y")], &[base("mine")]).unwrap();
        let names: Vec<&str> = settings.all.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["x: default", "y: default", "x: tick_hz=1000", "y: tick_hz=1000", "mine"]);
        assert!(settings.all[4].mark);
    }

    #[test]
    fn a_setting_has_the_same_key_in_whatever_folder_it_lies() {
        let keys = |folder: &str, files: &[&str]| -> Vec<String> {
            let base = |file: &&str| {
                let text = r#"Graph(version: 1, nodes: {"s": (kind: "trajectory", params: (file: "../t/a.csv")), "o": (kind: "trajectory", params: (file: "/o.csv"))}, wires: [])"#;
                let graph = GraphFile::parse(&Source::new(format!("{folder}/{file}"), text)).unwrap();
                Base { graph, ..base(file) }
            };
            let bases: Vec<Base> = files.iter().map(base).collect();
            let text = r#"Study(version: 1, strokes: [(name: "s")], grids: [(name: "g", knobs: {"s.file": ["b.csv"]})])"#;
            let study = Study::parse(&Source::new(format!("{folder}/g/studies/s.ron"), text)).unwrap();
            Settings::new(&study, &bases, &[]).unwrap().all.into_iter().map(|s| s.key).collect()
        };
        let there = keys("/a/b", &["g/g.ron"]);
        assert_eq!(there.len(), 2);
        for folder in ["x", "../y", "/c"] {
            assert_eq!(keys(folder, &["g/g.ron"]), there, "{folder}");
        }
        // What lies elsewhere as seen from the graph is another file, and graphs that say the same of different files are different settings.
        let other = keys("/a/b", &["n/g.ron"]);
        assert_eq!((&other[0], other[1] == there[1]), (&there[0], false));
        let two = keys("/a/b", &["g/g.ron", "h/g.ron"]);
        let different: std::collections::BTreeSet<&String> = two.iter().collect();
        assert_eq!((two.len(), different.len()), (4, 4));
        assert_eq!(two[0], there[0]);
    }
}
