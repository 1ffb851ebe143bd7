//! The path of a stylus in pixels, thinned to visible points, and lanes beside it.

use super::Moment;
use super::outline::Point;
use crate::lines::Pen;

/// Least length of a piece in pixels, but for the last.
const STEP: f64 = 2.0;
/// Most pieces.
pub(super) const MOST_PIECES: usize = 6000;
/// Width of a lane, and distance of the first from the path.
pub(super) const LANE: f64 = 3.0;
const CLEAR: f64 = 1.0;
/// Cosine of a turn that a lane does not follow.
const SHARP: f64 = 0.3;

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

/// The path in at most [`MOST_PIECES`] pieces, each [`STEP`] pixels long or more; `pixels` places it.
pub(super) fn pieces(moments: &[Moment], pixels: impl Fn(Point) -> Point) -> Vec<Piece> {
    let ticks = moments.len().div_ceil(MOST_PIECES - 1).max(1);
    let mut pieces = pieces_of(moments, pixels, STEP, ticks);
    // A path of many jumps may have more.
    pieces.truncate(MOST_PIECES);
    pieces
}

/// Pieces of at least this length and number of ticks. A piece has the effects of all its ticks.
fn pieces_of(moments: &[Moment], pixels: impl Fn(Point) -> Point, step: f64, ticks: usize) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::new();
    // The unfinished piece, and its number of ticks.
    let mut open: Option<(Piece, usize)> = None;
    for moment in moments {
        let Some(at) = moment.place().map(&pixels) else {
            pieces.extend(open.take().map(|(piece, _)| piece));
            continue;
        };
        let &Moment { effects, touches, jumps, .. } = moment;
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
            write_beside(&mut d, run, 0.0);
        }
    }
    d
}

/// Path data of the lane of each effect: on the right of the path, wherever the effect is active. Lanes that
/// are active together lie side by side, the first nearest to the path.
pub(super) fn lanes(pieces: &[Piece], effects: usize) -> Vec<String> {
    let mut paths = vec![String::new(); effects.min(u16::BITS as usize)];
    for run in pieces.chunk_by(|a, b| b.joined && a.effects == b.effects) {
        let active = (0..paths.len()).filter(|bit| run[0].effects >> bit & 1 == 1);
        for (lane, bit) in active.enumerate() {
            write_beside(&mut paths[bit], run, CLEAR + (lane as f64 + 0.5) * LANE);
        }
    }
    paths
}

/// Writes a line `off` pixels to the right of joined pieces. A lane is broken at sharp turns.
fn write_beside(d: &mut String, run: &[Piece], off: f64) {
    let mut pen = Pen::default();
    let mut before: Option<Point> = None;
    for Piece { from, to, .. } in run {
        let length = distance(*from, *to);
        let ahead = [0, 1].map(|k| (to[k] - from[k]) / length);
        let way = if length > 1e-9 { ahead } else { before.unwrap_or([1.0, 0.0]) };
        if off > 0.0 && before.is_some_and(|b| b[0] * way[0] + b[1] * way[1] < SHARP) {
            pen.end(d);
        }
        for p in [from, to] {
            pen.to(d, p[0] - off * way[1], p[1] + off * way[0]);
        }
        before = Some(way);
    }
    pen.end(d);
}

fn distance(a: Point, b: Point) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

#[cfg(test)]
#[path = "way_tests.rs"]
pub(crate) mod tests;
