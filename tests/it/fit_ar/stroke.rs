//! A recording of a made texture, as a table and as an array.

use std::f64::consts::PI;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use asperity_accuracy::npy;
use asperity_autoregressive::{Model, Synthesis, TextureFile};
use harness::graphs;

/// A stroke over a shipped texture: six seconds at each of nine of its models, a second on the way from one
/// to the next.
pub struct Stroke {
    pub force: Vec<f64>,
    pub speed: Vec<f64>,
    pub acceleration: Vec<f64>,
    pub models: Vec<Model>,
}

pub fn stroke() -> &'static Stroke {
    static STROKE: OnceLock<Stroke> = OnceLock::new();
    STROKE.get_or_init(|| {
        let file = TextureFile::read(graphs("models/made_ar/rough.ron")).unwrap_or_else(|e| panic!("{e}"));
        let sounding = file.texture.models().iter().filter(|m| m.variance > 0.0 && m.speed_mm_s > 50.0);
        let models: Vec<Model> = sounding.filter(|m| m.speed_mm_s < 250.0).cloned().collect();
        assert_eq!(models.len(), 9);
        let mut synthesis = Synthesis::new(Arc::new(file.texture), 6);
        let (mut force, mut speed, mut acceleration) = (vec![], vec![], vec![]);
        let place = |m: &Model| [m.speed_mm_s, m.force_n];
        let mut from = place(&models[0]);
        for to in models.iter().map(place) {
            for n in 0..7000 {
                let part = 0.5 - 0.5 * (PI * f64::from(n.min(1000)) / 1000.0).cos();
                let [v, f] = [0, 1].map(|k| from[k] + part * (to[k] - from[k]));
                speed.push(v);
                force.push(f);
                synthesis.touch(v, f);
                let mut out = [0.0];
                synthesis.process(acceleration.len() as u64, &mut out);
                acceleration.push(f64::from(out[0]));
            }
            from = to;
        }
        Stroke { force, speed, acceleration, models }
    })
}

pub fn table(columns: &str, row: impl Fn(usize) -> Vec<f64>) -> String {
    format!("# made\nt_s,{columns}\n{}", rows(stroke().force.len(), row))
}

fn rows(count: usize, row: impl Fn(usize) -> Vec<f64>) -> String {
    let cells = |n: usize| row(n).iter().map(|x| format!(",{x:?}")).collect::<String>();
    (0..count).map(|n| format!("{:?}{}\n", n as f64 / 1000.0, cells(n))).collect()
}

pub const COLUMNS: &str = "force_n,speed_mm_s,acceleration_m_s2";

pub fn row(n: usize) -> Vec<f64> {
    let s = stroke();
    vec![s.force[n], s.speed[n], s.acceleration[n]]
}

/// The recording's samples in a row each, with a column that is left out, as float64.
pub fn write_npy(path: &Path) {
    let rows: Vec<f64> = (0..stroke().force.len())
        .flat_map(|n| {
            let [force, speed, acceleration] = row(n)[..] else { panic!("three columns") };
            [speed, f64::NAN, force, acceleration]
        })
        .collect();
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 4), }}", rows.len() / 4);
    let header = format!("{header:<117}\n");
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(rows.iter().flat_map(|x| x.to_le_bytes()));
    npy::parse(&bytes).unwrap_or_else(|e| panic!("{e}"));
    std::fs::write(path, bytes).expect("a file");
}

/// A table of so many rows.
pub fn table_of(count: usize, row: impl Fn(usize) -> Vec<f64>) -> String {
    format!("t_s,{COLUMNS}\n{}", rows(count, row))
}
