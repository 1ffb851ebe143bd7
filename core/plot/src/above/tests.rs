//! What is shown, and how much of it.

use asperity_world::space::{Pose, Shape};

use super::names::Written;
use super::way::tests::lines_of;
use super::*;
use crate::Render;
use crate::tests::tags;

fn tile(name: &str, place_mm: [f64; 3], size_mm: [f64; 2]) -> Seen {
    let surface = Surface {
        shape: Shape::rectangle(size_mm, 5.0).unwrap(),
        pose: Pose::new(place_mm, [0.0; 3]).unwrap(),
    };
    Seen { name: name.into(), note: String::new(), surface, soft: false, touched: false }
}

/// Along x through 0, `mm` long, in 1000 ticks.
fn along(mm: f32, effects: impl Fn(usize) -> u16) -> Vec<Moment> {
    let moment = |k: usize| Moment {
        at_mm: [mm * (k as f32 / 999.0 - 0.5), 0.0],
        effects: effects(k),
        touches: effects(k) != 0,
        jumps: false,
    };
    (0..1000).map(moment).collect()
}

fn above(surfaces: Vec<Seen>, moments: Vec<Moment>) -> Above {
    let effects = ["stiffness", "friction", "a <texture>"].map(String::from).to_vec();
    Above { surfaces, effects, moments }
}

fn svg(above: Above) -> String {
    let svg = Render { title: "T".into(), above: Some(above), ..Render::default() }.into_figure().to_svg();
    tags(&svg);
    svg
}

#[test]
fn what_is_shown_is_the_way_and_what_lies_about_it() {
    let way = Some([[-50.0, 0.0], [50.0, 0.0]]);
    let near = [[-60.0, -10.0], [60.0, 10.0]];
    let shown = |surfaces: &[Bounds]| view(way, surfaces.iter().copied());
    let about = |[low, high]: Bounds| {
        let by = 0.02 * (high[0] - low[0]).max(high[1] - low[1]);
        [low.map(|v| v - by), high.map(|v| v + by)]
    };
    assert_eq!(shown(&[]), about(near));
    // One that is near is shown as a whole, one that is large up to where it is far, one that is far not.
    assert_eq!(shown(&[[[55.0, -20.0], [70.0, 5.0]]]), about([[-60.0, -20.0], [70.0, 10.0]]));
    assert_eq!(shown(&[[[-1e4; 2], [1e4; 2]]]), about([[-100.0, -50.0], [100.0, 50.0]]));
    assert_eq!(shown(&[[[61.0, 0.0], [70.0, 5.0]]]), about(near));
    // Without a way all surfaces are; a way that stands still has something about it.
    assert_eq!(view(None, [[[0.0; 2], [4.0, 100.0]]].into_iter()), [[-2.0, -2.0], [6.0, 102.0]]);
    assert_eq!(view(None, std::iter::empty()), [[-5.2; 2], [5.2; 2]]);
    assert_eq!(view(Some([[3.0; 2]; 2]), std::iter::empty()), [[-2.2; 2], [8.2; 2]]);
}

#[test]
fn both_axes_have_one_scale_and_hold_the_way() {
    for (mm, size) in [(176.0, [20.0, 60.0]), (3.0, [4.0, 400.0]), (900.0, [5.0, 5.0]), (0.0, [1.0, 1.0])] {
        let above = above(vec![tile("t", [0.0; 3], size)], along(mm, |_| 1));
        let laid = above.laid(74.0);
        let scale = |axis: &Axis| (axis.high - axis.low) / (axis.pixels[1] - axis.pixels[0]).abs();
        assert!((scale(&laid.x) / scale(&laid.y) - 1.0).abs() < 1e-9, "{mm}");
        let inside = |p: &Point| {
            (laid.x.pixels[0]..=laid.x.pixels[1]).contains(&p[0])
                && (laid.y.pixels[1]..=laid.y.pixels[0]).contains(&p[1])
        };
        assert!(laid.pieces.iter().all(|piece| inside(&piece.from) && inside(&piece.to)), "{mm}");
        // y points up.
        assert!(laid.y.at(1.0) < laid.y.at(0.0) && laid.x.at(1.0) > laid.x.at(0.0));
    }
}

#[test]
fn a_tile_is_drawn_where_it_is() {
    let above = above(vec![tile("left", [-20.0, 10.0, 3.0], [30.0, 12.0])], along(100.0, |_| 0));
    let laid = above.laid(74.0);
    let mut drawn = Svg::new(1.0, 1.0, "");
    let (names, left_out) = laid.surfaces(&mut drawn);
    assert_eq!((names.len(), left_out), (1, 0));
    let drawn = drawn.finish();
    let d = drawn.rsplit_once("<path d=\"").unwrap().1.split_once('z').unwrap().0;
    let corners = &lines_of(d)[0];
    let want =
        [[-35.0, 4.0], [-5.0, 4.0], [-5.0, 16.0], [-35.0, 16.0]].map(|[x, y]| [laid.x.at(x), laid.y.at(y)]);
    for w in want {
        assert!(corners.iter().any(|c| (c[0] - w[0]).hypot(c[1] - w[1]) < 0.2), "{w:?} {corners:?}");
    }
}

#[test]
fn only_what_was_active_is_in_the_legend_with_its_part_of_the_time() {
    let moments = along(80.0, |k| {
        if k < 300 {
            0
        } else if k == 500 {
            0b101
        } else {
            0b1
        }
    });
    let svg = svg(above(vec![tile("a & b", [0.0; 3], [60.0, 30.0])], moments));
    assert!(svg.contains(">stiffness</text>") && svg.contains(">70 %</text>"), "{svg}");
    assert!(svg.contains(">a &lt;texture&gt;</text>") && svg.contains(">0.1 %</text>"));
    assert!(!svg.contains("friction") && !svg.contains(COLOURS[1]));
    assert!(svg.contains(">30 %</text>") && svg.contains("in the air") && svg.contains("a &amp; b"));
    let lanes: Vec<&str> = svg.matches("<title>stiffness</title>").collect();
    assert_eq!(lanes.len(), 1);
}

#[test]
fn parts_of_the_time_are_never_nothing_where_there_is_something() {
    let cases = [
        (0.0, "0 %"),
        (1e-5, "< 0.1 %"),
        (0.004, "0.4 %"),
        (0.0994, "9.9 %"),
        (0.0999, "10 %"),
        (1.0, "100 %"),
    ];
    assert!(cases.iter().all(|(part, text)| percent(*part) == *text));
}

#[test]
fn thousands_of_tiles_have_no_names_and_the_file_stays_small() {
    let field = |side: usize| {
        let at = |i: usize| (i as f64 - 0.5 * side as f64) * 100.0 / side as f64;
        let tiles = (0..side * side)
            .map(|i| tile(&format!("tile {i}"), [at(i % side), at(i / side), 0.0], [0.9, 0.9]));
        let mut moments = along(90.0, |_| 1);
        // From corner to corner.
        moments.iter_mut().for_each(|m| m.at_mm[1] = m.at_mm[0]);
        svg(above(tiles.collect(), moments))
    };
    let thousand = field(32);
    assert!(!thousand.contains("tile ") && !thousand.contains("not drawn"));
    assert!(thousand.len() < 60_000, "{}", thousand.len());
    let many = field(100);
    assert!(many.contains("; 6000 more surfaces are not drawn"), "{}", many.len());
    assert!(many.len() < 160_000, "{}", many.len());
}

#[test]
fn what_is_left_out_is_furthest_from_the_way() {
    // Two rows of tiles, 4000 by the way and 100 away from it.
    let mut tiles: Vec<Seen> =
        (0..100).map(|i| tile("far", [f64::from(i) - 50.0, 40.0, 0.0], [0.4; 2])).collect();
    tiles.extend(
        (0..4000).map(|i| tile("by", [f64::from(i % 400) * 0.25 - 50.0, f64::from(i / 400), 0.0], [0.1; 2])),
    );
    tiles[7].touched = true;
    let above = above(tiles, along(100.0, |_| 1));
    let laid = above.laid(0.0);
    let mut all: Vec<(&Seen, Outline)> =
        above.surfaces.iter().map(|s| (s, Outline::of(&s.surface))).collect();
    laid.nearest_first(&mut all);
    assert!(all[0].0.touched && all[1..4001].iter().all(|(s, _)| s.name == "by"));
}

#[test]
fn names_are_on_their_areas_and_off_each_other() {
    let square = |x: f64, y: f64, w: f64, h: f64| vec![[x, y], [x + w, y], [x + w, y + h], [x, y + h]];
    let name = |name: &str, note: &str, area| Name { name: name.into(), note: note.into(), area };
    let names = [
        name("honey", "", square(0.0, 0.0, 80.0, 60.0)),
        name("floor", "", square(0.0, 0.0, 80.0, 60.0)),
        // Wide enough for the name alone; for both, standing.
        name("1", "sandpaper P36", square(100.0, 0.0, 40.0, 200.0)),
        name("2", "sandpaper P36", square(150.0, 0.0, 40.0, 40.0)),
        name("no room", "", square(200.0, 0.0, 30.0, 30.0)),
        name("a diamond", "", vec![[300.0, 0.0], [360.0, 60.0], [300.0, 120.0], [240.0, 60.0]]),
    ];
    let frame = [[0.0; 2], [1000.0; 2]];
    let written = place(&names, frame, &[]);
    let texts: Vec<String> = written.iter().map(|w| format!("{w:?}")).collect();
    assert_eq!(written.len(), 5, "{texts:?}");
    assert!(texts[2].contains("sandpaper") && texts[2].contains("upright: true"), "{}", texts[2]);
    assert!(!texts[3].contains("sandpaper"), "{}", texts[3]);
    let rect = Written::covers;
    for (i, a) in written.iter().enumerate() {
        for b in &written[..i] {
            let ([la, ha], [lb, hb]) = (rect(a), rect(b));
            assert!(ha[0] <= lb[0] || hb[0] <= la[0] || ha[1] <= lb[1] || hb[1] <= la[1], "{a:?} {b:?}");
        }
    }
    // In the diamond |x - 300| + |y - 60| is 60 at most.
    let [low, high] = rect(&written[4]);
    for (x, y) in [(low[0], low[1]), (high[0], low[1]), (low[0], high[1]), (high[0], high[1])] {
        assert!((x - 300.0).abs() + (y - 60.0).abs() <= 60.0, "{low:?} {high:?}");
    }
    // A way along the top takes the name to the bottom.
    let way: Vec<Point> = (0..40).map(|i| [2.0 * f64::from(i), 8.0]).collect();
    let [low, _] = rect(&place(&names[..1], frame, &way)[0]);
    assert!(low[1] > 20.0, "{low:?}");
}

#[test]
fn nothing_and_what_is_no_number_is_drawn_without_a_fault() {
    let svg_of = |surfaces: Vec<Seen>, moments: Vec<Moment>| svg(above(surfaces, moments));
    assert!(svg_of(Vec::new(), Vec::new()).contains("none"));
    let mut moments = along(10.0, |k| k as u16);
    moments[5].at_mm[0] = f32::NAN;
    moments[9].at_mm[1] = f32::INFINITY;
    svg_of(Vec::new(), moments.clone());
    let pose = |turn| Pose::new([0.0, 3.0, 0.0], turn).unwrap();
    let large = [
        Shape::plane(),
        Shape::sphere(1e5).unwrap(),
        Shape::cuboid([1e5; 3]).unwrap(),
        Shape::sphere(1e-3).unwrap(),
    ];
    for shape in large {
        for turn in [[0.0; 3], [90.0, 0.0, 30.0], [20.0, 30.0, 40.0]] {
            let surface = Surface { shape: shape.clone(), pose: pose(turn) };
            let seen = Seen { surface, soft: true, touched: true, ..tile("x", [0.0; 3], [1.0; 2]) };
            let svg = svg_of(vec![seen], moments.clone());
            let longest = svg
                .split(['M', 'l', ' ', '-', 'a', 'z'])
                .filter_map(|n| n.parse::<f64>().ok())
                .fold(0.0, f64::max);
            assert!(longest < 2.1 * LARGE, "{longest}");
        }
    }
    // No effect has a name.
    svg(Above { effects: Vec::new(), ..above(Vec::new(), along(10.0, |_| u16::MAX)) });
}

/// Colours as seen with all cones, without the long ones, without the middle ones (F. Viénot, H. Brettel, J. Mollon, "Digital video colourmaps for checking the
/// legibility of displays by dichromats", 1999), in CIE Lab under D65.
fn seen_as(hex: &str) -> [[f64; 3]; 3] {
    let linear = |i: usize| {
        let c = f64::from(u8::from_str_radix(&hex[i..i + 2], 16).unwrap()) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    let rgb = [linear(1), linear(3), linear(5)];
    let times = |m: [[f64; 3]; 3], v: [f64; 3]| m.map(|r| r[0] * v[0] + r[1] * v[1] + r[2] * v[2]);
    let cones = [[17.8824, 43.5161, 4.11935], [3.45565, 27.1554, 3.86714], [0.0299566, 0.184309, 1.46709]];
    let [l, m, s] = times(cones, rgb);
    let back = |lms: [f64; 3]| {
        // The inverse of `cones`, as published.
        let inverse = [
            [0.080944447905, -0.130504409160, 0.116721066440],
            [-0.010248533515, 0.054019326636, -0.113614708214],
            [-0.000365296938, -0.004121614686, 0.693511404861],
        ];
        times(inverse, lms).map(|v| v.clamp(0.0, 1.0))
    };
    let all = [rgb, back([2.02344 * m - 2.52581 * s, m, s]), back([l, 0.494207 * l + 1.24827 * s, s])];
    all.map(|rgb| {
        let xyz = times([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]], rgb);
        let f = |t: f64| if t > 0.008856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
        let [x, y, z] = [f(xyz[0] / 0.9505), f(xyz[1]), f(xyz[2] / 1.089)];
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    })
}

/// 2.3 is just noticeable; lines that are thin need several times that.
#[test]
fn colours_are_told_apart_by_those_who_do_not_see_red_or_green() {
    let off = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let seen: Vec<_> = COLOURS.iter().map(|c| seen_as(c)).collect();
    for (i, a) in seen.iter().enumerate() {
        for (j, b) in seen[..i].iter().enumerate() {
            for k in 0..3 {
                assert!(off(a[k], b[k]) > 20.0, "{} {} {k}: {}", COLOURS[i], COLOURS[j], off(a[k], b[k]));
            }
        }
        // On a light ground.
        assert!(a.iter().all(|lab| lab[0] < 80.0), "{}", COLOURS[i]);
    }
}
