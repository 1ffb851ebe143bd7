//! View, legend, names and size of the picture from above.

use asperity_scene::space::{Pose, Shape};

use super::way::tests::lines_of;
use super::*;
use crate::Render;
use crate::svg::text_width;
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

fn above(surfaces: Vec<Seen>, moments: Vec<Moment>) -> SceneMap {
    let effects = ["stiffness", "friction", "a <texture>"].map(String::from).to_vec();
    SceneMap { surfaces, effects, moments, hz: 100.0 }
}

fn svg(above: SceneMap) -> String {
    let svg = Render { title: "T".into(), above: Some(above), ..Render::default() }.to_svg();
    tags(&svg);
    svg
}

#[test]
fn view_holds_the_path_and_near_surfaces() {
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
fn axes_share_a_scale_and_hold_the_path() {
    for (mm, size) in [(176.0, [20.0, 60.0]), (3.0, [4.0, 400.0]), (900.0, [5.0, 5.0]), (0.0, [1.0, 1.0])] {
        let above = above(vec![tile("t", [0.0; 3], size)], along(mm, |_| 1));
        let laid = above.laid(74.0);
        let scale = |axis: &Axis| (axis.high - axis.low) / (axis.pixels[1] - axis.pixels[0]).abs();
        assert!((scale(&laid.panel.x) / scale(&laid.panel.y) - 1.0).abs() < 1e-9, "{mm}");
        let inside = |p: &Point| {
            (laid.panel.x.pixels[0]..=laid.panel.x.pixels[1]).contains(&p[0])
                && (laid.panel.y.pixels[1]..=laid.panel.y.pixels[0]).contains(&p[1])
        };
        assert!(laid.pieces.iter().all(|piece| inside(&piece.from) && inside(&piece.to)), "{mm}");
        // y points up.
        assert!(laid.panel.y.at(1.0) < laid.panel.y.at(0.0) && laid.panel.x.at(1.0) > laid.panel.x.at(0.0));
    }
}

#[test]
fn tile_is_drawn_at_its_place() {
    let above = above(vec![tile("left", [-20.0, 10.0, 3.0], [30.0, 12.0])], along(100.0, |_| 0));
    let laid = above.laid(74.0);
    let mut drawn = Svg::new(1.0, 1.0, "");
    let outlines: Vec<_> = above.surfaces.iter().map(|seen| (seen, outline(&seen.surface))).collect();
    assert_eq!(laid.draw_surfaces(&mut drawn, &outlines).len(), 1);
    let drawn = drawn.finish();
    let d = drawn.rsplit_once("<path d=\"").unwrap().1.split_once('z').unwrap().0;
    let corners = &lines_of(d)[0];
    let want = [[-35.0, 4.0], [-5.0, 4.0], [-5.0, 16.0], [-35.0, 16.0]]
        .map(|[x, y]| [laid.panel.x.at(x), laid.panel.y.at(y)]);
    for w in want {
        assert!(corners.iter().any(|c| (c[0] - w[0]).hypot(c[1] - w[1]) < 0.2), "{w:?} {corners:?}");
    }
}

#[test]
fn legend_lists_active_effects_with_their_share() {
    let moments = along(80.0, |k| match k {
        0..300 => 0,
        500 => 0b101,
        _ => 0b1,
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
fn bars_mark_active_times_and_merge() {
    let x = Axis::linear((0.0, 10.0), [100.0, 1100.0]);
    let bars = |moments: Vec<Moment>, hz: f64| SceneMap { hz, ..above(Vec::new(), moments) }.bars(0, &x);
    // 1000 ticks of a pixel.
    let found = bars(along(50.0, |k| u16::from((200..300).contains(&k) || k == 700 || k == 703)), 100.0);
    let wanted = [[300.0, 400.0], [800.0, 801.0], [803.0, 804.0]];
    let off = found.iter().flatten().zip(wanted.iter().flatten()).map(|(a, b)| (a - b).abs());
    assert!(found.len() == 3 && off.fold(0.0, f64::max) < 1e-9, "{found:?}");
    let some = |count: u32, active: fn(u32) -> bool| -> Vec<Moment> {
        (0..count).map(|k| Moment { effects: u16::from(active(k)), ..Moment::default() }).collect()
    };
    // 100 ticks a pixel, of which every other one is active.
    let found = bars(some(300_000, |k| k % 2 == 1), 1e4);
    assert!(found.len() == 1 && (found[0][0] - 100.0).abs() < 0.1 && found[0][1] == 1100.0, "{found:?}");
    assert!(bars(some(20_000, |k| k % 4 < 2), 2000.0).len() <= 501);
    for hz in [0.0, f64::NAN, f64::INFINITY] {
        let found = bars(along(50.0, |_| 1), hz);
        assert!(found.iter().flatten().all(|v| v.is_nan() || (100.0..=1101.0).contains(v)), "{found:?}");
    }
}

#[test]
fn small_shares_are_not_written_as_zero() {
    for (part, text) in [
        (0.0, "0 %"),
        (1e-5, "< 0.1 %"),
        (0.004, "0.4 %"),
        (0.0994, "9.9 %"),
        (0.0999, "10 %"),
        (1.0, "100 %"),
    ] {
        assert_eq!(percent(part), text);
    }
}

/// A square field of tiles of a size, and a way over it from corner to corner.
fn field(side: usize, size: f64) -> (Vec<Seen>, Vec<Moment>) {
    let at = |i: usize| (i as f64 - 0.5 * side as f64) * 100.0 / side as f64;
    let tiles =
        (0..side * side).map(|i| tile(&format!("t{i}"), [at(i % side), at(i / side), 0.0], [size; 2]));
    let mut way = along(90.0, |_| 1);
    way.iter_mut().for_each(|m| m.at_mm[1] = m.at_mm[0]);
    (tiles.collect(), way)
}

#[test]
fn thousands_of_tiles_are_a_small_file_without_names() {
    let drawn = |side: usize| {
        let (tiles, way) = field(side, 0.9);
        svg(above(tiles, way))
    };
    let (thousand, many) = (drawn(32), drawn(100));
    assert!(!thousand.contains(">t5") && !thousand.contains("not drawn"));
    assert!(thousand.len() < 80_000, "{}", thousand.len());
    assert!(many.contains("; 6000 more surfaces are not drawn"), "{}", many.len());
    assert!(many.len() < 240_000, "{}", many.len());
}

/// Texts of a picture with their bounds, but for upright ones.
fn covered_by_texts(svg: &str) -> Vec<(String, Bounds)> {
    // Typefaces that are wider than the estimate, bold ones more so.
    let size = |class: &str| match class {
        "title" => (19.0, 1.2),
        "head" => (13.0, 1.2),
        "small" => (11.0, 1.08),
        "wire" => (10.5, 1.08),
        _ => (12.0, 1.08),
    };
    let length = |text: &str, class: &str| {
        let text = text.replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">");
        text_width(&text, size(class).0) * size(class).1
    };
    let attribute = |tag: &str, name: &str| {
        tag.split_once(&format!("{name}=\""))
            .map_or(String::new(), |(_, rest)| rest.split('"').next().unwrap().into())
    };
    let text = |part: &str| {
        let (tag, rest) = part.split_once('>').unwrap();
        let body = rest.split_once("</text>").unwrap().0;
        let [x, y] = ["x", "y"].map(|k| attribute(tag, &format!(" {k}")).parse::<f64>().unwrap());
        let (text, long) = match body.split_once("</tspan><tspan dx=\"9\">") {
            Some((head, after)) => {
                let (head, after) =
                    (head.split_once('>').unwrap().1, after.strip_suffix("</tspan>").unwrap());
                (format!("{head} {after}"), length(head, "head") + 9.0 + length(after, ""))
            }
            None => (body.to_owned(), length(body, &attribute(tag, "class"))),
        };
        let high = size(&attribute(tag, "class")).0;
        let left = match attribute(tag, "text-anchor").as_str() {
            "middle" => x - 0.5 * long,
            "end" => x - long,
            _ => x,
        };
        (text, [[left, y - 0.76 * high], [left + long, y + 0.24 * high]])
    };
    svg.split("<text ")
        .skip(1)
        .filter(|part| !part.starts_with("transform"))
        .map(|part| text(&format!(" {part}")))
        .collect()
}

#[test]
fn texts_do_not_overlap_and_stay_on_the_page() {
    let names: [String; 11] =
        std::array::from_fn(|i| format!("{:14}", ["stiffness", "autoregressive"][i % 2]).trim().into());
    for count in [0, 1, 6, 11] {
        let above = SceneMap {
            effects: names.to_vec(),
            ..above(vec![tile("a tile", [0.0; 3], [20.0, 60.0])], along(176.0, |_| (1 << count) - 1))
        };
        let position =
            crate::Series::sampled("position", "mm", 100.0, vec![1.0; 3000]).with_columns(&["x", "y", "z"]);
        let render = Render {
            title: "T".into(),
            subtitle: "of 500 Hz".into(),
            above: Some(above),
            ..Render::default()
        };
        let svg = Render { position: Some(position), active: vec![(1.0, 2.0)], ..render }.to_svg();
        let texts = covered_by_texts(&svg);
        assert!(
            texts.len() > 25 + 2 * count && texts.iter().any(|(text, _)| text == "Effects along the way")
        );
        for (i, (text, [low, high])) in texts.iter().enumerate() {
            assert!(low[0] > 0.0 && high[0] < 1200.0, "{text}: {low:?} {high:?}");
            // What stands beside the map ends where the panels do.
            assert!(low[0] < ASIDE || low[0] > END || high[0] <= END + 0.1, "{text}: {high:?}");
            for (other, [l, h]) in &texts[..i] {
                // Two apart at least where they are in a row.
                let apart = high[0] + 2.0 < l[0] || h[0] + 2.0 < low[0] || high[1] <= l[1] || h[1] <= low[1];
                assert!(apart, "{count}: {text} over {other}: {low:?} {high:?} {l:?} {h:?}");
            }
        }
        // The next heading is not in the last rows of the legend.
        let bottom = texts.iter().find(|(text, _)| text == "beginning, end").unwrap().1[1][1];
        let next = |text: &str| texts.iter().find(|(t, _)| t.starts_with(text)).unwrap().1[0][1];
        assert!(next(if count > 0 { "Effects active" } else { "Position" }) > bottom + 30.0);
    }
}

#[test]
fn names_are_on_their_areas_and_off_each_other() {
    let frame = [[0.0; 2], [1000.0; 2]];
    let area = |[x, y, w, h]: [f64; 4]| [[x, y], [x + w, y + h]];
    let named = |name: &str, note: &str| Seen { note: note.into(), ..tile(name, [0.0; 3], [1.0; 2]) };
    let long = "a name of many words that nobody would ever give to a surface";
    let cases = [
        (named("honey", ""), [0.0, 0.0, 80.0, 60.0]),
        (named("floor", ""), [0.0, 0.0, 80.0, 60.0]),
        (named("1", "sandpaper P36"), [100.0, 0.0, 240.0, 200.0]),
        (named("2", "sandpaper P36"), [350.0, 0.0, 40.0, 40.0]),
        (named(long, "leather"), [500.0, 0.0, 190.0, 60.0]),
        (named("a wall", ""), [1000.0, 300.0, 0.0, 100.0]),
    ];
    let areas: Vec<(&Seen, Bounds)> = cases.iter().map(|(seen, at)| (seen, area(*at))).collect();
    let mut svg = Svg::new(1000.0, 1000.0, "");
    assert_eq!(draw_names(&mut svg, &areas, frame), 6);
    let found = covered_by_texts(&svg.finish());
    let texts: Vec<&str> = found.iter().map(|(text, _)| text.as_str()).collect();
    assert_eq!(texts[..4], ["honey", "floor", "1 \u{b7} sandpaper P36", "2"]);
    assert!(texts[4].ends_with('\u{2026}') && texts[5] == "a wall", "{texts:?}");
    for (i, (text, at)) in found.iter().enumerate() {
        assert!(i == 5 || meet(*at, areas[i].1), "{text} {at:?}");
        assert!(at[1][0] - at[0][0] < 300.0 && at[1][0] <= 1000.0, "{text} {at:?}");
        assert!(found[..i].iter().all(|(_, other)| !meet(*at, *other)), "{text} {at:?}");
    }
    // Names without room are left out.
    let here: Vec<_> =
        (0..16).map(|i| (areas[0].0, area([500.0 + f64::from(i % 4) * 20.0, 500.0, 20.0, 20.0]))).collect();
    let written = draw_names(&mut Svg::new(1.0, 1.0, ""), &here, frame);
    assert!((1..16).contains(&written), "{written}");
}

#[test]
fn tile_name_is_off_all_lanes() {
    // 85 pixels wide, 5 lanes above and below a way to and fro.
    let mut moments = along(176.0, |_| 0b1_1111);
    let back: Vec<Moment> = moments.iter().rev().copied().collect();
    moments.extend(back);
    let mut tiles = vec![tile("network", [-80.0, 0.0, 0.0], [20.0, 60.0])];
    tiles[0].note = "canvas".into();
    let effects = ["a", "b", "c", "d", "e"].map(String::from).to_vec();
    let svg = svg(SceneMap { effects, ..above(tiles, moments) });
    let lanes = svg.lines().filter(|line| line.contains(&format!("stroke-width=\"{LANE}\"><title>")));
    let ends: Vec<f64> = lanes
        .flat_map(|line| lines_of(line.split('"').nth(1).unwrap()))
        .flatten()
        .flat_map(|[_, y]| [y - 0.5 * LANE, y + 0.5 * LANE])
        .collect();
    let (top, bottom) = ends.iter().fold((f64::MAX, f64::MIN), |(a, b), y| (a.min(*y), b.max(*y)));
    assert!((29.0..36.0).contains(&(bottom - top)), "{top} {bottom}");
    let words: Vec<_> = covered_by_texts(&svg)
        .into_iter()
        .filter(|(t, _)| t.contains("network") || t.contains("canvas"))
        .collect();
    assert!(!words.is_empty());
    assert!(
        words.iter().all(|(_, [low, high])| high[1] < top || low[1] > bottom),
        "{words:?} {top} {bottom}"
    );
}

#[test]
fn left_out_names_are_counted_and_touched_ones_kept() {
    let (mut tiles, way) = field(8, 9.0);
    let none = svg(above(tiles.clone(), way.clone()));
    assert!(none.contains("mm; 64 names are left out<") && !none.contains(">t36<"));
    tiles[36].touched = true;
    let one = svg(above(tiles, way.clone()));
    assert!(one.contains("mm; 63 names are left out<") && one.contains(">t36<"));
    let few = svg(above(field(4, 9.0).0, way));
    assert!(few.contains(">x and y, mm<") && (0..16).all(|i| few.contains(&format!(">t{i}<"))));
}

#[test]
fn times_cover_any_named_effect() {
    let moments = along(50.0, |k| match k {
        0..100 => 0b1,
        100..150 => 0b11,
        150..200 => 0b100,
        200..300 => 0b1,
        300..1000 => 0b10,
        _ => 0,
    });
    let above = above(Vec::new(), moments);
    assert_eq!(above.times(&["friction"]), [(1.0, 1.5), (3.0, 10.0)]);
    assert_eq!(above.times(&["a <texture>", "friction", "nothing"]), [(1.0, 2.0), (3.0, 10.0)]);
    assert_eq!(above.times(&["nothing"]), []);
}

#[test]
fn empty_and_not_finite_scenes_are_drawn() {
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
                .split(['M', 'l', ' ', '-', 'z'])
                .filter_map(|n| n.parse::<f64>().ok())
                .fold(0.0, f64::max);
            assert!(longest < 5e3, "{longest}");
        }
    }
    // No effect has a name.
    svg(SceneMap { effects: Vec::new(), ..above(Vec::new(), along(10.0, |_| u16::MAX)) });
}

/// Colours as seen with all cones, without the long ones, without the middle ones, in CIE Lab under D65
/// (F. Viénot, H. Brettel, J. Mollon, "Digital video colourmaps for checking the legibility of displays by
/// dichromats", 1999).
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

/// A distance of 2.3 is just noticeable; thin lines need several times that.
#[test]
fn colours_differ_with_red_green_blindness() {
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
