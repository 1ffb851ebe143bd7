//! Names on areas, where there is room.

use super::outline::{Bounds, Point, bounds, left_of};
use crate::svg::{Svg, escape, num, text_width};

/// Size of the letters, and the height of a line.
const SIZE: f64 = 10.5;
const LINE: f64 = 14.0;
/// From the edges of the area.
const EDGE: f64 = 3.0;
/// What is nearer to the way than this has lanes over it.
const LANES: f64 = 12.0;

/// What may be written on an area.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Name {
    pub(super) name: String,
    pub(super) note: String,
    /// Convex, in pixels.
    pub(super) area: Vec<Point>,
}

/// A text in its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Written {
    text: String,
    /// What it covers.
    at: Bounds,
    /// From below upward.
    upright: bool,
}

impl Written {
    #[cfg(test)]
    pub(super) fn covers(&self) -> Bounds {
        self.at
    }

    /// Writes it.
    pub(super) fn draw(&self, svg: &mut Svg) {
        let [[left, _], [right, bottom]] = self.at;
        if self.upright {
            svg.raw(format_args!(
                "<text transform=\"translate({} {})rotate(-90)\" class=\"wire\">{}</text>\n",
                num(right - 4.0),
                num(bottom - 1.0),
                escape(&self.text)
            ));
        } else {
            svg.text([left + 1.0, bottom - 4.0], "start", "wire", &self.text);
        }
    }
}

/// The names that there is room for within `frame`, each on its area, off the others, and off the way where that can be.
pub(super) fn place(names: &[Name], frame: Bounds, way: &[Point]) -> Vec<Written> {
    let mut written: Vec<Written> = Vec::new();
    for name in names {
        let both = format!("{} \u{b7} {}", name.name, name.note);
        let texts = [both.as_str(), name.name.as_str()];
        let texts = if name.note.is_empty() || name.note == name.name { &texts[1..] } else { &texts[..] };
        let found =
            texts.iter().flat_map(|text| [(text, false), (text, true)]).find_map(|(text, upright)| {
                let length = text_width(text, SIZE) + 2.0;
                let size = if upright { [LINE, length] } else { [length, LINE] };
                let free = spots(&name.area, size)
                    .filter(|at| inside(*at, frame) && corners(*at).iter().all(|p| holds(&name.area, *p)))
                    .filter(|at| written.iter().all(|w| !overlap(w.at, *at)));
                let crossed = |[low, high]: &Bounds| {
                    let near =
                        |p: &&Point| (0..2).all(|k| (low[k] - LANES..=high[k] + LANES).contains(&p[k]));
                    way.iter().filter(near).count()
                };
                let at = free.min_by_key(crossed)?;
                Some(Written { text: (*text).to_owned(), at, upright })
            });
        written.extend(found);
    }
    written
}

/// Places of a text of this size within an area's bounds: from the top left.
fn spots(area: &[Point], size: [f64; 2]) -> impl Iterator<Item = Bounds> {
    const STEPS: usize = 5;
    let free = bounds(area.iter().copied()).and_then(|[low, high]| {
        let low = low.map(|v| v + EDGE);
        let room: [f64; 2] = std::array::from_fn(|k| high[k] - EDGE - low[k] - size[k]);
        (room[0] >= 0.0 && room[1] >= 0.0).then_some((low, room))
    });
    let at = move |low: Point, room: [f64; 2], i: usize| {
        let part = [i % STEPS, i / STEPS].map(|n| n as f64 / (STEPS - 1) as f64);
        let corner: Point = std::array::from_fn(|k| low[k] + part[k] * room[k]);
        [corner, [corner[0] + size[0], corner[1] + size[1]]]
    };
    free.into_iter().flat_map(move |(low, room)| (0..STEPS * STEPS).map(move |i| at(low, room, i)))
}

fn corners([low, high]: Bounds) -> [Point; 4] {
    [low, [high[0], low[1]], high, [low[0], high[1]]]
}

/// Whether a convex area holds a point.
fn holds(area: &[Point], p: Point) -> bool {
    let edges = || area.iter().zip(area.iter().cycle().skip(1)).map(|(a, b)| left_of(*a, *b, p));
    edges().all(|side| side >= 0.0) || edges().all(|side| side <= 0.0)
}

fn inside(a: Bounds, b: Bounds) -> bool {
    (0..2).all(|k| a[0][k] >= b[0][k] && a[1][k] <= b[1][k])
}

fn overlap(a: Bounds, b: Bounds) -> bool {
    (0..2).all(|k| a[0][k] < b[1][k] && b[0][k] < a[1][k])
}
