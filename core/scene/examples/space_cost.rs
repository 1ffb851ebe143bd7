//! Measures the cost of finding the touched surface among 1 to 10000:
//! `cargo run --release --example space_cost [SCENE]`.
//!
//! Strokes run at 100 mm/s and at 1 m/s under 500 Hz. The figures are nanoseconds per query, build time,
//! and bytes of the index per entry. Each tick counts with the least time of seven runs. So the worst
//! time is that of the query and not of the machine.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use asperity_numbers::Random;
use asperity_scene::space::{Contact, Entry, HeightGrid, Hold, Index, Pose, Shape, Surface};

const TICKS: usize = 4000;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;
type Make = fn(usize, usize, &mut Random) -> Result<(Shape, [f64; 3], [f64; 3])>;

fn turn(r: &mut Random) -> [f64; 3] {
    [r.range(-180.0, 180.0), r.range(-180.0, 180.0), r.range(-180.0, 180.0)]
}

fn near(r: &mut Random, mm: f64) -> [f64; 3] {
    [r.range(-mm, mm), r.range(-mm, mm), r.range(-mm, mm)]
}

fn tile(i: usize, n: usize, mm: f64) -> [f64; 3] {
    let side = (n as f64).sqrt().ceil() as usize;
    let at = |k: usize| (k as f64 - (side / 2) as f64) * mm;
    [at(i % side), at(i / side), 0.0]
}

fn scenes() -> Vec<(&'static str, f64, Make)> {
    vec![
        ("one among balls", 0.4, |i, _, r| match i {
            0 => Ok((Shape::rectangle([60.0, 60.0], 3.0)?, [0.0; 3], [0.0; 3])),
            // Above it, as near as 3 mm.
            _ => Ok((
                Shape::sphere(1.0)?,
                [r.range(-30.0, 30.0), r.range(-30.0, 30.0), r.range(4.0, 34.0)],
                [0.0; 3],
            )),
        }),
        ("one, others far", 0.4, |i, n, r| match i {
            0 => Ok((Shape::rectangle([60.0, 60.0], 3.0)?, [0.0; 3], [0.0; 3])),
            _ => {
                let [x, y, _] = tile(i, n, 5.0);
                Ok((Shape::rectangle([5.0, 5.0], 3.0)?, [x + 1000.0, y, r.range(-5.0, 5.0)], turn(r)))
            }
        }),
        ("tiles", 0.4, |i, n, _| Ok((Shape::rectangle([5.0, 5.0], 3.0)?, tile(i, n, 5.0), [0.0; 3]))),
        ("tiles tilted", 0.4, |i, n, _| {
            let tilt = [30.0, 20.0, 10.0];
            let at = Pose::new([0.0; 3], tilt)?.to_world(tile(i, n, 5.0));
            Ok((Shape::rectangle([5.0, 5.0], 3.0)?, at, tilt))
        }),
        ("tiles uneven", 0.4, |i, n, r| {
            let [x, y, _] = tile(i, n, 4.0);
            let tilt = [r.range(-10.0, 10.0), r.range(-10.0, 10.0), r.range(0.0, 90.0)];
            Ok((Shape::rectangle([5.0, 5.0], 3.0)?, [x, y, r.range(-0.5, 0.5)], tilt))
        }),
        ("stack 1 um", 0.0, |i, _, _| {
            Ok((Shape::rectangle([50.0, 50.0], 2.0)?, [0.0, 0.0, -1e-3 * i as f64], [0.0; 3]))
        }),
        ("stack 0.1 mm", 0.0, |i, _, _| {
            Ok((Shape::rectangle([50.0, 50.0], 2.0)?, [0.0, 0.0, -0.1 * i as f64], [0.0; 3]))
        }),
        ("concentric spheres", 15.0, |i, n, _| {
            Ok((Shape::sphere(10.0 + 10.0 * i as f64 / n as f64)?, [0.0; 3], [0.0; 3]))
        }),
        ("spheres near", 10.0, |_, _, r| Ok((Shape::sphere(10.0)?, near(r, 2.0), [0.0; 3]))),
        ("planes same", 1.0, |_, _, _| Ok((Shape::plane(), [0.0; 3], [0.0; 3]))),
        ("planes coincident", 1.0, |_, _, r| {
            Ok((
                Shape::plane(),
                [r.range(-50.0, 50.0), r.range(-50.0, 50.0), 0.0],
                [0.0, 0.0, r.range(0.0, 360.0)],
            ))
        }),
        ("planes parallel", 1.0, |i, _, _| Ok((Shape::plane(), [0.0, 0.0, -1e-3 * i as f64], [0.0; 3]))),
        ("planes bundle", 5.0, |_, _, r| Ok((Shape::plane(), near(r, 1.0), turn(r)))),
        ("planes bowl", 19.9, |_, _, r| {
            let turn = turn(r);
            Ok((Shape::plane(), Pose::new([0.0; 3], turn)?.to_world([0.0, 0.0, -20.0]), turn))
        }),
        ("boxes near", 9.0, |_, _, r| Ok((Shape::cuboid([20.0, 20.0, 20.0])?, near(r, 2.0), [0.0; 3]))),
        ("boxes near, turned", 9.0, |_, _, r| {
            Ok((Shape::cuboid([20.0, 20.0, 20.0])?, near(r, 2.0), [30.0, 20.0, 10.0]))
        }),
        ("boxes near, any turn", 13.0, |_, _, r| {
            Ok((Shape::cuboid([20.0, 20.0, 20.0])?, near(r, 2.0), turn(r)))
        }),
        ("rectangles near", 1.0, |_, _, r| {
            let at = near(r, 2.0);
            Ok((Shape::rectangle([50.0, 50.0], 3.0)?, at, [0.0, 0.0, r.range(0.0, 360.0)]))
        }),
        ("rectangles, any turn", 8.0, |_, _, r| {
            Ok((Shape::rectangle([50.0, 50.0], 3.0)?, near(r, 2.0), turn(r)))
        }),
        ("spheres apart", 100.0, |_, _, r| Ok((Shape::sphere(r.range(1.0, 8.0))?, near(r, 100.0), [0.0; 3]))),
        ("boxes apart, any turn", 100.0, |_, _, r| {
            let size = [r.range(2.0, 10.0), r.range(2.0, 10.0), r.range(2.0, 10.0)];
            Ok((Shape::cuboid(size)?, near(r, 100.0), turn(r)))
        }),
        ("dome of tiles", 50.3, |i, n, _| {
            let z = 1.0 - (2 * i + 1) as f64 / n as f64;
            let (tilt, around) = (z.acos().to_degrees(), (i as f64 * 137.507_764).rem_euclid(360.0));
            let pose = Pose::new([0.0; 3], [0.0, tilt, around])?;
            let size = (4.0 * std::f64::consts::PI * 2500.0 / n as f64).sqrt().min(60.0);
            Ok((Shape::rectangle([size; 2], 3.0)?, pose.to_world([0.0, 0.0, 50.0]), [0.0, tilt, around]))
        }),
        ("far away", 5.0, |i, n, r| {
            let [x, y, _] = tile(i, n, 5.0);
            Ok((Shape::rectangle([5.0, 5.0], 3.0)?, [x + 1000.0, y, r.range(-5.0, 5.0)], turn(r)))
        }),
    ]
}

fn main() -> Result<()> {
    let only = std::env::args().nth(1);
    let relief = relief()?;
    let mut all = scenes();
    // Reliefs share their heights. These two are filled in below.
    all.push(("reliefs", 0.6, |i, n, _| Ok((Shape::plane(), tile(i, n, 5.0), [0.0; 3]))));
    all.push(("reliefs on one spot", 1.0, |_, _, r| Ok((Shape::plane(), near(r, 2.0), [0.0; 3]))));
    let empty = empty();
    println!(
        "one query: median, 99th percentile, worst in ns; \
         deepest at 100 mm/s | at 1 m/s | nearest at 100 mm/s"
    );
    for (name, height, make) in all {
        if only.as_ref().is_some_and(|o| !name.contains(o.as_str())) {
            continue;
        }
        println!("{name}");
        for n in [1, 10, 100, 1000, 10_000] {
            let entries = |reach_mm: f64| -> Result<Vec<Entry>> {
                let mut random = Random::new(7);
                (0..n)
                    .map(|i| {
                        let (mut shape, place, turn) = make(i, n, &mut random)?;
                        if name.starts_with("reliefs") {
                            let side = if name == "reliefs" { 5.0 } else { 50.0 };
                            shape = Shape::relief(relief.clone(), Some([side; 2]), 1.0, 3.0)?;
                        }
                        let surface = Surface { shape, pose: Pose::new(place, turn)? };
                        Ok(Entry { surface, reach_mm })
                    })
                    .collect()
            };
            let (plain, reaching) = (entries(0.0)?, Index::new(entries(2.0)?, 0.1)?);
            let builds = (0..5).map(|_| {
                let entries = plain.clone();
                let start = Instant::now();
                let made = Index::new(entries, 0.1);
                (start.elapsed().as_secs_f64() * 1e3, made)
            });
            let (ms, index) = builds.min_by(|a, b| a.0.total_cmp(&b.0)).ok_or("no build")?;
            let index = index?;
            let deepest = |step| walk(height, step, empty, |at, hold| index.deepest(at, hold));
            let nearest = walk(height + 1.0, 0.2, empty, |at, hold| reaching.nearest(at, hold));
            println!(
                "  {n:6} {} | {} | {}   built in {ms:6.2} ms, {:3} B each",
                said(&deepest(0.2)),
                said(&deepest(2.0)),
                said(&nearest),
                index.bytes() / n
            );
        }
    }
    println!("an entry itself: {} B", size_of::<Entry>());
    Ok(())
}

fn relief() -> Result<Arc<HeightGrid>> {
    let mut random = Random::new(3);
    let heights = (0..64 * 64).map(|_| random.range(-0.1, 0.1) as f32).collect();
    Ok(Arc::new(HeightGrid::new(64, heights, [0.25; 2], true)?))
}

/// Time of the clock itself, in ns.
fn empty() -> f64 {
    let mut all: Vec<f64> = (0..10_000).map(|_| Instant::now().elapsed().as_secs_f64() * 1e9).collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

struct Figures {
    median: f64,
    high: f64,
    worst: f64,
    touched: usize,
}

fn said(f: &Figures) -> String {
    let Figures { median, high, worst, touched } = f;
    format!("{median:6.0} {high:6.0} {worst:6.0} ({touched:3} %)")
}

/// Runs a stroke that wanders over the scene, pressing now and then. Each tick counts with its least time
/// of seven runs.
fn walk(
    height: f64,
    step: f64,
    empty: f64,
    query: impl Fn([f64; 3], Option<Hold>) -> Option<Contact>,
) -> Figures {
    let (mut point, mut heading) = ([0.3, 0.2, height], 0.0_f64);
    let mut random = Random::new(11);
    let mut points = Vec::new();
    for tick in 0..TICKS {
        heading += random.range(-0.3, 0.3);
        // Turns back to the middle when it is 20 mm off.
        if f64::hypot(point[0], point[1]) > 20.0 {
            heading = f64::atan2(-point[1], -point[0]);
        }
        point[0] += step * heading.cos();
        point[1] += step * heading.sin();
        point[2] = height - 1.0 + (tick as f64 * 0.02 * step).sin() * 1.5;
        points.push(point);
    }
    let (mut least, mut touched) = (vec![f64::INFINITY; TICKS], 0);
    for _ in 0..7 {
        let mut hold: Option<Hold> = None;
        touched = 0;
        for (point, least) in points.iter().zip(&mut least) {
            let start = Instant::now();
            let found = query(black_box(*point), black_box(hold));
            *least = least.min(start.elapsed().as_secs_f64() * 1e9 - empty);
            touched += usize::from(found.is_some());
            hold = black_box(found.map(|f| f.hold()));
        }
    }
    least.sort_by(f64::total_cmp);
    let (median, high, worst) = (least[TICKS / 2], least[TICKS * 99 / 100], least[TICKS - 1]);
    Figures { median, high, worst, touched: touched * 100 / TICKS }
}
