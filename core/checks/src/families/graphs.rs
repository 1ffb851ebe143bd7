//! Graphs of any shape, and a graph beside itself.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source};
use asperity_graph::GraphFile;
use asperity_node::random::bits;
use asperity_node::{
    Descriptor, Fault, FrameLayout, FrameRate, Input, LayoutSpec, NodeKind, Output, ParamKind, RateSpec,
    ShapeSpec, Unit, UnitSpec, Var,
};

use super::often;
use crate::buffers::{finite, same};
use crate::case::{Case, Family, Found, Stop};
use crate::played::{Motion, Played, samples};
use crate::rig::Rig;
use crate::subject::Subject;

const GRAPHS: Family = Family("graphs");

pub(super) const CASES: &[Case] = &[
    GRAPHS.kinds(
        "random_graphs",
        random,
        "random graphs of up to 40 nodes of any kinds. Most parameters and wires fit, some do not",
        "a graph that loads runs for 60 ticks, finite and without a fault, except numbers beyond all \
         bounds in a loop, which are contained. A graph that does not load is refused with a reason and a \
         place in its file",
    ),
    GRAPHS.graph(
        "same_bytes",
        same_bytes,
        "the graph is compiled and run twice, tick by tick side by side",
        "every output of every node is the same in every tick, to the bit",
    ),
];

/// Most nodes of a graph.
const MOST: usize = 40;
/// Ticks of each run.
const TICKS: u64 = 60;
/// The name of such a graph.
const NAME: &str = "drawn.ron";

/// A random graph, as a file.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The text of the file.
    pub text: String,
    /// Ticks a second.
    tick_hz: u32,
}

/// The result of a random graph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Became {
    /// It ran.
    Ran {
        /// Number of nodes.
        nodes: usize,
        /// Whether it has a loop.
        looped: bool,
        /// Faults of a loop beyond all bounds, which were contained.
        contained: u64,
    },
    /// It was refused, for this reason.
    Refused(String),
}

/// Kinds that play in such graphs, beside the subject's own.
fn players(tick_hz: u32) -> Vec<Arc<NodeKind>> {
    let noise = |n: u64| (2.0 * asperity_node::random::uniform(9, n) - 1.0) as f32;
    let control = |name: &str, count, unit| {
        let values = Arc::new(move |tick: u64, out: &mut [f64]| {
            for (x, i) in out.iter_mut().zip(0..) {
                *x = f64::from(noise(4 * tick + i));
            }
        });
        Played::control(name, count, unit, values)
    };
    let audio = samples(noise);
    let mut all = vec![
        control("some force", 1, Unit::NEWTON),
        control("some place", 3, Unit::MILLIMETRE),
        control("some motion", 2, Unit::MILLIMETRE_PER_SECOND),
        control("some speed", 1, Unit::MILLIMETRE_PER_SECOND),
        Played::audio("some acceleration", Unit::METRE_PER_SECOND_SQUARED, audio.clone()),
        Played::audio_at("some slow sound", 2500, Unit::METRE_PER_SECOND_SQUARED, audio.clone()),
        Played::audio("some current", Unit::AMPERE, audio),
    ];
    if let Some(frame_rate) = FrameRate::new(tick_hz, 1) {
        let layout = FrameLayout { rate_hz: 2500, length: 250, bins: 101, frame_rate };
        let frames = Arc::new(move |frame: u64, out: &mut [f32]| {
            for (x, i) in out.iter_mut().zip(0..) {
                *x = noise(128 * frame + i).abs();
            }
            frame % 5 != 3
        });
        all.push(Played::magnitudes("some spectra", layout, frames));
    }
    all
}

/// Draws a graph of a subject's kinds. `choose` answers a number below the one that it is given; 0 makes the
/// graph simpler.
pub fn drawn(subject: &Subject<'_>, choose: &mut dyn FnMut(usize) -> usize) -> Drawn {
    let tick_hz = [500, 1000, 100, 4000, 441][choose(5)];
    let audio_hz = [48_000, 44_100, 8000, 96_000][choose(4)];
    let players = players(tick_hz);
    // Kinds that need a file, a material or a place are left out.
    let simple = |d: &&Descriptor| d.params.iter().all(|p| p.default.is_some() || p.optional);
    let kinds: Vec<&Descriptor> =
        players.iter().chain(subject.registry.iter()).map(|k| k.descriptor()).filter(simple).collect();
    let mut types = Types { nodes: Vec::new(), bound: Vec::new(), audio_hz };
    let mut wires = Vec::new();
    // Inputs from later nodes: loops.
    let mut later = Vec::new();
    for to in 0..1 + choose(MOST) {
        // Mostly a kind whose inputs can be wired.
        let mut d = kinds[choose(kinds.len())];
        let tries = if choose(200) == 199 { 0 } else { 40 };
        for _ in 0..tries {
            if types.serves(d) {
                break;
            }
            d = kinds[choose(kinds.len())];
        }
        types.nodes.push(d);
        types.bound.push(Bound::default());
        for input in &d.inputs {
            if input.optional && choose(3) == 0 {
                continue;
            }
            let one_in = if d.feedback.is_some() { 2 } else { 60 };
            if choose(one_in) == one_in - 1 {
                later.push((to, input));
            } else {
                wires.extend(wire(&mut types, to, (to, input), choose));
            }
        }
    }
    for end in later {
        let all = types.nodes.len();
        wires.extend(wire(&mut types, all, end, choose));
    }
    let nodes = &types.nodes;
    let mut text = format!("Graph(version: 1, tick_hz: {tick_hz}, audio_hz: {audio_hz}, nodes: {{\n");
    for (i, d) in nodes.iter().enumerate() {
        let kind = if choose(2000) == 1999 { format!("{}x", d.kind) } else { d.kind.to_string() };
        let params: Vec<String> = d.params.iter().filter_map(|p| param(&p.name, &p.kind, choose)).collect();
        let unknown = if choose(2000) == 1999 { "nothing: 1" } else { "" };
        let rarely = if types.hears(i) { 1200 } else { 60 };
        let every =
            if choose(rarely) == rarely - 1 { format!("every: {}, ", 2 + choose(2)) } else { String::new() };
        let _ =
            writeln!(text, "    \"n{i}\": (kind: {kind:?}, {every}params: ({}{unknown})),", params.concat());
    }
    // A node without a sink does not run, so every loose end gets a probe.
    let heard: BTreeSet<usize> = wires.iter().map(|(from, ..)| *from).collect();
    let ends = nodes.iter().enumerate().filter(|(i, _)| !heard.contains(i));
    let ends = ends.filter_map(|(i, d)| Some((i, d.outputs.first()?)));
    let ends: Vec<(usize, &Output)> = ends.filter(|(i, o)| types.knows(*i, o)).collect();
    for (i, _) in &ends {
        let _ = writeln!(text, "    \"end{i}\": (kind: \"probe\"),");
    }
    text += "}, wires: [\n";
    for (i, output) in &ends {
        let _ = writeln!(text, "    (\"n{i}.{}\", \"end{i}\"),", output.name);
    }
    for (from, output, to, input) in wires {
        let name = if choose(2000) == 1999 { "no_such_port" } else { &input.name };
        let _ = writeln!(text, "    (\"n{from}.{}\", \"n{to}.{name}\"),", output.name);
    }
    text += "])\n";
    Drawn { text, tick_hz }
}

/// Wires an input to one of the nodes before `reach`: mostly to one that fits.
fn wire<'d>(
    types: &mut Types<'d>,
    reach: usize,
    (to, input): (usize, &'d Input),
    choose: &mut dyn FnMut(usize) -> usize,
) -> Option<(usize, &'d Output, usize, &'d Input)> {
    let any = choose(800) == 799;
    let beyond = choose(64) == 63;
    let near = types.outputs().filter(|(from, o)| *from < reach && (beyond || types.is_sure(*from, o)));
    let fits: Vec<_> =
        near.filter(|(from, o)| any || types.joins(*from, o, &types.bound[to], input)).collect();
    let (from, output) = *fits.get(fits.len().checked_sub(1 + choose(fits.len()))?)?;
    types.join(from, output, to, input);
    Some((from, output, to, input))
}

/// The text of a parameter, or none: mostly it is left out.
fn param(name: &str, kind: &ParamKind, choose: &mut dyn FnMut(usize) -> usize) -> Option<String> {
    // Factors that let most loops end.
    match name {
        "gain" => return Some(format!("gain: {}, ", ["0.5", "-0.9", "1.0", "0.0"][choose(4)])),
        "inputs" => return Some(format!("inputs: {}, gains: [0.4], ", 2 + choose(2))),
        "gains" | "unit" => return None,
        _ => {}
    }
    if choose(12) < 11 {
        return None;
    }
    let value = match kind {
        ParamKind::Number(r) => {
            let (a, b) = (*r.start(), *r.end());
            let beyond = if choose(1000) == 999 { b.abs() + 1.0 } else { 0.0 };
            format!("{:?}", [a, b, 0.5 * (a + b), a + 0.01 * (b - a)][choose(4)] + beyond)
        }
        ParamKind::Integer(r) => [*r.start(), *r.end(), (r.start() + r.end()) / 2][choose(3)].to_string(),
        ParamKind::Flag => ["false", "true"][choose(2)].to_owned(),
        ParamKind::Choice(words) if !words.is_empty() => format!("{:?}", words[choose(words.len())]),
        _ => return None,
    };
    Some(format!("{name}: {value}, "))
}

impl Drawn {
    /// Loads and runs it.
    ///
    /// # Errors
    /// Something that must hold does not.
    pub fn run(&self, subject: &Subject<'_>) -> Result<Became, Stop> {
        let source = Source::new(NAME, self.text.as_str());
        let told = |e: &Diagnostic| {
            ensure!(!e.message.trim().is_empty() && e.place.is_some(), "refused without a place: {e}");
            Ok::<_, Stop>(e.message.clone())
        };
        let graph = match GraphFile::parse(&source) {
            Ok(graph) => graph,
            Err(e) => return Ok(Became::Refused(told(&e)?)),
        };
        let compiled = match subject.compile(&graph, &players(self.tick_hz)) {
            Ok(compiled) => compiled,
            Err(errors) => {
                let first = errors.iter().map(told).collect::<Result<Vec<_>, _>>()?.into_iter().next();
                let why = first.ok_or_else(|| Stop::Failed("refused without a word".into()))?;
                return Ok(Became::Refused(why));
            }
        };
        let mut rig = Rig::from(compiled);
        let nodes = rig.schedule.nodes.len();
        let looped = rig.schedule.nodes.iter().any(|n| n.closes_cycle);
        rig.run(TICKS, |rig, tick| {
            match rig.outputs().find(|&(i, o)| !rig.engine.output(i, o).is_some_and(finite)) {
                Some((i, o)) => {
                    let (name, kind) = (rig.name(i, o), &rig.schedule.nodes[i].kind);
                    bail!("`{name}` ({kind}) is not finite in tick {tick}")
                }
                None => Ok(()),
            }
        })?;
        let mut contained = 0;
        for (i, node) in rig.schedule.nodes.iter().enumerate() {
            let Some(report) = rig.engine.report(i).filter(|r| r.faults > 0) else { continue };
            let beyond = looped && report.last_fault == Some(Fault::NotFinite);
            let how = report.last_fault.map(|f| f.to_string()).unwrap_or_default();
            ensure!(beyond, "`{}` ({}) {how}", node.id, node.kind);
            contained += report.faults;
        }
        Ok(Became::Ran { nodes, looped, contained })
    }
}

fn random(subject: &Subject<'_>) -> Found {
    let graphs = subject.by_effort(100, 1500, 100_000);
    let (mut ran, mut nodes, mut loops, mut beyond) = (0_u64, 0, 0, 0);
    let mut refused = BTreeMap::new();
    // Without names and numbers.
    let gist =
        |why: &str| why.split('`').step_by(2).collect::<Vec<_>>().join("`_`").replace(char::is_numeric, "");
    for seed in 0..graphs {
        let mut count = 0;
        let mut choose = |n: usize| {
            count += 1;
            (bits(seed, count) % n.max(1) as u64) as usize
        };
        let graph = drawn(subject, &mut choose);
        match graph.run(subject).map_err(|e| e.after(&format!("graph {seed}:\n{}", graph.text)))? {
            Became::Ran { nodes: n, looped, contained } => {
                (ran, nodes) = (ran + 1, nodes + n);
                loops += u64::from(looped);
                beyond += u64::from(contained > 0);
            }
            Became::Refused(why) => *refused.entry(gist(&why)).or_default() += 1,
        }
    }
    let often = often(&refused);
    ensure!(3 * ran >= graphs, "only {ran} of {graphs} could be run; {often}");
    Ok(format!(
        "{ran} of {graphs} ran, of {} nodes on average, {loops} with a loop, which went beyond all bounds in \
         {beyond}; the others were refused, such as, {often}",
        nodes as u64 / ran.max(1)
    ))
}

/// A known shape.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Known {
    Control(usize),
    Audio(u32),
    Magnitude(FrameLayout),
    Spectrum(FrameLayout),
}

/// Values of a node's variables. A variable of a layout is one of its rate too.
#[derive(Clone, Debug, Default)]
struct Bound {
    shapes: BTreeMap<Var, Known>,
    units: BTreeMap<Var, Unit>,
}

impl Bound {
    /// A shape, where its variables are known.
    fn shape(&self, spec: &ShapeSpec, audio_hz: u32) -> Option<Known> {
        let known = |var: &Var| self.shapes.get(var).copied();
        let layout = |layout: &LayoutSpec| match layout {
            LayoutSpec::Is(layout) => Some(*layout),
            LayoutSpec::Of(var) => match known(var)? {
                Known::Magnitude(layout) | Known::Spectrum(layout) => Some(layout),
                Known::Control(_) | Known::Audio(_) => None,
            },
        };
        Some(match spec {
            ShapeSpec::Like(var) => return known(var),
            ShapeSpec::Control(count) => Known::Control(*count),
            ShapeSpec::Audio(RateSpec::Graph) => Known::Audio(audio_hz),
            ShapeSpec::Audio(RateSpec::Hz(hz)) => Known::Audio(*hz),
            ShapeSpec::Audio(RateSpec::Of(var)) => match known(var)? {
                Known::Magnitude(layout) | Known::Spectrum(layout) => Known::Audio(layout.rate_hz),
                known => known,
            },
            ShapeSpec::Magnitude(of) => Known::Magnitude(layout(of)?),
            ShapeSpec::Spectrum(of) => Known::Spectrum(layout(of)?),
        })
    }

    /// Whether a shape is or can become this.
    fn takes(&self, spec: &ShapeSpec, known: Known, audio_hz: u32) -> bool {
        match (self.shape(spec, audio_hz), spec, known) {
            (Some(own), ..) => own == known,
            (None, ShapeSpec::Like(_), _)
            | (None, ShapeSpec::Audio(_), Known::Audio(_))
            | (None, ShapeSpec::Magnitude(_), Known::Magnitude(_))
            | (None, ShapeSpec::Spectrum(_), Known::Spectrum(_)) => true,
            _ => false,
        }
    }

    fn unit<'s>(&'s self, spec: &'s UnitSpec) -> Option<&'s Unit> {
        match spec {
            UnitSpec::Is(unit) => Some(unit),
            UnitSpec::Of { var, .. } => self.units.get(var),
        }
    }

    fn bind(&mut self, shape: &ShapeSpec, known: Option<Known>, unit: &UnitSpec, is: Option<&Unit>) {
        if let (
            ShapeSpec::Like(var)
            | ShapeSpec::Audio(RateSpec::Of(var))
            | ShapeSpec::Magnitude(LayoutSpec::Of(var))
            | ShapeSpec::Spectrum(LayoutSpec::Of(var)),
            Some(known),
        ) = (shape, known)
        {
            let bound = self.shapes.entry(*var).or_insert(known);
            // A layout says more than its rate.
            *bound = if let Known::Audio(_) = known { *bound } else { known };
        }
        if let (UnitSpec::Of { var, .. }, Some(unit)) = (unit, is) {
            self.units.insert(*var, unit.clone());
        }
    }
}

/// The nodes of a graph that is drawn, and the known types of their ports: nearly those of the compiler.
struct Types<'d> {
    nodes: Vec<&'d Descriptor>,
    bound: Vec<Bound>,
    audio_hz: u32,
}

impl<'d> Types<'d> {
    /// Whether every input that needs a wire can have one.
    fn serves(&self, node: &Descriptor) -> bool {
        let new = Bound::default();
        let served =
            |input: &Input| self.outputs().any(|(i, o)| self.is_sure(i, o) && self.joins(i, o, &new, input));
        node.inputs.iter().filter(|input| !input.optional).all(served)
    }

    /// All outputs, with their nodes.
    fn outputs(&self) -> impl Iterator<Item = (usize, &'d Output)> + '_ {
        self.nodes.iter().enumerate().flat_map(|(i, d)| d.outputs.iter().map(move |o| (i, o)))
    }

    /// Whether an output always exists: a node of a file or a message often has its first output only.
    fn is_sure(&self, node: usize, output: &Output) -> bool {
        let d = self.nodes[node];
        d.inputs.iter().any(|i| !i.optional && !i.host_fed)
            || d.outputs.first().is_some_and(|f| f.name == output.name)
    }

    /// Whether an output fits an input of a node, as far as is known.
    fn joins(&self, from: usize, output: &Output, to: &Bound, input: &Input) -> bool {
        let (bound, hz) = (&self.bound[from], self.audio_hz);
        let shapes = match bound.shape(&output.shape, hz) {
            Some(known) => to.takes(&input.shape, known, hz),
            // The type of a later node is unknown: only a node that closes a loop is wired to it.
            None => {
                let known = to.shape(&input.shape, hz).filter(|_| self.nodes[from].feedback.is_some());
                known.is_some_and(|known| bound.takes(&output.shape, known, hz))
            }
        };
        let among = |spec: &UnitSpec, unit: &Unit| match spec {
            UnitSpec::Is(_) => true,
            UnitSpec::Of { among, .. } => among.is_empty() || among.contains(unit),
        };
        let units = match (bound.unit(&output.unit), to.unit(&input.unit)) {
            (Some(a), Some(b)) => a == b,
            (Some(a), None) => among(&input.unit, a),
            (None, Some(b)) => among(&output.unit, b),
            (None, None) => true,
        };
        shapes && units && (!input.limited || output.limited)
    }

    /// Binds the types of both ends of a wire.
    fn join(&mut self, from: usize, output: &Output, to: usize, input: &Input) {
        let (a, b) = (&self.bound[from], &self.bound[to]);
        let shape = a.shape(&output.shape, self.audio_hz).or(b.shape(&input.shape, self.audio_hz));
        let unit = a.unit(&output.unit).or(b.unit(&input.unit)).cloned();
        self.bound[from].bind(&output.shape, shape, &output.unit, unit.as_ref());
        self.bound[to].bind(&input.shape, shape, &input.unit, unit.as_ref());
    }

    /// Whether the type of an output is known.
    fn knows(&self, node: usize, output: &Output) -> bool {
        self.bound[node].shape(&output.shape, self.audio_hz).is_some()
    }

    /// Whether a node carries audio, and so runs in every tick.
    fn hears(&self, node: usize) -> bool {
        let (d, bound) = (self.nodes[node], &self.bound[node]);
        let specs = d.inputs.iter().map(|i| &i.shape).chain(d.outputs.iter().map(|o| &o.shape));
        specs.into_iter().any(|spec| matches!(bound.shape(spec, self.audio_hz), Some(Known::Audio(_))))
    }
}

/// The first output that differs.
fn differs(a: &Rig, b: &Rig) -> Option<String> {
    let differ = |i, o| match (a.engine.output(i, o), b.engine.output(i, o)) {
        (Some(a), Some(b)) => !same(a, b),
        (a, b) => a.is_some() != b.is_some(),
    };
    a.outputs().find(|(i, o)| differ(*i, *o)).map(|(i, o)| a.name(i, o))
}

fn same_bytes(subject: &Subject<'_>) -> Found {
    let hz = f64::from(subject.its_graph()?.tick_hz);
    let motion: Motion = Arc::new(move |tick| {
        let t = tick as f64 / hz;
        // On and off the surface, slow and fast, here and there.
        [30.0 * (2.0 * t).sin() * t.cos(), 30.0 * t.sin(), 1.0 - 3.0 * (1.3 * t).sin().abs()]
    });
    let rig = || Rig::moved_if_possible(subject, motion.clone());
    let (mut one, mut other) = (rig()?, rig()?);
    let ticks = one.ticks(subject.by_effort(3.0, 10.0, 120.0));
    one.run(ticks, |one, tick| {
        other.engine.tick();
        match differs(one, &other) {
            Some(output) => bail!("`{output}` differs in tick {tick}"),
            None => Ok(()),
        }
    })?;
    let outputs: usize = one.schedule.nodes.iter().map(|n| n.outputs.len()).sum();
    ensure!(one.schedule == other.schedule, "the schedules differ");
    Ok(format!("{outputs} outputs are the same in each of {ticks} ticks"))
}
