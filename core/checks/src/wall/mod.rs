//! What pushes back in a graph: the force that it answers to the place of a stylus, apart from all else that it does.
//!
//! What only plays, draws or writes is taken out, so that a tick costs what the force costs; what is asked of it is the graph's own.

mod law;
mod spots;

pub(crate) use law::{Curve, Near};
pub(crate) use spots::{Column, Spot, pitch_mm};

use std::sync::Arc;

use asperity_graph::{GraphFile, WireDecl};
use asperity_node::{Descriptor, NodeKind, Output, ShapeSpec, Unit, UnitSpec};
use asperity_scene::effect::passivity::Sampling;

use crate::case::{Not, not_applicable};
use crate::played::{Place, Played};
use crate::rig::Rig;
use crate::subject::Subject;

/// The sinks of a case of its own; no file can have a node of this name.
const PROBES: [&str; 2] = [" the force ", " the wall "];

/// The force of a graph.
pub(crate) struct Wall {
    rig: Rig,
    place: Arc<Place>,
    force: (usize, usize),
    /// Whether that is a vector; else it acts along the normal that the wall tells.
    vector: bool,
    told: Told,
    /// Ticks from one force to the next.
    every: u64,
    delay_s: f64,
    source: String,
    /// Whether a device is told of the wall, to evaluate it by itself.
    handed_on: bool,
}

/// What the node of the wall tells of it: node, and outputs.
#[derive(Clone, Copy, Debug)]
struct Told {
    node: usize,
    force: usize,
    normal: usize,
    stiffness: Option<usize>,
    damping: Option<usize>,
}

fn is(output: &Output, name: &str, count: usize, unit: &Unit) -> bool {
    output.name == name
        && output.shape == ShapeSpec::Control(count)
        && output.unit == UnitSpec::Is(unit.clone())
}

/// Whether a kind tells of a wall: the force along a normal.
pub(crate) fn tells(d: &Descriptor) -> bool {
    d.outputs.iter().any(|o| is(o, "force", 1, &Unit::NEWTON))
        && d.outputs.iter().any(|o| is(o, "normal", 3, &Unit::NONE))
}

/// Kinds that are a wall by themselves: they tell of one, and take nothing but a place.
pub(crate) fn floors(subject: &Subject<'_>) -> Vec<Arc<dyn NodeKind>> {
    let takes_a_place = |d: &Descriptor| {
        let mut needed = d.inputs.iter().filter(|i| !i.optional && !i.fed);
        let first = needed.next().is_some_and(|i| i.shape == ShapeSpec::Control(3) && i.name == "position");
        first && needed.next().is_none()
    };
    let all = subject.registry().iter().filter(|k| tells(k.descriptor()) && takes_a_place(k.descriptor()));
    all.cloned().collect()
}

impl Wall {
    /// The force of the subject's graph.
    ///
    /// # Errors
    /// Nothing in it moves a stylus, or no force follows from where that is.
    pub(crate) fn of_graph(subject: &Subject<'_>) -> Result<Self, Not> {
        Self::new(subject, subject.its_graph()?.clone())
    }

    /// The force of a kind of floor, with parameters as a graph file says them.
    ///
    /// # Errors
    /// What the compiler says.
    pub(crate) fn of_floor(
        subject: &Subject<'_>,
        kind: &str,
        params: &[(&str, &str)],
        tick_hz: u32,
    ) -> Result<Self, Not> {
        let mut graph = GraphFile::empty("a floor");
        graph.tick_hz = tick_hz;
        let stylus = subject.registry().iter().find(|k| {
            let d = k.descriptor();
            d.inputs.is_empty() && d.outputs.iter().any(|o| is(o, "position", 3, &Unit::MILLIMETRE))
        });
        let Some(stylus) = stylus else { return not_applicable("there is no kind that moves a stylus") };
        graph.add_node("stylus", &stylus.descriptor().kind, &[], "the case")?;
        graph.add_node("floor", kind, params, "the case")?;
        graph.add_wire("stylus.position", "floor.position", "the case");
        Self::new(subject, graph)
    }

    fn new(subject: &Subject<'_>, graph: GraphFile) -> Result<Self, Not> {
        let place = Arc::new(Place::default());
        let registry = subject.registry();
        let (mut graph, kinds) =
            Rig::with_stylus(&graph, registry, &place.motion()).or_else(not_applicable)?;
        let sinks: Vec<String> = graph
            .nodes
            .iter()
            .filter(|n| registry.get(&n.kind).is_some_and(|k| k.descriptor().sink))
            .map(|n| n.id.clone())
            .collect();
        let stiffness = |w: &&WireDecl| w.from.port.as_deref() == Some("stiffness");
        let handed_on = graph.wires.iter().filter(stiffness).any(|w| sinks.contains(&w.to.node));
        graph.nodes.retain(|n| !sinks.contains(&n.id));
        graph.wires.retain(|w| !sinks.contains(&w.to.node));

        let declared: Vec<(&str, &Descriptor)> = graph
            .nodes
            .iter()
            .filter_map(|n| Some((n.id.as_str(), registry.get(&n.kind)?.descriptor())))
            .collect();
        let Some(teller) = declared.iter().find(|(_, d)| tells(d)).map(|(id, _)| (*id).to_owned()) else {
            return not_applicable("nothing in this graph tells of a wall: a force along a normal");
        };
        let out_of = |fits: &dyn Fn(&Output) -> bool| {
            let find = |(id, d): &(&str, &Descriptor)| {
                let output = d.outputs.iter().find(|o| fits(o))?;
                Some(((*id).to_owned(), output.name.to_string()))
            };
            declared.iter().find_map(find)
        };
        // What is held to a device's limits comes last; else the wall's push with all it has; else Hooke's force.
        let vector = out_of(&|o| {
            o.limited
                && o.shape == ShapeSpec::Control(3)
                && matches!(&o.unit, UnitSpec::Is(u) if *u == Unit::NEWTON)
        })
        .or_else(|| out_of(&|o| is(o, "push", 3, &Unit::NEWTON)));
        let (node, port) = vector.clone().unwrap_or_else(|| (teller.clone(), "force".to_owned()));
        for (probe, from) in PROBES
            .iter()
            .zip([format!("{node}.{port}"), format!("{teller}.force")])
            .take(if vector.is_some() { 2 } else { 1 })
        {
            graph.add_node(probe, "probe", &[], "the case")?;
            graph.add_wire(&from, probe, "the case");
        }
        let rig = Rig::of(subject, &graph, &kinds)?;
        let schedule = &rig.schedule;
        let output = |node: &str, port: &str| {
            let index = schedule.index_of(node)?;
            Some((index, schedule.nodes.get(index)?.outputs.iter().position(|o| o.name == port)?))
        };
        let told = || {
            let (node, force) = output(&teller, "force")?;
            let (_, normal) = output(&teller, "normal")?;
            let of = |port| output(&teller, port).map(|(_, output)| output);
            Some(Told { node, force, normal, stiffness: of("stiffness"), damping: of("damping") })
        };
        let (Some(force), Some(told)) = (output(&node, &port), told()) else {
            return not_applicable("the force of this graph follows from no stylus");
        };
        let every = schedule.nodes.iter().map(|n| u64::from(n.every)).max().unwrap_or(1);
        let probe = schedule.index_of(PROBES[0]);
        let latest = schedule.paths.iter().filter(|p| Some(p.to) == probe).map(|p| p.most).max();
        let delay_s = latest.map_or(0.0, |l| 1e-3 * l.ms()).max(0.0);
        let source = format!("{node}.{port}");
        Ok(Self { rig, place, force, vector: vector.is_some(), told, every, delay_s, source, handed_on })
    }

    /// Which output the force is.
    pub(crate) fn source(&self) -> &str {
        &self.source
    }

    /// Whether a device is told of the wall and evaluates it in a loop of its own, where it is late by less.
    pub(crate) fn is_handed_on(&self) -> bool {
        self.handed_on
    }

    /// When places are read and forces set, as the graph declares it.
    pub(crate) fn sampling(&self) -> Sampling {
        Sampling { tick_hz: f64::from(self.rig.schedule.tick_hz) / self.every as f64, delay_s: self.delay_s }
    }

    /// Ticks a second.
    pub(crate) fn tick_hz(&self) -> f64 {
        f64::from(self.rig.schedule.tick_hz)
    }

    /// Ticks from one force to the next.
    pub(crate) fn every(&self) -> u64 {
        self.every
    }

    /// Faults of all nodes so far.
    pub(crate) fn faults(&self) -> u64 {
        self.rig.engine.faults()
    }

    /// As new, at the first tick.
    pub(crate) fn reset(&mut self) {
        self.rig.engine.reset();
    }

    /// One tick with the stylus there \[mm\]; answers the force on it \[N\].
    pub(crate) fn at(&mut self, place_mm: [f64; 3]) -> [f64; 3] {
        self.place.put(place_mm);
        self.rig.engine.tick();
        let (node, output) = self.force;
        if self.vector {
            return self.values(node, output);
        }
        let [force] = self.values(node, output);
        self.normal().map(|n| n * force)
    }

    /// One tick with the stylus `x_mm` above a spot along its normal; answers the force along it \[N\].
    pub(crate) fn above(&mut self, spot: &Spot, x_mm: f64) -> f64 {
        let force = self.at(spot.above(x_mm));
        spot.along(force)
    }

    /// Hooke's force in the last tick \[N\], as the wall tells it: above 0 where it is touched.
    pub(crate) fn touched_n(&self) -> f64 {
        let [force] = self.values(self.told.node, self.told.force);
        force
    }

    /// The way out of what is touched.
    pub(crate) fn normal(&self) -> [f64; 3] {
        self.values(self.told.node, self.told.normal)
    }

    fn values<const N: usize>(&self, node: usize, output: usize) -> [f64; N] {
        match self.rig.engine.output(node, output) {
            Some(asperity_node::Buffer::Control { values, .. }) => {
                std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
            }
            _ => [0.0; N],
        }
    }
}

impl std::fmt::Debug for Wall {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Wall").field("source", &self.source).finish_non_exhaustive()
    }
}

/// A stylus for graphs that a case makes.
pub(crate) fn stylus(place: &Arc<Place>) -> Arc<dyn NodeKind> {
    let like = Descriptor::new("stylus", "").output(Output::new(
        "position",
        ShapeSpec::Control(3),
        Unit::MILLIMETRE,
    ));
    Played::stylus("stylus from memory", &like, place.motion())
}
