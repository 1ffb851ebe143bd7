//! How random a learned texture is, beside the simulated physics of the same strokes: pulses, repetition, kurtosis, level.
//!
//!     cargo bench -p asperity --bench rhythm -- [--graph FILE] [--all] [--seeds 5] [--seconds 20] [--force 1.0] [--only NAME]
//!
//! Four parts: circles at constant speed and force over twelve materials (or all), gratings straight across their ridges, a hand's motion, and magnitudes that stand
//! still. Each figure is the median over seeds; a seed is another piece of the surface, another place on it, and another draw of the graph.

use std::sync::Arc;

use asperity_dataset::felt::Hand;
use asperity_dataset::made::{Ground, surface, surfaces};
use asperity_engine::Options;
use asperity_graph::GraphFile;
use asperity_measure::accuracy::rhythm::{Rhythm, repeats_at};
use asperity_nodes::registry;
use asperity_study::{Chain, Path3};
use asperity_world::motion::{Shape, Stroke, StrokeParams};

/// One of each kind of surface, at least one of each family.
const MATERIALS: [&str; 12] = [
    "sandpaper P80",
    "sandpaper P220",
    "voile",
    "sine grating 1 mm",
    "microcellular rubber",
    "upholstery foam",
    "needle felt",
    "velour",
    "beech",
    "leather grain, fine",
    "float glass",
    "printer paper",
];
const SPEEDS_MM_S: [f64; 4] = [40.0, 80.0, 160.0, 280.0];
const GRATINGS: [&str; 4] =
    ["sine grating 1 mm", "narrow ridges 1 mm", "sine grating 2.5 mm", "square grating 3 mm"];
/// Beginning that is left out \[s\]: filters settle.
const SETTLES_S: f64 = 1.0;
const RADIUS_MM: f64 = 30.0;
/// Depth in mm at which the floor of the shipped graphs pushes with 1 N.
const MM_PER_N: f64 = 2.0;

struct Asked {
    graph: String,
    all: bool,
    seeds: u64,
    seconds: f64,
    force_n: f64,
    only: Option<String>,
}

fn asked() -> Asked {
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/texture.ron").to_owned();
    let mut asked = Asked { graph, all: false, seeds: 5, seconds: 20.0, force_n: 1.0, only: None };
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut value = || args.next().expect("a value");
        match arg.as_str() {
            "--graph" => asked.graph = value(),
            "--all" => asked.all = true,
            "--seeds" => asked.seeds = value().parse().expect("a number"),
            "--seconds" => asked.seconds = value().parse().expect("a number"),
            "--force" => asked.force_n = value().parse().expect("a number"),
            "--only" => asked.only = Some(value()),
            // What cargo adds.
            "--bench" => {}
            other => panic!("unknown argument {other}"),
        }
    }
    asked
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The signal that a graph makes of a way over a material, behind its phase retrieval, and its rate.
fn rendered(graph: &str, material: &str, seed: u64, way: &Path3, seconds: f64) -> (Vec<f64>, f64) {
    let mut graph = GraphFile::read(graph).unwrap_or_else(|e| panic!("{e}"));
    graph.seed = seed;
    graph.set(&format!("texture.material={material}"), "bench").unwrap_or_else(|e| panic!("{e}"));
    let options = Options { sleep: false, ..Options::default() };
    let chain = Chain::new(&graph, &registry(), vec![way.clone()], options);
    let heard = chain.unwrap_or_else(|e| panic!("{e}")).hear(seconds);
    assert_eq!(heard.faults, 0);
    let rate = f64::from(heard.framing.expect("frames").rate_hz);
    let from = (SETTLES_S * rate) as usize;
    (heard.signal[from..].to_vec(), rate)
}

/// What the pen feels of the same way, on three axes.
fn felt(material: &str, seed: u64, way: &Path3, seconds: f64) -> (Vec<Vec<f64>>, f64) {
    let surface = surface(material).unwrap_or_else(|e| panic!("{e}"));
    let hand = Hand::new(seconds, |t| way(t)).unwrap_or_else(|e| panic!("{e}"));
    let felt = Ground::new(&surface, 1000 + seed).felt(&hand, seed);
    let from = (SETTLES_S * felt.rate_hz) as usize;
    (felt.acceleration_m_s2.iter().map(|axis| axis[from..].to_vec()).collect(), felt.rate_hz)
}

fn rhythm(axes: &[Vec<f64>], rate: f64) -> Rhythm {
    let axes: Vec<&[f64]> = axes.iter().map(Vec::as_slice).collect();
    Rhythm::new(&axes, rate).unwrap_or_else(|e| panic!("{e}"))
}

/// Figures of both, the median over seeds: what is rendered, what is true.
fn both(asked: &Asked, material: &str, way: &Path3) -> [Vec<Rhythm>; 2] {
    let seconds = asked.seconds + SETTLES_S;
    let of = |seed| {
        let (signal, rate) = rendered(&asked.graph, material, seed, way, seconds);
        let (axes, truth_rate) = felt(material, seed, way, seconds);
        (rhythm(&[signal], rate), rhythm(&axes, truth_rate))
    };
    let all: Vec<(Rhythm, Rhythm)> = (0..asked.seeds).map(of).collect();
    [all.iter().map(|r| r.0).collect(), all.iter().map(|r| r.1).collect()]
}

fn circles(asked: &Asked) {
    let names: Vec<String> = match asked.all {
        true => surfaces(1)[0].iter().map(|s| s.name.clone()).collect(),
        false => MATERIALS.map(str::to_owned).into(),
    };
    println!("\n## Circles of {} mm, constant speed, {} N\n", RADIUS_MM, asked.force_n);
    println!(
        "Each cell: rendered / true; * where modulation is off by more than 25 %, repetition by more than 0.1, kurtosis by more than 15 %.\n"
    );
    println!(
        "| material | speed mm/s | modulation 15-25 Hz | repetition | kurtosis | deviation of level dB | holds |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut holding = 0;
    for name in names.iter().filter(|n| asked.only.as_ref().is_none_or(|only| n.contains(only.as_str()))) {
        let mut all_hold = true;
        for speed in SPEEDS_MM_S {
            let depth = -MM_PER_N * asked.force_n;
            let way: Path3 = Arc::new(move |t| {
                let (sin, cos) = (speed * t / RADIUS_MM).sin_cos();
                [RADIUS_MM * cos, RADIUS_MM * sin, depth]
            });
            let [ours, truth] = both(asked, name, &way);
            let pair = |f: fn(&Rhythm) -> f64| [&ours, &truth].map(|r| median(r.iter().map(f).collect()));
            let [m, mt] = pair(Rhythm::pulses);
            let [r, rt] = pair(Rhythm::repetition);
            let [k, kt] = pair(|r| r.kurtosis);
            let [d, dt] = pair(|r| r.level_deviation_db);
            let off = [(m / mt - 1.0).abs() > 0.25, (r - rt).abs() > 0.1, (k / kt - 1.0).abs() > 0.15];
            let star = off.map(|off| if off { "*" } else { "" });
            let holds = !off.contains(&true);
            all_hold &= holds;
            println!(
                "| {name} | {speed} | {m:.3} / {mt:.3}{} | {r:.2} / {rt:.2}{} | {k:.2} / {kt:.2}{} | {d:.2} / {dt:.2} | {} |",
                star[0],
                star[1],
                star[2],
                if holds { "yes" } else { "no" }
            );
        }
        holding += usize::from(all_hold);
    }
    println!("\n{holding} of {} materials hold at all four speeds.", names.len());
}

fn gratings(asked: &Asked) {
    println!("\n## Gratings, straight across, {} N\n", asked.force_n);
    println!(
        "| grating | speed mm/s | lag ms, rendered / true | correlation there | kurtosis | modulation 15-25 Hz |"
    );
    println!("|---|---|---|---|---|---|");
    for name in GRATINGS.iter().filter(|n| asked.only.as_ref().is_none_or(|only| n.contains(only.as_str()))) {
        let pitch: f64 = name.split(' ').find_map(|word| word.parse().ok()).expect("a pitch");
        for speed in [60.0, 100.0] {
            let depth = -MM_PER_N * asked.force_n;
            let way: Path3 = Arc::new(move |t| [speed * t, 0.0, depth]);
            let seconds = 0.4 * asked.seconds + SETTLES_S;
            let (mut lags, mut heights, mut ks, mut ms) =
                ([vec![], vec![]], [vec![], vec![]], [vec![], vec![]], [vec![], vec![]]);
            for seed in 0..asked.seeds {
                let ours = rendered(&asked.graph, name, seed, &way, seconds);
                let (axes, rate) = felt(name, seed, &way, seconds);
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
    println!("| material | 20 Hz power over the truth's dB | level over the truth's dB | kurtosis |");
    println!("|---|---|---|---|");
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
        let short = Asked { graph: asked.graph.clone(), only: None, seconds: asked.seconds - 2.0, ..*asked };
        let [ours, truth] = both(&short, name, &way);
        let pair = |f: fn(&Rhythm) -> f64| [&ours, &truth].map(|r| median(r.iter().map(f).collect()));
        let ([m, mt], [l, lt], [k, kt]) = (pair(Rhythm::pulses), pair(|r| r.rms), pair(|r| r.kurtosis));
        println!(
            "| {name} | {:+.1} | {:+.1} | {k:.1} / {kt:.1} |",
            20.0 * (m / mt).log10(),
            20.0 * (l / lt).log10()
        );
    }
}

fn main() {
    let asked = asked();
    println!(
        "# {}: {} seeds, {} s each",
        asked.graph.rsplit('/').next().unwrap_or(""),
        asked.seeds,
        asked.seconds
    );
    circles(&asked);
    gratings(&asked);
    hand(&asked);
}
