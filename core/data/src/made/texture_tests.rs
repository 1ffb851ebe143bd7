//! Makes the textures of `graphs/models/made_ar/surfaces`: autoregressive models of simulated strokes over
//! twelve made surfaces. `ASPERITY_WRITE_TEXTURES=1` writes them all and prints the table of their README.

use std::path::PathBuf;
use std::sync::Arc;

use asperity_autoregressive::fit::{Criterion, Order, Recording, Report, Settings, Tolerance};
use asperity_autoregressive::{Filter, Model, Texture, TextureFile};
use asperity_numbers::Elementary as _;
use asperity_surfaces::stylus::SAMPLE_HZ;
use rayon::prelude::*;

use super::{Ground, surface};
use crate::felt::Hand;
use crate::history::STIFFNESS_N_PER_MM;

/// Surfaces, and the materials of the paper's study that they stand for.
const ALL: [[&str; 2]; 12] = [
    ["fine loop pile", "Carpet 2"],
    ["plush", "Carpet 3"],
    ["frosted acrylic", "Frosted acrylic"],
    ["EVA foam", "Polyethylene foam"],
    ["spark-eroded plastic", "Rough plastic"],
    ["sandpaper P220", "Sandpaper 220"],
    ["sandpaper P320", "Sandpaper 320"],
    ["coir", "Scouring pad"],
    ["pebbled handle", "Velcro hooks"],
    ["terry towel", "Velcro loops"],
    ["printer paper", "Wax paper"],
    ["acrylic sheet", "Whiteboard"],
];
/// The two that every run makes again. `ASPERITY_ALL_TEXTURES=1` makes all.
const QUICK: [&str; 2] = ["acrylic sheet", "terry towel"];

const SPEEDS_MM_S: [f64; 5] = [20.0, 40.0, 80.0, 160.0, 300.0];
const FORCES_N: [f64; 4] = [0.3, 0.8, 1.6, 3.2];
/// Silent places, each with the number of the model whose coefficients it takes.
const SILENT: [(usize, [f64; 2]); 3] = [(0, [0.0, 0.0]), (3, [0.0, 3.2]), (16, [300.0, 0.0])];
/// Pieces of a surface. Each is stroked at all speeds and forces.
const PIECES: u64 = 3;
const SECONDS: f64 = 1.0;
/// Time left out while the pen comes to rest on the surface.
const SETTLING_S: f64 = 0.3;
/// Strokes follow a circle, so that many directions count.
const RADIUS_MM: f64 = 30.0;

/// Up to 1 kHz, as the network. The simulation has no slow motion to remove.
const SETTINGS: Settings = Settings {
    model_hz: 2000,
    high_pass_hz: 0.0,
    order: Order::Best { most: 24, by: Criterion::Aicc },
    shortest_s: 0.2,
    least_speed_mm_s: 5.0,
    least_force_n: 0.05,
    tolerance: Tolerance { speed_mm_s: 10.0, force_n: 0.1, part: 0.2 },
    most_models: 64,
};

/// Strokes at all speeds and forces over some pieces of a surface.
#[derive(Default)]
struct Strokes {
    force_n: Vec<f64>,
    speed_mm_s: Vec<f64>,
    acceleration_m_s2: [Vec<f64>; 3],
}

impl Strokes {
    fn new(name: &str, first: u64) -> Self {
        let (surface, mut all) = (surface(name).unwrap(), Self::default());
        let skipped = (SETTLING_S * f64::from(SAMPLE_HZ)) as usize;
        for seed in first..first + PIECES {
            let ground = Ground::new(&surface, seed);
            for (i, speed) in SPEEDS_MM_S.into_iter().enumerate() {
                for (j, force) in FORCES_N.into_iter().enumerate() {
                    let hand = Hand::new(SETTLING_S + SECONDS, |t| {
                        let (sin, cos) = (speed * t / RADIUS_MM + seed as f64).sine_cosine();
                        [RADIUS_MM * cos, RADIUS_MM * sin, -force / STIFFNESS_N_PER_MM]
                    });
                    let felt = ground.felt(&hand.unwrap(), (4 * i + j) as u64);
                    for (all, axis) in all.acceleration_m_s2.iter_mut().zip(&felt.acceleration_m_s2) {
                        all.extend(&axis[skipped..]);
                    }
                    all.force_n.resize(all.acceleration_m_s2[0].len(), force);
                    all.speed_mm_s.resize(all.force_n.len(), speed);
                }
            }
        }
        all
    }

    fn recording(&self) -> Recording<'_> {
        Recording {
            rate_hz: f64::from(SAMPLE_HZ),
            force_n: &self.force_n,
            speed_mm_s: &self.speed_mm_s,
            acceleration_m_s2: self.acceleration_m_s2.iter().map(Vec::as_slice).collect(),
        }
    }
}

fn rounded(text: String) -> f64 {
    text.parse().unwrap()
}

/// A model at the speed and force of its strokes. Coefficients have nine digits after the point; the level
/// stays. A place beside the grid would make thin triangles with a silent corner.
fn short(model: &Model) -> Model {
    let ar: Vec<f64> = model.ar.iter().map(|c| rounded(format!("{c:.9}"))).collect();
    let variance = model.filter().variance() / Filter::new(&ar, &[], 1.0).variance();
    Model {
        ar,
        variance: rounded(format!("{variance:.3e}")),
        speed_mm_s: model.speed_mm_s.round(),
        force_n: rounded(format!("{:.1}", model.force_n)),
        ..model.clone()
    }
}

fn made([name, paper]: [&str; 2]) -> (TextureFile, Report) {
    let (texture, report) = Strokes::new(name, 1).recording().fit(&SETTINGS).unwrap();
    let mut models: Vec<Model> = texture.models().iter().map(short).collect();
    let places: Vec<[f64; 2]> = models.iter().map(|m| [m.speed_mm_s, m.force_n]).collect();
    assert_eq!(places, SPEEDS_MM_S.map(|speed| FORCES_N.map(|force| [speed, force])).concat(), "{name}");
    for (beside, [speed_mm_s, force_n]) in SILENT {
        models.push(Model { variance: 0.0, speed_mm_s, force_n, ..models[beside].clone() });
    }
    let file = TextureFile {
        description: format!("{} It stands for {paper}.", surface(name).unwrap().description),
        origin: "Fitted to simulated strokes, not measured: core/data/src/made/texture_tests.rs".to_owned(),
        texture: Texture::new(texture.rate_hz(), models, None).unwrap(),
    };
    (file, report)
}

/// A row of the README's table: the rendering against strokes over pieces that were not fitted.
fn row([name, paper]: [&str; 2], texture: &Texture, report: &Report) -> String {
    let strokes = Strokes::new(name, 1 + PIECES);
    let texture = Arc::new(texture.clone());
    let compared = strokes.recording().compare(&SETTINGS, &texture, report).unwrap();
    let (level_db, worst) = (compared.all.level_off_db(), *compared.all.worst().unwrap());
    assert!(level_db.abs() < 3.0, "{name}: {level_db} dB");
    let slow = |model: usize| compared.models[model].level_off_db();
    let slow = (0..FORCES_N.len()).map(slow).max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap();
    let (off, hz, order) = (worst.off_db(), worst.centre_hz, texture.models()[0].ar.len());
    format!("| `{name}` | {paper} | {order} | {level_db:+.1} | {off:+.1} at {hz:.0} Hz | {slow:+.1} |")
}

#[test]
fn shipped_textures_are_the_made_ones() {
    let set = |name: &str| std::env::var_os(name).is_some();
    let writes = set("ASPERITY_WRITE_TEXTURES");
    let all = writes || set("ASPERITY_ALL_TEXTURES");
    let chosen: Vec<[&str; 2]> = ALL.into_iter().filter(|[name, _]| all || QUICK.contains(name)).collect();
    let rows = chosen.into_par_iter().map(|of| {
        let (file, report) = made(of);
        let (text, path) = (file.to_ron().unwrap(), path(of[0]));
        if writes {
            std::fs::write(&path, &text).unwrap();
        }
        assert!(text == std::fs::read_to_string(path).unwrap(), "{}", of[0]);
        if all { row(of, &file.texture, &report) + "\n" } else { String::new() }
    });
    let rows: Vec<String> = rows.collect();
    print!("{}", rows.concat());
}

#[test]
fn every_shipped_texture_loads_and_names_a_surface() {
    for [name, paper] in ALL {
        let file = TextureFile::read(path(name)).unwrap();
        assert!(file.description.ends_with(&format!("{paper}.")) && surface(name).is_ok());
    }
}

fn path(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../graphs/models/made_ar/surfaces");
    folder.join(format!("{name}.ron"))
}
