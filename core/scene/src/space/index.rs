//! Finds which of many surfaces a point touches.

use asperity_diagnostics::Diagnostic;

use super::surface::near;
use super::tree::{Best, Tree};
use super::{Hold, Surface, Touch, WORLD_MM};

/// Largest number of entries in an index.
pub const MOST_ENTRIES: usize = 1 << 20;

/// Least depth in millimetres at which a point touches. It is more than rounding, so that a stylus in
/// many planes at once touches none.
const TOUCHED_MM: f64 = 1e-6;

/// A surface of an index.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The surface.
    pub surface: Surface,
    /// Distance outside from which it is felt, in millimetres; 0 if it is felt by touch alone.
    pub reach_mm: f64,
}

/// Surface that a point touches, or is near to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Number of the entry.
    pub entry: u32,
    /// Place and direction of the touch.
    pub touch: Touch,
}

impl Contact {
    /// Memory for the next tick.
    pub fn hold(&self) -> Hold {
        Hold { entry: self.entry, feature: self.touch.feature }
    }
}

/// Surfaces by number, and a search among them that takes as long for many as for one.
#[derive(Clone, Debug)]
pub struct Index {
    entries: Vec<Entry>,
    hysteresis_mm: f64,
    /// All surfaces.
    touched: Tree,
    /// The surfaces with a reach.
    reaching: Tree,
}

impl Index {
    /// Makes an index over entries. The number of an entry is its place in the list. Another surface
    /// takes over from the held one if it is deeper by more than `hysteresis_mm`. Another face of a box
    /// takes over if it is nearer by more than that.
    ///
    /// # Errors
    /// There are more than [`MOST_ENTRIES`]. A reach or the hysteresis is not from 0 to [`WORLD_MM`].
    pub fn new(entries: Vec<Entry>, hysteresis_mm: f64) -> Result<Self, Diagnostic> {
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
        let (touched, reaching) = (Tree::new(&entries, false), Tree::new(&entries, true));
        Ok(Self { entries, hysteresis_mm, touched, reaching })
    }

    /// The entries.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Size of the search trees in bytes, without the entries.
    pub fn bytes(&self) -> usize {
        self.touched.bytes() + self.reaching.bytes()
    }

    /// Finds the surface that a point of the world touches. The held one stays while it is still touched
    /// and no other is deeper by more than the hysteresis. Else the answer is the deepest, or `None`.
    ///
    /// Depths are compared in steps of 1/8192 mm. Among equals the lowest number wins. `last` comes from
    /// [`Contact::hold`] of the tick before. An entry that does not exist counts as none. Nothing is
    /// allocated.
    pub fn deepest(&self, point_mm: [f64; 3], last: Option<Hold>) -> Option<Contact> {
        self.search(&self.touched, point_mm, last, TOUCHED_MM, |_| TOUCHED_MM)
    }

    /// Counts the nodes and surfaces that [`deepest`](Self::deepest) looks at, as a measure of its cost.
    #[cfg(test)]
    fn looks(&self, point_mm: [f64; 3], last: Option<Hold>) -> u32 {
        let mut best = self.best(point_mm, last, TOUCHED_MM, |_| TOUCHED_MM).1;
        self.touched.search(point_mm, &self.entries, &mut best, |_| TOUCHED_MM);
        best.looks
    }

    /// Finds the same over entries with a reach, as far as they reach: the deepest that is touched, else
    /// the nearest. A held surface that is not touched gives way to any that is.
    pub fn nearest(&self, point_mm: [f64; 3], last: Option<Hold>) -> Option<Contact> {
        self.search(&self.reaching, point_mm, last, f64::MIN, |e| {
            if e.reach_mm > 0.0 { -e.reach_mm } else { f64::INFINITY }
        })
    }

    fn search(
        &self,
        tree: &Tree,
        point: [f64; 3],
        last: Option<Hold>,
        least: f64,
        felt: fn(&Entry) -> f64,
    ) -> Option<Contact> {
        if !near(point) {
            return None;
        }
        let (held, mut best) = self.best(point, last, least, felt);
        tree.search(point, &self.entries, &mut best, felt);
        let Some(found) = best.found else { return held };
        let touch = self.entries.get(found as usize)?.surface.touch(point, None, self.hysteresis_mm)?;
        Some(Contact { entry: found, touch })
    }

    /// The held surface, if it is still felt, and the depth that another needs to take over.
    fn best(
        &self,
        point: [f64; 3],
        last: Option<Hold>,
        least: f64,
        felt: fn(&Entry) -> f64,
    ) -> (Option<Contact>, Best) {
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
            None => Best::nothing(least),
        };
        (held, best)
    }
}

#[cfg(test)]
#[path = "index_tests.rs"]
mod tests;
