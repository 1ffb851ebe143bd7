//! Layered placement of a directed graph.
//!
//! After K. Sugiyama, S. Tagawa, M. Toda, "Methods for visual understanding of hierarchical system
//! structures", IEEE Trans. SMC 11(2), 1981. Layers follow the longest path. Each vertex moves toward its
//! neighbours, first past those beside it, which lowers the number of crossings, then off them.

/// A wire from a box to another, given by their indices.
pub(super) type Edge = (usize, usize);

/// Finds the edges that close a cycle of edges before them. Edges marked in `known` count as such.
pub(super) fn cycle_closers(nodes: usize, edges: &[Edge], known: &[bool]) -> Vec<bool> {
    // Whether a path leads from one node to another.
    let mut leads: Vec<Vec<bool>> = (0..nodes).map(|a| (0..nodes).map(|b| a == b).collect()).collect();
    let closes = |(&(from, to), &known): (&Edge, &bool)| {
        let closes = known || leads[to][from];
        if !closes {
            let behind = leads[to].clone();
            for before in leads.iter_mut().filter(|leads| leads[from]) {
                before.iter_mut().zip(&behind).for_each(|(to, behind)| *to |= behind);
            }
        }
        closes
    };
    edges.iter().zip(known).map(closes).collect()
}

/// The layer of each node: one past the last node that feeds it. A node without inputs stands right before
/// the first node it feeds. `edges` must have no cycle.
pub(super) fn longest_path_layers(nodes: usize, edges: &[Edge]) -> Vec<usize> {
    let mut layer = vec![0usize; nodes];
    // Without a cycle no path is longer than the number of nodes.
    for _ in 0..nodes {
        edges.iter().for_each(|e| layer[e.1] = layer[e.1].max(layer[e.0] + 1));
    }
    for node in (0..nodes).filter(|n| edges.iter().all(|e| e.1 != *n)) {
        let first = edges.iter().filter(|e| e.0 == node).map(|e| layer[e.1]).min();
        layer[node] = first.map_or(0, |l| l.saturating_sub(1));
    }
    layer
}

/// Vertices with their places along the layers: boxes, and bends where an edge passes a layer.
#[derive(Clone, Debug, Default)]
pub(super) struct Placement {
    /// Vertices of each layer in order. The lowest indices are the nodes.
    pub(super) layers: Vec<Vec<usize>>,
    /// Vertices of each edge, its ends included.
    pub(super) chains: Vec<Vec<usize>>,
    pub(super) x: Vec<f64>,
}

/// Least gap beside a bend, and beside a box.
const BEND_GAP: f64 = 18.0;
const BOX_GAP: f64 = 26.0;
/// Sweeps in which vertices pass each other, and all sweeps.
const ORDER: usize = 24;
const SWEEPS: usize = 200;

impl Placement {
    pub(super) fn new(layer: &[usize], edges: &[Edge]) -> Self {
        let mut layers = vec![Vec::new(); layer.iter().max().map_or(0, |l| l + 1)];
        layer.iter().enumerate().for_each(|(node, l)| layers[*l].push(node));
        let mut vertices = layer.len();
        let mut chains = Vec::with_capacity(edges.len());
        for (from, to) in edges {
            let bends = vertices..vertices + layer[*to].saturating_sub(layer[*from] + 1);
            vertices = bends.end;
            bends.clone().zip(layer[*from] + 1..).for_each(|(bend, l)| layers[l].push(bend));
            chains.push([*from].into_iter().chain(bends).chain([*to]).collect());
        }
        Self { layers, chains, x: vec![0.0; vertices] }
    }

    /// Places the vertices along their layers near their neighbours. `width` has the width of each node;
    /// `ports` has, for each edge, the offsets of its ends from the centres of their nodes. The least left
    /// edge becomes 0. Returns the greatest right edge.
    pub(super) fn place(&mut self, width: &[f64], ports: &[(f64, f64)]) -> f64 {
        let half = |v: usize| width.get(v).map_or(0.0, |w| w / 2.0);
        let gap = |v: usize| if v < width.len() { BOX_GAP } else { BEND_GAP };
        // Neighbours above and below each vertex, with the wanted shift from them.
        let mut joined = vec![[Vec::new(), Vec::new()]; self.x.len()];
        for (chain, (start, end)) in self.chains.iter().zip(ports) {
            for (i, w) in chain.windows(2).enumerate() {
                let above = if i == 0 { *start } else { 0.0 };
                let below = if i + 2 == chain.len() { *end } else { 0.0 };
                joined[w[0]][1].push((w[1], below - above));
                joined[w[1]][0].push((w[0], above - below));
            }
        }
        for sweep in 0..SWEEPS {
            let last = self.layers.len().saturating_sub(1);
            for i in 0..self.layers.len() {
                let layer = &mut self.layers[if sweep % 2 == 0 { i } else { last - i }];
                // Late sweeps look at both sides, so that a box stands between its inputs and its outputs.
                let sides = if sweep >= ORDER { 0..=1 } else { sweep % 2..=sweep % 2 };
                let wanted = |v: &usize| {
                    let near: Vec<_> = joined[*v][sides.clone()].iter().flatten().collect();
                    let sum: f64 = near.iter().map(|(other, shift)| self.x[*other] + shift).sum();
                    if near.is_empty() { self.x[*v] } else { sum / near.len() as f64 }
                };
                if sweep < ORDER {
                    layer.sort_by(|a, b| wanted(a).total_cmp(&wanted(b)));
                }
                let gaps: Vec<f64> =
                    layer.windows(2).map(|w| half(w[0]) + half(w[1]) + gap(w[0]).max(gap(w[1]))).collect();
                let places = separated(&layer.iter().map(wanted).collect::<Vec<_>>(), &gaps);
                layer.iter().zip(places).for_each(|(v, x)| self.x[*v] = x);
            }
        }
        let left = (0..self.x.len()).map(|v| self.x[v] - half(v)).fold(f64::MAX, f64::min);
        self.x.iter_mut().for_each(|x| *x -= left);
        (0..self.x.len()).map(|v| self.x[v] + half(v)).fold(0.0, f64::max)
    }
}

/// Places nearest to the wanted ones that keep their order and these least gaps. It is an isotonic regression
/// by pooling adjacent violators (M. Ayer et al., 1955).
fn separated(wanted: &[f64], gaps: &[f64]) -> Vec<f64> {
    let offsets = || {
        std::iter::once(&0.0).chain(gaps).scan(0.0, |at, gap| {
            *at += gap;
            Some(*at)
        })
    };
    // Pools of neighbours that share a mean: sum, members.
    let mut pools: Vec<(f64, usize)> = Vec::with_capacity(wanted.len());
    for (x, offset) in wanted.iter().zip(offsets()) {
        let mut pool = (x - offset, 1);
        let mean = |(sum, members): (f64, usize)| sum / members as f64;
        while let Some((sum, members)) = pools.pop_if(|last| mean(*last) > mean(pool)) {
            pool = (sum + pool.0, members + pool.1);
        }
        pools.push(pool);
    }
    let means = pools.iter().flat_map(|(sum, members)| std::iter::repeat_n(sum / *members as f64, *members));
    means.zip(offsets()).map(|(mean, offset)| mean + offset).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn placed(nodes: usize, edges: &[Edge], ports: &[(f64, f64)]) -> Placement {
        let mut placement = Placement::new(&longest_path_layers(nodes, edges), edges);
        placement.place(&vec![100.0; nodes], ports);
        placement
    }

    #[test]
    fn layers_follow_the_longest_path() {
        // 0 -> 1 -> 2 -> 3 and 0 -> 3, with 4 feeding 2 alone.
        assert_eq!(longest_path_layers(5, &[(0, 1), (1, 2), (2, 3), (0, 3), (4, 2)]), [0, 1, 2, 3, 1]);
    }

    #[test]
    fn one_edge_of_a_cycle_closes_it() {
        let e = [(0, 1), (1, 2), (2, 0), (1, 1), (0, 2)];
        assert_eq!(cycle_closers(3, &e, &[false; 5]), [false, false, true, true, false]);
        let known = [true, false, false, false, false];
        assert_eq!(cycle_closers(3, &e, &known), [true, false, false, true, true]);
    }

    #[test]
    fn avoidable_crossings_are_removed() {
        // 0, 1, 2 feed 5, 4, 3: crossed as numbered, straight when turned.
        let p = placed(6, &[(0, 5), (1, 4), (2, 3)], &[(0.0, 0.0); 3]);
        let across = |a: usize, b: usize| p.x[a] < p.x[b];
        assert!(across(0, 1) == across(5, 4) && across(1, 2) == across(4, 3), "{:?}", p.x);
    }

    #[test]
    fn separated_places_keep_gaps_and_move_least() {
        assert_eq!(separated(&[0.0, 10.0], &[4.0]), [0.0, 10.0]);
        // Both want 5, 4 apart: 3 and 7.
        assert_eq!(separated(&[5.0, 5.0], &[4.0]), [3.0, 7.0]);
        let x = separated(&[9.0, 1.0, 2.0, 30.0], &[2.0, 2.0, 2.0]);
        assert!(x.windows(2).all(|w| w[1] - w[0] >= 2.0 - 1e-12), "{x:?}");
    }

    #[test]
    fn chain_is_straight_through_its_ports() {
        // 1 -> 2 -> 3 hang under 0, which also feeds 4; 4 feeds 3's neighbour 5.
        let e = [(0, 1), (1, 2), (2, 3), (0, 4), (4, 5)];
        let ports = [(-20.0, 0.0), (5.0, -7.0), (0.0, 11.0), (20.0, 0.0), (14.0, 0.0)];
        let p = placed(6, &e, &ports);
        for i in [1, 2, 4] {
            assert!((p.x[e[i].0] + ports[i].0 - p.x[e[i].1] - ports[i].1).abs() < 1.0, "{:?}", p.x);
        }
    }

    proptest! {
        #[test]
        fn boxes_and_bends_of_a_layer_do_not_overlap(
            width in proptest::collection::vec(40.0..240.0f64, 3..28),
            wires in proptest::collection::vec(
                (0.0..1.0f64, 0.0..1.0f64, -20.0..20.0f64, -20.0..20.0f64), 0..50,
            ),
        ) {
            let node = |part: f64, of: usize| (part * of as f64) as usize;
            let to = |part: f64| 1 + node(part, width.len() - 1);
            let e: Vec<Edge> = wires.iter().map(|w| (node(w.1, to(w.0)), to(w.0))).collect();
            let ports: Vec<(f64, f64)> = wires.iter().map(|w| (w.2, w.3)).collect();
            let mut p = Placement::new(&longest_path_layers(width.len(), &e), &e);
            let right = p.place(&width, &ports);
            let half = |v: usize| width.get(v).map_or(0.0, |w| w / 2.0);
            for layer in &p.layers {
                let inside = |v: &usize| p.x[*v] - half(*v) >= -1e-6 && p.x[*v] + half(*v) <= right + 1e-6;
                prop_assert!(layer.iter().all(inside));
                for w in layer.windows(2) {
                    let between = p.x[w[1]] - half(w[1]) - p.x[w[0]] - half(w[0]);
                    prop_assert!(between >= BEND_GAP - 1e-5, "{between} {w:?}");
                }
            }
        }
    }
}
