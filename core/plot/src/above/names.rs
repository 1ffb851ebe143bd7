//! Names on areas, where there is room, or else beside them.

use super::cover::Cover;
use super::outline::{Bounds, Point, bounds, left_of};
use crate::svg::{Svg, escape, num, text_width};

/// Size of the letters, the height of a line, and how far the next is below.
const SIZE: f64 = 10.5;
const LINE: f64 = 14.0;
const NEXT: f64 = 12.0;
/// From the edges of the area, and from the way.
const EDGE: f64 = 3.0;
const CLEAR: f64 = 2.0;
/// Characters of a name and of a note at most, and where that is too long.
const LONGEST: usize = 120;
const SHORT: usize = 40;
/// What it costs, where a cell that the way covers costs 1: to cut the name, to leave the note out, to stand beside the area and for each
/// pixel away from it, and to be where another area is or the edge of its own.
const CUT: f64 = 2.0;
const NO_NOTE: f64 = 5.0;
const BESIDE: f64 = 8.0;
const AWAY: f64 = 0.25;
const ELSEWHERE: f64 = 3.0;
/// How far a text beside an area is from it, in pixels.
const REACHES: [f64; 5] = [8.0, 18.0, 34.0, 56.0, 90.0];
const POINTER: &str = "stroke=\"#6b7f90\" stroke-width=\"0.8\" fill=\"none\"";

/// What may be written on an area.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Name {
    pub(super) name: String,
    pub(super) note: String,
    /// Convex, in pixels; on one line where it is seen from the side.
    pub(super) area: Vec<Point>,
}

/// A text in its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Written {
    pub(super) lines: Vec<String>,
    /// What it covers.
    pub(super) at: Bounds,
    /// From below upward.
    pub(super) upright: bool,
    /// From a text beside its area into the area.
    pub(super) pointer: Option<[Point; 2]>,
}

impl Written {
    /// Draws what points from it.
    pub(super) fn point(&self, svg: &mut Svg) {
        if let Some([from, to]) = self.pointer {
            let [from, to] = [from, to].map(|[x, y]| format!("{} {}", num(x), num(y)));
            svg.path(&format!("M{from}L{to}"), POINTER);
        }
    }

    /// Writes it.
    pub(super) fn draw(&self, svg: &mut Svg) {
        let [[left, top], [_, bottom]] = self.at;
        for (i, line) in self.lines.iter().enumerate() {
            let base = LINE - 4.0 + NEXT * i as f64;
            if self.upright {
                svg.raw(format_args!(
                    "<text transform=\"translate({} {})rotate(-90)\" class=\"wire\">{}</text>\n",
                    num(left + base),
                    num(bottom - 1.0),
                    escape(line)
                ));
            } else {
                svg.text([left + 1.0, top + base], "start", "wire", line);
            }
        }
    }
}

/// A text in lines.
struct Block {
    lines: Vec<String>,
    upright: bool,
    size: [f64; 2],
}

impl Block {
    fn of(lines: Vec<String>, upright: bool) -> Self {
        let length = lines.iter().map(|line| length(line)).fold(0.0, f64::max);
        let height = LINE + NEXT * (lines.len() as f64 - 1.0);
        Self { lines, upright, size: if upright { [height, length] } else { [length, height] } }
    }

    /// A text in up to three lines, lying and standing; the first is read most easily.
    fn all(text: &str) -> Vec<Self> {
        let order = [(1, false), (2, false), (1, true), (3, false), (2, true), (3, true)];
        order
            .into_iter()
            .filter_map(|(count, upright)| Some(Self::of(wrapped(text, count)?, upright)))
            .collect()
    }
}

/// How long a line is in pixels, rather more than less.
fn length(line: &str) -> f64 {
    let wide = line.chars().filter(|c| *c >= '\u{1100}').count() as f64;
    1.05 * text_width(line, SIZE) + 0.5 * SIZE * wide + 2.0
}

/// A text in so many lines, as short as can be; none where it has not so many words.
fn wrapped(text: &str, count: usize) -> Option<Vec<String>> {
    let mut words: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match words.last_mut() {
            Some(last) if word == "\u{b7}" => *last += " \u{b7}",
            _ => words.push(word.to_owned()),
        }
    }
    if words.len() < count {
        return None;
    }
    let filled = |most: f64| {
        let mut lines: Vec<String> = Vec::new();
        for word in &words {
            match lines.last_mut() {
                Some(last) if length(&format!("{last} {word}")) <= most => *last = format!("{last} {word}"),
                _ => lines.push(word.clone()),
            }
        }
        lines
    };
    let mut limits: Vec<f64> = (0..words.len())
        .flat_map(|a| (a + 1..=words.len()).map(move |b| (a, b)))
        .map(|(a, b)| length(&words[a..b].join(" ")))
        .collect();
    limits.sort_by(f64::total_cmp);
    let fits = limits.partition_point(|most| filled(*most).len() > count);
    let mut lines = limits.get(fits).map(|most| filled(*most)).filter(|lines| lines.len() == count)?;
    // Between lines nothing else is needed.
    for line in &mut lines {
        line.truncate(line.trim_end_matches(" \u{b7}").len());
    }
    Some(lines)
}

/// A text of so many characters at most.
fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let kept: String = text.chars().take(most.saturating_sub(1)).collect();
    kept.trim_end().to_owned() + "\u{2026}"
}

/// Where names go.
struct Room<'a> {
    names: &'a [Name],
    /// How much of the picture each area has.
    sizes: Vec<f64>,
    frame: Bounds,
    cover: &'a Cover,
    written: Vec<Written>,
}

/// The names that there is room for within `frame`, each on its area or beside it, off the others, and off the way where that can be; and how many have none.
pub(super) fn place(names: &[Name], frame: Bounds, cover: &Cover) -> (Vec<Written>, usize) {
    let sizes = names.iter().map(|name| size(&name.area)).collect();
    let mut room = Room { names, sizes, frame, cover, written: Vec::new() };
    let mut later = Vec::new();
    for of in 0..names.len() {
        match room.within(of) {
            Some((0.0, written)) => room.written.push(written),
            _ => later.push(of),
        }
    }
    let mut left_out = 0;
    for of in later {
        let found = room.within(of).into_iter().chain(room.beside(of));
        match found.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((_, written)) => room.written.push(written),
            None => left_out += 1,
        }
    }
    (room.written, left_out)
}

impl Room<'_> {
    /// What may be written, with what it costs: the whole name, if it is not to be short, or else what begins it.
    fn texts(&self, of: usize, short: bool) -> Vec<(f64, String)> {
        let Name { name, note, .. } = &self.names[of];
        let whole = (!short).then(|| (0.0, cut(name, LONGEST)));
        let begun = (short || name.chars().count() > SHORT).then(|| (CUT, cut(name, SHORT)));
        let names: Vec<(f64, String)> = whole.into_iter().chain(begun).collect();
        if note.is_empty() || note == name {
            return names;
        }
        let note = cut(note, LONGEST);
        let both = names.iter().map(|(cost, name)| (*cost, format!("{name} \u{b7} {note}")));
        both.chain(names.iter().map(|(cost, name)| (cost + NO_NOTE, name.clone()))).collect()
    }

    /// The best place on its area.
    fn within(&self, of: usize) -> Option<(f64, Written)> {
        let area = &self.names[of].area;
        let mut best: Option<(f64, Written)> = None;
        for (cost, text) in self.texts(of, false) {
            for block in Block::all(&text) {
                let free = spots(area, block.size)
                    .filter(|at| corners(*at).iter().all(|p| holds(area, *p)) && self.is_free(*at));
                for at in free {
                    let cost = cost + self.covered(at) + ELSEWHERE * self.others(of, at, self.sizes[of]);
                    if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                        let (lines, upright) = (block.lines.clone(), block.upright);
                        best = Some((cost, Written { lines, at, upright, pointer: None }));
                    }
                }
                if best.as_ref().is_some_and(|(cost, _)| *cost == 0.0) {
                    return best;
                }
            }
        }
        best
    }

    /// The best place beside its area.
    fn beside(&self, of: usize) -> Option<(f64, Written)> {
        let area = &self.names[of].area;
        let anchors = anchors(area);
        let count = area.len().max(1) as f64;
        let middle: Point = std::array::from_fn(|k| area.iter().map(|p| p[k]).sum::<f64>() / count);
        let mut best: Option<(f64, Written)> = None;
        for (cost, text) in self.texts(of, true) {
            for lines in [1, 2].into_iter().filter_map(|count| wrapped(&text, count)) {
                let block = Block::of(lines, false);
                for reach in REACHES {
                    let least = cost + BESIDE + AWAY * reach;
                    for (anchor, side) in anchors.iter().flat_map(|a| SIDES.iter().map(move |s| (*a, *s))) {
                        let over = |cost: f64| best.as_ref().is_some_and(|(best, _)| cost >= *best);
                        if over(least) {
                            break;
                        }
                        let tip: Point = std::array::from_fn(|k| anchor[k] + reach * side[k]);
                        let sign = side.map(|v| if v == 0.0 { 0.0 } else { v.signum() });
                        let low: Point =
                            std::array::from_fn(|k| tip[k] - block.size[k] * (0.5 - 0.5 * sign[k]));
                        let at = [low, std::array::from_fn(|k| low[k] + block.size[k])];
                        if !self.is_free(at) || over(least + self.covered(at)) {
                            continue;
                        }
                        let own = if holds(area, centre(at)) { 1.0 } else { 0.0 };
                        let cost =
                            least + self.covered(at) + ELSEWHERE * (own + self.others(of, at, f64::INFINITY));
                        let pointer = [tip, toward(anchor, middle, EDGE)];
                        if !over(cost) && !self.written.iter().any(|w| crosses(pointer, w.at)) {
                            let lines = block.lines.clone();
                            best =
                                Some((cost, Written { lines, at, upright: false, pointer: Some(pointer) }));
                        }
                    }
                }
            }
        }
        best
    }

    /// Whether a text may be here.
    fn is_free(&self, at: Bounds) -> bool {
        let clear = |w: &Written| !overlap(w.at, at) && !w.pointer.is_some_and(|line| crosses(line, at));
        inside(at, self.frame) && self.written.iter().all(clear)
    }

    /// How much of the way it covers.
    fn covered(&self, [low, high]: Bounds) -> f64 {
        f64::from(self.cover.count([low.map(|v| v - CLEAR), high.map(|v| v + CLEAR)]))
    }

    /// On how many other areas that are smaller than this a text is.
    fn others(&self, of: usize, at: Bounds, size: f64) -> f64 {
        let all = self.names.iter().zip(&self.sizes).enumerate();
        let smaller = all.filter(|(i, (_, s))| *i != of && **s < 0.99 * size);
        smaller.filter(|(_, (name, _))| holds(&name.area, centre(at))).count() as f64
    }
}

/// To which sides a text may be.
const SIDES: [Point; 8] =
    [[1.0, 0.0], [0.7, -0.7], [0.7, 0.7], [-1.0, 0.0], [-0.7, -0.7], [-0.7, 0.7], [0.0, -1.0], [0.0, 1.0]];

/// Points along the edge of an area.
fn anchors(area: &[Point]) -> Vec<Point> {
    const COUNT: usize = 16;
    let edges = || area.iter().zip(area.iter().cycle().skip(1));
    let around: f64 = edges().map(|(a, b)| distance(*a, *b)).sum();
    let mut anchors = Vec::with_capacity(COUNT + 1);
    let (mut next, mut from) = (0.0, 0.0);
    for (a, b) in edges() {
        let length = distance(*a, *b);
        while length > 0.0 && next < from + length && anchors.len() < COUNT {
            anchors.push(toward(*a, *b, next - from));
            next += around / COUNT as f64;
        }
        from += length;
    }
    if anchors.is_empty() {
        anchors.extend(area.first());
    }
    anchors
}

/// Places of a text of this size within an area's bounds: from the top left.
fn spots(area: &[Point], size: [f64; 2]) -> impl Iterator<Item = Bounds> {
    const STEPS: usize = 9;
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

fn centre([low, high]: Bounds) -> Point {
    std::array::from_fn(|k| 0.5 * (low[k] + high[k]))
}

/// Whether a convex area holds a point.
fn holds(area: &[Point], p: Point) -> bool {
    let edges = || area.iter().zip(area.iter().cycle().skip(1)).map(|(a, b)| left_of(*a, *b, p));
    edges().all(|side| side >= 0.0) || edges().all(|side| side <= 0.0)
}

/// How much of the picture a convex area has.
fn size(area: &[Point]) -> f64 {
    let origin = area.first().copied().unwrap_or_default();
    area.windows(2).map(|w| 0.5 * left_of(origin, w[0], w[1])).sum::<f64>().abs()
}

fn inside(a: Bounds, b: Bounds) -> bool {
    (0..2).all(|k| a[0][k] >= b[0][k] && a[1][k] <= b[1][k])
}

fn overlap(a: Bounds, b: Bounds) -> bool {
    (0..2).all(|k| a[0][k] < b[1][k] && b[0][k] < a[1][k])
}

/// Whether a line that is not long goes through bounds.
fn crosses([from, to]: [Point; 2], at: Bounds) -> bool {
    let on = |i: usize| -> Point { std::array::from_fn(|k| from[k] + i as f64 / 16.0 * (to[k] - from[k])) };
    (0..=16).map(on).any(|p| (0..2).all(|k| at[0][k] < p[k] && p[k] < at[1][k]))
}

/// So far from one point to another.
fn toward(from: Point, to: Point, by: f64) -> Point {
    let length = distance(from, to);
    let part = if length > by { by / length } else { 1.0 };
    std::array::from_fn(|k| from[k] + part * (to[k] - from[k]))
}

fn distance(a: Point, b: Point) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

#[cfg(test)]
#[path = "names_tests.rs"]
mod tests;
