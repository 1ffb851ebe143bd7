//! Builds a tree by halving again and again, by the key in which surfaces differ most. Surfaces that lie
//! apart from the rest are parted from it.

use std::collections::HashMap;

use super::super::shape::Form;
use super::super::vector::{Vector, dot, least, most, norm, sub};
use super::Entry;
use super::block::{Block, Class, LANES, Part, SLACK_MM};
use super::item::{Boxed, Item, Key};
use super::tree::{MOST_LEVELS, Tree};

/// Largest number of surfaces in a leaf.
const LEAF: usize = 4;
/// Number of overlapping surfaces from which they are parted by depth.
const PILED: f64 = 4.0;
/// Assumed distance of a point from planes when turns are weighed against places, in millimetres.
const LEVER_MM: f64 = 50.0;
/// Largest number of different turns for which boxes are parted by turn.
const FEW_TURNS: usize = 8;
/// Smallest difference that counts, in millimetres.
const ALIKE_MM: f64 = 1e-6;
/// Number of places at which a cut better than halving is looked for.
const BINS: usize = 16;
/// Such a cut is taken if its cost is below this part of the cost of halving.
const BETTER: f64 = 0.7;

/// Builds a tree over all surfaces of a class, or over those with a reach.
pub(super) fn tree(class: Class, entries: &[Entry], reaching: bool) -> Tree {
    let mut chosen: Vec<(usize, &Entry)> = Vec::new();
    // Of surfaces that are touched alike, the one with the lowest number always wins, unless another
    // reaches further.
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
            chosen.push((number, entry));
        }
    }
    let part = 1.0 / chosen.len() as f64;
    let middle = chosen.iter().fold([0.0; 3], |sum: Vector, (_, entry)| {
        let place = entry.surface.pose.place_mm();
        std::array::from_fn(|k| sum[k] + part * place[k])
    });
    let mut known: HashMap<[u64; 9], u32> = HashMap::new();
    let (mut items, mut frames) = (Vec::with_capacity(chosen.len()), Vec::new());
    for (number, entry) in chosen {
        let mut item = Item::new(number, entry, middle);
        if !reaching {
            item.reach = 0.0;
        }
        let mut bits = [0; 9];
        bits.iter_mut().zip(item.axes.iter().flatten()).for_each(|(to, x)| *to = x.to_bits());
        item.frame = *known.entry(bits).or_insert_with(|| {
            frames.push(item.axes);
            frames.len() as u32 - 1
        });
        items.push(item);
    }
    let mut some: Vec<Boxed> =
        (0..items.len() as u32).map(|item| Boxed { item, ..Boxed::default() }).collect();
    let tree = Tree { class, frames, blocks: Vec::new(), items: Vec::with_capacity(items.len()) };
    let mut builder = Builder { tree, items };
    if !some.is_empty() {
        builder.block(&mut some, None, 0);
    }
    builder.tree.blocks.shrink_to_fit();
    builder.tree
}

/// Levels of blocks over this many surfaces that are halved again and again.
fn levels(count: usize) -> usize {
    let leaves = count.div_ceil(LEAF);
    1 + (0..).take_while(|level| LANES.pow(*level) < leaves).count()
}

/// Number of surfaces before a cut by their keys that is better than halving. The cut minimises the sum,
/// over both parts, of volume times number of surfaces. This is the cost after MacDonald and Booth 1990,
/// "Heuristics for ray tracing using space subdivision": a part is looked into if the point is in it.
fn apart(some: &[Boxed]) -> Option<usize> {
    let bounds = (f64::INFINITY, f64::NEG_INFINITY);
    let (first, last) = some.iter().fold(bounds, |(a, b), boxed| (least(a, boxed.key), most(b, boxed.key)));
    let per_bin = BINS as f64 / (last - first);
    if !per_bin.is_finite() {
        return None;
    }
    let mut bins = [Extent::NONE; BINS];
    for boxed in some {
        bins[(((boxed.key - first) * per_bin) as usize).min(BINS - 1)].add(&boxed.low, &boxed.high, 1);
    }
    let mut behind = [Extent::NONE; BINS + 1];
    for i in (0..BINS).rev() {
        behind[i] = behind[i + 1];
        behind[i].add(&bins[i].low, &bins[i].high, bins[i].count);
    }
    let mut before = Extent::NONE;
    // The cut nearest to the half stands for halving.
    let (mut best, mut halves) = ((f64::INFINITY, 0), (usize::MAX, f64::INFINITY));
    for (bin, behind) in bins.iter().zip(&behind[1..]) {
        before.add(&bin.low, &bin.high, bin.count);
        if before.count == 0 || behind.count == 0 {
            continue;
        }
        let cost = before.cost() + behind.cost();
        if cost < best.0 {
            best = (cost, before.count);
        }
        let off = before.count.abs_diff(some.len() / 2);
        if off < halves.0 {
            halves = (off, cost);
        }
    }
    // If almost all surfaces are in one bin, that cut does not stand for halving.
    let even = if halves.0 > some.len() / 4 { behind[0].cost() } else { halves.1 };
    (best.0 < BETTER * even).then_some(best.1)
}

/// Extent and number of some surfaces.
#[derive(Clone, Copy)]
struct Extent {
    low: Vector,
    high: Vector,
    count: usize,
}

impl Extent {
    const NONE: Self = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3], count: 0 };

    fn add(&mut self, low: &Vector, high: &Vector, count: usize) {
        for k in 0..3 {
            self.low[k] = least(self.low[k], low[k]);
            self.high[k] = most(self.high[k], high[k]);
        }
        self.count += count;
    }

    /// Volume times count. A sheet has no thickness, but counts as having volume.
    fn cost(&self) -> f64 {
        let volume: f64 = (0..3).map(|k| self.high[k] - self.low[k] + ALIKE_MM).product();
        volume * self.count as f64
    }
}

/// A tree under construction. Functions that take surfaces take at least one.
struct Builder {
    tree: Tree,
    items: Vec<Item>,
}

impl Builder {
    fn item(&self, boxed: &Boxed) -> &Item {
        &self.items[boxed.item as usize]
    }

    fn sheets(&self) -> bool {
        self.tree.class == Class::Sheets
    }

    /// Frame of all surfaces, if they share one.
    fn common(&self, some: &[Boxed]) -> Option<u32> {
        let first = self.item(&some[0]).frame;
        some.iter().all(|b| self.item(b).frame == first).then_some(first)
    }

    /// Frame most like all others. For sheets it is the frame whose normal is nearest to the mean.
    fn frame(&self, some: &[Boxed]) -> u32 {
        let first = self.item(&some[0]);
        if !self.sheets() || self.common(some).is_some() {
            return first.frame;
        }
        let mean = some.iter().fold([0.0; 3], |sum: Vector, b| {
            let normal = self.item(b).axes[2];
            std::array::from_fn(|k| sum[k] + normal[k])
        });
        let toward = |item: &Item| dot(item.axes[2], mean);
        let nearest = some.iter().map(|b| self.item(b)).max_by(|a, b| toward(a).total_cmp(&toward(b)));
        nearest.unwrap_or(first).frame
    }

    /// Bounds of some surfaces in a frame. They are also noted for each surface.
    fn part(&self, some: &mut [Boxed], number: u32) -> Part {
        let frame = &self.tree.frames[number as usize];
        let mut part = Part { items: some.len() as u32, ..Part::empty() };
        for boxed in some.iter_mut() {
            let item = &self.items[boxed.item as usize];
            boxed.place = frame.map(|axis| dot(axis, item.place));
            [boxed.low, boxed.high] = item.bounds(frame, boxed.place, item.frame == number);
            for k in 0..3 {
                part.low[k] = least(part.low[k], boxed.low[k]);
                part.high[k] = most(part.high[k], boxed.high[k]);
                part.core[k] = least(part.core[k], boxed.place[k]);
                part.other[k] = most(part.other[k], boxed.place[k]);
            }
            part.lowest = part.lowest.min(item.entry);
            part.most = most(part.most, item.most);
            part.reach = most(part.reach, item.reach);
            part.above = most(part.above, item.ball);
            part.beyond = most(part.beyond, item.widest);
        }
        if self.sheets() {
            self.lie(some, number, &mut part);
        }
        part.low = part.low.map(|x| x - SLACK_MM);
        part.high = part.high.map(|x| x + SLACK_MM);
        part.above += SLACK_MM;
        part.beyond += if self.sheets() { -SLACK_MM } else { SLACK_MM };
        part.most += SLACK_MM;
        part
    }

    /// Notes how sheets lie: their heights above their midst, each along its own normal, and how normals
    /// differ.
    fn lie(&self, some: &mut [Boxed], number: u32, part: &mut Part) {
        let frame = &self.tree.frames[number as usize];
        let normal = |of: u32| match of == number {
            true => [0.0, 0.0, 1.0],
            false => frame.map(|axis| dot(axis, self.tree.frames[of as usize][2])),
        };
        let middle = std::array::from_fn(|k| 0.5 * (part.core[k] + part.other[k]));
        let direction = self.frame(some);
        (part.core, part.other) = (middle, normal(direction));
        (part.above, part.beyond) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut chord = 0.0;
        for boxed in some.iter_mut() {
            let item = &self.items[boxed.item as usize];
            let own = normal(item.frame);
            if item.frame != direction {
                chord = most(chord, norm(sub(own, part.other)));
            }
            boxed.above = dot(own, sub(boxed.place, middle));
            let [low, high] = item.top;
            part.above = most(part.above, boxed.above + high);
            part.beyond = least(part.beyond, boxed.above + low);
        }
        if chord > 0.0 {
            // Twice the sine of half the angle.
            let half = least(0.5 * chord + 1e-12, 1.0);
            part.spread = [1.0 - 2.0 * half * half, 2.0 * half * (1.0 - half * half).sqrt()];
        }
    }

    /// Adds the block of some surfaces, then the blocks into which it is split. Surfaces that are turned
    /// alike get their own frame. Others get the frame of the block before.
    fn block(&mut self, some: &mut [Boxed], before: Option<u32>, level: usize) -> u32 {
        let common = self.common(some);
        let frame = common.or(before).unwrap_or_else(|| self.frame(some));
        let mut ends = [some.len(); LANES];
        if some.len() > LEAF {
            let even = level + 1 + levels(some.len()) > MOST_LEVELS;
            let middle = self.cut(some, even);
            let (left, right) = some.split_at_mut(middle);
            ends = [self.cut(left, even), middle, middle + self.cut(right, even), some.len()];
        }
        let mut parts: [Part; LANES] = std::array::from_fn(|_| Part::empty());
        let mut begin = 0;
        for (part, end) in parts.iter_mut().zip(ends) {
            if begin < end {
                *part = self.part(&mut some[begin..end], frame);
            }
            begin = end;
        }
        let number = self.tree.blocks.len();
        self.tree.blocks.push(Block::new(frame, common.is_some(), &parts));
        let mut begin = 0;
        for (lane, end) in ends.into_iter().enumerate() {
            let some = &mut some[begin..end];
            begin = end;
            self.tree.blocks[number].first[lane] = if some.len() > LEAF {
                self.tree.blocks[number].items[lane] = 0;
                self.block(some, Some(frame), level + 1)
            } else {
                let first = self.tree.items.len() as u32;
                let numbers = some.iter().map(|b| self.items[b.item as usize].entry);
                self.tree.items.extend(numbers);
                first
            };
        }
        number as u32
    }

    /// Sorts surfaces around a cut, by the key in which they differ most, and answers where the second
    /// part begins. Few surfaces are not cut. The cut is at the half. Unless it has to be `even`, it may
    /// be where a point is more likely in at most one part.
    fn cut(&self, some: &mut [Boxed], even: bool) -> usize {
        if some.len() <= LEAF {
            return some.len();
        }
        let key = self.key(some);
        for boxed in some.iter_mut() {
            boxed.key = key.of(&self.items[boxed.item as usize], boxed);
        }
        let by_place = matches!(key, Key::Low(_) | Key::High(_) | Key::Place(_));
        let place = if by_place && !even { apart(some) } else { None };
        let place = place.unwrap_or(some.len().div_ceil(2));
        // Items are in the order of their entries.
        some.select_nth_unstable_by(place, |a, b| a.key.total_cmp(&b.key).then(a.item.cmp(&b.item)));
        place
    }

    /// Key that tells some surfaces apart best.
    ///
    /// Surfaces side by side are parted by place. The larger their spread is as a part of their extent,
    /// the more likely a point is in one half alone. If many surfaces lie over each other, a point is in
    /// both halves. One half is then left out if the other is deeper.
    ///
    /// Sheets over each other are parted by height or, if normals differ, by normal, whichever moves
    /// depths by more. Solids are parted by their extents. If solids are turned in many ways, they are
    /// parted by their middles, since an extent says little then.
    fn key(&self, some: &mut [Boxed]) -> Key {
        let part = self.part(some, self.frame(some));
        let some = &*some;
        let size: Vector = std::array::from_fn(|k| part.high[k] - part.low[k]);
        let spread = |key: Key| {
            let bounds = (f64::INFINITY, f64::NEG_INFINITY);
            let (low, high) = some.iter().fold(bounds, |(low, high), boxed| {
                let x = key.of(self.item(boxed), boxed);
                (least(low, x), most(high, x))
            });
            if high - low > ALIKE_MM { high - low } else { 0.0 }
        };
        let mut best = (Key::Number, 0.0);
        let mut weigh = |key: Key, weight: f64| {
            if weight > best.1 {
                best = (key, weight);
            }
        };
        // Sheets overlap as seen from above. For endless sheets the number of overlaps is not a number.
        let axes = if self.sheets() { 0..2 } else { 0..3 };
        let share = |b: &Boxed| axes.clone().map(|k| (b.high[k] - b.low[k]) / size[k]).product::<f64>();
        let over: f64 = some.iter().map(share).sum();
        let piled = over.is_nan() || over > PILED;
        if !piled || self.sheets() {
            for k in if piled { axes } else { 0..3 }.filter(|k| size[*k].is_finite()) {
                weigh(Key::Low(k), spread(Key::Low(k)) / size[k]);
                weigh(Key::High(k), spread(Key::High(k)) / size[k]);
            }
        }
        if piled && self.sheets() {
            let widest = 0.5 * most(most(size[0], size[1]), size[2]);
            let lever = if widest.is_finite() { widest } else { LEVER_MM };
            let heights = spread(Key::Above);
            let normals = [0, 1, 2].map(|k| lever * spread(Key::Normal(k)));
            let all = heights + most(most(normals[0], normals[1]), normals[2]);
            if all > 0.0 {
                weigh(Key::Above, heights / all);
                (0..3).for_each(|k| weigh(Key::Normal(k), normals[k] / all));
            }
        } else if piled && self.common(some).is_some() {
            (0..3).for_each(|k| weigh(Key::Low(k), spread(Key::Low(k))));
            (0..3).for_each(|k| weigh(Key::High(k), spread(Key::High(k))));
        } else if piled {
            let mut turns = Vec::with_capacity(FEW_TURNS + 1);
            for boxed in some {
                let frame = self.item(boxed).frame;
                if turns.len() <= FEW_TURNS && !turns.contains(&frame) {
                    turns.push(frame);
                }
            }
            if turns.len() <= FEW_TURNS {
                return Key::Turn;
            }
            (0..3).for_each(|k| weigh(Key::Place(k), spread(Key::Place(k))));
            weigh(Key::Size, spread(Key::Size));
        }
        best.0
    }
}
