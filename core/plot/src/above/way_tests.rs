//! The thinning against a look at every tick, lanes by hand.

use proptest::prelude::*;

use super::*;

fn thinned(stops: impl Iterator<Item = Stop>) -> Vec<Piece> {
    pieces(stops.collect::<Vec<_>>().into_iter())
}

fn stop(at: Point, effects: u16) -> Stop {
    Stop { at: Some(at), effects, touches: effects != 0, jumps: false }
}

/// A random walk with gaps and jumps.
fn walk() -> impl Strategy<Value = Vec<Stop>> {
    let one = (-9.0..9.0f64, -9.0..9.0f64, 0..8u16, proptest::bool::weighted(0.02), 0..40u8);
    proptest::collection::vec(one, 1..400).prop_map(|steps| {
        let mut at = [0.0; 2];
        let mut stops = Vec::new();
        for (dx, dy, effects, jumps, kind) in steps {
            // Most steps are shorter than a piece.
            let by = if kind < 30 { 0.1 } else { 1.0 };
            at = [at[0] + by * dx, at[1] + by * dy];
            stops.push(Stop { at: (kind > 0).then_some(at), effects, touches: effects > 3, jumps });
        }
        stops
    })
}

/// Lines of a path as the pen writes them: absolute, then relative, a minus for a space.
pub(crate) fn lines_of(d: &str) -> Vec<Vec<Point>> {
    let numbers = |text: &str| -> Vec<f64> {
        let spaced = text.replace('-', " -");
        spaced.split_whitespace().map(|n| n.parse().unwrap()).collect()
    };
    let line = |part: &str| {
        let (from, by) = part.split_once('l').unwrap();
        let from = numbers(from);
        let mut points = vec![[from[0], from[1]]];
        for by in numbers(by).chunks(2) {
            let last = points[points.len() - 1];
            points.push([last[0] + by[0], last[1] + by[1]]);
        }
        points
    };
    d.split('M').skip(1).map(line).collect()
}

proptest! {
    #[test]
    fn every_tick_is_near_a_piece_with_its_effects(
        stops in walk(),
        step in 0.5..20.0f64,
        ticks in 1..20usize,
    ) {
        let pieces = pieces_of(stops.iter().copied(), step, ticks);
        // No two places are the same, so that each piece begins at one tick.
        let begins = |p: &Piece| stops.iter().position(|s| s.at == Some(p.from)).unwrap();
        for (k, s) in stops.iter().enumerate().filter(|(_, s)| s.at.is_some()) {
            let near = |p: &&Piece| {
                (0..ticks).any(|t| begins(p) + t == k) || distance(p.from, s.at.unwrap()) < step
            };
            let of = pieces.iter().rfind(|p| begins(p) <= k).unwrap();
            let holds = of.effects & s.effects == s.effects && (of.touches || !s.touches);
            prop_assert!(near(&of) && holds, "{s:?}");
        }
        let mut last = 0;
        for (i, p) in pieces.iter().enumerate() {
            // Nothing is made up, and pieces are as long as they must be.
            let next = pieces.get(i + 1);
            let end = next.map_or(stops.len(), begins);
            let placed = stops[begins(p)..end].iter().filter(|s| s.at.is_some());
            prop_assert_eq!(placed.fold(0, |all, s| all | s.effects), p.effects);
            prop_assert!(begins(p) >= last);
            last = begins(p);
            if let Some(next) = next.filter(|next| next.joined) {
                prop_assert!(distance(p.from, p.to) >= step && end - begins(p) >= ticks);
                prop_assert_eq!(p.to, next.from);
            }
        }
        let breaks = stops.iter().filter(|s| s.jumps || s.at.is_none()).count() + 1;
        prop_assert!(pieces.iter().filter(|p| !p.joined).count() <= breaks);
    }

    #[test]
    fn simplified_line_is_near_all_its_points(
        steps in proptest::collection::vec(proptest::array::uniform2(-3.0..3.0f64), 0..700),
        stray in 0.05..5.0f64,
    ) {
        let mut at = [0.0; 2];
        let points: Vec<Point> = steps.iter().map(|s| { at = [at[0] + s[0], at[1] + s[1]]; at }).collect();
        let left = straight(&points, stray);
        prop_assert_eq!(left.first(), points.first());
        prop_assert_eq!(left.last(), points.last());
        let mut rest = points.iter();
        prop_assert!(left.iter().all(|p| rest.any(|q| q == p)), "in another order");
        let kept: Vec<usize> = left.iter().map(|p| points.iter().position(|q| q == p).unwrap()).collect();
        for w in kept.windows(2) {
            for p in &points[w[0]..w[1]] {
                // The distance to a line by trying places along it.
                let (a, b) = (points[w[0]], points[w[1]]);
                let on = |i: i32| [0, 1].map(|k| a[k] + f64::from(i) / 5000.0 * (b[k] - a[k]));
                let off = (0..=5000).map(|i| distance(on(i), *p)).fold(f64::MAX, f64::min);
                prop_assert!(off <= stray + distance(a, b) / 5000.0, "{p:?} {off}");
            }
        }
    }

    #[test]
    fn paths_of_any_walk_are_well_formed(stops in walk()) {
        let pieces = thinned(stops.into_iter());
        let all = lanes(&pieces, 3).into_iter().chain([line(&pieces, true), line(&pieces, false)]);
        for d in all {
            for line in lines_of(&d) {
                prop_assert!(line.len() > 1 && line.iter().flatten().all(|v| v.is_finite()), "{d}");
            }
        }
    }
}

#[test]
fn long_scribble_is_bounded() {
    // 20 s at 4 kHz, everything active by turns, here and there over the whole map.
    let at =
        |k: u32| [400.0 + 380.0 * (f64::from(k) * 0.37).sin(), 250.0 + 240.0 * (f64::from(k) * 0.51).cos()];
    let scribble = (0..80_000u32).map(|k| stop(at(k), (k * 7919 % 2048) as u16));
    let pieces = thinned(scribble);
    assert!((5000..=MOST_PIECES).contains(&pieces.len()), "{}", pieces.len());
    let size: usize = lanes(&pieces, 11).iter().map(String::len).sum();
    assert!(size < 1_300_000, "{size}");
    // One that jumps in every tick too.
    let jumps = (0..80_000u32).map(|k| Stop { jumps: true, ..stop(at(k), 1) });
    assert_eq!(thinned(jumps).len(), MOST_PIECES);
}

#[test]
fn straight_lanes_lie_on_the_right_in_order() {
    let there: Vec<Stop> = (0..=100).map(|k| stop([f64::from(k), 50.0], 0b101)).collect();
    let paths = lanes(&thinned(there.iter().copied()), 3);
    // Going to the right of the screen, whose y points down, the right hand is below.
    assert_eq!(paths, ["M0 52.5l100 0", "", "M0 55.5l100 0"]);
    assert_eq!(line(&thinned(there.iter().copied()), true), "M0 50l100 0");
    assert_eq!(line(&thinned(there.iter().copied()), false), "");
    // Back again, they are above, and nothing joins the two.
    let back = (0..100).rev().map(|k| stop([f64::from(k), 50.0], 0b101));
    let paths = lanes(&thinned(there.iter().copied().chain(back)), 3);
    assert_eq!(paths[0], "M0 52.5l100 0M100 47.5l-100 0");
}

#[test]
fn lanes_close_up_where_others_end() {
    let way = (0..=100).map(|k| stop([f64::from(k), 0.0], if k < 40 { 0b11 } else { 0b10 }));
    let paths = lanes(&thinned(way), 2);
    assert_eq!(paths, ["M0 2.5l40 0", "M0 5.5l40 0M40 2.5l60 0"]);
}

#[test]
fn short_effect_is_still_seen() {
    let way = (0..=100).map(|k| stop([f64::from(k), 0.0], u16::from(k == 50)));
    let found = lines_of(&lanes(&thinned(way), 1)[0]);
    assert_eq!(found.len(), 1);
    let [a, b] = [found[0][0], found[0][1]];
    assert!((b[0] - a[0] - LEAST).abs() < 0.11 && (0.5 * (a[0] + b[0]) - 51.0).abs() < 0.2, "{found:?}");
    // Also of one that stands still all the time.
    let still = (0..50).map(|_| stop([7.0, 7.0], 1));
    assert_eq!(lines_of(&lanes(&thinned(still), 1)[0]).len(), 1);
}

#[test]
fn lane_around_a_circle_is_a_circle() {
    let turns = |way: f64| {
        let at = move |k: i32| {
            let (sin, cos) = (way * f64::from(k) * 0.002).sin_cos();
            stop([100.0 * cos, 100.0 * sin], 1)
        };
        let found = lines_of(&lanes(&thinned((0..=3142).map(at)), 1)[0]);
        assert_eq!(found.len(), 1);
        found[0].iter().map(|p| p[0].hypot(p[1])).fold((f64::MAX, f64::MIN), |(a, b), r| (a.min(r), b.max(r)))
    };
    // On the screen a growing angle goes clockwise: the right hand is inside.
    let (low, high) = turns(1.0);
    assert!(low > 97.2 && high < 97.7, "{low} {high}");
    let (low, high) = turns(-1.0);
    assert!(low > 102.2 && high < 102.7, "{low} {high}");
}
