//! Names of surfaces: on the surface where there is room, else beside it with a leader line.
//!
//! The placement is greedy. Names are placed one by one; each takes the first free place of a fixed list.

use std::collections::HashSet;

use super::outline::{Bounds, Point, bounds, left_of};
use crate::svg::{Svg, num, text_width};

/// Font size, height of one line, and distance of the next line.
const SIZE: f64 = 10.5;
const LINE: f64 = 14.0;
const NEXT: f64 = 12.0;
/// Distance of a name from the edges of its area, and from the path of the stylus.
const EDGE: f64 = 3.0;
const CLEAR: f64 = 2.0;
/// Most characters of a name or note, and of a name that is shortened.
const LONGEST: usize = 120;
const SHORT: usize = 40;
/// Most lines of a name.
const MOST_LINES: usize = 3;
/// Lengths of leader lines in pixels, and their directions.
const REACHES: [f64; 5] = [8.0, 18.0, 34.0, 56.0, 90.0];
const SIDES: [Point; 8] =
    [[1.0, 0.0], [0.7, -0.7], [0.7, 0.7], [-1.0, 0.0], [-0.7, -0.7], [-0.7, 0.7], [0.0, -1.0], [0.0, 1.0]];
const LEADER: &str = "stroke=\"#6b7f90\" stroke-width=\"0.8\" fill=\"none\"";

/// A name to be written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Name {
    pub(super) name: String,
    /// Written after the name where there is room.
    pub(super) note: String,
    /// The surface: convex, in pixels; a line where it is seen from the side.
    pub(super) area: Vec<Point>,
}

/// A name in its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Label {
    pub(super) lines: Vec<String>,
    pub(super) at: Bounds,
    /// Whether it reads from the bottom up.
    pub(super) upright: bool,
    /// From the text to its surface.
    pub(super) leader: Option<[Point; 2]>,
}

impl Label {
    pub(super) fn draw_leader(&self, svg: &mut Svg) {
        if let Some([from, to]) = self.leader {
            let [from, to] = [from, to].map(|[x, y]| format!("{} {}", num(x), num(y)));
            svg.path(&format!("M{from}L{to}"), LEADER);
        }
    }

    pub(super) fn draw(&self, svg: &mut Svg) {
        let [[left, top], [_, bottom]] = self.at;
        for (i, line) in self.lines.iter().enumerate() {
            let base = LINE - 4.0 + NEXT * i as f64;
            if self.upright {
                svg.upright_text([left + base, bottom - 1.0], "start", "wire", line);
            } else {
                svg.text([left + 1.0, top + base], "start", "wire", line);
            }
        }
    }
}

/// The cells of a 3-pixel grid that the path of the stylus and its lanes cover.
#[derive(Default)]
pub(super) struct Cover(HashSet<[i32; 2]>);

impl Cover {
    /// Edge of a cell in pixels.
    pub(super) const CELL: f64 = 3.0;

    /// Covers the cell of a point.
    pub(super) fn add(&mut self, p: Point) {
        self.0.insert(p.map(|v| (v / Self::CELL).floor() as i32));
    }

    /// Whether a covered cell shares something with the bounds.
    pub(super) fn meets(&self, [low, high]: Bounds) -> bool {
        let [x, y] =
            [0, 1].map(|k| (low[k] / Self::CELL).floor() as i32..(high[k] / Self::CELL).ceil() as i32);
        x.into_iter().any(|x| y.clone().any(|y| self.0.contains(&[x, y])))
    }
}

/// Places names within `frame`, off each other. Names also keep off the path and off smaller surfaces
/// where they can. Returns the labels and the number of names without room.
pub(super) fn place(names: &[Name], frame: Bounds, cover: &Cover) -> (Vec<Label>, usize) {
    let mut room = Room { names, frame, cover, labels: Vec::new() };
    let mut later = Vec::new();
    for of in 0..names.len() {
        match room.on_area(of, true) {
            Some(label) => room.labels.push(label),
            None => later.push(of),
        }
    }
    let mut left_out = 0;
    for of in later {
        let found = room
            .beside_area(of, true)
            .or_else(|| room.on_area(of, false))
            .or_else(|| room.beside_area(of, false));
        match found {
            Some(label) => room.labels.push(label),
            None => left_out += 1,
        }
    }
    (room.labels, left_out)
}

struct Room<'a> {
    names: &'a [Name],
    frame: Bounds,
    cover: &'a Cover,
    labels: Vec<Label>,
}

impl Room<'_> {
    /// The first free place on the area of a name: lying before upright, with its note before without.
    /// `clear` asks for one off the path and off smaller surfaces.
    fn on_area(&self, of: usize, clear: bool) -> Option<Label> {
        let name = &self.names[of];
        let [low, high] = bounds(name.area.iter().copied())?;
        for text in texts(name, LONGEST).into_iter().chain(texts(name, SHORT)) {
            for upright in [false, true] {
                let length = if upright { high[1] - low[1] } else { high[0] - low[0] } - 2.0 * EDGE;
                for part in [1.0, 0.6, 0.4] {
                    let Some(lines) = wrapped(&text, part * length) else { continue };
                    let size = size(&lines, upright);
                    let at = spots([low, high], size).into_iter().find(|at| {
                        corners(*at).iter().all(|p| holds(&name.area, *p))
                            && self.is_free(*at)
                            && (!clear || self.is_clear(*at, area_size(&name.area), of))
                    });
                    if let Some(at) = at {
                        return Some(Label { lines, at, upright, leader: None });
                    }
                }
            }
        }
        None
    }

    /// The first free place beside the area of a name, with a leader line.
    fn beside_area(&self, of: usize, clear: bool) -> Option<Label> {
        let name = &self.names[of];
        let count = name.area.len() as f64;
        let middle: Point = [0, 1].map(|k| name.area.iter().map(|p| p[k]).sum::<f64>() / count);
        let text = texts(name, SHORT).swap_remove(0);
        let whole = length(&text);
        for (reach, side) in REACHES.iter().flat_map(|reach| SIDES.map(|side| (*reach, side))) {
            let along = |p: &Point| p[0] * side[0] + p[1] * side[1];
            let anchor = *name.area.iter().max_by(|a, b| along(a).total_cmp(&along(b)))?;
            let tip: Point = [0, 1].map(|k| anchor[k] + reach * side[k]);
            for lines in [1.0, 0.6].into_iter().filter_map(|part| wrapped(&text, part * whole)) {
                let size = size(&lines, false);
                // The text begins at the tip and continues away from the area.
                let low: Point = [0, 1].map(|k| {
                    let sign = if side[k] == 0.0 { 0.0 } else { side[k].signum() };
                    tip[k] - size[k] * (0.5 - 0.5 * sign)
                });
                let at = [low, [low[0] + size[0], low[1] + size[1]]];
                let leader = [tip, toward(anchor, middle, EDGE)];
                if self.is_free(at)
                    && !self.labels.iter().any(|label| crosses(leader, label.at))
                    && (!clear || (self.is_clear(at, f64::INFINITY, of) && !holds(&name.area, centre(at))))
                {
                    return Some(Label { lines, at, upright: false, leader: Some(leader) });
                }
            }
        }
        None
    }

    /// Whether bounds lie within the frame, off the labels and their leaders.
    fn is_free(&self, at: Bounds) -> bool {
        let off =
            |label: &Label| !overlap(label.at, at) && !label.leader.is_some_and(|leader| crosses(leader, at));
        inside(at, self.frame) && self.labels.iter().all(off)
    }

    /// Whether bounds are off the path, and off the other areas that are smaller than `size`.
    fn is_clear(&self, at: Bounds, size: f64, of: usize) -> bool {
        let smaller = |name: &Name| area_size(&name.area) < 0.99 * size && holds(&name.area, centre(at));
        !self.cover.meets([at[0].map(|v| v - CLEAR), at[1].map(|v| v + CLEAR)])
            && !self.names.iter().enumerate().any(|(i, name)| i != of && smaller(name))
    }
}

/// Texts for a name of at most so many characters: with its note, then without.
fn texts(Name { name, note, .. }: &Name, most: usize) -> Vec<String> {
    let alone = shortened(name, most);
    if note.is_empty() || note == name {
        return vec![alone];
    }
    vec![format!("{alone} \u{b7} {}", shortened(note, LONGEST)), alone]
}

/// A text of at most so many characters; an ellipsis marks the cut.
fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let kept: String = text.chars().take(most.saturating_sub(1)).collect();
    kept.trim_end().to_owned() + "\u{2026}"
}

/// A text in lines that are no longer than `most` pixels. `None` where a word is longer, or where there
/// are too many lines.
fn wrapped(text: &str, most: f64) -> Option<Vec<String>> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            // A dot between name and note stays with the name.
            Some(last) if word == "\u{b7}" || length(&format!("{last} {word}")) <= most => {
                *last = format!("{last} {word}");
            }
            _ => lines.push(word.to_owned()),
        }
    }
    for line in &mut lines {
        line.truncate(line.trim_end_matches(" \u{b7}").len());
    }
    let fits = (1..=MOST_LINES).contains(&lines.len()) && lines.iter().all(|line| length(line) <= most);
    fits.then_some(lines)
}

/// Length of a line in pixels, on the large side.
fn length(line: &str) -> f64 {
    let wide = line.chars().filter(|c| *c >= '\u{1100}').count() as f64;
    1.05 * text_width(line, SIZE) + 0.5 * SIZE * wide + 2.0
}

/// Width and height of lines.
fn size(lines: &[String], upright: bool) -> [f64; 2] {
    let length = lines.iter().map(|line| length(line)).fold(0.0, f64::max);
    let height = LINE + NEXT * (lines.len() as f64 - 1.0);
    if upright { [height, length] } else { [length, height] }
}

/// Places for a text of this size within bounds, from the top left on.
fn spots([low, high]: Bounds, size: [f64; 2]) -> Vec<Bounds> {
    const STEPS: usize = 9;
    let room = [0, 1].map(|k| high[k] - low[k] - 2.0 * EDGE - size[k]);
    if room.iter().any(|r| *r < 0.0) {
        return Vec::new();
    }
    let at = |i: usize| {
        let part = [i % STEPS, i / STEPS].map(|n| n as f64 / (STEPS - 1) as f64);
        let corner: Point = [0, 1].map(|k| low[k] + EDGE + part[k] * room[k]);
        [corner, [corner[0] + size[0], corner[1] + size[1]]]
    };
    (0..STEPS * STEPS).map(at).collect()
}

fn corners([low, high]: Bounds) -> [Point; 4] {
    [low, [high[0], low[1]], high, [low[0], high[1]]]
}

fn centre([low, high]: Bounds) -> Point {
    [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])]
}

/// Whether a convex area holds a point.
fn holds(area: &[Point], p: Point) -> bool {
    let sides = || area.iter().zip(area.iter().cycle().skip(1)).map(|(a, b)| left_of(*a, *b, p));
    sides().all(|side| side >= 0.0) || sides().all(|side| side <= 0.0)
}

/// Size of a convex area in square pixels.
fn area_size(area: &[Point]) -> f64 {
    let origin = area.first().copied().unwrap_or_default();
    area.windows(2).map(|w| 0.5 * left_of(origin, w[0], w[1])).sum::<f64>().abs()
}

fn inside(a: Bounds, b: Bounds) -> bool {
    (0..2).all(|k| a[0][k] >= b[0][k] && a[1][k] <= b[1][k])
}

fn overlap(a: Bounds, b: Bounds) -> bool {
    (0..2).all(|k| a[0][k] < b[1][k] && b[0][k] < a[1][k])
}

/// Whether a short line passes through bounds.
fn crosses([from, to]: [Point; 2], at: Bounds) -> bool {
    let on = |i: i32| [0, 1].map(|k| from[k] + f64::from(i) / 16.0 * (to[k] - from[k]));
    (0..=16).map(on).any(|p| (0..2).all(|k| at[0][k] < p[k] && p[k] < at[1][k]))
}

/// The point `by` pixels from one point toward another, no further than that.
fn toward(from: Point, to: Point, by: f64) -> Point {
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    let part = if length > by { by / length } else { 1.0 };
    [0, 1].map(|k| from[k] + part * (to[k] - from[k]))
}

#[cfg(test)]
#[path = "names_tests.rs"]
mod tests;
