//! Layered placement of a directed graph.
//!
//! After K. Sugiyama, S. Tagawa, M. Toda, "Methods for visual understanding of hierarchical system
//! structures", IEEE Trans. SMC 11(2), 1981. Layers follow the longest path. Sorting by barycentres lowers
//! the number of crossings. Then each vertex moves toward its neighbours, off those beside it.

/// A wire from a box to another, given by their indices.
pub(super) type Edge = (usize, usize);

/// Finds the edges that close a cycle, by a depth-first walk. Edges marked in `known` count as such.
pub(super) fn cycle_closers(nodes: usize, edges: &[Edge], known: &[bool]) -> Vec<bool> {
    let mut closes = known.to_vec();
    // Per node its edges that are still to walk, and whether the walk is inside it; `None` before.
    let mut out = vec![Vec::new(); nodes];
    for (i, e) in edges.iter().enumerate().rev().filter(|(i, _)| !known[*i]) {
        out[e.0].push(i);
    }
    let mut open: Vec<Option<bool>> = vec![None; nodes];
    for root in 0..nodes {
        let mut walk = if open[root].is_none() { vec![root] } else { Vec::new() };
        while let Some(&node) = walk.last() {
            open[node] = Some(true);
            let Some(edge) = out[node].pop() else {
                open[node] = Some(false);
                walk.pop();
                continue;
            };
            match open[edges[edge].1] {
                None => walk.push(edges[edge].1),
                Some(inside) => closes[edge] = inside,
            }
        }
    }
    closes
}

/// The layer of each node: one past the last node that feeds it. A node without inputs stands right before
/// the first node it feeds. `edges` must have no cycle.
pub(super) fn longest_path_layers(nodes: usize, edges: &[Edge]) -> Vec<usize> {
    let mut layer = vec![0usize; nodes];
    // Without a cycle no path is longer than the number of nodes.
    for _ in 0..nodes {
        let before = layer.clone();
        edges.iter().for_each(|e| layer[e.1] = layer[e.1].max(layer[e.0] + 1));
        if layer == before {
            break;
        }
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
    /// Centre of each vertex.
    pub(super) x: Vec<f64>,
}

/// Least gap beside a bend, and beside a box.
const BEND_GAP: f64 = 18.0;
const BOX_GAP: f64 = 26.0;
/// Sweeps that order the vertices, and sweeps that move them.
const ORDER: usize = 24;
const MOVE: usize = 200;

impl Placement {
    /// Orders the vertices of every layer with few crossings.
    pub(super) fn order(layer: &[usize], edges: &[Edge]) -> Self {
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
        let mut placement = Self { layers, chains, x: vec![0.0; vertices] };
        let mut best = (placement.crossings(), placement.layers.clone());
        for sweep in 0..ORDER {
            let down = sweep % 2 == 0;
            let count = placement.layers.len();
            for i in 1..count {
                placement.sort_by_barycentre(if down { i } else { count - 1 - i }, down);
            }
            let crossings = placement.crossings();
            if crossings < best.0 {
                best = (crossings, placement.layers.clone());
            }
        }
        placement.layers = best.1;
        placement
    }

    /// Pieces of edges between neighbouring layers.
    fn pieces(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.chains.iter().flat_map(|c| c.windows(2).map(|w| (w[0], w[1])))
    }

    fn ranks(&self) -> Vec<usize> {
        let mut rank = vec![0; self.x.len()];
        for l in &self.layers {
            l.iter().enumerate().for_each(|(i, v)| rank[*v] = i);
        }
        rank
    }

    fn sort_by_barycentre(&mut self, layer: usize, down: bool) {
        let rank = self.ranks();
        let mut sums = vec![(0.0, 0.0); self.x.len()];
        for (a, b) in self.pieces() {
            let (own, other) = if down { (b, a) } else { (a, b) };
            sums[own].0 += rank[other] as f64;
            sums[own].1 += 1.0;
        }
        let key = |v: &usize| if sums[*v].1 > 0.0 { sums[*v].0 / sums[*v].1 } else { rank[*v] as f64 };
        self.layers[layer].sort_by(|a, b| key(a).total_cmp(&key(b)));
    }

    /// Number of crossing pairs of pieces.
    pub(super) fn crossings(&self) -> usize {
        let rank = self.ranks();
        let mut layer_of = vec![0; self.x.len()];
        for (i, l) in self.layers.iter().enumerate() {
            l.iter().for_each(|v| layer_of[*v] = i);
        }
        let mut pieces: Vec<[usize; 3]> =
            self.pieces().map(|(a, b)| [layer_of[a], rank[a], rank[b]]).collect();
        pieces.sort_unstable();
        let crosses = |a: &[usize; 3], b: &[usize; 3]| a[1] < b[1] && a[2] > b[2];
        let of_layer = |p: &[[usize; 3]]| -> usize {
            p.iter().map(|a| p.iter().filter(|b| crosses(a, b)).count()).sum()
        };
        pieces.chunk_by(|a, b| a[0] == b[0]).map(of_layer).sum()
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
        for sweep in 0..MOVE {
            for i in 0..self.layers.len() {
                let layer = &self.layers[if sweep % 2 == 0 { i } else { self.layers.len() - 1 - i }];
                // Late sweeps look at both sides, so that a box stands between its inputs and its outputs.
                let sides = if sweep >= 20 { 0..=1 } else { sweep % 2..=sweep % 2 };
                let wanted = layer.iter().map(|&v| {
                    let near: Vec<_> = joined[v][sides.clone()].iter().flatten().collect();
                    let sum: f64 = near.iter().map(|(other, shift)| self.x[*other] + shift).sum();
                    if near.is_empty() { self.x[v] } else { sum / near.len() as f64 }
                });
                let gaps: Vec<f64> =
                    layer.windows(2).map(|w| half(w[0]) + half(w[1]) + gap(w[0]).max(gap(w[1]))).collect();
                let places = separated(&wanted.collect::<Vec<_>>(), &gaps);
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
        while let Some((sum, members)) =
            pools.pop_if(|(sum, members)| *sum / *members as f64 > pool.0 / pool.1 as f64)
        {
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
        assert_eq!(cycle_closers(3, &e, &known), [true, false, true, true, false]);
    }

    #[test]
    fn avoidable_crossings_are_removed() {
        // 0, 1, 2 feed 5, 4, 3: crossed as numbered, straight when turned. A complete bipartite graph of 2
        // and 2 has one crossing however it is drawn.
        for (edges, crossings) in [(&[(0, 5), (1, 4), (2, 3)][..], 0), (&[(0, 2), (0, 3), (1, 2), (1, 3)], 1)]
        {
            assert_eq!(Placement::order(&longest_path_layers(6, edges), edges).crossings(), crossings);
        }
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
        let mut p = Placement::order(&longest_path_layers(6, &e), &e);
        let ports = [(-20.0, 0.0), (5.0, -7.0), (0.0, 11.0), (20.0, 0.0), (14.0, 0.0)];
        p.place(&[100.0; 6], &ports);
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
            let mut p = Placement::order(&longest_path_layers(width.len(), &e), &e);
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
