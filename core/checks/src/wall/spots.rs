//! Where the walls of a graph are: what is found going down on them.

use super::Wall;
use crate::subject::Subject;

/// How far columns reach from the middle \[mm\].
const REACH_MM: f64 = 100.0;
/// Between which heights walls are looked for, and how finely \[mm\]: none is as thin.
const HEIGHTS_MM: (f64, f64, f64) = (40.0, -40.0, 1.6);

/// How finely walls of a graph are looked for \[mm\].
pub(crate) fn pitch_mm(subject: &Subject<'_>) -> f64 {
    subject.by_effort(20.0, 10.0, 5.0)
}

/// A place on a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spot {
    /// On the surface \[mm\].
    pub foot_mm: [f64; 3],
    /// The way out, of length 1.
    pub normal: [f64; 3],
    /// Stiffness that the wall tells \[N/mm\]; 0 where it does not.
    pub stiffness_n_per_mm: f64,
    /// Damping that it tells \[N s/m\].
    pub damping_ns_per_m: f64,
}

impl Spot {
    /// So far outside along the normal \[mm\]; below 0 in the wall.
    pub(crate) fn above(&self, x_mm: f64) -> [f64; 3] {
        std::array::from_fn(|k| self.foot_mm[k] + x_mm * self.normal[k])
    }

    /// The part of a force along the normal.
    pub(crate) fn along(&self, force: [f64; 3]) -> f64 {
        (0..3).map(|k| force[k] * self.normal[k]).sum()
    }

    /// Whether the wall tells the same stiffness and damping there.
    pub(crate) fn alike(&self, other: &Self) -> bool {
        (self.stiffness_n_per_mm, self.damping_ns_per_m) == (other.stiffness_n_per_mm, other.damping_ns_per_m)
    }

    /// Whether it is part of the same level surface.
    pub(crate) fn goes_on(&self, other: &Self) -> bool {
        let level = |s: &Self| s.normal[2] > 1.0 - 1e-9;
        self.alike(other) && level(self) && level(other) && (self.foot_mm[2] - other.foot_mm[2]).abs() < 1e-6
    }
}

/// What was found going down somewhere.
pub(crate) struct Column {
    /// Row and column.
    pub at: [usize; 2],
    /// x and y \[mm\].
    pub foot_mm: [f64; 2],
    /// What was met first, if anything was.
    pub spot: Option<Spot>,
}

impl Wall {
    /// What a stylus meets that goes down from above, in columns every `pitch_mm`; rows of as many columns as there are rows. They stand a little off
    /// round numbers, where surfaces often end.
    pub(crate) fn columns(&mut self, pitch_mm: f64) -> Vec<Column> {
        let half = (REACH_MM / pitch_mm) as usize;
        let place = |i: usize| (i as f64 - half as f64) * pitch_mm + 0.31 * pitch_mm;
        let rows = 0..=2 * half;
        let all = rows.clone().flat_map(|i| rows.clone().map(move |k| [i, k]));
        let column = |at: [usize; 2]| {
            let foot_mm = at.map(place);
            Column { at, foot_mm, spot: self.down(foot_mm) }
        };
        all.map(column).collect()
    }

    /// What is met going down there.
    pub(crate) fn down(&mut self, [x, y]: [f64; 2]) -> Option<Spot> {
        let (from, to, step) = HEIGHTS_MM;
        let steps = ((from - to) / step) as usize;
        let mut high = from;
        let touches = |it: &mut Self, z: f64| {
            (0..it.every).for_each(|_| _ = it.at([x, y, z]));
            it.touched_n() > 0.0
        };
        // What is touched from above already has no surface here.
        if touches(self, high) {
            return None;
        }
        for n in 1..=steps {
            let z = from - n as f64 * step;
            if !touches(self, z) {
                high = z;
                continue;
            }
            let mut low = z;
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if touches(self, middle) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            _ = touches(self, low);
            let normal = self.normal();
            let told = |it: &Self, output: Option<usize>| {
                output.map_or(0.0, |output| it.values::<1>(it.told.node, output)[0])
            };
            let (stiffness_n_per_mm, damping_ns_per_m) =
                (told(self, self.told.stiffness), told(self, self.told.damping));
            let foot_mm = [x, y, high];
            return Some(Spot { foot_mm, normal, stiffness_n_per_mm, damping_ns_per_m });
        }
        None
    }

    /// One spot of every wall that tells another stiffness or damping: that with the most of its like around it.
    pub(crate) fn walls(&mut self, pitch_mm: f64) -> Vec<Spot> {
        let columns = self.columns(pitch_mm);
        let near = |a: &Column, b: &Column| a.at.iter().zip(b.at).all(|(a, b)| a.abs_diff(b) <= 1);
        let mut all: Vec<(Spot, usize)> = Vec::new();
        for column in &columns {
            let Some(spot) = column.spot else { continue };
            let around =
                columns.iter().filter(|c| near(c, column) && c.spot.is_some_and(|s| s.goes_on(&spot)));
            let around = around.count();
            match all.iter_mut().find(|(known, _)| known.alike(&spot)) {
                Some(best) if best.1 < around => *best = (spot, around),
                Some(_) => {}
                None => all.push((spot, around)),
            }
        }
        all.into_iter().map(|(spot, _)| spot).collect()
    }
}
