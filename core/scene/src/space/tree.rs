//! A tree of boxes over surfaces, and the search for the deepest of them.

use super::index::{Entry, felt};
use super::shape::Form;
use super::vector::{Vector, dot, least, most};

/// Widening of bounds for rounding, in millimetres.
const SLACK_MM: f64 = 1e-9;
/// Largest number of surfaces in a leaf.
const LEAF: usize = 4;
/// Most nodes that wait to be looked at: one for each level, and one more for the last.
const WAITING: usize = 24;
/// Steps per millimetre in which depths are compared. Depths of surfaces that coincide differ only by
/// rounding, and the numbers of their entries must decide.
const STEPS_PER_MM: f64 = 8192.0;

/// The deepest surface so far, and the depth that still beats it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Best {
    /// A depth from here on is equal. With a lower number it is better.
    level: f64,
    /// A depth from here on is deeper.
    above: f64,
    entry: u32,
    pub found: Option<u32>,
    /// Number of nodes and surfaces that were looked at.
    pub looks: u32,
}

impl Best {
    /// Starts without a surface. Anything at least this deep is better.
    pub(super) fn nothing(depth: f64) -> Self {
        Self { level: depth, above: depth, entry: 0, found: None, looks: 0 }
    }

    /// Starts with a held surface. Only a greater depth is better.
    pub(super) fn held(depth: f64) -> Self {
        Self::nothing(steps(depth).1)
    }

    #[inline]
    fn admits(&self, depth: f64, entry: u32) -> bool {
        depth >= self.above || (depth >= self.level && entry < self.entry)
    }
}

/// Step that a depth is in: its lower end, and that of the next.
#[inline]
fn steps(depth: f64) -> (f64, f64) {
    let scaled = depth * STEPS_PER_MM;
    let near = scaled as i64;
    let whole = (near - i64::from(scaled < near as f64)) as f64;
    (whole / STEPS_PER_MM, (whole + 1.0) / STEPS_PER_MM)
}

/// Bounds on the depths of some surfaces.
#[derive(Clone, Debug)]
struct Bounds {
    /// Box in which they are touched.
    low: Vector,
    high: Vector,
    /// Least and greatest coordinates of the normals of sheets (rectangles and reliefs).
    normals: Option<[Vector; 2]>,
    /// Whether there are solids: spheres and boxes.
    solid: bool,
    /// Least and greatest coordinates of the centres, where all are spheres.
    centres: Option<[Vector; 2]>,
    /// Largest possible depth.
    most: f64,
    /// Distance from which they are felt.
    reach: f64,
    /// Lowest number of an entry.
    lowest: u32,
}

impl Bounds {
    /// Bounds of one surface; `None` for an endless plane.
    fn of(number: u32, entry: &Entry) -> Option<Self> {
        let pose = &entry.surface.pose;
        let sheet = |[x, y]: [f64; 2], low: f64, high: f64, thickness: f64| {
            ([-0.5 * x, -0.5 * y, low - thickness], [0.5 * x, 0.5 * y, high], thickness, false)
        };
        let (low, high, depth, solid) = match entry.surface.shape.form() {
            Form::Plane => return None,
            Form::Rectangle { size_mm, thickness_mm } => sheet(*size_mm, 0.0, 0.0, *thickness_mm),
            Form::Relief(relief) => {
                let [low, high] = relief.bounds_mm;
                sheet(relief.size_mm, low, high, relief.thickness_mm)
            }
            Form::Sphere { radius_mm: r } => ([-r; 3], [*r; 3], *r, true),
            Form::Box { size_mm } => {
                let half = size_mm.map(|s| 0.5 * s);
                (half.map(|h| -h), half, least(least(half[0], half[1]), half[2]), true)
            }
        };
        // A sphere is the same however it is turned.
        let round = matches!(entry.surface.shape.form(), Form::Sphere { .. });
        let middle = pose.to_world([0, 1, 2].map(|k| 0.5 * (low[k] + high[k])));
        let half = [0, 1, 2].map(|k| 0.5 * (high[k] - low[k]));
        let half = if round { half } else { pose.turn().map(|row| dot(row.map(f64::abs), half)) };
        let normal = pose.axis(2);
        Some(Self {
            low: [0, 1, 2].map(|k| middle[k] - half[k] - SLACK_MM),
            high: [0, 1, 2].map(|k| middle[k] + half[k] + SLACK_MM),
            normals: (!solid).then_some([normal, normal]),
            solid,
            centres: round.then_some([pose.place_mm(); 2]),
            most: depth + SLACK_MM,
            reach: entry.reach_mm,
            lowest: number,
        })
    }

    /// Bounds of both.
    fn with(&self, other: &Self) -> Self {
        let lower = |a: Vector, b: Vector| [0, 1, 2].map(|k| least(a[k], b[k]));
        let upper = |a: Vector, b: Vector| [0, 1, 2].map(|k| most(a[k], b[k]));
        let around = |[a, b]: [Vector; 2], [c, d]: [Vector; 2]| [lower(a, c), upper(b, d)];
        let normals = match (self.normals, other.normals) {
            (Some(one), Some(other)) => Some(around(one, other)),
            (one, other) => one.or(other),
        };
        Self {
            low: lower(self.low, other.low),
            high: upper(self.high, other.high),
            normals,
            solid: self.solid || other.solid,
            centres: self.centres.zip(other.centres).map(|(one, other)| around(one, other)),
            most: most(self.most, other.most),
            reach: most(self.reach, other.reach),
            lowest: self.lowest.min(other.lowest),
        }
    }

    /// Upper bound on the depth of the surfaces at a point; minus infinity where none is felt.
    ///
    /// A solid is no deeper than the distance to the nearest way out of the box. A sphere is no deeper than
    /// the largest radius less the distance to the centres. Let a sheet have the normal `n`. The depth below
    /// it is at most `n . (c - p)`, with `c` anywhere in the box.
    #[inline]
    fn ceiling(&self, point: Vector) -> f64 {
        let within: Vector = std::array::from_fn(|k| least(point[k] - self.low[k], self.high[k] - point[k]));
        let exit = least(least(within[0], within[1]), within[2]);
        if exit < 0.0 {
            let outside = within.map(|x| least(x, 0.0));
            let square = dot(outside, outside);
            return if square <= self.reach * self.reach {
                SLACK_MM - square.sqrt()
            } else {
                f64::NEG_INFINITY
            };
        }
        let mut bound = if self.solid { exit } else { f64::NEG_INFINITY };
        if let Some([low, high]) = self.centres {
            let off: Vector = std::array::from_fn(|k| most(most(low[k] - point[k], point[k] - high[k]), 0.0));
            bound = least(bound, self.most - dot(off, off).sqrt());
        }
        if let Some([from, to]) = &self.normals {
            let below = (0..3).map(|k| {
                let (a, b) = (self.low[k] - point[k], self.high[k] - point[k]);
                most(most(from[k] * a, from[k] * b), most(to[k] * a, to[k] * b))
            });
            bound = most(bound, below.sum::<f64>() + SLACK_MM);
        }
        least(bound, self.most)
    }

    /// The least and greatest coordinates, by which surfaces are sorted.
    fn key(&self, key: usize) -> f64 {
        if key < 3 { self.low[key] } else { self.high[key - 3] }
    }
}

/// Some surfaces: a leaf with items, or two nodes.
#[derive(Clone, Debug)]
struct Node {
    bounds: Bounds,
    /// Number of the first item; without items, the number of the first of two nodes.
    first: u32,
    items: u32,
}

/// A tree over surfaces. Endless planes are in no box and stand beside it.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    planes: Vec<u32>,
    nodes: Vec<Node>,
    items: Vec<u32>,
}

impl Tree {
    pub(super) fn new(entries: &[Entry]) -> Self {
        let mut tree = Self::default();
        let mut all = Vec::new();
        for (number, entry) in (0..).zip(entries) {
            match Bounds::of(number, entry) {
                Some(bounds) => all.push(bounds),
                None => tree.planes.push(number),
            }
        }
        if let Some(root) = tree.node(&all) {
            tree.nodes.push(root);
            tree.split(0, &mut all);
        }
        tree
    }

    fn node(&self, some: &[Bounds]) -> Option<Node> {
        let bounds = some.iter().cloned().reduce(|a, b| a.with(&b))?;
        Some(Node { bounds, first: self.items.len() as u32, items: some.len() as u32 })
    }

    /// Halves the surfaces of a node until they fit into leaves. The halves differ by the coordinate that has
    /// the largest range, as a part of their extent.
    fn split(&mut self, number: usize, some: &mut [Bounds]) {
        if some.len() <= LEAF {
            self.nodes[number].first = self.items.len() as u32;
            self.items.extend(some.iter().map(|bounds| bounds.lowest));
            return;
        }
        let whole = &self.nodes[number].bounds;
        let share = |key: usize| {
            let keys = || some.iter().map(|bounds| bounds.key(key));
            let range = keys().fold(f64::MIN, most) - keys().fold(f64::MAX, least);
            range / (whole.high[key % 3] - whole.low[key % 3])
        };
        let key = (0..6).max_by(|a, b| share(*a).total_cmp(&share(*b))).unwrap_or(0);
        let order = |a: &Bounds, b: &Bounds| a.key(key).total_cmp(&b.key(key)).then(a.lowest.cmp(&b.lowest));
        some.select_nth_unstable_by(some.len() / 2, order);
        let (left, right) = some.split_at_mut(some.len() / 2);
        let first = self.nodes.len();
        let halves: Vec<Node> = [&*left, &*right].into_iter().filter_map(|half| self.node(half)).collect();
        self.nodes.extend(halves);
        (self.nodes[number].first, self.nodes[number].items) = (first as u32, 0);
        self.split(first, left);
        self.split(first + 1, right);
    }

    /// Improves the best by the surfaces of the tree.
    pub(super) fn search(&self, point: Vector, entries: &[Entry], best: &mut Best) {
        let look = |numbers: &[u32], best: &mut Best| {
            for &number in numbers {
                let Some(entry) = entries.get(number as usize) else { continue };
                let depth = entry.surface.depth(point);
                best.looks += 1;
                if depth >= felt(entry) && best.admits(depth, number) {
                    let (level, above) = steps(depth);
                    *best = Best { level, above, entry: number, found: Some(number), ..*best };
                }
            }
        };
        look(&self.planes, best);
        let Some(root) = self.nodes.first() else { return };
        // Nodes that are still to be looked at, the one with the highest ceiling last.
        let mut waiting = [(0.0, root); WAITING];
        waiting[0].0 = root.bounds.ceiling(point);
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (ceiling, node) = waiting[count];
            best.looks += 1;
            if !best.admits(ceiling, node.bounds.lowest) {
                continue;
            }
            let first = node.first as usize;
            if node.items > 0 {
                look(self.items.get(first..first + node.items as usize).unwrap_or_default(), best);
                continue;
            }
            let Some([a, b]) = self.nodes.get(first..first + 2) else { continue };
            let [a, b] = [a, b].map(|node| (node.bounds.ceiling(point), node));
            for (ceiling, node) in if a.0 > b.0 { [b, a] } else { [a, b] } {
                if count < WAITING && ceiling > f64::NEG_INFINITY {
                    waiting[count] = (ceiling, node);
                    count += 1;
                }
            }
        }
    }

    /// Size on the heap in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.items[..]) + size_of_val(&self.planes[..])
    }
}
