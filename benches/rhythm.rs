//! How random a learned texture is, beside the simulated physics of the same strokes: pulses, repetition,
//! kurtosis, level.
//!
//!     cargo bench -p asperity --bench rhythm -- [--graph FILE] [--all] [--only NAME] [--speeds
//!     40,80,160,280] [--force 1.0] [--seeds 5] [--seconds 20] [--circles] [--radius 10] [--svg FILE]
//!
//! Three parts: straight strokes (or circles) at constant speed and force over two materials of each
//! family (or all), gratings straight across their ridges, and a hand's motion. `--svg` draws envelopes
//! instead, of phase retrieval alone, of the graph, and of the physics. Each figure is the median over seeds;
//! a seed is another piece of the surface, another place on it, and another draw of the graph.

use std::sync::Arc;

use asperity_accuracy::accuracy::rhythm::{Rhythm, envelope, repeats_at};
use asperity_data::felt::Hand;
use asperity_data::made::{Ground, pitch_mm, surface, surfaces};
use asperity_engine::Options;
use asperity_graph::GraphFile;
use asperity_motion::{Shape, Stroke, StrokeParams};
use asperity_nodes::registry;
use asperity_plot::{Chart, Plot, Trace};
use asperity_tradeoff::{Chain, Path3};
use clap::Parser;

/// Two of each family.
const MATERIALS: [&str; 16] = [
    "sandpaper P80",
    "sandpaper P220",
    "canvas",
    "voile",
    "sine grating 1 mm",
    "square grating 1.2 mm",
    "microcellular rubber",
    "upholstery foam",
    "needle felt",
    "velour",
    "beech",
    "oak",
    "leather grain, fine",
    "spark-eroded plastic",
    "float glass",
    "printer paper",
];
const GRATINGS: [&str; 4] =
    ["sine grating 1 mm", "narrow ridges 1 mm", "sine grating 2.5 mm", "square grating 3 mm"];
/// Beginning that is left out \[s\]: filters settle.
const SETTLES_S: f64 = 1.0;
/// Directions of straight strokes: whatever way the ridges run, one is across and one along.
const DIRECTIONS_DEG: [f64; 5] = [31.7, 58.3, 17.0, 121.7, 76.0];
/// Width of the pieces that straight strokes go over, in mm. A piece repeats after its width, and is a sum
/// of as many waves as fit into it: of 20 mm so few that what is random in the surface repeats. In 0.2 s at
/// 280 mm/s no place comes twice.
const WIDE_MM: f64 = 80.0;
/// Speed of a circle's centre.
const DRIFT_MM_S: f64 = 1.0;
/// A modulation below this is that of a steady line.
const STEADY: f64 = 0.1;
/// Depth in mm at which the floor of the shipped graphs pushes with 1 N.
const MM_PER_N: f64 = 2.0;

#[derive(Clone, Parser)]
struct Asked {
    #[arg(long, default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/texture.ron"))]
    graph: String,
    #[arg(long)]
    all: bool,
    #[arg(long, default_value_t = 5)]
    seeds: u64,
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    #[arg(long = "force", default_value_t = 1.0)]
    force_n: f64,
    #[arg(long = "speeds", value_delimiter = ',', default_values_t = [40.0, 80.0, 160.0, 280.0])]
    speeds_mm_s: Vec<f64>,
    #[arg(long = "radius", default_value_t = 10.0)]
    radius_mm: f64,
    #[arg(long)]
    circles: bool,
    #[arg(long)]
    only: Option<String>,
    #[arg(long)]
    svg: Option<String>,
    /// Added by cargo.
    #[arg(long, hide = true)]
    bench: bool,
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The signal that a graph makes of a way over a material, behind its phase retrieval, and its rate.
fn rendered(graph: &str, material: &str, seed: u64, way: &Path3, seconds: f64) -> (Vec<f64>, f64) {
    let graph = GraphFile::read(graph).unwrap_or_else(|e| panic!("{e}"));
    played(&graph, material, seed, way, seconds)
}

/// The same of a graph that is read.
fn played(graph: &GraphFile, material: &str, seed: u64, way: &Path3, seconds: f64) -> (Vec<f64>, f64) {
    let mut graph = graph.clone();
    graph.seed = seed;
    graph.set(&format!("texture.material={material}"), "bench").unwrap_or_else(|e| panic!("{e}"));
    let options = Options { sleep: false, ..Options::default() };
    let chain = Chain::new(&graph, &registry(), vec![way.clone()], options);
    let mut chain = chain.unwrap_or_else(|e| panic!("{e}"));
    let heard = chain.render(seconds);
    assert_eq!(chain.faults(), 0);
    let rate = f64::from(heard.framing.expect("frames").rate_hz);
    let from = (SETTLES_S * rate) as usize;
    (heard.signal[from..].to_vec(), rate)
}

/// The graph's seed: no two strokes have the same chance, or all would be off together.
fn drawn(about: &str, seed: u64) -> u64 {
    about.bytes().fold(seed, |number, byte| number.wrapping_mul(31).wrapping_add(byte.into()))
}

/// Pieces of a material, one a seed.
fn grounds(material: &str, seeds: u64, least_mm: f64) -> Vec<Ground> {
    let surface = surface(material).unwrap_or_else(|e| panic!("{e}"));
    each(seeds, |seed| Ground::wide(&surface, 1000 + seed, least_mm))
}

/// Acceleration that the pen feels of the same way, on three axes.
fn felt(ground: &Ground, seed: u64, way: &Path3, seconds: f64) -> (Vec<Vec<f64>>, f64) {
    let hand = Hand::new(seconds, |t| way(t)).unwrap_or_else(|e| panic!("{e}"));
    let felt = ground.felt(&hand, seed);
    let from = (SETTLES_S * felt.rate_hz) as usize;
    (felt.acceleration_m_s2.iter().map(|axis| axis[from..].to_vec()).collect(), felt.rate_hz)
}

fn rhythm(axes: &[Vec<f64>], rate: f64) -> Rhythm {
    let axes: Vec<&[f64]> = axes.iter().map(Vec::as_slice).collect();
    Rhythm::new(&axes, rate).unwrap_or_else(|e| panic!("{e}"))
}

/// Figures of both, the median over seeds: what is rendered, what is true.
fn both(
    asked: &Asked,
    material: &str,
    grounds: &[Ground],
    way: &(dyn Fn(u64) -> Path3 + Sync),
    turns_per_s: f64,
    about: &str,
) -> [Vec<Rhythm>; 2] {
    let seconds = asked.seconds + SETTLES_S;
    let of = |seed| {
        let way = &way(seed);
        let (signal, rate) = rendered(&asked.graph, material, drawn(about, seed), way, seconds);
        let (axes, truth_rate) = felt(&grounds[seed as usize], seed, way, seconds);
        let axes = turned(axes, truth_rate, turns_per_s);
        (rhythm(&[signal], rate), rhythm(&axes, truth_rate))
    };
    let all: Vec<(Rhythm, Rhythm)> = each(asked.seeds, of);
    [all.iter().map(|r| r.0).collect(), all.iter().map(|r| r.1).collect()]
}

/// Of every seed, on two threads.
fn each<T: Send>(seeds: u64, of: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let half = |first: u64| (first..seeds).step_by(2).map(|seed| (seed, of(seed))).collect::<Vec<_>>();
    let mut all = std::thread::scope(|scope| {
        let odd = scope.spawn(|| half(1));
        let mut all = half(0);
        all.extend(odd.join().expect("a thread"));
        all
    });
    all.sort_by_key(|(seed, _)| *seed);
    all.into_iter().map(|(_, found)| found).collect()
}

/// A circle at constant speed and force. Its centre drifts, so that no place comes twice: a made piece
/// repeats after 20.48 mm, and a circle that is no wider does not meet the repeat.
fn circle(asked: &Asked, speed_mm_s: f64) -> Path3 {
    let (radius_mm, depth_mm) = (asked.radius_mm, -MM_PER_N * asked.force_n);
    Arc::new(move |t| {
        let (sin, cos) = (speed_mm_s * t / radius_mm).sin_cos();
        [radius_mm * cos + 0.7 * DRIFT_MM_S * t, radius_mm * sin + 0.3 * DRIFT_MM_S * t, depth_mm]
    })
}

/// How often a circle goes round in a second.
fn turns_per_s(asked: &Asked, speed_mm_s: f64) -> f64 {
    speed_mm_s / (std::f64::consts::TAU * asked.radius_mm)
}

/// Turns the axes along the surface with a circle: the second is along the stroke, the third across.
fn turned(mut axes: Vec<Vec<f64>>, rate: f64, turns_per_s: f64) -> Vec<Vec<f64>> {
    let [_, x, y] = &mut axes[..] else { return axes };
    for (n, (x, y)) in x.iter_mut().zip(y).enumerate() {
        let (sin, cos) = (std::f64::consts::TAU * turns_per_s * (SETTLES_S + n as f64 / rate)).sin_cos();
        (*x, *y) = (*y * cos - *x * sin, *x * cos + *y * sin);
    }
    axes
}

/// A straight stroke at constant speed and force, in a direction of the seed's. None runs along the sides of
/// a piece.
fn line(asked: &Asked, speed_mm_s: f64, seed: u64) -> Path3 {
    let depth_mm = -MM_PER_N * asked.force_n;
    let degrees = DIRECTIONS_DEG[seed as usize % DIRECTIONS_DEG.len()];
    let (sin, cos) = degrees.to_radians().sin_cos();
    Arc::new(move |t| [speed_mm_s * t * cos, speed_mm_s * t * sin, depth_mm])
}

fn steady(asked: &Asked) {
    let mut names: Vec<(String, String)> =
        surfaces(1)[0].iter().map(|s| (s.name.clone(), s.family.name().to_owned())).collect();
    if !asked.all {
        names.retain(|(name, _)| MATERIALS.contains(&name.as_str()));
    }
    names.retain(|(name, _)| asked.only.as_ref().is_none_or(|only| name.contains(only.as_str())));
    let shape = if asked.circles {
        format!("Circles of {} mm", asked.radius_mm)
    } else {
        "Straight strokes".to_owned()
    };
    println!("\n## {shape}, constant speed, {} N\n", asked.force_n);
    println!(
        "Each cell: rendered / true. * is off: modulation by more than 25 % (not where both are below \
         {STEADY}), repetition by more than 0.1, kurtosis by more than 15 %.\n"
    );
    println!(
        "| material | speed mm/s | modulation 15-25 Hz | repetition | kurtosis | deviation of level dB | \
         holds |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut holding: Vec<(&str, &str)> = Vec::new();
    for (name, family) in &names {
        let mut all_hold = true;
        // A circle is no wider than the smallest piece.
        let grounds = grounds(name, asked.seeds, if asked.circles { 0.0 } else { WIDE_MM });
        for &speed in &asked.speeds_mm_s {
            let about = format!("{name}_{speed}");
            let [ours, truth] = if asked.circles {
                both(asked, name, &grounds, &|_| circle(asked, speed), turns_per_s(asked, speed), &about)
            } else {
                both(asked, name, &grounds, &|seed| line(asked, speed, seed), 0.0, &about)
            };
            let pair = |f: fn(&Rhythm) -> f64| [&ours, &truth].map(|r| median(r.iter().map(f).collect()));
            let [m, mt] = pair(Rhythm::pulses);
            let [r, rt] = pair(Rhythm::repetition);
            let [k, kt] = pair(|r| r.kurtosis);
            let [d, dt] = pair(|r| r.level_deviation_db);
            // A steady line is steady, however small its depth is.
            let steady = m.max(mt) < STEADY;
            let off =
                [!steady && (m / mt - 1.0).abs() > 0.25, (r - rt).abs() > 0.1, (k / kt - 1.0).abs() > 0.15];
            let star = off.map(|off| if off { "*" } else { "" });
            let holds = !off.contains(&true);
            all_hold &= holds;
            println!(
                "| {name} | {speed} | {m:.3} / {mt:.3}{} | {r:.2} / {rt:.2}{} | {k:.2} / {kt:.2}{} | \
                 {d:.2} / {dt:.2} | {} |",
                star[0],
                star[1],
                star[2],
                if holds { "yes" } else { "no" }
            );
        }
        if all_hold {
            holding.push((name, family));
        }
    }
    println!("\n{} of {} materials hold at all speeds:", holding.len(), names.len());
    let mut families: Vec<&str> = names.iter().map(|(_, family)| family.as_str()).collect();
    families.dedup();
    for family in families {
        let of = holding.iter().filter(|(_, f)| *f == family).map(|(name, _)| *name);
        println!("- {family}: {}", of.collect::<Vec<_>>().join(", "));
    }
}

fn gratings(asked: &Asked) {
    println!("\n## Gratings, straight across, {} N\n", asked.force_n);
    println!(
        "| grating | speed mm/s | lag ms, rendered / true | correlation there | kurtosis | modulation \
         15-25 Hz |"
    );
    println!("|---|---|---|---|---|---|");
    for name in GRATINGS.iter().filter(|n| asked.only.as_ref().is_none_or(|only| n.contains(only.as_str()))) {
        let grounds = grounds(name, asked.seeds, 0.0);
        // A piece holds a whole number of ridges.
        let pitch = surface(name).ok().and_then(|s| pitch_mm(&s)).expect("a grating");
        for speed in [60.0, 100.0] {
            let depth = -MM_PER_N * asked.force_n;
            let way: Path3 = Arc::new(move |t| [speed * t, 0.0, depth]);
            let seconds = 0.4 * asked.seconds + SETTLES_S;
            let (mut lags, mut heights, mut ks, mut ms) =
                ([vec![], vec![]], [vec![], vec![]], [vec![], vec![]], [vec![], vec![]]);
            let strokes = |seed| {
                let ours = rendered(&asked.graph, name, drawn(name, seed), &way, seconds);
                (ours, felt(&grounds[seed as usize], seed, &way, seconds))
            };
            for (ours, (axes, rate)) in each(asked.seeds, strokes) {
                let of = [rhythm(std::slice::from_ref(&ours.0), ours.1), rhythm(&axes, rate)];
                let repeat =
                    [repeats_at(&ours.0, ours.1, pitch / speed), repeats_at(&axes[0], rate, pitch / speed)];
                for i in 0..2 {
                    let repeat = repeat[i].as_ref().expect("long enough");
                    lags[i].push(1e3 * repeat.lag_s);
                    heights[i].push(repeat.correlation);
                    ks[i].push(of[i].kurtosis);
                    ms[i].push(of[i].pulses());
                }
            }
            let [l, h, k, m] = [lags, heights, ks, ms].map(|pair| pair.map(median));
            println!(
                "| {name} | {speed} | {:.2} / {:.2} | {:.2} / {:.2} | {:.1} / {:.1} | {:.3} / {:.3} |",
                l[0], l[1], h[0], h[1], k[0], k[1], m[0], m[1]
            );
        }
    }
}

fn hand(asked: &Asked) {
    println!("\n## A hand's motion: minimum-jerk strokes with tremor\n");
    println!(
        "| material | 20 Hz power over the truth's dB | level over the truth's dB | level over that of \
         phase retrieval alone dB | the same above 30 Hz | kurtosis |"
    );
    println!("|---|---|---|---|---|---|");
    for name in MATERIALS.iter().filter(|n| asked.only.as_ref().is_none_or(|only| n.contains(only.as_str())))
    {
        let params = StrokeParams {
            shape: Shape::Zigzag,
            mean_speed_mm_s: 90.0,
            tremor_mm: 0.05,
            quantum_mm: 0.0,
            duration_s: asked.seconds,
            ..StrokeParams::default()
        };
        let stroke = Stroke::new(params).unwrap_or_else(|e| panic!("{e}"));
        let way: Path3 = Arc::new(move |t| stroke.sample(t).position);
        let short = Asked { seconds: asked.seconds - 2.0, ..asked.clone() };
        let [ours, truth] = both(
            &short,
            name,
            &grounds(name, asked.seeds, 0.0),
            &|_| way.clone(),
            0.0,
            &format!("{name}_hand"),
        );
        let pair = |f: fn(&Rhythm) -> f64| [&ours, &truth].map(|r| median(r.iter().map(f).collect()));
        let ([m, mt], [l, lt], [k, kt]) = (pair(Rhythm::pulses), pair(|r| r.rms), pair(|r| r.kurtosis));
        // At all frequencies and above 30 Hz.
        let levels = |graph: &GraphFile| {
            let of = each(asked.seeds, |seed| {
                let (signal, rate) = played(graph, name, drawn(name, seed), &way, short.seconds + SETTLES_S);
                let square = signal.iter().map(|x| x * x).sum::<f64>() / signal.len() as f64;
                [square.sqrt(), rhythm(&[signal], rate).rms]
            });
            [0, 1].map(|band| median(of.iter().map(|levels: &[f64; 2]| levels[band]).collect()))
        };
        let graph = GraphFile::read(&asked.graph).unwrap_or_else(|e| panic!("{e}"));
        let over = retrieved(&asked.graph).map_or([f64::NAN; 2], |alone| {
            let (ours, alone) = (levels(&graph), levels(&alone));
            [0, 1].map(|band| 20.0 * (ours[band] / alone[band]).log10())
        });
        println!(
            "| {name} | {:+.1} | {:+.1} | {:+.2} | {:+.2} | {k:.1} / {kt:.1} |",
            20.0 * (m / mt).log10(),
            20.0 * (l / lt).log10(),
            over[0],
            over[1]
        );
    }
}

/// Signal of the same network by phase retrieval alone: the earlier graph. None of a graph that retrieves
/// phase itself.
fn retrieved(graph: &str) -> Option<GraphFile> {
    let mut graph = GraphFile::read(graph).unwrap_or_else(|e| panic!("{e}"));
    let phase = graph.nodes.iter_mut().find(|node| node.id == "phase").expect("a node `phase`");
    if phase.kind != "shaped_noise" {
        return None;
    }
    (phase.kind, phase.params) = ("sample_commit".into(), Vec::new());
    graph.wires.retain(|wire| wire.to.node != "phase" || wire.from.port.is_none());
    for set in ["phase.frames=2", "phase.passes=2"] {
        graph.set(set, "bench").unwrap_or_else(|e| panic!("{e}"));
    }
    Some(graph)
}

/// Envelopes over a second and their modulation over all: before, now, and the physics.
fn picture(asked: &Asked) -> String {
    let speed = 80.0;
    let way = circle(asked, speed);
    let seconds = asked.seconds + SETTLES_S;
    let pulsing = |label: &str, axes: &[Vec<f64>], rate: f64| {
        let axes: Vec<&[f64]> = axes.iter().map(Vec::as_slice).collect();
        let seen = envelope(&axes, rate).unwrap_or_else(|e| panic!("{e}"));
        // Two points a millisecond and a second of them are what can be seen.
        let step = (seen.rate_hz / 2000.0).round().max(1.0) as usize;
        let times = seen.over_mean.iter().enumerate().step_by(step);
        let points = times.map(|(i, e)| (i as f64 / seen.rate_hz, *e)).take_while(|p| p.0 <= 1.0);
        [points.collect(), seen.depths].map(|line| Trace {
            name: label.to_owned(),
            lines: vec![line],
            ..Trace::default()
        })
    };
    let row = |name: &str| {
        let read = GraphFile::read(&asked.graph).unwrap_or_else(|e| panic!("{e}"));
        let alone = retrieved(&asked.graph).expect("a graph of shaped noise");
        let (before, rate) = played(&alone, name, 0, &way, seconds);
        let (now, _) = played(&read, name, 0, &way, seconds);
        let (axes, truth_rate) = felt(&grounds(name, 1, 0.0)[0], 0, &way, seconds);
        let axes = turned(axes, truth_rate, turns_per_s(asked, speed));
        let all = [
            pulsing("phase retrieval alone", &[before], rate),
            pulsing("texture.ron", &[now], rate),
            pulsing("simulated physics", &axes, truth_rate),
        ];
        let plot = |i: usize, remark: &str, x_name: &str| Plot {
            heading: (name.to_owned(), remark.to_owned()),
            x_name: x_name.to_owned(),
            traces: all.iter().map(|traces| traces[i].clone()).collect(),
            ..Plot::default()
        };
        [plot(0, "envelope over its mean", "Time, s"), plot(1, "modulation depth", "Frequency, Hz")]
    };
    let pictured = ["sandpaper P80", "canvas", "needle felt", "sine grating 2.5 mm"];
    Chart {
        title: "Pulses at constant speed and force".into(),
        subtitle: format!("circles of {} mm, {speed} mm/s, {} N", asked.radius_mm, asked.force_n),
        columns: 2,
        size: [700.0, 180.0],
        plots: pictured.map(row).into_iter().flatten().collect(),
        ..Chart::default()
    }
    .to_svg()
}

fn main() {
    let asked = Asked::parse();
    if let Some(file) = &asked.svg {
        std::fs::write(file, picture(&asked)).expect("written");
        return;
    }
    println!(
        "# {}: {} seeds, {} s each",
        asked.graph.rsplit('/').next().unwrap_or(""),
        asked.seeds,
        asked.seconds
    );
    steady(&asked);
    gratings(&asked);
    hand(&asked);
}
