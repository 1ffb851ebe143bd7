//! The path of a stylus in pixels, thinned to what can be seen, and lanes beside it.

use super::outline::{Point, left_of};
use crate::lines::Pen;

/// Least length of a piece in pixels, but for the last.
const STEP: f64 = 2.0;
/// Most pieces.
pub(super) const MOST_PIECES: usize = 6000;
/// Greatest distance in pixels between a drawn line and the pieces.
const STRAY: f64 = 0.1;
/// Width of a lane, and distance of the first from the path.
pub(super) const LANE: f64 = 3.0;
const CLEAR: f64 = 1.0;
/// Cosine of a turn that a lane does not follow.
const SHARP: f64 = 0.3;
/// Least length of a drawn lane.
const LEAST: f64 = 2.5;

/// A tick at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stop {
    /// Place in pixels; `None` where it is not known.
    pub(super) at: Option<Point>,
    /// Bits of effects.
    pub(super) effects: u16,
    /// Whether something is touched.
    pub(super) touches: bool,
    /// Whether no path leads here from the place before.
    pub(super) jumps: bool,
}

/// A straight piece of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    pub(super) from: Point,
    pub(super) to: Point,
    /// All effects of its ticks.
    pub(super) effects: u16,
    /// Whether something was touched in one of them.
    pub(super) touches: bool,
    /// Whether it begins where the one before ends.
    pub(super) joined: bool,
}

/// The path in at most [`MOST_PIECES`] pieces, each [`STEP`] pixels long or more.
pub(super) fn pieces(stops: impl ExactSizeIterator<Item = Stop>) -> Vec<Piece> {
    let ticks = stops.len().div_ceil(MOST_PIECES - 1).max(1);
    let mut pieces = pieces_of(stops, STEP, ticks);
    // A path of many jumps may have more.
    pieces.truncate(MOST_PIECES);
    pieces
}

/// Pieces of at least this length and number of ticks. A piece has the effects of all its ticks.
fn pieces_of(stops: impl Iterator<Item = Stop>, step: f64, ticks: usize) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::new();
    // The unfinished piece, and its number of ticks.
    let mut open: Option<(Piece, usize)> = None;
    for Stop { at, effects, touches, jumps } in stops {
        let Some(at) = at else {
            pieces.extend(open.take().map(|(piece, _)| piece));
            continue;
        };
        let mut joined = false;
        if let Some((piece, of)) = open.as_mut().filter(|_| !jumps) {
            piece.to = at;
            if *of < ticks || distance(piece.from, at) < step {
                piece.effects |= effects;
                piece.touches |= touches;
                *of += 1;
                continue;
            }
            joined = true;
        }
        let next = Piece { from: at, to: at, effects, touches, joined };
        pieces.extend(open.replace((next, 1)).map(|(piece, _)| piece));
    }
    pieces.extend(open.map(|(piece, _)| piece));
    pieces
}

/// Path data of the path itself: where something is touched, or where not.
pub(super) fn line(pieces: &[Piece], touches: bool) -> String {
    let mut d = String::new();
    for run in pieces.chunk_by(|a, b| b.joined && a.touches == b.touches) {
        if run[0].touches == touches {
            write(&mut d, &straight(&points(run), STRAY));
        }
    }
    d
}

/// Path data of the lane of each effect: on the right of the path, wherever the effect is active. Lanes that
/// are active together lie side by side, the first nearest to the path.
pub(super) fn lanes(pieces: &[Piece], effects: usize) -> Vec<String> {
    let mut paths = vec![String::new(); effects.min(u16::BITS as usize)];
    for run in pieces.chunk_by(|a, b| b.joined && a.effects == b.effects) {
        let points = visible(straight(&points(run), STRAY));
        let active = (0..paths.len()).filter(|bit| run[0].effects >> bit & 1 == 1);
        for (lane, bit) in active.enumerate() {
            write_beside(&mut paths[bit], &points, CLEAR + (lane as f64 + 0.5) * LANE);
        }
    }
    paths
}

/// The corners of joined pieces.
fn points(run: &[Piece]) -> Vec<Point> {
    run.first().map(|first| first.from).into_iter().chain(run.iter().map(|piece| piece.to)).collect()
}

/// Removes repeated points. Extends a line that is too short to be seen to [`LEAST`].
fn visible(mut points: Vec<Point>) -> Vec<Point> {
    points.dedup();
    let length: f64 = points.windows(2).map(|w| distance(w[0], w[1])).sum();
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else { return points };
    if length >= LEAST {
        return points;
    }
    let way = direction(first, last);
    let middle = [0, 1].map(|k| 0.5 * (first[k] + last[k]));
    [-0.5, 0.5].map(|part| [0, 1].map(|k| middle[k] + part * LEAST * way[k])).to_vec()
}

/// Writes a lane `off` pixels to the right of a line. It is broken at sharp turns.
fn write_beside(d: &mut String, points: &[Point], off: f64) {
    let ways: Vec<Point> = points.windows(2).map(|w| direction(w[0], w[1])).collect();
    let (Some(&first), Some(&last)) = (ways.first(), ways.last()) else { return };
    let mut lane = vec![beside(points[0], first, off)];
    for (point, way) in points[1..].iter().zip(ways.windows(2)) {
        let [before, after] = [way[0], way[1]];
        if before[0] * after[0] + before[1] * after[1] < SHARP {
            lane.push(beside(*point, before, off));
            write(d, &std::mem::take(&mut lane));
            lane.push(beside(*point, after, off));
        } else {
            let mean = direction([0.0; 2], [before[0] + after[0], before[1] + after[1]]);
            lane.push(beside(*point, mean, off));
        }
    }
    lane.push(beside(points[points.len() - 1], last, off));
    write(d, &lane);
}

/// The point `off` pixels to the right of another, seen along a direction.
fn beside(p: Point, way: Point, off: f64) -> Point {
    [p[0] - off * way[1], p[1] + off * way[0]]
}

/// Unit vector from one point to another; along x where they are the same.
fn direction(a: Point, b: Point) -> Point {
    let length = distance(a, b);
    if length > 1e-9 { [(b[0] - a[0]) / length, (b[1] - a[1]) / length] } else { [1.0, 0.0] }
}

/// Writes a line through points, unless they are all the same.
fn write(d: &mut String, points: &[Point]) {
    let (mut pen, mut line) = (Pen::default(), String::new());
    points.iter().for_each(|[x, y]| pen.to(&mut line, *x, *y));
    // After a pen that never moved, the last character is its command.
    if !line.ends_with('l') {
        d.push_str(&line);
    }
}

/// Leaves out points that are nearer than `stray` to the line through the others (U. Ramer, "An iterative
/// procedure for the polygonal approximation of plane curves", 1972; D. Douglas, T. Peucker, 1973).
fn straight(points: &[Point], stray: f64) -> Vec<Point> {
    /// Points that are simplified together; this bounds the time for each point.
    const TOGETHER: usize = 256;
    let mut keep = vec![false; points.len()];
    let Some(last) = points.len().checked_sub(1) else { return Vec::new() };
    let mut spans: Vec<(usize, usize)> =
        (0..last).step_by(TOGETHER).map(|a| (a, (a + TOGETHER).min(last))).collect();
    keep[last] = true;
    while let Some((a, b)) = spans.pop() {
        keep[a] = true;
        let off = |i: usize| (i, beyond(points[a], points[b], points[i]));
        let furthest = (a + 1..b).map(off).max_by(|x, y| x.1.total_cmp(&y.1));
        if let Some((i, off)) = furthest
            && off > stray
        {
            spans.extend([(a, i), (i, b)]);
        }
    }
    points.iter().zip(keep).filter(|(_, keep)| *keep).map(|(p, _)| *p).collect()
}

/// Distance of a point from the segment between two others.
fn beyond(a: Point, b: Point, p: Point) -> f64 {
    let length = distance(a, b);
    let part = ((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])) / (length * length);
    if part > 0.0 && part < 1.0 {
        left_of(a, b, p).abs() / length
    } else {
        distance(a, p).min(distance(b, p))
    }
}

fn distance(a: Point, b: Point) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

#[cfg(test)]
#[path = "way_tests.rs"]
pub(crate) mod tests;
