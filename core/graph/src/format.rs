//! The content of a graph file.

use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::ron::{self, Value};
use asperity_diagnostics::{Diagnostic, Place, Source, Span, one_of};

/// Allowed tick rates in Hz.
const TICK_HZ: std::ops::RangeInclusive<i64> = 100..=4000;
/// Allowed audio rates in Hz.
const AUDIO_HZ: std::ops::RangeInclusive<i64> = 8000..=192_000;
/// Allowed values of `every`, in ticks.
pub const EVERY: std::ops::RangeInclusive<i64> = 1..=1000;
/// Default tick rate in Hz.
const DEFAULT_TICK_HZ: u32 = 500;
/// Default audio rate in Hz.
const DEFAULT_AUDIO_HZ: u32 = 48_000;
/// Default seed.
const DEFAULT_SEED: u64 = 1;

/// A graph as declared, before names are resolved.
#[derive(Clone, Debug)]
pub struct GraphFile {
    /// The text it was read from; empty for a graph made by a program.
    pub source: Arc<Source>,
    /// Ticks a second, 100 to 4000.
    pub tick_hz: u32,
    /// Audio rate in Hz, 8000 to 192000.
    pub audio_hz: u32,
    /// Seed of every random number of a render.
    pub seed: u64,
    /// Plugins that provide node kinds. The host loads them before it compiles the graph.
    pub plugins: Vec<PluginDecl>,
    /// Nodes in the order of the file.
    pub nodes: Vec<NodeDecl>,
    /// Wires in the order of the file.
    pub wires: Vec<WireDecl>,
}

/// A plugin in a graph: a file relative to the graph's, or a name.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub struct PluginDecl {
    pub name: String,
    pub place: Place,
}

/// A declared node.
#[derive(Clone, Debug)]
pub struct NodeDecl {
    /// Name in the graph.
    pub id: String,
    /// Position of the name.
    pub place: Place,
    /// Kind of the node.
    pub kind: String,
    /// Position of the kind.
    pub kind_place: Place,
    /// The node runs every `every`-th tick.
    pub every: u32,
    /// Parameters that the file sets.
    pub params: Vec<Setting>,
    /// Name that its seed follows from; its own for `None`.
    pub seeded_as: Option<String>,
}

/// A parameter with its value.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub struct Setting {
    pub name: String,
    pub place: Place,
    pub value: Value,
    /// The text as typed on a command line, where texts need no quotes.
    pub typed: Option<String>,
}

/// One end of a wire.
#[derive(Clone, Debug)]
pub struct Endpoint {
    /// Id of a node.
    pub node: String,
    /// Name of a port; `None` for the node's only one.
    pub port: Option<String>,
    /// Its position.
    pub place: Place,
}

/// A declared wire.
#[derive(Clone, Debug)]
#[allow(missing_docs)]
pub struct WireDecl {
    pub from: Endpoint,
    pub to: Endpoint,
}

impl GraphFile {
    /// Reads a graph file.
    ///
    /// # Errors
    /// A file that cannot be read, is not RON, or has wrong fields.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        Self::parse(&Source::read(path)?)
    }

    /// Reads a graph from a text.
    ///
    /// # Errors
    /// A text that is not RON or has wrong fields.
    pub fn parse(source: &Arc<Source>) -> Result<Self, Diagnostic> {
        let value = ron::parse(source)?;
        let mut graph = value.record("Graph").map_err(|e| match e.help {
            None => e.help("a graph begins with `Graph(`, a scene with `Scene(`"),
            Some(_) => e,
        })?;
        let version = graph.required("version")?;
        if version.i64()? != 1 {
            return Err(version
                .error("unknown version of the graph format")
                .help("this program reads version 1"));
        }
        let mut it = Self { source: source.clone(), ..Self::empty("") };
        for name in ["tick_hz", "audio_hz", "seed"] {
            if let Some(value) = graph.optional(name) {
                it.set_field(name, value)?;
            }
        }
        it.plugins = items(graph.optional("plugins"), plugin)?;
        let nodes = graph.required("nodes")?.map()?;
        it.nodes = nodes.iter().map(|(key, v)| NodeDecl::read(key, v)).collect::<Result<_, _>>()?;
        it.wires = items(graph.optional("wires"), wire)?;
        graph.finish()?;
        Ok(it)
    }

    /// Sets a number of the graph. Returns whether it has one of this name.
    fn set_field(&mut self, name: &str, value: &Value) -> Result<bool, Diagnostic> {
        match name {
            "tick_hz" => self.tick_hz = value.i64_in(TICK_HZ, "Hz")? as u32,
            "audio_hz" => self.audio_hz = value.i64_in(AUDIO_HZ, "Hz")? as u32,
            "seed" => self.seed = value.i64_in(0..=i64::MAX, "")? as u64,
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// An empty graph for a program to fill. `name` stands for the file in errors.
    pub fn empty(name: &str) -> Self {
        Self {
            source: Source::new(name, ""),
            tick_hz: DEFAULT_TICK_HZ,
            audio_hz: DEFAULT_AUDIO_HZ,
            seed: DEFAULT_SEED,
            plugins: Vec::new(),
            nodes: Vec::new(),
            wires: Vec::new(),
        }
    }

    /// A node by its id.
    pub fn node(&self, id: &str) -> Option<&NodeDecl> {
        self.nodes.iter().find(|n| n.id == id)
    }

    /// Sets a parameter of a node, or a field of the graph, from a text such as `stylus.speed_mm_s=80`,
    /// `texture.every=2` or `audio_hz=44100`. `origin` stands for the file in errors, such as `--set`.
    ///
    /// # Errors
    /// A text without `=`, an unknown node or field, a value out of range. An unknown parameter is an
    /// error only when the graph is compiled.
    pub fn set(&mut self, assignment: &str, origin: &str) -> Result<(), Diagnostic> {
        let source = Source::new(origin, assignment);
        let whole = Span { start: 0, end: assignment.len() };
        let fail = |m: String, help: String| Diagnostic::new(m).at(&source, whole).help(help);
        let Some((target, text)) = assignment.split_once('=') else {
            return Err(fail("there is no `=` in this".into(), "NODE.PARAM=VALUE".into()));
        };
        let value = ron::parse_or_text(&Source::new(format!("{origin} {}", target.trim()), text.trim()))?;
        self.set_value(target.trim(), value, Place { source, span: whole }, Some(text.trim().to_owned()))
    }

    /// Sets a parameter of a node, or a field of the graph, to a value of another file: `place` is where it
    /// names the target, such as `stylus.speed_mm_s`, and `typed` the value as a person typed it.
    ///
    /// # Errors
    /// An unknown node or field, a value out of range. An unknown parameter is an error only when the graph
    /// is compiled.
    pub fn set_value(
        &mut self,
        target: &str,
        value: Value,
        place: Place,
        typed: Option<String>,
    ) -> Result<(), Diagnostic> {
        let fail = |m: String, help: String| Diagnostic::new(m).at_place(&place).help(help);
        match target.split_once('.') {
            None => {
                if !self.set_field(target, &value)? {
                    let help = one_of(target, ["tick_hz", "audio_hz", "seed"]);
                    return Err(fail(format!("the graph has no setting `{target}`"), help));
                }
            }
            Some((id, param)) => {
                let Some(at) = self.nodes.iter().position(|n| n.id == id) else {
                    let help = one_of(id, self.nodes.iter().map(|n| n.id.as_str()));
                    return Err(fail(format!("the graph has no node `{id}`"), help));
                };
                let node = &mut self.nodes[at];
                if param == "every" {
                    node.every = value.i64_in(EVERY, "ticks")? as u32;
                    return Ok(());
                }
                node.params.retain(|s| s.name != param);
                node.params.push(Setting { name: param.to_owned(), place, value, typed });
            }
        }
        Ok(())
    }

    /// Adds a node that no file declares, such as a probe from the command line. Parameters are RON
    /// texts. `origin` stands for the file in errors.
    ///
    /// # Errors
    /// A parameter that is no RON value, an id that is taken.
    pub fn add_node(
        &mut self,
        id: &str,
        kind: &str,
        params: &[(&str, &str)],
        origin: &str,
    ) -> Result<(), Diagnostic> {
        let at = |text: &str| Place {
            source: Source::new(origin, text),
            span: Span { start: 0, end: text.len() },
        };
        if self.node(id).is_some() {
            return Err(Diagnostic::new(format!("the graph has a node `{id}` already")).in_file(origin));
        }
        let setting = |(name, text): &(&str, &str)| {
            let value = ron::parse_or_text(&Source::new(origin, *text))?;
            Ok(Setting { name: (*name).to_owned(), place: at(name), value, typed: Some((*text).to_owned()) })
        };
        self.nodes.push(NodeDecl {
            id: id.to_owned(),
            place: at(id),
            kind: kind.to_owned(),
            kind_place: at(kind),
            every: 1,
            params: params.iter().map(setting).collect::<Result<_, _>>()?,
            seeded_as: None,
        });
        Ok(())
    }

    /// Adds a wire between two endpoints such as `texture.magnitude` and `probe`.
    pub fn add_wire(&mut self, from: &str, to: &str, origin: &str) {
        let end = |text: &str| {
            let source = Source::new(origin, text);
            endpoint(text, Place { span: Span { start: 0, end: text.len() }, source })
        };
        self.wires.push(WireDecl { from: end(from), to: end(to) });
    }
}

/// The items of a list that may be left out.
fn items<T>(
    list: Option<&Value>,
    item: impl Fn(&Value) -> Result<T, Diagnostic>,
) -> Result<Vec<T>, Diagnostic> {
    list.map_or(Ok(Vec::new()), |v| v.list()?.iter().map(item).collect())
}

fn plugin(value: &Value) -> Result<PluginDecl, Diagnostic> {
    let name = value.text()?.to_owned();
    if name.trim().is_empty() {
        return Err(value.error("the name of a plugin is empty").help("plugins: [\"libmy_phase.so\"]"));
    }
    Ok(PluginDecl { name, place: value.place() })
}

impl NodeDecl {
    /// Reads a node from its entry in a graph's map: its id, and `(kind: "..", every: .., params:
    /// (..))`.
    ///
    /// # Errors
    /// An invalid id, or a value that is no such record.
    pub fn read(key: &ron::Key, value: &Value) -> Result<Self, Diagnostic> {
        let source = value.source();
        let place = |span| Place { source: source.clone(), span };
        if let Some(bad) = key.name.chars().find(|c| !(c.is_alphanumeric() || matches!(c, '_' | '-' | ' '))) {
            return Err(Diagnostic::new(format!("a node's id may not contain `{bad}`"))
                .at(source, key.span)
                .help("letters, digits, `_`, `-` and spaces"));
        }
        if key.name.trim().is_empty() || key.name.trim() != key.name {
            return Err(
                Diagnostic::new("a node's id may not be blank or begin or end blank").at(source, key.span)
            );
        }
        let mut record = value.record("Node")?;
        let kind_value = record.required("kind")?;
        let kind = kind_value.text()?.to_owned();
        let every = record.optional("every").map_or(Ok(1), |v| v.i64_in(EVERY, "ticks"))? as u32;
        let mut params = Vec::new();
        if let Some(v) = record.optional("params") {
            for (key, value) in v.record("Params")?.all() {
                let (name, place) = (key.name.clone(), place(key.span));
                params.push(Setting { name, place, value: value.clone(), typed: None });
            }
        }
        record.finish()?;
        Ok(Self {
            id: key.name.clone(),
            place: place(key.span),
            kind,
            kind_place: kind_value.place(),
            every,
            params,
            seeded_as: None,
        })
    }
}

fn wire(value: &Value) -> Result<WireDecl, Diagnostic> {
    let ends = value.list()?;
    let [from, to] = ends else {
        return Err(value
            .error(format!("a wire has two ends, found {}", ends.len()))
            .help("(\"node.output\", \"node.input\")"));
    };
    let end = |v: &Value| v.text().map(|text| endpoint(text, v.place()));
    Ok(WireDecl { from: end(from)?, to: end(to)? })
}

fn endpoint(text: &str, place: Place) -> Endpoint {
    match text.split_once('.') {
        Some((node, port)) => Endpoint { node: node.to_owned(), port: Some(port.to_owned()), place },
        None => Endpoint { node: text.to_owned(), port: None, place },
    }
}
