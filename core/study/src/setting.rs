//! Settings: a graph, and what was turned about it.

use std::collections::HashMap;
use std::path::PathBuf;

use asperity_graph::{GraphFile, text_of};
use asperity_node::Registry;
use asperity_source::Diagnostic;
use asperity_source::ron::Value;

use crate::file::{Grid, Study};
use crate::knob::Turned;

/// A graph that settings are made of.
#[derive(Clone, Debug)]
pub struct Base {
    /// What it is called: how its file was named.
    pub name: String,
    /// It; of a scene, what that lowers to.
    pub graph: GraphFile,
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
    /// What tells it from every other, and from itself after a change of any file it was made of.
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
            let name = named(bases, b, "default");
            it.take(&mut known, (b, base), turned, Vec::new(), None, (name, true, false));
        }
        for grid in &study.grids {
            for (knob, _) in &grid.knobs {
                let lacks = |base: &&Base| !knob.fits(&base.graph, &base.registry);
                if bases.iter().filter(lacks).count() == bases.len() && !bases.is_empty() {
                    let graphs: Vec<&str> = bases.iter().map(|b| b.name.as_str()).collect();
                    return Err(Diagnostic::new(format!(
                        "no graph has `{knob}` to turn: {}",
                        graphs.join(", ")
                    ))
                    .at(&knob.place().source, knob.place().span));
                }
                for base in bases.iter().filter(lacks) {
                    it.leave_out(
                        &knob.to_string(),
                        &format!("{} has nothing of that name to turn", base.name),
                    );
                }
            }
            for (b, base) in bases.iter().enumerate() {
                it.grid(&mut known, bases, b, base, grid)?;
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
        base: &Base,
        grid: &Grid,
    ) -> Result<(), Diagnostic> {
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
        for mut number in 0..count {
            let mut turned = Turned { graph: base.graph.clone(), guards: true };
            let mut changes = Vec::new();
            for (knob, values) in &knobs {
                let value = values[number % values.len()];
                number /= values.len();
                let before = (turned.graph.to_string(), turned.guards);
                knob.turn(&mut turned, value, &base.registry)?;
                if (turned.graph.to_string(), turned.guards) != before {
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
        let text = format!("{}\n{guards} {strength}\n{}", graph.source.path().display(), same(&graph));
        let at = *known.entry(text.clone()).or_insert(self.all.len());
        if let Some(there) = self.all.get_mut(at) {
            there.grids.extend(grid.filter(|g| !there.grids.contains(g)));
            there.mark |= mark;
            return;
        }
        let key = format!("{:016x}", fnv(&text));
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
    let text = text_of(value);
    let Some(rest) = text.strip_prefix("(kind: \"") else { return text.trim_matches('"').to_owned() };
    let Some((kind, rest)) = rest.split_once('"') else { return text };
    let params = rest.strip_prefix(", params: (").and_then(|r| r.strip_suffix("))"));
    match params {
        Some(params) if !params.is_empty() => format!("{kind}({params})"),
        _ => kind.to_owned(),
    }
}

/// A graph's text by which it is the same as another: parameters and nodes in order of their names.
fn same(graph: &GraphFile) -> String {
    let mut graph = graph.clone();
    graph.nodes.iter_mut().for_each(|n| n.params.sort_by(|a, b| a.name.cmp(&b.name)));
    graph.nodes.sort_by(|a, b| a.id.cmp(&b.id));
    graph.to_string()
}

/// FNV-1a of 64 bits (Fowler, Noll, Vo), which is the same on every machine.
pub(crate) fn fnv(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_source::Source;

    fn base(name: &str) -> Base {
        let text = r#"Graph(version: 1, nodes: {"a": (kind: "gain", params: (gain: 2.0)), "b": (kind: "mix")}, wires: [])"#;
        Base {
            name: name.into(),
            graph: GraphFile::parse(&Source::new(format!("{name}.ron"), text)).unwrap(),
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
    fn several_graphs_have_each_their_settings_and_a_mark_is_as_it_is() {
        let study = study(r#"(name: "g", knobs: {"tick_hz": [500, 1000]})"#);
        let settings = Settings::new(&study, &[base("x"), base("y")], &[base("mine")]).unwrap();
        let names: Vec<&str> = settings.all.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["x: default", "y: default", "x: tick_hz=1000", "y: tick_hz=1000", "mine"]);
        assert!(settings.all[4].mark);
    }

    #[test]
    fn the_same_text_has_the_same_key_on_every_machine() {
        // FNV-1a of "a", as its authors publish it.
        assert_eq!(fnv("a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv(""), 0xcbf2_9ce4_8422_2325);
    }
}
