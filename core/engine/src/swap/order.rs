//! Order of the steps of a tick during a crossfade: new nodes, shadows of old ones, and crossfades.

use std::collections::BTreeSet;

use asperity_graph::{Schedule, ScheduledNode, Step, topological_order};

use super::plan::{Place, Point};
use super::shadow::{Shadows, Ways};

/// One step of a tick: a [`Step`] by slot, or a crossfade.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Run {
    Wants(usize),
    Process(usize),
    Absorb(usize),
    Fade(usize),
}

impl From<Step> for Run {
    fn from(step: Step) -> Self {
        match step {
            Step::Wants(i) => Run::Wants(i),
            Step::Process(i) => Run::Process(i),
            Step::Absorb(i) => Run::Absorb(i),
        }
    }
}

/// Dependencies of the steps. Steps are numbered: `wants` and `process` of every slot, the crossfades,
/// every `absorb`.
struct Steps<'a> {
    points: &'a [Point],
    slots: usize,
    before: Vec<BTreeSet<usize>>,
    exists: Vec<bool>,
}

/// Orders the steps during a crossfade, each after its sources.
///
/// Such an order exists: old and new nodes meet only in kept ones, and no kept node is both after a
/// crossfade and before one.
pub(super) fn order(old: &Schedule, new: &Schedule, points: &[Point], shadows: &Shadows) -> Vec<Run> {
    // If gates wait for each other, nothing waits for them: their answers are those of the tick before.
    let found = [true, false].into_iter().find_map(|waits| sorted(old, new, points, shadows, waits));
    debug_assert!(found.is_some(), "steps wait for each other");
    found.unwrap_or_default()
}

/// Orders the steps; `None` if they wait for each other. `waits` says whether nodes wait for their
/// gates.
fn sorted(
    old: &Schedule,
    new: &Schedule,
    points: &[Point],
    shadows: &Shadows,
    waits: bool,
) -> Option<Vec<Run>> {
    let n = new.nodes.len();
    let slots = n + shadows.running;
    let count = 3 * slots + points.len();
    let mut steps = Steps { points, slots, before: vec![BTreeSet::new(); count], exists: vec![false; count] };
    let gates =
        |ways: &Ways| ways.iter().flatten().copied().filter(|&g| waits && g < slots).collect::<Vec<_>>();
    let new_ways = shadows.new_ways(old, new);
    for (j, node) in new.nodes.iter().enumerate() {
        steps.node(j, node, &gates(&new_ways[j]), |input, from| {
            let here = |p: &Point| p.node == j && p.place == Place::Input(input);
            points
                .iter()
                .position(here)
                .map(|p| steps_fade(slots, p))
                .unwrap_or_else(|| new_source(points, slots, from))
        });
    }
    for (k, &i) in shadows.nodes[..shadows.running].iter().enumerate() {
        let slot = |i: usize| shadows.slot(i).filter(|&x| x < slots);
        let gates = gates(&shadows.old_ways(old, i));
        steps.node(n + k, &old.nodes[i], &gates, |_, (from, _)| process(slot(from).unwrap_or(n + k)));
    }
    for (p, point) in points.iter().enumerate() {
        let fade = steps_fade(slots, p);
        steps.exists[fade] = true;
        let hears = match point.place {
            Place::Input(_) => new_source(points, slots, point.new),
            Place::Output(_) => process(point.node),
        };
        steps.before[fade].insert(hears);
        steps.before[fade].extend(point.old.and_then(|(i, _)| shadows.slot(i)).map(process));
    }
    steps.sort()
}

fn wants(slot: usize) -> usize {
    2 * slot
}

fn process(slot: usize) -> usize {
    2 * slot + 1
}

fn steps_fade(slots: usize, point: usize) -> usize {
    2 * slots + point
}

/// Step after which an output of a new node is ready.
fn new_source(points: &[Point], slots: usize, from: (usize, usize)) -> usize {
    let there = |p: &Point| p.new == from && matches!(p.place, Place::Output(_));
    points.iter().position(there).map_or(process(from.0), |p| steps_fade(slots, p))
}

impl Steps<'_> {
    fn absorb(&self, slot: usize) -> usize {
        2 * self.slots + self.points.len() + slot
    }

    /// Adds the steps of one node. `gates` are the slots that decide whether it is wanted; `source`
    /// gives the step that an input waits for.
    fn node(
        &mut self,
        x: usize,
        node: &ScheduledNode,
        gates: &[usize],
        source: impl Fn(usize, (usize, usize)) -> usize,
    ) {
        let absorb = self.absorb(x);
        let (asks, closes) = (node.gate.is_some(), node.closes_cycle);
        self.exists[process(x)] = true;
        self.exists[wants(x)] = asks;
        self.exists[absorb] = closes;
        for (input, port) in node.inputs.iter().enumerate() {
            let Some(from) = port.from else { continue };
            let source = source(input, from);
            self.before[if closes { absorb } else { process(x) }].insert(source);
            if asks && node.gate != Some(input) {
                self.before[wants(x)].insert(source);
            }
        }
        self.before[absorb].insert(process(x));
        if asks {
            self.before[process(x)].insert(wants(x));
        }
        for gate in gates.iter().filter(|gate| **gate != x) {
            self.before[process(x)].insert(wants(*gate));
            self.before[wants(x)].insert(wants(*gate));
        }
    }

    fn run(&self, step: usize) -> Run {
        let (fades, absorbs) = (2 * self.slots, 2 * self.slots + self.points.len());
        match step {
            s if s >= absorbs => Run::Absorb(s - absorbs),
            s if s >= fades => Run::Fade(s - fades),
            s if s % 2 == 0 => Run::Wants(s / 2),
            s => Run::Process(s / 2),
        }
    }

    fn sort(&self) -> Option<Vec<Run>> {
        let order = topological_order(&self.before, |step| self.exists[step]);
        let complete = order.len() == self.exists.iter().filter(|exists| **exists).count();
        complete.then(|| order.into_iter().map(|step| self.run(step)).collect())
    }
}
