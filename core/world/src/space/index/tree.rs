//! A tree over surfaces, and the search for the deepest of them.

use super::super::vector::{Vector, dot, least, most, norm, sub};
use super::Entry;

/// By how much bounds are widened, in millimetres, for rounding.
pub(super) const SLACK_MM: f64 = 1e-9;

/// Steps in which depths are compared, to a millimetre: those of surfaces that coincide differ by rounding alone, and their entries' numbers are to decide.
const STEPS_PER_MM: f64 = 8192.0;

/// 1 / sqrt(3), a little less.
const ONE_OF_THREE: f64 = 0.577_350_26;

/// Ceilings that differ by less are the same.
const NEARLY_MM: f64 = 1e-7;

/// More than the levels of a tree of 2^32 entries.
const LEVELS: usize = 34;

/// Which surfaces a tree is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// Planes, rectangles, reliefs: as deep as a point lies below them.
    Sheets,
    /// Spheres and boxes: as deep as it is far to the nearest way out.
    Solids,
}

/// Some surfaces together. Places and directions are in the node's frame, a turned copy of the world's axes around the same middle.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Which frame.
    pub frame: u32,
    /// The lowest number of an entry.
    pub lowest: u32,
    /// The first of two children, which stand side by side; of a leaf the first item.
    pub first: u32,
    /// Items of a leaf; 0 for none.
    pub items: u32,
    /// Where the surfaces are touched.
    pub low: Vector,
    pub high: Vector,
    /// A box around their middles; of sheets one point.
    pub core: [Vector; 2],
    /// Sheets: how far any lies above that point along its own normal. Solids: radius of the largest ball around one of them.
    pub above: f64,
    /// Sheets: how far all lie above that point at least. Solids: half the longest edge of any.
    pub beyond: f64,
    /// Sheets: cosine and sine of the largest angle between a normal and the frame's z.
    pub spread: [f64; 2],
    /// No surface can be deeper.
    pub most: f64,
    /// How far off the surfaces are felt.
    pub reach: f64,
}

impl Node {
    /// No surface of this node is deeper at a point (in the node's frame); minus infinity where none is felt.
    ///
    /// Sheets, with normals `n` and points `c` of them, are as deep as `n . (c - p) = n . (c - m) + n . (m - p)`, or less, and with `n` at most an angle `b` from z, which is
    /// at an angle `a` to `m - p`, the latter is within `|m - p| cos(a - b)` and `|m - p| cos(a + b)`. One that lies deeper than it is thick is not felt. Solids are no deeper than it is to the nearest way out of what holds them: the node's box, or a ball around
    /// the middle. Neither is a box deeper than `max_k h_k - max_k |v_k|`, `h` its half edges and `v` from its middle to the point, however it is turned, and the greatest
    /// of three coordinates is at least `|v| / sqrt(3)`.
    #[inline]
    fn ceiling(&self, class: Class, point: Vector) -> f64 {
        let (mut exit, mut outside) = (f64::INFINITY, 0.0);
        for k in 0..3 {
            let within = least(point[k] - self.low[k], self.high[k] - point[k]);
            exit = least(exit, within);
            let over = least(within, 0.0);
            outside += over * over;
        }
        if outside > self.reach * self.reach {
            return f64::NEG_INFINITY;
        }
        let [low, high] = self.core;
        let bound = match class {
            Class::Sheets if self.spread[1] == 0.0 => self.above + low[2] - point[2],
            Class::Sheets => {
                let to = sub(low, point);
                let aside = (to[0] * to[0] + to[1] * to[1]).sqrt();
                let [cos, sin] = self.spread;
                let (along, across) = (cos * to[2], sin * aside);
                // The sines of a - b and a + b, times the distance: past 0 the angle between is 0, past 180 degrees it is that.
                let turned = (cos * aside - sin * to[2], cos * aside + sin * to[2]);
                let far = if turned.0 > 0.0 && turned.1 > 0.0 { 0.0 } else { norm(to) };
                let up = if turned.0 > 0.0 { along + across } else { far };
                let down = if turned.1 > 0.0 { along - across } else { -far };
                if self.beyond + down > self.most {
                    return f64::NEG_INFINITY;
                }
                self.above + up
            }
            Class::Solids => {
                let off = norm(std::array::from_fn(|k| most(most(low[k] - point[k], point[k] - high[k]), 0.0)));
                least(exit, least(self.above - off, self.beyond - ONE_OF_THREE * off))
            }
        };
        let bound = least(bound, self.most);
        if outside > 0.0 { least(bound, SLACK_MM - outside.sqrt()) } else { bound }
    }
}

/// The deepest so far, and what can still be deeper.
#[derive(Clone, Copy, Debug)]
pub(super) struct Best {
    /// What reaches this is as deep; with a lower number it is better.
    level: f64,
    /// What reaches this is deeper.
    above: f64,
    entry: u32,
    pub found: Option<u32>,
}

impl Best {
    /// Anything at least this deep is better.
    pub(super) fn nothing(deeper_than: f64) -> Self {
        Self { level: deeper_than, above: deeper_than, entry: 0, found: None }
    }

    /// What is held: only what is deeper than this is better.
    pub(super) fn held(depth: f64) -> Self {
        let (_, above) = steps(depth);
        Self { level: above, above, entry: 0, found: None }
    }

    #[inline]
    fn admits(&self, depth: f64, entry: u32) -> bool {
        depth >= self.above || (depth >= self.level && entry < self.entry)
    }

    /// Takes what is better.
    #[inline]
    pub(super) fn offer(&mut self, depth: f64, entry: u32) {
        if self.admits(depth, entry) {
            let (level, above) = steps(depth);
            *self = Self { level, above, entry, found: Some(entry) };
        }
    }
}

/// The step a depth is in: its lower end, and that of the next.
#[inline]
fn steps(depth: f64) -> (f64, f64) {
    let scaled = depth * STEPS_PER_MM;
    let near = scaled as i64;
    let whole = (near - i64::from(scaled < near as f64)) as f64;
    (whole / STEPS_PER_MM, (whole + 1.0) / STEPS_PER_MM)
}

/// A tree over surfaces of a class.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub class: Class,
    pub frames: Vec<[Vector; 3]>,
    pub nodes: Vec<Node>,
    pub items: Vec<u32>,
}

/// A point in the frame it was last asked for in.
struct Seen<'t> {
    tree: &'t Tree,
    point: Vector,
    frame: u32,
    turned: Vector,
}

impl Seen<'_> {
    #[inline]
    fn ceiling(&mut self, node: &Node) -> f64 {
        if node.frame != self.frame {
            let Some(&[x, y, z]) = self.tree.frames.get(node.frame as usize) else { return f64::NEG_INFINITY };
            self.frame = node.frame;
            self.turned = [dot(x, self.point), dot(y, self.point), dot(z, self.point)];
        }
        node.ceiling(self.tree.class, self.turned)
    }
}

impl Tree {
    /// Improves on the best by what the tree holds. `felt` is the depth that an entry needs to be felt at all.
    pub(super) fn search(
        &self,
        point: Vector,
        entries: &[Entry],
        best: &mut Best,
        felt: impl Fn(&Entry) -> f64,
    ) {
        let Some(mut node) = self.nodes.first() else { return };
        let mut seen = Seen { tree: self, point, frame: u32::MAX, turned: point };
        if !best.admits(seen.ceiling(node), node.lowest) {
            return;
        }
        let mut waiting: [(u32, f64); LEVELS] = [(0, 0.0); LEVELS];
        let mut count = 0;
        loop {
            let (first, items) = (node.first as usize, node.items as usize);
            let mut next = None;
            if items > 0 {
                for &number in self.items.get(first..first + items).unwrap_or_default() {
                    let Some(entry) = entries.get(number as usize) else { continue };
                    let depth = entry.surface.depth_mm(point);
                    if depth >= felt(entry) {
                        best.offer(depth, number);
                    }
                }
            } else if let Some([a, b]) = self.nodes.get(first..first + 2) {
                let (over_a, over_b) = (seen.ceiling(a), seen.ceiling(b));
                // What is all but as deep is looked at in the order of numbers.
                let ahead = over_b - over_a;
                let b_first = ahead > NEARLY_MM || (ahead >= -NEARLY_MM && b.lowest < a.lowest);
                let (one, other) = if b_first { ((b, over_b), (a, over_a)) } else { ((a, over_a), (b, over_b)) };
                if best.admits(one.1, one.0.lowest) {
                    next = Some(one.0);
                    if best.admits(other.1, other.0.lowest)
                        && let Some(place) = waiting.get_mut(count)
                    {
                        *place = (node.first + u32::from(!b_first), other.1);
                        count += 1;
                    }
                } else if best.admits(other.1, other.0.lowest) {
                    next = Some(other.0);
                }
            }
            while next.is_none() && count > 0 {
                count -= 1;
                if let Some(&(at, over)) = waiting.get(count) {
                    next = self.nodes.get(at as usize).filter(|n| best.admits(over, n.lowest));
                }
            }
            match next {
                Some(it) => node = it,
                None => return,
            }
        }
    }

    /// Bytes on the heap.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.frames.as_slice())
            + size_of_val(self.nodes.as_slice())
            + size_of_val(self.items.as_slice())
    }
}
