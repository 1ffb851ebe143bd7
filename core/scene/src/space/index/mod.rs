//! Which of many surfaces a point touches.

mod block;
mod build;
mod item;
mod tree;

use asperity_diagnostics::Diagnostic;

use super::surface::near;
use super::{Hold, Surface, Touch, WORLD_MM};
use block::Class;
use tree::{Best, Tree};

/// Most entries of an index.
pub const MOST_ENTRIES: usize = 1 << 20;

/// How deep a point is at least in what it touches, in millimetres: more than rounding, so that a stylus that lies in many planes at once touches none.
const TOUCHED_MM: f64 = 1e-6;

/// A surface of an index.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The surface.
    pub surface: Surface,
    /// How far outside it is felt, in millimetres; 0 for one that is felt by touch alone.
    pub reach_mm: f64,
}

/// What a point touches, or is near to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The entry's number.
    pub entry: u32,
    /// Where and how.
    pub touch: Touch,
}

impl Contact {
    /// What to keep for the next tick.
    pub fn hold(&self) -> Hold {
        Hold { entry: self.entry, feature: self.touch.feature }
    }
}

/// Surfaces by number, and a search among them that takes as long for many as for one.
#[derive(Clone, Debug)]
pub struct Index {
    entries: Vec<Entry>,
    hysteresis_mm: f64,
    /// Over all.
    touched: [Tree; 2],
    /// Over those that reach.
    reaching: [Tree; 2],
}

impl Index {
    /// An index over entries, whose numbers are their places in the list. Another surface takes over from the one that is held when it is deeper by more than
    /// `hysteresis_mm`, and another face of a box when it is nearer by more.
    ///
    /// # Errors
    /// More than [`MOST_ENTRIES`]; a reach or a hysteresis that is not from 0 to [`WORLD_MM`].
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

    /// By how much another must be deeper to take over, in millimetres.
    pub fn hysteresis_mm(&self) -> f64 {
        self.hysteresis_mm
    }

    /// Bytes of the search trees, without the entries.
    pub fn bytes(&self) -> usize {
        self.touched.iter().chain(&self.reaching).map(Tree::bytes).sum()
    }

    /// The surface that a point of the world touches: the one that was held while it is still touched and none is deeper by more than the hysteresis, else the
    /// deepest, else none.
    ///
    /// Depths are compared in steps of 1/8192 mm; of equal ones the lowest number wins. What is held comes from [`Contact::hold`] of the tick before; an entry
    /// that does not exist is as good as none. Nothing is allocated.
    pub fn deepest(&self, point_mm: [f64; 3], last: Option<Hold>) -> Option<Contact> {
        self.search::<false>(&self.touched, point_mm, last, TOUCHED_MM, |_| TOUCHED_MM)
    }

    /// Blocks and surfaces that [`deepest`](Self::deepest) looks at: what it costs, counted.
    #[cfg(test)]
    fn looks(&self, point_mm: [f64; 3], last: Option<Hold>) -> u32 {
        let mut best = self.best(point_mm, last, TOUCHED_MM, |_| TOUCHED_MM).1;
        let search = |tree: &Tree| tree.search::<false>(point_mm, &self.entries, &mut best, |_| TOUCHED_MM);
        self.touched.iter().for_each(search);
        best.looks
    }

    /// The same over entries with a reach, and as far as they reach: the deepest of those that are touched, else the nearest. One that is held and not
    /// touched gives way to any that is.
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

    /// What is held, if it is still felt, and what has to be found to take over from it.
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
            // What is merely near does not hold its place against what is touched.
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
