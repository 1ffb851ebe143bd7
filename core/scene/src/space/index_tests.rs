use std::sync::{Arc, OnceLock};

use super::*;
use crate::space::{HeightGrid, Pose, Shape};
use asperity_numbers::Random;
use proptest::prelude::*;

fn at(shape: Shape, place: [f64; 3], turn: [f64; 3]) -> Entry {
    Entry { surface: Surface { shape, pose: Pose::new(place, turn).unwrap() }, reach_mm: 0.0 }
}

fn flat(shape: Shape, place: [f64; 3]) -> Entry {
    at(shape, place, [0.0; 3])
}

fn sheet(size: f64, thickness: f64) -> Shape {
    Shape::rectangle([size; 2], thickness).unwrap()
}

/// Answers as the index must, by brute force over every entry.
fn brute_force(index: &Index, point: [f64; 3], last: Option<Hold>) -> Option<Hold> {
    let step = |depth: f64| (depth * 8192.0).floor();
    let felt = |entry: &Entry, depth: f64| match entry.reach_mm {
        0.0 => depth >= 1e-6,
        reach => depth >= -reach,
    };
    let h = index.hysteresis_mm;
    let held = last.and_then(|hold| {
        let entry = index.entries().get(hold.entry as usize)?;
        let touch = entry.surface.touch(point, Some(hold.feature), h)?;
        felt(entry, touch.depth_mm).then_some((touch.depth_mm, Hold { feature: touch.feature, ..hold }))
    });
    let mut best: Option<(f64, u32)> = None;
    for (number, entry) in index.entries().iter().enumerate() {
        let depth = entry.surface.depth_mm(point);
        if felt(entry, depth) && best.is_none_or(|b| step(depth) > step(b.0)) {
            best = Some((depth, number as u32));
        }
    }
    if let Some((depth, hold)) = held
        && best.is_none_or(|b| step(b.0) <= step(if depth < 0.0 { (depth + h).min(0.0) } else { depth + h }))
    {
        return Some(hold);
    }
    let (_, entry) = best?;
    let touch = index.entries()[entry as usize].surface.touch(point, None, h)?;
    Some(Hold { entry, feature: touch.feature })
}

fn grid() -> Arc<HeightGrid> {
    static GRID: OnceLock<Arc<HeightGrid>> = OnceLock::new();
    let make = || {
        let mut random = Random::new(3);
        let heights = (0..32 * 32).map(|_| random.range(-0.3, 0.3) as f32).collect();
        Arc::new(HeightGrid::new(32, heights, [0.25; 2], true).unwrap())
    };
    GRID.get_or_init(make).clone()
}

/// A scene of random shapes, within `room` of the middle.
fn scene(random: &mut Random, count: usize, room: f64, turns: usize) -> Vec<Entry> {
    let few: Vec<[f64; 3]> = (0..3).map(|_| [0.0; 3].map(|_: f64| random.range(-180.0, 180.0))).collect();
    let kinds = 1 + random.below(31);
    let mut entries: Vec<Entry> = Vec::new();
    while entries.len() < count {
        if random.chance(0.1) && !entries.is_empty() {
            let mut again = entries[random.below(entries.len())].clone();
            again.reach_mm *= random.range(0.0, 2.0);
            entries.push(again);
            continue;
        }
        let kind = random.below(5);
        if kinds >> kind & 1 == 0 {
            continue;
        }
        let mut size = || random.range(0.5, 12.0);
        let shape = match kind {
            0 => Shape::plane(),
            1 => Shape::rectangle([size(), size()], size() / 4.0).unwrap(),
            2 => Shape::sphere(size()).unwrap(),
            3 => Shape::cuboid([size(), size(), size()]).unwrap(),
            _ => Shape::relief(grid(), Some([size(), size()]), size() / 12.0, size() / 4.0).unwrap(),
        };
        let turn = match turns {
            0 => [0.0; 3],
            1 => [0.0; 3].map(|_: f64| 90.0 * random.below(4) as f64),
            2 => few[random.below(few.len())],
            3 => [random.range(-9.0, 9.0), random.range(-9.0, 9.0), random.range(-180.0, 180.0)],
            _ => [0.0; 3].map(|_: f64| random.range(-180.0, 180.0)),
        };
        // Planes everywhere would leave no free place.
        let away = if kind == 0 { room } else { 0.0 };
        let mut place =
            [random.range(-room, room), random.range(-room, room), random.range(-room, room) - away];
        // Some lie apart.
        if kind > 0 && random.chance(0.2) {
            place[random.below(3)] += random.range(-1.0, 1.0) * 10f64.powf(random.range(0.0, 4.0));
        }
        let reach = if random.chance(0.3) { random.range(0.0, 4.0) } else { 0.0 };
        entries.push(Entry { reach_mm: reach, ..at(shape, place, turn) });
    }
    entries
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn index_matches_brute_force(
        seed in 0..u64::MAX,
        count in prop_oneof![1..6usize, 6..80usize, 80..400usize],
        room in prop_oneof![Just(0.0), Just(1.0), Just(15.0), Just(60.0)],
        turns in 0..5usize,
        hysteresis in prop_oneof![Just(0.0), Just(0.1), Just(1.0)],
        step in prop_oneof![Just(0.01), Just(0.3), Just(3.0)],
        away in prop_oneof![Just(0.0), Just(9e4)],
        reaching in 0..3usize,
    ) {
        let mut random = Random::new(seed);
        let mut entries = scene(&mut random, count, room, turns);
        for entry in &mut entries {
            // Also where floating-point numbers are coarse.
            entry.surface.pose = entry.surface.pose.moved([away, -away, away]);
            // None, some or all reach beyond themselves.
            entry.reach_mm = [0.0, entry.reach_mm, entry.reach_mm + 0.1][reaching];
        }
        let index = Index::new(entries, hysteresis).unwrap();
        let mut point = [0.0; 3].map(|_: f64| random.range(-room - 5.0, room + 5.0));
        let mut held = None;
        for tick in 0..150 {
            // Also exactly on planes, edges and middles.
            let asked = if tick % 10 == 9 { point.map(f64::round) } else { point };
            let asked = [asked[0] + away, asked[1] - away, asked[2] + away];
            let found = index.find(asked, held);
            prop_assert_eq!(found.map(|f| f.hold()), brute_force(&index, asked, held), "{:?}", asked);
            if let Some(found) = found {
                let surface = &index.entries()[found.entry as usize].surface;
                let last = held.filter(|l: &Hold| l.entry == found.entry).map(|l| l.feature);
                prop_assert_eq!(Some(found.touch), surface.touch(asked, last, hysteresis));
            }
            held = found.map(|f| f.hold());
            if tick % 40 == 39 {
                // A hold from anywhere.
                held = Some(Hold {
                    entry: random.below(count + 2) as u32,
                    feature: random.below(8) as u8,
                });
            }
            point.iter_mut().for_each(|x| *x += random.range(-step, step) - 0.02 * step * *x);
        }
    }
}

#[test]
fn nearest_in_reach_is_found_and_a_touched_one_goes_first() {
    let ball = |x, reach_mm| Entry { reach_mm, ..flat(Shape::sphere(2.0).unwrap(), [x, 0.0, 0.0]) };
    let index = Index::new(vec![ball(0.0, 3.0), ball(10.0, 5.0), ball(-5.0, 0.0)], 0.5).unwrap();
    let near = |x, last: Option<u32>| {
        let found = index.find([x, 0.0, 0.0], last.map(|entry| Hold { entry, feature: 0 }))?;
        Some((found.entry, (found.touch.depth_mm * 10.0).round() / 10.0))
    };
    assert_eq!(near(4.0, None), Some((0, -2.0)));
    assert_eq!(
        [near(-4.0, None), near(-4.0, Some(0))],
        [Some((2, 1.0)); 2],
        "touched, though it does not reach"
    );
    assert_eq!(near(5.2, None), Some((1, -2.8)));
    assert_eq!([near(5.2, Some(0)), near(5.3, Some(0))], [Some((1, -2.8)), Some((1, -2.7))]);
    assert_eq!([near(4.9, Some(0)), near(4.9, Some(1))], [Some((0, -2.9)), Some((1, -3.1))]);
    assert_eq!([near(1.0, None), near(-8.5, None), near(17.1, None)], [Some((0, 1.0)), None, None]);
}

#[test]
fn no_surfaces_and_no_point_are_no_contact() {
    let empty = Index::new(vec![], 0.1).unwrap();
    assert_eq!(empty.find([0.0; 3], None), None);
    let hold = Some(Hold { entry: 0, feature: 0 });
    for reach_mm in [0.0, 1.0] {
        let plane = Index::new(vec![Entry { reach_mm, ..flat(Shape::plane(), [0.0; 3]) }], 0.1).unwrap();
        for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e300, -2e6] {
            for point in [[bad, 0.0, -1.0], [0.0, bad, -1.0], [0.0, 0.0, bad]] {
                assert_eq!((plane.find(point, None), plane.find(point, hold)), (None, None), "{point:?}");
            }
        }
        assert_eq!(plane.find([0.0; 3], None).is_some(), reach_mm > 0.0, "on the surface is not in it");
    }
}

#[test]
fn indices_that_cannot_be_are_refused() {
    let one = |reach_mm| vec![Entry { reach_mm, ..flat(Shape::plane(), [0.0; 3]) }];
    let error = |entries, hysteresis| Index::new(entries, hysteresis).unwrap_err().to_string();
    assert!(error(one(-1.0), 0.1).starts_with("surface 0 reaches -1 mm (from 0"));
    assert!(error(one(f64::NAN), 0.1).contains("NaN"));
    assert!(error(one(0.0), -0.1).starts_with("a hysteresis of -0.1 mm"));
    assert!(error(one(0.0), f64::INFINITY).contains("inf"));
}

/// Makes a surface from its number and the number of all surfaces.
type Make = fn(usize, usize, &mut Random) -> Entry;

fn tile(number: usize, count: usize) -> [f64; 3] {
    let side = (count as f64).sqrt().ceil() as usize;
    let at = |k: usize| 5.0 * (k as f64 - (side / 2) as f64);
    [at(number % side), at(number / side), 0.0]
}

/// Scenes with all surfaces near the stylus or in its way.
fn crowds() -> Vec<(&'static str, Make)> {
    vec![
        ("tiles", |i, n, _| flat(sheet(5.0, 3.0), tile(i, n))),
        ("stack", |i, _, _| flat(sheet(50.0, 2.0), [0.0, 0.0, -1e-3 * i as f64])),
        ("spheres in each other", |i, n, _| {
            flat(Shape::sphere(10.0 + 10.0 * i as f64 / n as f64).unwrap(), [0.0, 0.0, -20.0])
        }),
        ("uneven tiles", |i, n, r| {
            let [x, y, _] = tile(i, n).map(|x| 0.8 * x);
            let turn = [r.range(-10.0, 10.0), r.range(-10.0, 10.0), r.range(0.0, 90.0)];
            at(sheet(5.0, 3.0), [x, y, r.range(-0.5, 0.5)], turn)
        }),
        ("rectangles on one spot", |_, _, r| {
            let place = [r.range(-2.0, 2.0), r.range(-2.0, 2.0), r.range(-2.0, 2.0)];
            at(sheet(50.0, 3.0), place, [0.0, 0.0, r.range(0.0, 360.0)])
        }),
        ("one, and others far", |i, n, _| match i {
            0 => flat(sheet(40.0, 3.0), [0.0; 3]),
            _ => {
                let [x, y, _] = tile(i, n);
                flat(sheet(5.0, 3.0), [x + 1000.0, y, 0.0])
            }
        }),
    ]
}

#[test]
fn tick_looks_at_few_of_10000_surfaces() {
    for (name, make) in crowds() {
        for count in [1, 100, 10_000] {
            let mut random = Random::new(7);
            let entries = (0..count).map(|i| make(i, count, &mut random)).collect();
            let index = Index::new(entries, 0.1).unwrap();
            let (mut hold, mut greatest) = (None, 0);
            for tick in 0..4000 {
                let t = f64::from(tick) * 0.002;
                let point = [9.0 * (3.1 * t).sin(), 9.0 * (1.7 * t).cos(), 1.5 * (6.1 * t).sin()];
                greatest = greatest.max(index.looks(point, hold));
                hold = index.find(point, hold).map(|c| c.hold());
            }
            // A box says little of how deep a point lies under one of many turned sheets on one spot.
            let most = if name == "rectangles on one spot" { 600 } else { 60 };
            assert!(greatest <= most, "{name}: {greatest} looks among {count}");
        }
    }
}

#[test]
fn clusters_at_every_scale_are_found() {
    // Each cluster is twice as far off as the one before.
    for each in [1, 40, 400] {
        let place = |cluster: i32, i: i32| {
            let off = 9e4 * 0.5_f64.powi(cluster);
            [off, 1e-2 * off * f64::from(i) / f64::from(each), 0.0]
        };
        let places: Vec<[f64; 3]> = (0..26).flat_map(|c| (0..each).map(move |i| place(c, i))).collect();
        let entries = places.iter().map(|p| flat(Shape::sphere(1e-3).unwrap(), *p)).collect();
        let index = Index::new(entries, 0.0).unwrap();
        for place in places.iter().step_by(places.len().div_ceil(200)) {
            let point = [place[0] + 5e-4, place[1], place[2]];
            let found = index.find(point, None).map(|c| c.hold());
            assert_eq!(found, brute_force(&index, point, None), "{point:?}");
            assert!(found.is_some());
        }
    }
}
