//! Layered placement of a directed graph.
//!
//! After K. Sugiyama, S. Tagawa, M. Toda, "Methods for visual understanding of hierarchical system
//! structures", IEEE Trans. SMC 11(2), 1981. Layers follow the longest path. Sorting by barycentres lowers
//! the number of crossings. Places along the layers minimise least squares, with gaps between neighbours.

/// A wire between two boxes, given by their indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    pub(super) from: usize,
    pub(super) to: usize,
}

/// Finds the edges that close a cycle, by a depth-first walk. Edges marked in `known` count as such.
pub(super) fn cycle_closers(nodes: usize, edges: &[Edge], known: &[bool]) -> Vec<bool> {
    let mut closes = known.to_vec();
    let mut out = vec![Vec::new(); nodes];
    for (i, e) in edges.iter().enumerate().filter(|(i, _)| !known[*i]) {
        out[e.from].push(i);
    }
    #[derive(Clone, Copy, PartialEq)]
    enum Seen {
        No,
        Open,
        Done,
    }
    let mut seen = vec![Seen::No; nodes];
    for root in 0..nodes {
        if seen[root] != Seen::No {
            continue;
        }
        seen[root] = Seen::Open;
        let mut walk = vec![(root, 0)];
        while let Some((node, next)) = walk.last_mut() {
            let node = *node;
            let Some(&edge) = out[node].get(*next) else {
                seen[node] = Seen::Done;
                walk.pop();
                continue;
            };
            *next += 1;
            let to = edges[edge].to;
            match seen[to] {
                Seen::Open => closes[edge] = true,
                Seen::Done => {}
                Seen::No => {
                    seen[to] = Seen::Open;
                    walk.push((to, 0));
                }
            }
        }
    }
    closes
}

/// The layer of each node: one past the last node that feeds it. A node without inputs stands right before
/// the first node it feeds. `edges` must have no cycle.
pub(super) fn longest_path_layers(nodes: usize, edges: &[Edge]) -> Vec<usize> {
    let mut waiting = vec![0usize; nodes];
    edges.iter().for_each(|e| waiting[e.to] += 1);
    let fed: Vec<bool> = waiting.iter().map(|w| *w > 0).collect();
    let mut layer = vec![0usize; nodes];
    let mut ready: Vec<usize> = (0..nodes).filter(|n| waiting[*n] == 0).collect();
    while let Some(node) = ready.pop() {
        for e in edges.iter().filter(|e| e.from == node) {
            layer[e.to] = layer[e.to].max(layer[node] + 1);
            waiting[e.to] -= 1;
            if waiting[e.to] == 0 {
                ready.push(e.to);
            }
        }
    }
    for node in (0..nodes).filter(|n| !fed[*n]) {
        let first = edges.iter().filter(|e| e.from == node).map(|e| layer[e.to]).min();
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

/// Half the least gap beside a bend, and beside a box.
const BEND_ROOM: f64 = 9.0;
const BOX_ROOM: f64 = 13.0;
/// Weight of a piece that should be straight, and enough sweeps for it to settle within a pixel.
const STRAIGHT: f64 = 100.0;
const SWEEPS: usize = 1500;
/// Most vertices times sweeps. It bounds the time for a huge graph.
const MOVES: usize = 5_000_000;

impl Placement {
    /// Orders the vertices of every layer with few crossings.
    pub(super) fn order(layer: &[usize], edges: &[Edge]) -> Self {
        let mut layers = vec![Vec::new(); layer.iter().max().map_or(0, |l| l + 1)];
        for (node, l) in layer.iter().enumerate() {
            layers[*l].push(node);
        }
        let mut vertices = layer.len();
        let mut chains = Vec::with_capacity(edges.len());
        for e in edges {
            let mut chain = vec![e.from];
            for l in layers.iter_mut().take(layer[e.to]).skip(layer[e.from] + 1) {
                l.push(vertices);
                chain.push(vertices);
                vertices += 1;
            }
            chain.push(e.to);
            chains.push(chain);
        }
        let mut placement = Self { layers, chains, x: vec![0.0; vertices] };
        let mut best = (placement.crossings(), placement.layers.clone());
        for sweep in 0..24 {
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
        let mut between = vec![Vec::new(); self.layers.len()];
        for (a, b) in self.pieces() {
            between[layer_of[a]].push((rank[a], rank[b]));
        }
        between
            .iter()
            .map(|p| {
                let crosses = |a: &(usize, usize), b: &(usize, usize)| {
                    (a.0 < b.0 && a.1 > b.1) || (a.0 > b.0 && a.1 < b.1)
                };
                p.iter()
                    .enumerate()
                    .map(|(i, a)| p[..i].iter().filter(|b| crosses(a, b)).count())
                    .sum::<usize>()
            })
            .sum()
    }

    /// Places the vertices along their layers near their neighbours. `width` has the width of each node;
    /// `ports` has, for each edge, the offsets of its ends from the centres of their nodes. The least left
    /// edge becomes 0. Returns the greatest right edge.
    pub(super) fn place(&mut self, width: &[f64], ports: &[(f64, f64)]) -> f64 {
        let half = |v: usize| width.get(v).map_or(0.0, |w| w / 2.0);
        let room = |v: usize| if v < width.len() { BOX_ROOM } else { BEND_ROOM };
        let mut degree = vec![[0usize; 2]; self.x.len()];
        for (a, b) in self.pieces() {
            degree[a][1] += 1;
            degree[b][0] += 1;
        }
        // A piece that is the only one at both its ends weighs most: plain chains and long edges become
        // straight.
        let mut joined: Joined = vec![[Vec::new(), Vec::new()]; self.x.len()];
        for (chain, (start, end)) in self.chains.iter().zip(ports) {
            let last = chain.len() - 1;
            for (i, w) in chain.windows(2).enumerate() {
                let above = if i == 0 { *start } else { 0.0 };
                let below = if i + 1 == last { *end } else { 0.0 };
                let weight = if degree[w[0]][1] == 1 && degree[w[1]][0] == 1 { STRAIGHT } else { 1.0 };
                joined[w[0]][1].push((w[1], below - above, weight));
                joined[w[1]][0].push((w[0], above - below, weight));
            }
        }
        for sweep in 0..SWEEPS.min(40 + MOVES / self.x.len().max(1)) {
            for i in 0..self.layers.len() {
                let at = if sweep % 2 == 0 { i } else { self.layers.len() - 1 - i };
                let layer = &self.layers[at];
                // Late sweeps weigh both sides, so that a box stands between its inputs and its outputs.
                let sides: &[usize] = if sweep >= 20 {
                    &[0, 1]
                } else if sweep % 2 == 0 {
                    &[0]
                } else {
                    &[1]
                };
                let wanted: Vec<(f64, f64)> = layer
                    .iter()
                    .map(|&v| {
                        let (mut sum, mut n) = (0.0, 0.0);
                        for (other, shift, weight) in sides.iter().flat_map(|s| &joined[v][*s]) {
                            sum += weight * (self.x[*other] + shift);
                            n += weight;
                        }
                        if n > 0.0 { (sum / n, n) } else { (self.x[v], 0.1) }
                    })
                    .collect();
                let gaps: Vec<f64> = layer
                    .windows(2)
                    .map(|w| half(w[0]) + half(w[1]) + room(w[0]).max(room(w[1])) * 2.0)
                    .collect();
                for (v, x) in layer.iter().zip(separated(&wanted, &gaps)) {
                    self.x[*v] = x;
                }
            }
        }
        let left = (0..self.x.len()).map(|v| self.x[v] - half(v)).fold(f64::MAX, f64::min);
        self.x.iter_mut().for_each(|x| *x -= left);
        (0..self.x.len()).map(|v| self.x[v] + half(v)).fold(0.0, f64::max)
    }
}

/// Neighbours above and below each vertex: index, wanted shift of the vertex from it, and weight.
type Joined = Vec<[Vec<(usize, f64, f64)>; 2]>;

/// Places nearest to the wanted ones (place and weight) that keep their order and these least gaps. It is
/// a weighted isotonic regression by pooling adjacent violators (M. Ayer et al., 1955).
fn separated(wanted: &[(f64, f64)], gaps: &[f64]) -> Vec<f64> {
    let offsets: Vec<f64> = std::iter::once(0.0)
        .chain(gaps.iter().scan(0.0, |at, g| {
            *at += g;
            Some(*at)
        }))
        .collect();
    // Pools of neighbours that share a mean: mean, weight, members.
    let mut pools: Vec<(f64, f64, usize)> = Vec::with_capacity(wanted.len());
    for ((x, w), offset) in wanted.iter().zip(&offsets) {
        let mut pool = (x - offset, *w, 1);
        while let Some(&(mean, weight, members)) = pools.last()
            && mean > pool.0
        {
            let sum = weight + pool.1;
            pool = ((mean * weight + pool.0 * pool.1) / sum, sum, members + pool.2);
            pools.pop();
        }
        pools.push(pool);
    }
    pools
        .iter()
        .flat_map(|p| std::iter::repeat_n(p.0, p.2))
        .zip(&offsets)
        .map(|(mean, offset)| mean + offset)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edges(list: &[(usize, usize)]) -> Vec<Edge> {
        list.iter().map(|&(from, to)| Edge { from, to }).collect()
    }

    #[test]
    fn layers_follow_the_longest_path() {
        // 0 -> 1 -> 2 -> 3 and 0 -> 3, with 4 feeding 2 alone.
        let e = edges(&[(0, 1), (1, 2), (2, 3), (0, 3), (4, 2)]);
        assert_eq!(longest_path_layers(5, &e), [0, 1, 2, 3, 1]);
    }

    #[test]
    fn one_edge_of_a_cycle_closes_it() {
        let e = edges(&[(0, 1), (1, 2), (2, 0), (1, 1), (0, 2)]);
        assert_eq!(cycle_closers(3, &e, &[false; 5]), [false, false, true, true, false]);
        assert_eq!(
            cycle_closers(3, &e, &[true, false, false, false, false]),
            [true, false, true, true, false]
        );
    }

    #[test]
    fn avoidable_crossings_are_removed() {
        // 0, 1, 2 feed 5, 4, 3: crossed as numbered, straight when turned.
        let e = edges(&[(0, 5), (1, 4), (2, 3)]);
        let p = Placement::order(&longest_path_layers(6, &e), &e);
        assert_eq!(p.crossings(), 0);
        // A complete bipartite graph of 2 and 2 has one crossing however it is drawn.
        let e = edges(&[(0, 2), (0, 3), (1, 2), (1, 3)]);
        assert_eq!(Placement::order(&longest_path_layers(4, &e), &e).crossings(), 1);
    }

    #[test]
    fn separated_places_keep_gaps_and_move_least() {
        assert_eq!(separated(&[(0.0, 1.0), (10.0, 1.0)], &[4.0]), [0.0, 10.0]);
        // Both want 5, 4 apart: 3 and 7. With three times the weight the second moves a third as far.
        assert_eq!(separated(&[(5.0, 1.0), (5.0, 1.0)], &[4.0]), [3.0, 7.0]);
        assert_eq!(separated(&[(5.0, 1.0), (5.0, 3.0)], &[4.0]), [2.0, 6.0]);
        let x = separated(&[(9.0, 1.0), (1.0, 1.0), (2.0, 1.0), (30.0, 1.0)], &[2.0, 2.0, 2.0]);
        assert!(x.windows(2).all(|w| w[1] - w[0] >= 2.0 - 1e-12), "{x:?}");
    }

    #[test]
    fn chain_is_straight_through_its_ports() {
        // 1 -> 2 -> 3 hang under 0, which also feeds 4; 4 feeds 3's neighbour 5.
        let e = edges(&[(0, 1), (1, 2), (2, 3), (0, 4), (4, 5)]);
        let mut p = Placement::order(&longest_path_layers(6, &e), &e);
        let ports = [(-20.0, 0.0), (5.0, -7.0), (0.0, 11.0), (20.0, 0.0), (0.0, 0.0)];
        p.place(&[100.0; 6], &ports);
        for i in [1, 2, 4] {
            let (start, end) = ports[i];
            assert!((p.x[e[i].from] + start - p.x[e[i].to] - end).abs() < 1.0, "{:?}", p.x);
        }
    }

    #[test]
    fn boxes_and_bends_of_a_layer_do_not_overlap() {
        for seed in 0..40 {
            let mut n = 0;
            let mut below = |top: usize| {
                n += 1;
                let mixed = (seed * 1000 + n as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
                ((mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 33) as usize % top
            };
            let nodes = 3 + below(25);
            let width: Vec<f64> = (0..nodes).map(|_| 40.0 + below(200) as f64).collect();
            let list: Vec<(usize, usize)> = (0..2 * nodes)
                .map(|_| {
                    let to = 1 + below(nodes - 1);
                    (below(to), to)
                })
                .collect();
            let e = edges(&list);
            let ports: Vec<(f64, f64)> =
                e.iter().map(|_| (below(40) as f64 - 20.0, below(40) as f64 - 20.0)).collect();
            let mut p = Placement::order(&longest_path_layers(nodes, &e), &e);
            let right = p.place(&width, &ports);
            let half = |v: usize| width.get(v).map_or(0.0, |w| w / 2.0);
            for layer in &p.layers {
                assert!(
                    layer.iter().all(|v| p.x[*v] - half(*v) >= -1e-6 && p.x[*v] + half(*v) <= right + 1e-6)
                );
                for w in layer.windows(2) {
                    let between = p.x[w[1]] - half(w[1]) - p.x[w[0]] - half(w[0]);
                    assert!(between >= 2.0 * BEND_ROOM - 1e-5, "{between} {w:?} seed {seed}");
                }
            }
        }
    }
}
