//! Finds which of many surfaces a point touches.

use asperity_diagnostics::Diagnostic;

use super::surface::near;
use super::tree::{Best, Tree};
use super::{Hold, Surface, Touch, WORLD_MM};

/// Largest number of entries in an index.
const MOST_ENTRIES: usize = 1 << 20;

/// Least depth in millimetres at which a point touches. It is more than rounding, so that a stylus in
/// many planes at once touches none.
const TOUCHED_MM: f64 = 1e-6;

/// A surface of an index.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entry {
    pub(crate) surface: Surface,
    /// Distance outside from which it is felt, in millimetres; 0 if it is felt by touch alone.
    pub(crate) reach_mm: f64,
}

/// Surface that a point touches, or is near to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contact {
    /// Number of the entry: its place in the list.
    pub(crate) entry: u32,
    pub(crate) touch: Touch,
}

impl Contact {
    /// Memory for the next tick.
    pub(crate) fn hold(&self) -> Hold {
        Hold { entry: self.entry, feature: self.touch.feature }
    }
}

/// Surfaces by number, and a search among them that takes as long for many as for one.
#[derive(Clone, Debug)]
pub(crate) struct Index {
    entries: Vec<Entry>,
    hysteresis_mm: f64,
    tree: Tree,
    /// Least depth at which any of them is felt.
    least_mm: f64,
}

/// Depth from which on a surface is felt.
pub(super) fn felt(entry: &Entry) -> f64 {
    if entry.reach_mm > 0.0 { -entry.reach_mm } else { TOUCHED_MM }
}

impl Index {
    /// Makes an index over entries. Another surface takes over from the held one if it is deeper by more than
    /// `hysteresis_mm`, and another face of a box if it is nearer by more than that.
    pub(crate) fn new(entries: Vec<Entry>, hysteresis_mm: f64) -> Result<Self, Diagnostic> {
        let refused = |what: String, most: String| Err(Diagnostic::new(what).help(most));
        if entries.len() > MOST_ENTRIES {
            return refused(format!("{} surfaces", entries.len()), format!("at most {MOST_ENTRIES}"));
        }
        let (range, world) = (0.0..=WORLD_MM, format!("from 0 to {WORLD_MM} mm"));
        if !range.contains(&hysteresis_mm) {
            return refused(format!("a hysteresis of {hysteresis_mm} mm"), world);
        }
        let mut reaches = entries.iter().map(|entry| entry.reach_mm).enumerate();
        if let Some((number, reach)) = reaches.find(|(_, reach)| !range.contains(reach)) {
            return refused(format!("surface {number} reaches {reach} mm"), world);
        }
        let least_mm = if entries.iter().any(|entry| entry.reach_mm > 0.0) { f64::MIN } else { TOUCHED_MM };
        Ok(Self { tree: Tree::new(&entries), entries, hysteresis_mm, least_mm })
    }

    pub(crate) fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Size of the search tree in bytes, without the entries.
    pub(crate) fn bytes(&self) -> usize {
        self.tree.bytes()
    }

    /// Finds the surface that a point of the world touches, or is within reach of: the deepest, else the
    /// nearest. The held one stays while it is still felt and no other is deeper by more than the hysteresis;
    /// one that is not touched gives way to any that is.
    ///
    /// Depths are compared in steps of 1/8192 mm. Among equals the lowest number wins. `last` comes from
    /// [`Contact::hold`] of the tick before. An entry that does not exist counts as none. Nothing is
    /// allocated.
    pub(crate) fn find(&self, point: [f64; 3], last: Option<Hold>) -> Option<Contact> {
        if !near(point) {
            return None;
        }
        let (held, mut best) = self.best(point, last);
        self.tree.search(point, &self.entries, &mut best);
        let Some(found) = best.found else { return held };
        let touch = self.entries.get(found as usize)?.surface.touch(point, None, self.hysteresis_mm)?;
        Some(Contact { entry: found, touch })
    }

    /// Counts the nodes and surfaces that [`find`](Self::find) looks at, as a measure of its cost.
    #[cfg(test)]
    fn looks(&self, point_mm: [f64; 3], last: Option<Hold>) -> u32 {
        let mut best = self.best(point_mm, last).1;
        self.tree.search(point_mm, &self.entries, &mut best);
        best.looks
    }

    /// The held surface, if it is still felt, and the depth that another needs to take over.
    fn best(&self, point: [f64; 3], last: Option<Hold>) -> (Option<Contact>, Best) {
        let held = last.and_then(|hold| {
            let entry = self.entries.get(hold.entry as usize)?;
            let touch = entry.surface.touch(point, Some(hold.feature), self.hysteresis_mm)?;
            (touch.depth_mm >= felt(entry)).then_some(Contact { entry: hold.entry, touch })
        });
        let best = match &held {
            // A surface that is merely near does not hold its place against a touched one.
            Some(held) if held.touch.depth_mm < 0.0 => {
                Best::held((held.touch.depth_mm + self.hysteresis_mm).min(0.0))
            }
            Some(held) => Best::held(held.touch.depth_mm + self.hysteresis_mm),
            None => Best::nothing(self.least_mm),
        };
        (held, best)
    }
}

#[cfg(test)]
#[path = "index_tests.rs"]
mod tests;
