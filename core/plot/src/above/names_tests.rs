//! Placement of names by hand; covered cells against a look at every point.

use proptest::prelude::*;

use super::*;

const FRAME: Bounds = [[0.0; 2], [1000.0; 2]];

fn square(x: f64, y: f64, w: f64, h: f64) -> Vec<Point> {
    vec![[x, y], [x + w, y], [x + w, y + h], [x, y + h]]
}

fn name(name: &str, note: &str, area: Vec<Point>) -> Name {
    Name { name: name.into(), note: note.into(), area }
}

fn covered(points: &[Point]) -> Cover {
    let mut cover = Cover::default();
    points.iter().for_each(|p| cover.add(*p));
    cover
}

/// Names in their places where the path covers these points.
fn placed(names: &[Name], path: &[Point]) -> (Vec<Label>, usize) {
    place(names, FRAME, &covered(path))
}

fn text(written: &Label) -> String {
    written.lines.join(" ")
}

fn of<'a>(written: &'a [Label], start: &str) -> &'a Label {
    written.iter().find(|w| text(w).starts_with(start)).unwrap_or_else(|| panic!("{start}: {written:?}"))
}

#[test]
fn names_are_on_their_areas_and_off_each_other() {
    let names = [
        name("honey", "", square(0.0, 0.0, 80.0, 60.0)),
        name("floor", "", square(0.0, 0.0, 80.0, 60.0)),
        // Too narrow for both, unless standing.
        name("1", "sandpaper P36", square(100.0, 0.0, 40.0, 200.0)),
        name("2", "sandpaper P36", square(150.0, 0.0, 40.0, 40.0)),
        name("a diamond", "", vec![[300.0, 0.0], [360.0, 60.0], [300.0, 120.0], [240.0, 60.0]]),
    ];
    let (written, left_out) = placed(&names, &[]);
    assert_eq!((written.len(), left_out), (5, 0), "{written:?}");
    assert!(written.iter().all(|w| w.leader.is_none()), "{written:?}");
    let both = of(&written, "1");
    assert!(text(both) == "1 \u{b7} sandpaper P36" && both.upright, "{both:?}");
    assert_eq!(text(of(&written, "2")), "2");
    for (i, a) in written.iter().enumerate() {
        for b in &written[..i] {
            let ([la, ha], [lb, hb]) = (a.at, b.at);
            assert!(ha[0] <= lb[0] || hb[0] <= la[0] || ha[1] <= lb[1] || hb[1] <= la[1], "{a:?} {b:?}");
        }
    }
    // In the diamond |x - 300| + |y - 60| is 60 at most.
    let [low, high] = of(&written, "a diamond").at;
    for (x, y) in [(low[0], low[1]), (high[0], low[1]), (low[0], high[1]), (high[0], high[1])] {
        assert!((x - 300.0).abs() + (y - 60.0).abs() <= 60.0, "{low:?} {high:?}");
    }
    // A way along the top takes the name to the bottom.
    let way: Vec<Point> = (0..40).map(|i| [2.0 * f64::from(i), 8.0]).collect();
    let [low, _] = placed(&names[..1], &way).0[0].at;
    assert!(low[1] > 12.0, "{low:?}");
}

#[test]
fn name_is_wrapped_to_stay_off_the_path() {
    // A way across the middle: one line, standing, would cross it.
    let way: Vec<Point> = (0..100).map(|i| [f64::from(i), 100.0]).collect();
    let narrow = [name("10", "leather grain, coarse", square(0.0, 0.0, 46.0, 200.0))];
    let (written, _) = placed(&narrow, &way);
    let at = &written[0];
    assert!(text(at).replace(" \u{b7}", "") == "10 leather grain, coarse" && at.lines.len() > 1, "{at:?}");
    assert!(at.leader.is_none() && (at.at[1][1] < 100.0 || at.at[0][1] > 100.0), "{at:?}");
}

#[test]
fn small_or_side_on_areas_are_named_beside() {
    let long = "a very long name that goes on and on and on, with commas & <tags>";
    let names = [
        name("a small ball", "", square(500.0, 500.0, 12.0, 12.0)),
        name("a wall", "oak", vec![[200.0, 300.0], [200.0, 400.0]]),
        name("a face", "", vec![[300.0, 300.0], [300.0, 300.0], [340.0, 340.0], [340.0, 340.0]]),
        name("in the corner", "", square(996.0, 996.0, 4.0, 4.0)),
        name(long, "leather", square(700.0, 100.0, 30.0, 30.0)),
    ];
    let (written, left_out) = placed(&names, &[]);
    assert_eq!((written.len(), left_out), (5, 0), "{written:?}");
    for (n, start) in names.iter().zip(["a small", "a wall", "a face", "in the", "a very"]) {
        let w = of(&written, start);
        let [low, high] = w.at;
        let [from, to] = w.leader.unwrap();
        let near =
            |p: Point| n.area.iter().map(|q| (p[0] - q[0]).hypot(p[1] - q[1])).fold(f64::MAX, f64::min);
        let off = (0..2).map(|k| (low[k] - from[k]).max(from[k] - high[k]).max(0.0)).fold(0.0, f64::max);
        // From the text's edge to the area, whose points are no further apart than 100.
        assert!(off < 1e-9 && near(to) <= 50.0 && (from[0] - to[0]).hypot(from[1] - to[1]) < 30.0, "{w:?}");
        assert!((0..2).all(|k| low[k] >= 0.0 && high[k] <= 1000.0), "{w:?}");
    }
    assert_eq!(text(of(&written, "a wall")), "a wall \u{b7} oak");
    // What is cut says so.
    assert!(text(of(&written, "a very")).contains("\u{2026} \u{b7} leather"), "{written:?}");
    // On an area it is cut rather than put beside it.
    let wide = [name(long, "leather", square(0.0, 0.0, 190.0, 60.0))];
    let (on, _) = placed(&wide, &[]);
    assert!(on[0].leader.is_none() && text(&on[0]).ends_with("\u{b7} leather"), "{on:?}");
    // Another area is not where it stands, if there is room elsewhere.
    let big = name("big", "", square(508.0, 400.0, 400.0, 300.0));
    let (written, _) = placed(&[names[0].clone(), big], &[]);
    assert!(of(&written, "a small").at[1][0] <= 560.0, "{written:?}");
}

#[test]
fn names_without_room_are_counted() {
    // A field of areas without a space between them.
    let field: Vec<Name> = (0..2500)
        .map(|i| name("here", "", square(f64::from(i % 50) * 20.0, f64::from(i / 50) * 20.0, 20.0, 20.0)))
        .collect();
    let frame = [[480.0; 2], [560.0; 2]];
    let shown: Vec<Name> =
        field.into_iter().filter(|n| overlap(frame, bounds(n.area.iter().copied()).unwrap())).collect();
    let (written, left_out) = place(&shown, frame, &Cover::default());
    assert!(left_out > 0 && written.len() + left_out == shown.len(), "{} {left_out}", written.len());
    assert!(written.iter().all(|w| inside(w.at, frame)));
    assert_eq!(place(&[name("x", "", Vec::new())], FRAME, &Cover::default()).1, 1);
}

#[test]
fn texts_are_wrapped_to_a_width() {
    let lines = |text: &str, like: &str| wrapped(text, length(like)).map(|lines| lines.join("|"));
    let name = "10 \u{b7} leather grain, coarse";
    assert_eq!(lines(name, "grain, coarse").unwrap(), "10 \u{b7} leather|grain, coarse");
    assert_eq!(lines(name, "10 \u{b7} leather").unwrap(), "10 \u{b7} leather|grain,|coarse");
    assert_eq!(lines("1 \u{b7} sandpaper", "sandpaper").unwrap(), "1|sandpaper");
    assert_eq!(lines("one", "one").unwrap(), "one");
    assert_eq!(lines("one", "on"), None);
    assert_eq!(lines("a b c d", "a"), None);
    assert_eq!(lines("", "one"), None);
    assert_eq!(shortened("short", 5), "short");
    assert_eq!(shortened("longer", 5), "long\u{2026}");
}

proptest! {
    #[test]
    fn cover_meets_bounds_of_covered_cells(
        points in proptest::collection::vec(proptest::array::uniform2(-5.0..65.0f64), 0..60),
        low in proptest::array::uniform2(-9.0..60.0f64),
        size in proptest::array::uniform2(0.1..40.0f64),
    ) {
        let bounds = [low, [low[0] + size[0], low[1] + size[1]]];
        let cell = |p: &Point| {
            let corner = p.map(|v| 3.0 * (v / 3.0).floor());
            [corner, corner.map(|v| v + 3.0)]
        };
        let want = points.iter().any(|p| overlap(cell(p), bounds));
        prop_assert_eq!(covered(&points).meets(bounds), want);
    }
}
