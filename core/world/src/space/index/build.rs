//! How a tree is made.

use std::collections::HashMap;

use super::super::shape::Form;
use super::super::vector::{Vector, dot, least, most, norm, sub};
use super::Entry;
use super::tree::{Class, Node, SLACK_MM, Tree};

/// Most surfaces of a leaf: to look at one takes about as long as to look at a node.
const LEAF: usize = 2;
/// How far from a node's middle a point is thought to be at most when turns are weighed against places, in millimetres.
const LEVER_MM: f64 = 50.0;
/// From how many on, that lie over each other, they are split by depth.
const PILED: f64 = 4.0;
/// To so many different turns of boxes each gets a part of the tree.
const FEW_TURNS: usize = 8;
/// What differs by less does not differ.
const ALIKE_MM: f64 = 1e-6;

/// A surface that is to go into a tree.
struct Item {
    entry: u32,
    reach: f64,
    frame: u32,
    /// Columns of its turn: its axes as the world sees them.
    axes: [Vector; 3],
    /// The point its box is counted from; of an endless plane the one nearest to the middle of the scene.
    place: Vector,
    /// Where it is touched, in its own coordinates.
    low: Vector,
    high: Vector,
    /// The least height of its top, above `place`.
    lowest: f64,
    round: bool,
    most: f64,
    /// Radius of the ball around `place` that holds it.
    ball: f64,
    /// Half its longest edge.
    widest: f64,
}

impl Item {
    fn new(number: usize, entry: &Entry, middle: Vector) -> Self {
        let pose = &entry.surface.pose;
        let axes = [0, 1, 2].map(|k| pose.axis(k));
        let mut place = pose.place_mm();
        let infinite = f64::INFINITY;
        let (low, high, greatest) = match entry.surface.shape.form() {
            Form::Plane => {
                let z = axes[2];
                let off = dot(z, sub(place, middle));
                place = std::array::from_fn(|k| middle[k] + off * z[k]);
                ([-infinite; 3], [infinite, infinite, 0.0], infinite)
            }
            Form::Rectangle { size_mm: [x, y], thickness_mm: t } => {
                ([-0.5 * x, -0.5 * y, -t], [0.5 * x, 0.5 * y, 0.0], *t)
            }
            Form::Relief(relief) => {
                let ([x, y], [low, high]) = (relief.size_mm(), relief.bounds_mm());
                let t = relief.thickness_mm();
                ([-0.5 * x, -0.5 * y, low - t], [0.5 * x, 0.5 * y, high], t)
            }
            Form::Sphere { radius_mm: r } => ([-r; 3], [*r; 3], *r),
            Form::Box { size_mm } => {
                let half = size_mm.map(|s| 0.5 * s);
                (half.map(|h| -h), half, least(least(half[0], half[1]), half[2]))
            }
        };
        let round = matches!(entry.surface.shape.form(), Form::Sphere { .. });
        let lowest = match entry.surface.shape.form() {
            Form::Relief(relief) => relief.bounds_mm()[0],
            _ => 0.0,
        };
        let widest = most(most(high[0], high[1]), high[2]);
        let ball = if round { high[0] } else { norm(high) };
        let (entry, reach) = (number as u32, entry.reach_mm);
        Self { entry, reach, frame: 0, axes, place, low, high, lowest, round, most: greatest, ball, widest }
    }

    /// Its box in a frame in which it lies at a place: least and greatest along the frame's axes.
    fn bounds(&self, frame: &[Vector; 3], place: Vector, same: bool) -> (Vector, Vector) {
        let (mut low, mut high) = (place, place);
        if same || self.round {
            return (std::array::from_fn(|k| low[k] + self.low[k]), std::array::from_fn(|k| high[k] + self.high[k]));
        }
        for k in 0..3 {
            for j in 0..3 {
                let along = dot(frame[k], self.axes[j]);
                // Nothing times endless is nothing.
                if along != 0.0 {
                    let (a, b) = (along * self.low[j], along * self.high[j]);
                    low[k] += least(a, b);
                    high[k] += most(a, b);
                }
            }
        }
        (low, high)
    }
}

/// What is known of an item while a node is made of it.
#[derive(Clone, Copy)]
struct Boxed {
    item: u32,
    /// By what it is sorted.
    key: f64,
    /// How far its top lies above the node's middle along its normal.
    above: f64,
    place: Vector,
    low: Vector,
    high: Vector,
}

struct Builder {
    tree: Tree,
    items: Vec<Item>,
}

/// A tree over all surfaces of a class, or over those that reach.
pub(super) fn tree(class: Class, entries: &[Entry], reaching: bool) -> Tree {
    let tree = Tree { class, frames: Vec::new(), nodes: Vec::new(), items: Vec::new() };
    let mut of_class: Vec<(usize, &Entry)> = Vec::new();
    // Of surfaces that are touched alike the one of lowest number always wins, unless another reaches further.
    let mut known: HashMap<[u64; 20], f64> = HashMap::new();
    for (number, entry) in entries.iter().enumerate() {
        let solid = matches!(entry.surface.shape.form(), Form::Sphere { .. } | Form::Box { .. });
        if solid != (class == Class::Solids) || (reaching && entry.reach_mm == 0.0) {
            continue;
        }
        let reach = if reaching { entry.reach_mm } else { 0.0 };
        let before = known.entry(entry.surface.key()).or_insert(-1.0);
        if reach > *before {
            *before = reach;
            of_class.push((number, entry));
        }
    }
    let count = of_class.len() as f64;
    let middle = of_class.iter().fold([0.0; 3], |sum: Vector, (_, e)| {
        std::array::from_fn(|k| sum[k] + e.surface.pose.place_mm()[k] / count)
    });
    let mut frames: HashMap<[u64; 9], u32> = HashMap::new();
    let mut builder = Builder { tree, items: Vec::with_capacity(of_class.len()) };
    for (number, entry) in of_class {
        let mut item = Item::new(number, entry, middle);
        if !reaching {
            item.reach = 0.0;
        }
        let mut bits = [0; 9];
        bits.iter_mut().zip(item.axes.iter().flatten()).for_each(|(to, x)| *to = x.to_bits());
        item.frame = *frames.entry(bits).or_insert_with(|| {
            builder.tree.frames.push(item.axes);
            builder.tree.frames.len() as u32 - 1
        });
        builder.items.push(item);
    }
    let mut order: Vec<Boxed> = (0..builder.items.len() as u32)
        .map(|item| Boxed { item, key: 0.0, above: 0.0, place: [0.0; 3], low: [0.0; 3], high: [0.0; 3] })
        .collect();
    if !order.is_empty() {
        let root = builder.node(&mut order);
        builder.tree.nodes.push(root);
        builder.split(0, &mut order);
    }
    builder.tree.nodes.shrink_to_fit();
    builder.tree
}

impl Builder {
    fn item(&self, boxed: &Boxed) -> &Item {
        &self.items[boxed.item as usize]
    }

    /// The frame in which some surfaces lie most alike: that of the one whose normal is nearest to their mean.
    fn frame(&self, some: &[Boxed]) -> u32 {
        let first = self.item(&some[0]);
        if self.tree.class == Class::Solids || some.iter().all(|b| self.item(b).frame == first.frame) {
            return first.frame;
        }
        let mean = some.iter().fold([0.0; 3], |sum: Vector, b| {
            std::array::from_fn(|k| sum[k] + self.item(b).axes[2][k])
        });
        let nearest = some.iter().map(|b| self.item(b)).max_by(|a, b| {
            dot(a.axes[2], mean).total_cmp(&dot(b.axes[2], mean))
        });
        nearest.unwrap_or(first).frame
    }

    /// The node of some surfaces, whose boxes in its frame are noted. It is a leaf until it is split.
    fn node(&self, some: &mut [Boxed]) -> Node {
        let number = self.frame(some);
        let frame = &self.tree.frames[number as usize];
        let sheets = self.tree.class == Class::Sheets;
        let infinite = f64::INFINITY;
        let mut node = Node {
            frame: number,
            lowest: u32::MAX,
            first: 0,
            items: some.len() as u32,
            low: [infinite; 3],
            high: [-infinite; 3],
            core: [[infinite; 3], [-infinite; 3]],
            above: -infinite,
            beyond: if sheets { infinite } else { 0.0 },
            spread: [1.0, 0.0],
            most: 0.0,
            reach: 0.0,
        };
        for boxed in some.iter_mut() {
            let item = &self.items[boxed.item as usize];
            boxed.place = frame.map(|axis| dot(axis, item.place));
            (boxed.low, boxed.high) = item.bounds(frame, boxed.place, item.frame == number);
            for k in 0..3 {
                node.low[k] = least(node.low[k], boxed.low[k]);
                node.high[k] = most(node.high[k], boxed.high[k]);
                node.core[0][k] = least(node.core[0][k], boxed.place[k]);
                node.core[1][k] = most(node.core[1][k], boxed.place[k]);
            }
            node.lowest = node.lowest.min(item.entry);
            node.most = most(node.most, item.most);
            node.reach = most(node.reach, item.reach);
        }
        if sheets {
            let [low, high] = node.core;
            let middle = std::array::from_fn(|k| 0.5 * (low[k] + high[k]));
            node.core = [middle; 2];
        }
        let mut spread = 0.0;
        for boxed in some.iter_mut() {
            let item = &self.items[boxed.item as usize];
            if !sheets {
                node.above = most(node.above, item.ball);
                node.beyond = most(node.beyond, item.widest);
                continue;
            }
            boxed.above = if item.frame == number {
                boxed.place[2] - node.core[0][2]
            } else {
                let z = item.axes[2];
                spread = most(spread, norm(sub(z, frame[2])));
                dot(frame.map(|axis| dot(axis, z)), sub(boxed.place, node.core[0]))
            };
            node.above = most(node.above, boxed.above + item.high[2]);
            node.beyond = least(node.beyond, boxed.above + item.lowest);
        }
        if spread > 0.0 {
            // A chord of the unit sphere.
            let half = least(0.5 * spread + 1e-12, 1.0);
            node.spread = [1.0 - 2.0 * half * half, 2.0 * half * (1.0 - half * half).sqrt()];
        }
        node.low = node.low.map(|x| x - SLACK_MM);
        node.high = node.high.map(|x| x + SLACK_MM);
        node.above += SLACK_MM;
        node.beyond += if sheets { -SLACK_MM } else { SLACK_MM };
        node.most += SLACK_MM;
        node
    }

    /// Splits a node in two halves, and these, until leaves are small.
    fn split(&mut self, node: usize, some: &mut [Boxed]) {
        if some.len() <= LEAF {
            self.tree.nodes[node].first = self.tree.items.len() as u32;
            let numbers = some.iter().map(|b| self.items[b.item as usize].entry);
            self.tree.items.extend(numbers);
            return;
        }
        self.halve(some, &self.tree.nodes[node]);
        let (left, right) = some.split_at_mut(some.len() / 2);
        let (a, b) = (self.node(left), self.node(right));
        let first = self.tree.nodes.len();
        self.tree.nodes.extend([a, b]);
        self.tree.nodes[node].first = first as u32;
        self.tree.nodes[node].items = 0;
        self.split(first, left);
        self.split(first + 1, right);
    }

    /// Puts the half of some surfaces first that is less along whatever they differ most in, as a part of what they take up.
    fn halve(&self, some: &mut [Boxed], node: &Node) {
        let sheets = self.tree.class == Class::Sheets;
        let size: Vector = std::array::from_fn(|k| node.high[k] - node.low[k]);
        // How many lie over each other: of sheets seen from above.
        let axes = if sheets { 0..2 } else { 0..3 };
        let share = |b: &Boxed| axes.clone().map(|k| (b.high[k] - b.low[k]) / size[k]).product::<f64>();
        let piled = !(some.iter().map(share).sum::<f64>() <= PILED);
        let extent = |key: Key| {
            let bounds = (f64::INFINITY, f64::NEG_INFINITY);
            let (low, high) = some.iter().fold(bounds, |(low, high), boxed| {
                let x = key.of(self.item(boxed), boxed);
                (least(low, x), most(high, x))
            });
            // Nothing differs by less.
            if high - low > ALIKE_MM { high - low } else { 0.0 }
        };
        let mut best = (Key::Number, 0.0);
        let mut weigh = |key: Key, gain: f64| {
            if gain > best.1 {
                best = (key, gain);
            }
        };
        let first = self.item(&some[0]).frame;
        let mixed = some.iter().any(|b| self.item(b).frame != first && !self.item(b).round);
        if sheets || !piled {
            // How likely a point is in one half alone.
            let axes = if piled { 0..2 } else { 0..3 };
            for k in axes.filter(|k| size[*k].is_finite()) {
                weigh(Key::Low(k), extent(Key::Low(k)) / size[k]);
                weigh(Key::High(k), extent(Key::High(k)) / size[k]);
            }
        }
        if piled && sheets {
            // One half is deeper, unless normals differ more than places.
            let widest = 0.5 * most(most(size[0], size[1]), size[2]);
            let lever = if widest.is_finite() { widest } else { LEVER_MM };
            let places = extent(Key::Above);
            let turns = [0, 1, 2].map(|k| lever * extent(Key::Axis(k)));
            let all = places + most(most(turns[0], turns[1]), turns[2]);
            if all > 0.0 {
                weigh(Key::Above, places / all);
                (0..3).for_each(|k| weigh(Key::Axis(k), turns[k] / all));
            }
        } else if piled && mixed {
            let mut turns = vec![first];
            for boxed in some.iter() {
                let frame = self.item(boxed).frame;
                if turns.len() <= FEW_TURNS && !turns.contains(&frame) {
                    turns.push(frame);
                }
            }
            if turns.len() <= FEW_TURNS {
                weigh(Key::Frame, f64::INFINITY);
            }
            (0..3).for_each(|k| weigh(Key::Place(k), extent(Key::Place(k))));
            weigh(Key::Size, extent(Key::Size));
        } else if piled {
            (0..3).for_each(|k| weigh(Key::Low(k), extent(Key::Low(k))));
            (0..3).for_each(|k| weigh(Key::High(k), extent(Key::High(k))));
        }
        for boxed in some.iter_mut() {
            boxed.key = best.0.of(&self.items[boxed.item as usize], boxed);
        }
        // Items are in the order of their entries.
        let middle = some.len() / 2;
        some.select_nth_unstable_by(middle, |a, b| a.key.total_cmp(&b.key).then(a.item.cmp(&b.item)));
    }
}

/// What surfaces are sorted by.
#[derive(Clone, Copy)]
enum Key {
    Low(usize),
    High(usize),
    Place(usize),
    Above,
    /// A coordinate of the normal.
    Axis(usize),
    Frame,
    Size,
    Number,
}

impl Key {
    fn of(self, item: &Item, boxed: &Boxed) -> f64 {
        match self {
            Self::Low(k) => boxed.low[k],
            Self::High(k) => boxed.high[k],
            Self::Place(k) => boxed.place[k],
            Self::Above => boxed.above,
            Self::Axis(k) => item.axes[2][k],
            Self::Frame => f64::from(item.frame),
            Self::Size => item.widest,
            Self::Number => 0.0,
        }
    }
}
