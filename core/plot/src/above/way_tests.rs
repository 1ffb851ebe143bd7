//! The thinning against a look at every tick, lanes by hand.

use proptest::prelude::*;

use super::*;

fn thinned(stops: impl Iterator<Item = Moment>) -> Vec<Piece> {
    pieces(&stops.collect::<Vec<_>>(), |at| at)
}

fn stop(at: Point, effects: u16) -> Moment {
    Moment { at_mm: at.map(|v| v as f32), effects, touches: effects != 0, jumps: false }
}

/// A random walk with gaps and jumps.
fn walk() -> impl Strategy<Value = Vec<Moment>> {
    let one = (-9.0..9.0f64, -9.0..9.0f64, 0..8u16, proptest::bool::weighted(0.02), 0..40u8);
    proptest::collection::vec(one, 1..400).prop_map(|steps| {
        let mut at = [0.0; 2];
        let mut stops = Vec::new();
        for (dx, dy, effects, jumps, kind) in steps {
            // Most steps are shorter than a piece.
            let by = if kind < 30 { 0.1 } else { 1.0 };
            at = [at[0] + by * dx, at[1] + by * dy];
            let at_mm = at.map(|v| if kind > 0 { v as f32 } else { f32::NAN });
            stops.push(Moment { at_mm, effects, touches: effects > 3, jumps });
        }
        stops
    })
}

/// Lines of a path as the pen writes them: absolute, then relative. A dot has one point.
pub(crate) fn lines_of(d: &str) -> Vec<Vec<Point>> {
    let numbers = |text: &str| -> Vec<f64> { text.split_whitespace().map(|n| n.parse().unwrap()).collect() };
    let line = |part: &str| {
        let (from, by) =
            part.trim_end_matches('z').split_once('l').unwrap_or((part.trim_end_matches('z'), ""));
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
        let pieces = pieces_of(&stops, |at| at, step, ticks);
        // No two places are the same, so that each piece begins at one tick.
        let begins = |p: &Piece| stops.iter().position(|s| s.place() == Some(p.from)).unwrap();
        for (k, s) in stops.iter().enumerate().filter(|(_, s)| s.place().is_some()) {
            let near = |p: &&Piece| {
                (0..ticks).any(|t| begins(p) + t == k) || distance(p.from, s.place().unwrap()) < step
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
            let placed = stops[begins(p)..end].iter().filter(|s| s.place().is_some());
            prop_assert_eq!(placed.fold(0, |all, s| all | s.effects), p.effects);
            prop_assert!(begins(p) >= last);
            last = begins(p);
            if let Some(next) = next.filter(|next| next.joined) {
                prop_assert!(distance(p.from, p.to) >= step && end - begins(p) >= ticks);
                prop_assert_eq!(p.to, next.from);
            }
        }
        let breaks = stops.iter().filter(|s| s.jumps || s.place().is_none()).count() + 1;
        prop_assert!(pieces.iter().filter(|p| !p.joined).count() <= breaks);
    }

    #[test]
    fn paths_of_any_walk_are_well_formed(stops in walk()) {
        let pieces = thinned(stops.into_iter());
        let all = lanes(&pieces, 3).into_iter().chain([line(&pieces, true), line(&pieces, false)]);
        for d in all {
            for line in lines_of(&d) {
                prop_assert!(line.iter().flatten().all(|v| v.is_finite()), "{d}");
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
    assert!(size < 1_400_000, "{size}");
    // One that jumps in every tick too.
    let jumps = (0..80_000u32).map(|k| Moment { jumps: true, ..stop(at(k), 1) });
    assert_eq!(thinned(jumps).len(), MOST_PIECES);
}

/// Lines with their ends alone, as long as they are straight.
fn ends(d: &str) -> Vec<[Point; 2]> {
    lines_of(d).iter().map(|line| [line[0], line[line.len() - 1]]).collect()
}

#[test]
fn straight_lanes_lie_on_the_right_in_order() {
    let there: Vec<Moment> = (0..=100).map(|k| stop([f64::from(k), 50.0], 0b101)).collect();
    let paths = lanes(&thinned(there.iter().copied()), 3);
    // Going to the right of the screen, whose y points down, the right hand is below.
    let at = |y: f64| vec![[[0.0, y], [100.0, y]]];
    assert_eq!([0, 1, 2].map(|i: usize| ends(&paths[i])), [at(52.5), Vec::new(), at(55.5)]);
    assert_eq!(ends(&line(&thinned(there.iter().copied()), true)), at(50.0));
    assert_eq!(line(&thinned(there.iter().copied()), false), "");
    // Back again, they are above, and nothing joins the two.
    let back = (0..100).rev().map(|k| stop([f64::from(k), 50.0], 0b101));
    let paths = lanes(&thinned(there.iter().copied().chain(back)), 3);
    assert_eq!(ends(&paths[0]), [[[0.0, 52.5], [100.0, 52.5]], [[100.0, 47.5], [0.0, 47.5]]]);
}

#[test]
fn lanes_close_up_where_others_end() {
    let way = (0..=100).map(|k| stop([f64::from(k), 0.0], if k < 40 { 0b11 } else { 0b10 }));
    let paths = lanes(&thinned(way), 2);
    assert_eq!(ends(&paths[0]), [[[0.0, 2.5], [40.0, 2.5]]]);
    assert_eq!(ends(&paths[1]), [[[0.0, 5.5], [40.0, 5.5]], [[40.0, 2.5], [100.0, 2.5]]]);
}

#[test]
fn short_effect_is_still_seen() {
    let way = (0..=100).map(|k| stop([f64::from(k), 0.0], u16::from(k == 50)));
    let [[a, b]] = ends(&lanes(&thinned(way), 1)[0])[..] else { panic!("not one line") };
    assert!((1.9..2.6).contains(&(b[0] - a[0])) && (0.5 * (a[0] + b[0]) - 51.0).abs() < 0.2, "{a:?} {b:?}");
    // Also of one that stands still all the time: a dot.
    let still = (0..50).map(|_| stop([7.0, 7.0], 1));
    assert_eq!(lanes(&thinned(still), 1)[0], "M7 9.5z");
}

#[test]
fn lane_around_a_circle_is_a_circle() {
    // On the screen a growing angle goes clockwise: the right hand is inside.
    for (way, within) in [(1.0, 97.2..97.8), (-1.0, 102.2..102.8)] {
        let at = move |k: i32| {
            let (sin, cos) = (way * f64::from(k) * 0.002).sin_cos();
            stop([100.0 * cos, 100.0 * sin], 1)
        };
        let found = lines_of(&lanes(&thinned((0..=3142).map(at)), 1)[0]);
        assert_eq!(found.len(), 1);
        let inside = |p: &Point| within.contains(&p[0].hypot(p[1]));
        assert!(found[0].iter().all(inside), "{way} {:?}", found[0]);
    }
}
