//! Old nodes that run beside the new ones until the crossfade ends.

use std::collections::BTreeSet;

use asperity_graph::Schedule;

use super::plan::{Fate, Place, Point};

/// Sets of gates: a node is wanted while all gates of one set are open. No set at all for a node that
/// always runs.
pub(super) type Ways = Vec<Vec<usize>>;

/// A node with more sets than this always runs during the fade.
const MOST_WAYS: usize = 64;

/// A node's gate sets; one empty set if it always runs.
fn as_ways(gate_sets: &Ways) -> Ways {
    if gate_sets.is_empty() { vec![Vec::new()] } else { gate_sets.clone() }
}

/// Adds a set, unless a subset of it is there; removes supersets of it.
fn add(ways: &mut Ways, way: Vec<usize>) {
    let within = |a: &[usize], b: &[usize]| a.iter().all(|gate| b.contains(gate));
    if !ways.iter().any(|known| within(known, &way)) {
        ways.retain(|known| !within(&way, known));
        ways.push(way);
    }
    if ways.len() > MOST_WAYS {
        *ways = vec![Vec::new()];
    }
}

/// Old nodes beside the new ones. Their slots come after those of the new nodes.
#[derive(Debug)]
pub(super) struct Shadows {
    /// Old nodes: first those that run, then gates that keep their last answer.
    pub(super) nodes: Vec<usize>,
    /// Number of those that run.
    pub(super) running: usize,
    /// Slot of each old node that is still there.
    slots: Vec<Option<usize>>,
    /// New and old index of kept nodes that old nodes or a crossfade still read.
    heard: Vec<(usize, usize)>,
    /// For each old node, when new nodes want it through a crossfade: sets of slots, in addition to
    /// those of the old graph.
    faded: Vec<Ways>,
}

impl Shadows {
    /// Finds all nodes that the old side of a crossfade needs and that are not kept.
    pub(super) fn find(old: &Schedule, new: &Schedule, fates: &[Fate], points: &[Point]) -> Self {
        let mut slots = vec![None; old.nodes.len()];
        for (j, fate) in fates.iter().enumerate() {
            if let Some(i) = fate.kept() {
                slots[i] = Some(j);
            }
        }
        let (mut shadows, mut heard) = (BTreeSet::new(), BTreeSet::new());
        let mut open: Vec<usize> = points.iter().filter_map(|p| Some(p.old?.0)).collect();
        while let Some(i) = open.pop() {
            match slots[i] {
                Some(j) => {
                    heard.insert((j, i));
                }
                None if shadows.insert(i) => {
                    open.extend(old.nodes[i].inputs.iter().filter_map(|input| Some(input.from?.0)));
                }
                None => {}
            }
        }
        let gate_sets = |i: usize| old.nodes[i].gate_sets.iter().flatten().copied();
        let asked = shadows.iter().copied().chain(heard.iter().map(|(_, i)| *i)).flat_map(gate_sets);
        let gates: BTreeSet<usize> = asked.filter(|&g| slots[g].is_none() && !shadows.contains(&g)).collect();
        let running = shadows.len();
        let nodes: Vec<usize> = shadows.into_iter().chain(gates).collect();
        for (k, &i) in nodes.iter().enumerate() {
            slots[i] = Some(new.nodes.len() + k);
        }
        let mut shadows =
            Self { nodes, running, slots, heard: heard.into_iter().collect(), faded: Vec::new() };
        shadows.faded = shadows.faded(old, new, points);
        shadows
    }

    /// Computes the field `faded`.
    fn faded(&self, old: &Schedule, new: &Schedule, points: &[Point]) -> Vec<Ways> {
        let mut ways: Vec<Ways> = vec![Vec::new(); old.nodes.len()];
        for point in points {
            let Some((i, _)) = point.old else { continue };
            let reader = &new.nodes[point.node];
            let gated = matches!(point.place, Place::Input(input) if reader.gate == Some(input));
            for mut way in as_ways(&reader.gate_sets) {
                if gated && !way.contains(&point.node) {
                    way.push(point.node);
                }
                add(&mut ways[i], way);
            }
        }
        // From the sinks up: a wanted node wants its sources.
        for i in (0..ways.len()).rev() {
            for way in ways[i].clone() {
                for (input, port) in old.nodes[i].inputs.iter().enumerate() {
                    let Some((from, _)) = port.from else { continue };
                    let mut way = way.clone();
                    if old.nodes[i].gate == Some(input) {
                        way.extend(self.slot(i).filter(|slot| !way.contains(slot)));
                    }
                    add(&mut ways[from], way);
                }
            }
        }
        ways
    }

    /// Slot of an old node, among new nodes and shadows.
    pub(super) fn slot(&self, old: usize) -> Option<usize> {
        self.slots.get(old).copied().flatten()
    }

    /// When an old node is wanted during the fade, by slot: as in the old graph, and as the source of
    /// new nodes.
    pub(super) fn old_ways(&self, old: &Schedule, i: usize) -> Ways {
        let mut ways: Ways = Vec::new();
        for way in as_ways(&old.nodes[i].gate_sets) {
            add(&mut ways, way.iter().filter_map(|&g| self.slot(g)).collect());
        }
        self.faded[i].iter().for_each(|way| add(&mut ways, way.clone()));
        if ways.iter().any(Vec::is_empty) { Vec::new() } else { ways }
    }

    /// When each new node is wanted while old ones read it, directly or indirectly.
    pub(super) fn new_ways(&self, old: &Schedule, new: &Schedule) -> Vec<Ways> {
        let mut ways: Vec<Ways> = new.nodes.iter().map(|n| n.gate_sets.clone()).collect();
        let mut more: Vec<Ways> = vec![Vec::new(); ways.len()];
        for &(j, i) in &self.heard {
            let was = self.old_ways(old, i);
            more[j] = if was.is_empty() { vec![Vec::new()] } else { was };
        }
        // From the sinks up: a wanted node wants its sources.
        for j in (0..ways.len()).rev() {
            let mut wanted = Ways::new();
            std::mem::take(&mut more[j]).into_iter().for_each(|way| add(&mut wanted, way));
            for way in wanted {
                let known = |known: &Vec<usize>| known.iter().all(|gate| way.contains(gate));
                if ways[j].is_empty() || ways[j].iter().any(known) {
                    continue;
                }
                for (input, port) in new.nodes[j].inputs.iter().enumerate() {
                    let Some((from, _)) = port.from else { continue };
                    let mut way = way.clone();
                    if new.nodes[j].gate == Some(input) && !way.contains(&j) {
                        way.push(j);
                    }
                    more[from].push(way);
                }
                add(&mut ways[j], way);
            }
            if ways[j].iter().any(Vec::is_empty) {
                ways[j].clear();
            }
        }
        ways
    }
}
