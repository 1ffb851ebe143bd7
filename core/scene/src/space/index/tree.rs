//! A tree over surfaces, and the search for the deepest of them.

use super::super::vector::{Vector, dot};
use super::Entry;
use super::block::{Block, Class, LANES, Lanes};

/// Steps per millimetre in which depths are compared. Depths of surfaces that coincide differ only by
/// rounding, and the numbers of their entries must decide.
const STEPS_PER_MM: f64 = 8192.0;

/// Ceilings that differ by less count as equal.
const NEARLY_MM: f64 = 1e-7;

/// Most levels of blocks: enough to halve 2^20 entries again and again.
pub(super) const MOST_LEVELS: usize = 10;

/// Most parts that wait to be looked at: three for each level, and four for the last.
const WAITING: usize = 3 * MOST_LEVELS + 1;

/// The deepest surface so far, and the depth that still beats it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Best {
    /// A depth from here on is equal. With a lower number it is better.
    level: f64,
    /// A depth from here on is deeper.
    above: f64,
    entry: u32,
    pub found: Option<u32>,
    /// Number of blocks and surfaces that were looked at.
    pub looks: u32,
}

impl Best {
    /// Starts without a surface. Anything at least this deep is better.
    pub(super) fn nothing(depth: f64) -> Self {
        Self { level: depth, above: depth, entry: 0, found: None, looks: 0 }
    }

    /// Starts with a held surface. Only a greater depth is better.
    pub(super) fn held(depth: f64) -> Self {
        let (_, above) = steps(depth);
        Self::nothing(above)
    }

    #[inline]
    fn admits(&self, depth: f64, entry: u32) -> bool {
        depth >= self.above || (depth >= self.level && entry < self.entry)
    }

    /// Takes a surface if it is better.
    #[inline]
    fn offer(&mut self, depth: f64, entry: u32) {
        if self.admits(depth, entry) {
            let (level, above) = steps(depth);
            *self = Self { level, above, entry, found: Some(entry), ..*self };
        }
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

/// A part that is still to be looked at.
#[derive(Clone, Copy, Default)]
struct Waits {
    ceiling: f64,
    block: u32,
    lane: u32,
}

/// A tree over surfaces of a class. The first block is the root.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub class: Class,
    pub frames: Vec<[Vector; 3]>,
    pub blocks: Vec<Block>,
    pub items: Vec<u32>,
}

/// A point, and the frame in which it was last needed.
struct Seen<'t> {
    tree: &'t Tree,
    point: Vector,
    frame: u32,
    turned: Vector,
}

impl Seen<'_> {
    #[inline]
    fn ceilings<const REACHING: bool>(&mut self, block: &Block) -> Lanes {
        if block.frame != self.frame
            && let Some(&[x, y, z]) = self.tree.frames.get(block.frame as usize)
        {
            self.frame = block.frame;
            self.turned = [dot(x, self.point), dot(y, self.point), dot(z, self.point)];
        }
        block.ceilings::<REACHING>(self.tree.class, self.turned)
    }
}

impl Tree {
    /// Improves the best by the surfaces of the tree. `felt` is the depth that an entry needs to be felt
    /// at all.
    pub(super) fn search<const REACHING: bool>(
        &self,
        point: Vector,
        entries: &[Entry],
        best: &mut Best,
        felt: impl Fn(&Entry) -> f64,
    ) {
        let Some(root) = self.blocks.first() else { return };
        let mut seen = Seen { tree: self, point, frame: u32::MAX, turned: point };
        let ceilings = seen.ceilings::<REACHING>(root);
        best.looks += 1;
        // Mostly the root is enough.
        if (0..LANES).any(|lane| best.admits(ceilings[lane], root.lowest[lane])) {
            self.descend::<REACHING>(seen, ceilings, entries, best, felt);
        }
    }

    #[inline(never)]
    fn descend<const REACHING: bool>(
        &self,
        mut seen: Seen<'_>,
        mut ceilings: Lanes,
        entries: &[Entry],
        best: &mut Best,
        felt: impl Fn(&Entry) -> f64,
    ) {
        let mut waiting = [Waits::default(); WAITING];
        let (mut count, mut number) = (0, 0);
        loop {
            let Some(block) = self.blocks.get(number as usize) else { return };
            let below = count;
            for (lane, (ceiling, lowest)) in ceilings.into_iter().zip(block.lowest).enumerate() {
                if count == WAITING || !best.admits(ceiling, lowest) {
                    continue;
                }
                // The highest ceiling comes first. Nearly equal ceilings come in the order of numbers.
                let mut place = count;
                count += 1;
                while place > below {
                    let before = waiting[place - 1];
                    let ahead = before.ceiling - ceiling;
                    let lower = block.lowest[before.lane as usize % LANES] < lowest;
                    if !(ahead > NEARLY_MM || (ahead >= -NEARLY_MM && lower)) {
                        break;
                    }
                    waiting[place] = before;
                    place -= 1;
                }
                waiting[place] = Waits { ceiling, block: number, lane: lane as u32 };
            }
            // Go to the next block.
            loop {
                if count == 0 {
                    return;
                }
                count -= 1;
                let Waits { ceiling, block, lane } = waiting[count];
                let Some(block) = self.blocks.get(block as usize) else { continue };
                let lane = lane as usize % LANES;
                if !best.admits(ceiling, block.lowest[lane]) {
                    continue;
                }
                let (first, items) = (block.first[lane], block.items[lane]);
                if items == 0 {
                    number = first;
                    break;
                }
                let range = first as usize..(first + items) as usize;
                for &number in self.items.get(range).unwrap_or_default() {
                    let Some(entry) = entries.get(number as usize) else { continue };
                    let depth = entry.surface.depth::<REACHING>(seen.point);
                    best.looks += 1;
                    if depth >= felt(entry) {
                        best.offer(depth, number);
                    }
                }
            }
            let Some(block) = self.blocks.get(number as usize) else { return };
            best.looks += 1;
            ceilings = seen.ceilings::<REACHING>(block);
        }
    }

    /// Size on the heap in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.frames.as_slice())
            + size_of_val(self.blocks.as_slice())
            + size_of_val(self.items.as_slice())
    }
}
