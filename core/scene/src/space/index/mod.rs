//! Finds which of many surfaces a point touches.

mod block;
mod build;
mod item;
mod tree;

use asperity_diagnostics::Diagnostic;

use super::surface::near;
use super::{Hold, Surface, Touch, WORLD_MM};
use block::Class;
use tree::{Best, Tree};

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
    /// Trees over all surfaces.
    touched: [Tree; 2],
    /// Trees over the surfaces with a reach.
    reaching: [Tree; 2],
}

impl Index {
    /// Makes an index over entries. The number of an entry is its place in the list. Another surface
    /// takes over from the held one if it is deeper by more than `hysteresis_mm`. Another face of a box
    /// takes over if it is nearer by more than that.
    ///
    /// # Errors
    /// There are more than [`MOST_ENTRIES`]. A reach or the hysteresis is not from 0 to [`WORLD_MM`].
    pub fn new(entries: Vec<Entry>, hysteresis_mm: f64) -> Result<Self, Diagnostic> {
        if entries.len() > MOST_ENTRIES {
            return Err(Diagnostic::new(format!("{} surfaces", entries.len()))
                .help(format!("at most {MOST_ENTRIES}")));
        }
        let range = 0.0..=WORLD_MM;
        if !range.contains(&hysteresis_mm) {
            return Err(Diagnostic::new(format!("a hysteresis of {hysteresis_mm} mm"))
                .help(format!("from 0 to {WORLD_MM} mm")));
        }
        if let Some((number, entry)) = entries.iter().enumerate().find(|(_, e)| !range.contains(&e.reach_mm))
        {
            return Err(Diagnostic::new(format!("surface {number} reaches {} mm", entry.reach_mm))
                .help(format!("from 0 to {WORLD_MM} mm")));
        }
        let classes = [Class::Sheets, Class::Solids];
        let touched = classes.map(|class| build::tree(class, &entries, false));
        let reaching = classes.map(|class| build::tree(class, &entries, true));
        Ok(Self { entries, hysteresis_mm, touched, reaching })
    }

    /// The entries.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Depth in millimetres by which another surface must exceed the held one to take over.
    pub fn hysteresis_mm(&self) -> f64 {
        self.hysteresis_mm
    }

    /// Size of the search trees in bytes, without the entries.
    pub fn bytes(&self) -> usize {
        self.touched.iter().chain(&self.reaching).map(Tree::bytes).sum()
    }

    /// Finds the surface that a point of the world touches. The held one stays while it is still touched
    /// and no other is deeper by more than the hysteresis. Else the answer is the deepest, or `None`.
    ///
    /// Depths are compared in steps of 1/8192 mm. Among equals the lowest number wins. `last` comes from
    /// [`Contact::hold`] of the tick before. An entry that does not exist counts as none. Nothing is
    /// allocated.
    pub fn deepest(&self, point_mm: [f64; 3], last: Option<Hold>) -> Option<Contact> {
        self.search::<false>(&self.touched, point_mm, last, TOUCHED_MM, |_| TOUCHED_MM)
    }

    /// Counts the blocks and surfaces that [`deepest`](Self::deepest) looks at, as a measure of its cost.
    #[cfg(test)]
    fn looks(&self, point_mm: [f64; 3], last: Option<Hold>) -> u32 {
        let mut best = self.best(point_mm, last, TOUCHED_MM, |_| TOUCHED_MM).1;
        let search = |tree: &Tree| tree.search::<false>(point_mm, &self.entries, &mut best, |_| TOUCHED_MM);
        self.touched.iter().for_each(search);
        best.looks
    }

    /// Finds the same over entries with a reach, as far as they reach: the deepest that is touched, else
    /// the nearest. A held surface that is not touched gives way to any that is.
    pub fn nearest(&self, point_mm: [f64; 3], last: Option<Hold>) -> Option<Contact> {
        self.search::<true>(&self.reaching, point_mm, last, f64::MIN, |e| {
            if e.reach_mm > 0.0 { -e.reach_mm } else { f64::INFINITY }
        })
    }

    fn search<const REACHING: bool>(
        &self,
        trees: &[Tree; 2],
        point: [f64; 3],
        last: Option<Hold>,
        least: f64,
        felt: impl Fn(&Entry) -> f64 + Copy,
    ) -> Option<Contact> {
        if !near(point) {
            return None;
        }
        let (held, mut best) = self.best(point, last, least, felt);
        trees.iter().for_each(|tree| tree.search::<REACHING>(point, &self.entries, &mut best, felt));
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
        felt: impl Fn(&Entry) -> f64,
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
#[path = "../index_tests.rs"]
mod tests;
