//! The walls of a graph: the force with which it answers the place of a stylus.
//!
//! Sinks that only play, draw or write are taken out, so that a tick costs only the force.

use asperity_graph::{GraphFile, WireDecl};
use asperity_node::{Descriptor, Law, Output, ShapeSpec, Unit, UnitSpec};
use asperity_scene::bound::{Passivity, Sampling};

use crate::case::{Stop, not_applicable};
use crate::rig::Rig;
use crate::subject::Subject;

/// Names of the case's own sinks. No graph file can have them.
const PROBES: [&str; 2] = [" the force ", " the wall "];

/// An output: its node and its number.
type At = (usize, usize);

/// The force of a graph.
pub(crate) struct Wall {
    rig: Rig,
    force: At,
    /// Whether the force is a vector; else it acts along the normal of the wall.
    vector: bool,
    /// Hooke's force, the normal, the stiffness and the damping of the touched wall.
    touched: At,
    normal: At,
    stiffness: Option<At>,
    damping: Option<At>,
    /// Ticks from one force to the next.
    pub every: u64,
    delay_s: f64,
    /// Name of the output of the force.
    pub source: String,
    /// Whether a device evaluates the wall in its own loop, with less delay.
    pub handed_on: bool,
}

fn is(output: &Output, name: &str, count: usize, unit: &Unit) -> bool {
    output.name == name
        && output.shape == ShapeSpec::Control(count)
        && output.unit == UnitSpec::Is(unit.clone())
}

/// Whether a kind tells of a wall: a force along a normal.
fn tells(d: &Descriptor) -> bool {
    d.outputs.iter().any(|o| is(o, "force", 1, &Unit::NEWTON))
        && d.outputs.iter().any(|o| is(o, "normal", 3, &Unit::NONE))
}

impl Wall {
    /// The force of the subject's graph.
    pub(crate) fn of_graph(subject: &Subject<'_>) -> Result<Self, Stop> {
        Self::new(subject, subject.its_graph()?)
    }

    /// The force of a graph.
    pub(crate) fn new(subject: &Subject<'_>, graph: &GraphFile) -> Result<Self, Stop> {
        let registry = &subject.registry;
        let (mut graph, kinds) = Rig::with_stylus(graph, registry, None).or_else(not_applicable)?;
        let is_sink = |kind: &str| registry.get(kind).is_some_and(|k| k.descriptor().sink);
        let sinks = graph.nodes.iter().filter(|n| is_sink(&n.kind)).map(|n| n.id.clone());
        let sinks: Vec<String> = sinks.collect();
        let stiffness = |w: &&WireDecl| w.from.port.as_deref() == Some("stiffness");
        let handed_on = graph.wires.iter().filter(stiffness).any(|w| sinks.contains(&w.to.node));
        graph.nodes.retain(|n| !sinks.contains(&n.id));
        graph.wires.retain(|w| !sinks.contains(&w.to.node));

        let declared = graph.nodes.iter();
        let declared = declared.filter_map(|n| Some((n.id.as_str(), registry.get(&n.kind)?.descriptor())));
        let declared: Vec<(&str, &Descriptor)> = declared.collect();
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
        // A force that is limited for a device comes last. Else it is the wall's whole push, else Hooke's
        // force.
        let newtons = UnitSpec::Is(Unit::NEWTON);
        let vector = out_of(&|o| o.limited && o.shape == ShapeSpec::Control(3) && o.unit == newtons)
            .or_else(|| out_of(&|o| is(o, "push", 3, &Unit::NEWTON)));
        let (node, port) = vector.clone().unwrap_or_else(|| (teller.clone(), "force".to_owned()));
        let ends = [format!("{node}.{port}"), format!("{teller}.force")];
        for (probe, from) in PROBES.iter().zip(&ends).take(if vector.is_some() { 2 } else { 1 }) {
            graph.add_node(probe, "probe", &[], "the case")?;
            graph.add_wire(from, probe, "the case");
        }
        let rig = Rig::of(subject, &graph, &kinds)?;
        let schedule = &rig.schedule;
        let output = |node: &str, port: &str| {
            let index = schedule.index_of(node)?;
            Some((index, schedule.nodes.get(index)?.outputs.iter().position(|o| o.name == port)?))
        };
        let told = |port| output(&teller, port);
        let (Some(force), Some(touched), Some(normal)) =
            (output(&node, &port), told("force"), told("normal"))
        else {
            return not_applicable("the force of this graph follows from no stylus");
        };
        let (stiffness, damping) = (told("stiffness"), told("damping"));
        let every = schedule.nodes.iter().map(|n| u64::from(n.every)).max().unwrap_or(1);
        let probe = schedule.index_of(PROBES[0]);
        let latest = schedule.paths.iter().filter(|p| Some(p.to) == probe).map(|p| p.most).max();
        let delay_s = latest.map_or(0.0, |l| 1e-3 * l.ms()).max(0.0);
        let ([source, _], vector) = (ends, vector.is_some());
        Ok(Self {
            rig,
            force,
            vector,
            touched,
            normal,
            stiffness,
            damping,
            every,
            delay_s,
            source,
            handed_on,
        })
    }

    /// Rate and delay of the force, as the graph declares them.
    pub(crate) fn sampling(&self) -> Sampling {
        Sampling { tick_hz: f64::from(self.rig.schedule.tick_hz) / self.every as f64, delay_s: self.delay_s }
    }

    /// Ticks a second.
    pub(crate) fn tick_hz(&self) -> f64 {
        f64::from(self.rig.schedule.tick_hz)
    }

    /// Checks that no node has failed so far.
    pub(crate) fn sound(&self) -> Result<(), Stop> {
        self.rig.sound()
    }

    /// Starts anew from the first tick.
    pub(crate) fn reset(&mut self) {
        self.rig.engine.reset();
    }

    /// Runs a tick with the stylus at a place \[mm\]. Answers the force on it \[N\].
    pub(crate) fn at(&mut self, place_mm: [f64; 3]) -> [f64; 3] {
        self.rig.place(place_mm, true);
        self.rig.engine.tick();
        if self.vector {
            return self.values(self.force);
        }
        let [force] = self.values(self.force);
        self.normal().map(|n| n * force)
    }

    /// Runs a tick with the stylus `x_mm` above a spot along its normal. Answers the force along it \[N\].
    pub(crate) fn above(&mut self, spot: &Spot, x_mm: f64) -> f64 {
        let force = self.at(spot.above(x_mm));
        spot.along(force)
    }

    /// Hooke's force of the last tick \[N\]; above 0 on contact.
    pub(crate) fn touched_n(&self) -> f64 {
        self.values::<1>(self.touched)[0]
    }

    /// The outward normal of the touched wall.
    pub(crate) fn normal(&self) -> [f64; 3] {
        self.values(self.normal)
    }

    fn values<const N: usize>(&self, (node, output): At) -> [f64; N] {
        let values = self.rig.values(node, output);
        std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
    }
}

/// Reach of the columns from the middle \[mm\].
const REACH_MM: f64 = 100.0;
/// Heights between which walls are looked for, and the step \[mm\]. No wall is thinner than the step.
const HEIGHTS_MM: (f64, f64, f64) = (40.0, -40.0, 1.6);

/// Distance of the columns \[mm\].
pub(crate) fn pitch_mm(subject: &Subject<'_>) -> f64 {
    subject.by_effort(20.0, 10.0, 5.0)
}

/// A place on a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spot {
    /// Point of the surface \[mm\].
    pub foot_mm: [f64; 3],
    /// Outward normal, of length 1.
    pub normal: [f64; 3],
    /// Stiffness and damping that the wall tells, or 0.
    pub told: Law,
}

impl Spot {
    /// The point `x_mm` outside along the normal; inside the wall where it is below 0.
    pub(crate) fn above(&self, x_mm: f64) -> [f64; 3] {
        std::array::from_fn(|k| self.foot_mm[k] + x_mm * self.normal[k])
    }

    /// The part of a force along the normal.
    pub(crate) fn along(&self, force: [f64; 3]) -> f64 {
        (0..3).map(|k| force[k] * self.normal[k]).sum()
    }

    /// Whether both spots have the same stiffness and damping.
    pub(crate) fn alike(&self, other: &Self) -> bool {
        self.told == other.told
    }

    /// Whether both spots are part of the same level surface.
    pub(crate) fn goes_on(&self, other: &Self) -> bool {
        let level = |s: &Self| s.normal[2] > 1.0 - 1e-9;
        self.alike(other) && level(self) && level(other) && (self.foot_mm[2] - other.foot_mm[2]).abs() < 1e-6
    }
}

/// A vertical line on which a wall was looked for.
pub(crate) struct Column {
    /// Row and column.
    pub at: [usize; 2],
    /// x and y \[mm\].
    pub foot_mm: [f64; 2],
    /// The first wall from above.
    pub spot: Option<Spot>,
}

impl Wall {
    /// A square grid of columns with a distance of `pitch_mm`. They stand beside round numbers, where
    /// surfaces often end.
    pub(crate) fn columns(&mut self, pitch_mm: f64) -> Vec<Column> {
        let half = (REACH_MM / pitch_mm) as usize;
        let place = |i: usize| (i as f64 - half as f64) * pitch_mm + 0.31 * pitch_mm;
        let rows = 0..=2 * half;
        let all = rows.clone().flat_map(|i| rows.clone().map(move |k| [i, k]));
        let column = |at: [usize; 2]| {
            let foot_mm = at.map(place);
            Column { at, foot_mm, spot: self.down(foot_mm) }
        };
        all.map(column).collect()
    }

    /// The first wall from above at x and y.
    pub(crate) fn down(&mut self, [x, y]: [f64; 2]) -> Option<Spot> {
        let (from, to, step) = HEIGHTS_MM;
        let steps = ((from - to) / step) as usize;
        let mut high = from;
        let touches = |it: &mut Self, z: f64| {
            (0..it.every).for_each(|_| _ = it.at([x, y, z]));
            it.touched_n() > 0.0
        };
        // Contact at the top means that there is no surface here.
        if touches(self, high) {
            return None;
        }
        for n in 1..=steps {
            let z = from - n as f64 * step;
            if !touches(self, z) {
                high = z;
                continue;
            }
            let mut low = z;
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                *if touches(self, middle) { &mut low } else { &mut high } = middle;
            }
            _ = touches(self, low);
            let told = |output: Option<At>| output.map_or(0.0, |at| self.values::<1>(at)[0]);
            let told = Law { stiffness_n_per_mm: told(self.stiffness), damping_ns_per_m: told(self.damping) };
            return Some(Spot { foot_mm: [x, y, high], normal: self.normal(), told });
        }
        None
    }

    /// One spot of every wall with another stiffness or damping: that with the most of its surface around it.
    pub(crate) fn walls(&mut self, pitch_mm: f64) -> Vec<Spot> {
        let columns = self.columns(pitch_mm);
        let near = |a: &Column, b: &Column| a.at.iter().zip(b.at).all(|(a, b)| a.abs_diff(b) <= 1);
        let mut all: Vec<(Spot, usize)> = Vec::new();
        for column in &columns {
            let Some(spot) = column.spot else { continue };
            let level = |c: &&Column| near(c, column) && c.spot.is_some_and(|s| s.goes_on(&spot));
            let around = columns.iter().filter(level).count();
            match all.iter_mut().find(|(known, _)| known.alike(&spot)) {
                Some(best) if best.1 < around => *best = (spot, around),
                Some(_) => {}
                None => all.push((spot, around)),
            }
        }
        all.into_iter().map(|(spot, _)| spot).collect()
    }
}

/// Farthest place from the surface, in or out \[mm\].
const FAR_MM: f64 = 6.0;
/// Points of a curve on either side of the surface.
const POINTS: i32 = 200;

/// Force at rest along the normal.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    /// Place \[mm\] from in to out, force \[N\], and energy \[mJ\] above its least value.
    points: Vec<[f64; 3]>,
}

impl Curve {
    /// Energy of the wall at a place \[mJ\]: the work to bring a stylus there slowly from the place of least
    /// energy.
    pub(crate) fn energy_mj(&self, x_mm: f64) -> f64 {
        let at = self.points.partition_point(|p| p[0] < x_mm);
        match (at.checked_sub(1).and_then(|i| self.points.get(i)), self.points.get(at)) {
            (Some(a), Some(b)) => {
                let part = (x_mm - a[0]) / (b[0] - a[0]);
                // The force between two points is a straight line.
                let here = a[1] + part * (b[1] - a[1]);
                b[2] + 0.5 * (here + b[1]) * (b[0] - x_mm)
            }
            (None, Some(first)) => first[2] + first[1] * (first[0] - x_mm),
            _ => self.points.last().map_or(0.0, |p| p[2]),
        }
    }
}

/// A wall near its surface.
#[derive(Clone, Debug)]
pub(crate) struct Near {
    /// The spot.
    pub spot: Spot,
    /// Its measured stiffness and damping.
    pub law: Law,
    /// Depth to which Hooke's law holds, within some hundredths \[mm\].
    pub deep_mm: f64,
    /// Part by which the slope is below the steepest there at most.
    pub gentler: f64,
    /// Depth from which on it is stiffer, if it is \[mm\].
    pub stiffens_mm: Option<f64>,
    /// Rate and delay of the force.
    pub sampling: Sampling,
}

impl Near {
    /// The damping that a device needs \[N s/m\], with more delay than the graph's own.
    pub(crate) fn needed_ns_per_m(&self, late_s: f64) -> f64 {
        let sampling = Sampling { delay_s: self.sampling.delay_s + late_s, ..self.sampling };
        Passivity::of(self.law, sampling, 0.0).needed_ns_per_m
    }

    /// Whether it is a pure spring, within 1e-4, without delay. The energy that a motion takes out is then
    /// known, not only bounded.
    pub(crate) fn is_hooke(&self) -> bool {
        self.law.damping_ns_per_m == 0.0 && self.sampling.delay_s == 0.0 && self.gentler <= 1e-4
    }

    /// Time from one force to the next \[s\].
    pub(crate) fn tick_s(&self) -> f64 {
        1.0 / self.sampling.tick_hz
    }

    /// The mass that swings in it by so many radians a tick \[kg\].
    pub(crate) fn mass_kg(&self, radians: f64) -> f64 {
        1e3 * self.law.stiffness_n_per_mm * (self.tick_s() / radians).powi(2)
    }
}

impl Wall {
    /// The force at rest \[N\]: after three runs of the wall.
    fn at_rest(&mut self, spot: &Spot, x_mm: f64) -> f64 {
        let mut force = 0.0;
        (0..3 * self.every).for_each(|_| force = self.above(spot, x_mm));
        force
    }

    /// The law of the wall at a spot: its force at rest, and the damping that it tells. Where speed adds
    /// more, as a drag does, that counts. Where it adds less, the force is late or the wall drives, and that
    /// is no law.
    pub(crate) fn near(&mut self, spot: Spot) -> Result<Near, Stop> {
        self.reset();
        self.at_rest(&spot, FAR_MM);
        let start = 1e-3;
        // Not from the surface itself, which is where contact was found.
        let surface = self.at_rest(&spot, -start);
        let stiffness = (self.at_rest(&spot, -2.0 * start) - surface) / start;
        if stiffness <= 0.0 {
            return not_applicable("the wall does not push out");
        }
        let (mut deep, mut gentlest, mut steepest, mut before) =
            (start, stiffness, stiffness, (start, surface));
        let mut stiffens = None;
        for n in 4..50 {
            let depth = start * 1.2_f64.powi(n);
            if depth > FAR_MM {
                break;
            }
            let force = self.at_rest(&spot, -depth);
            let slope = (force - before.1) / (depth - before.0);
            if !(0.99..=1.05).contains(&(slope / stiffness)) {
                stiffens = (slope > stiffness).then_some(deep);
                break;
            }
            (gentlest, steepest) = (gentlest.min(slope), steepest.max(slope));
            (deep, before) = (depth, (depth, force));
        }
        let stiffness = steepest;
        let told = if self.vector { spot.told.damping_ns_per_m } else { 0.0 };
        let damping = self.damping(&spot, deep, stiffness).max(told);
        let law = Law { stiffness_n_per_mm: stiffness, damping_ns_per_m: damping };
        self.sound()?;
        let (gentler, sampling) = (1.0 - gentlest / stiffness, self.sampling());
        Ok(Near { spot, law, deep_mm: deep, gentler, stiffens_mm: stiffens, sampling })
    }

    /// Force per speed \[N s/m\]; above 0 against the motion.
    fn damping(&mut self, spot: &Spot, deep_mm: f64, stiffness_n_per_mm: f64) -> f64 {
        let middle = -0.5 * deep_mm;
        let still = self.at_rest(spot, middle);
        let step = 1e-3 * deep_mm;
        let runs = self.every;
        // In at a constant speed; the place counts at the last run.
        let mut force = 0.0;
        for n in 1..=4 {
            (0..runs).for_each(|_| force = self.above(spot, middle - f64::from(n) * step));
        }
        let beyond = force - still - stiffness_n_per_mm * 4.0 * step;
        let speed_mm_s = step * self.sampling().tick_hz;
        let damping = 1e3 * beyond / speed_mm_s;
        // Rounding alone is no damping.
        if damping.abs() < 1e-6 * 1e3 * stiffness_n_per_mm / self.sampling().tick_hz { 0.0 } else { damping }
    }

    /// The force at rest from twice the depth to which Hooke's law holds to well outside.
    pub(crate) fn curve(&mut self, near: &Near) -> Curve {
        self.reset();
        let mut points: Vec<[f64; 3]> = Vec::new();
        for n in (-2 * POINTS..=POINTS).rev() {
            let x = f64::from(n) / f64::from(POINTS) * if n > 0 { FAR_MM } else { near.deep_mm };
            let force = self.at_rest(&near.spot, x);
            let energy = points.last().map_or(0.0, |p| p[2] + 0.5 * (p[1] + force) * (p[0] - x));
            points.push([x, force, energy]);
        }
        points.reverse();
        let least = points.iter().map(|p| p[2]).fold(f64::INFINITY, f64::min);
        points.iter_mut().for_each(|p| p[2] -= least);
        Curve { points }
    }
}
