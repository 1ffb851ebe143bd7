//! Makes the textures of `graphs/models/made_ar` from resonances, zeros and levels that grow with speed
//! and force. `ASPERITY_WRITE_TEXTURES=1` writes them.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use asperity_diagnostics::Source;

use super::testing::{multiply, poles};
use super::{Filter, Model, Texture, TextureFile, is_stable, line_spectrum, toolkit};

const RATE_HZ: f64 = 1000.0;

/// Speeds in mm/s and forces in N with models. Models lie a little beside them, as a hand would.
const SPEEDS: [f64; 5] = [20.0, 60.0, 120.0, 200.0, 300.0];
const FORCES: [f64; 3] = [0.3, 1.0, 3.0];
/// Silent places: no speed or no force.
const SILENT: [[f64; 2]; 5] = [[0.0, 0.0], [150.0, 0.0], [300.0, 0.0], [0.0, 1.0], [0.0, 3.0]];

/// The sound at a speed and force.
struct Sound {
    /// Resonances: frequency and bandwidth in Hz.
    poles: Vec<[f64; 2]>,
    /// Real poles.
    real: Vec<f64>,
    /// Antiresonances: frequency and bandwidth in Hz.
    zeros: Vec<[f64; 2]>,
    gain: f64,
    /// Root mean square in m/s^2.
    level: f64,
}

type Made = (&'static str, &'static str, fn(f64, f64) -> Sound);

const ALL: [Made; 3] = [
    (
        "rough",
        "Coarse cloth, as a steel tip feels it: ribs 1.2 mm apart, whose frequency grows with the speed, \
         and the tool's own resonance.",
        |speed, force| {
            let ribs = speed / 1.2;
            Sound {
                poles: vec![
                    [ribs, 15.0 + 0.4 * ribs],
                    [170.0 + 15.0 * force + 0.1 * speed, 60.0],
                    [390.0, 120.0],
                ],
                real: vec![0.5],
                zeros: vec![],
                gain: 1.0,
                level: 1.2 * (speed / 100.0).powf(0.6) * force.powf(0.4),
            }
        },
    ),
    ("smooth", "Fine paper: a soft hiss with little below it.", |speed, force| Sound {
        poles: vec![[280.0 + 20.0 * force + 0.2 * speed, 180.0]],
        real: vec![0.6],
        zeros: vec![[90.0 + 0.1 * speed, 100.0]],
        gain: 0.5 + 0.25 * force,
        level: 0.12 * (speed / 100.0).powf(0.5) * force.powf(0.3),
    }),
    (
        "ringing",
        "A glazed tile under a light tool: sharp resonances on the contact, whose stiffness grows with the \
         third root of the force.",
        |speed, force| Sound {
            // A ball on a plane (Hertz 1882).
            poles: [[70.0, 6.0], [82.0, 7.0], [230.0, 10.0], [270.0, 12.0]]
                .map(|[hz, bandwidth_hz]| [hz * (force / 0.3).powf(1.0 / 6.0), bandwidth_hz])
                .to_vec(),
            real: vec![],
            zeros: vec![],
            gain: 1.0,
            level: 0.5 * (speed / 100.0).powf(0.5) * force.powf(0.35),
        },
    ),
];

/// `c_1 ..` of a polynomial with these pairs of roots and real roots, rounded to six digits after the point.
fn polynomial(pairs: &[[f64; 2]], real: &[f64]) -> Vec<f64> {
    let mut all = poles(pairs, RATE_HZ);
    all.insert(0, 1.0);
    for root in real {
        multiply(&mut all, [-root, 0.0]);
        all.pop();
    }
    all[1..].iter().map(|c| format!("{c:.6}").parse().unwrap()).collect()
}

fn model(sound: &Sound, [speed_mm_s, force_n]: [f64; 2], silent: bool) -> Model {
    let ar = polynomial(&sound.poles, &sound.real);
    let ma = polynomial(&sound.zeros, &[]);
    let unit = Filter::new(&ar, &ma, 1.0).variance();
    let variance = if silent { 0.0 } else { (sound.level / sound.gain).powi(2) / unit };
    // To four digits.
    Model {
        ar,
        ma,
        variance: format!("{variance:.3e}").parse().unwrap(),
        gain: sound.gain,
        speed_mm_s,
        force_n,
    }
}

fn made((_, description, sound): &Made) -> TextureFile {
    let mut models = Vec::new();
    for (i, speed) in SPEEDS.into_iter().enumerate() {
        for (j, force) in FORCES.into_iter().enumerate() {
            let off = ((3 * i + 5 * j) % 7) as f64 - 3.0;
            let at = [speed + off, force * (1.0 + 0.02 * off)];
            models.push(model(&sound(speed, force), at, false));
        }
    }
    for [speed, force] in SILENT {
        models.push(model(&sound(speed.max(SPEEDS[0]), force.max(FORCES[0])), [speed, force], true));
    }
    let texture = Texture::new(RATE_HZ, models, None).unwrap();
    let origin = "Made from resonances, not measured: core/autoregressive/src/made_tests.rs".to_owned();
    TextureFile { description: (*description).to_owned(), origin, texture }
}

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("../../graphs/models/made_ar/{name}.ron"))
}

/// The shipped textures by name.
pub(super) fn shipped() -> Vec<(&'static str, TextureFile)> {
    ALL.iter().map(|(name, ..)| (*name, TextureFile::read(path(name)).unwrap())).collect()
}

/// Rounded coefficients do not depend on a machine's sine.
#[test]
fn shipped_files_are_the_made_ones() {
    for texture in &ALL {
        if std::env::var_os("ASPERITY_WRITE_TEXTURES").is_some() {
            std::fs::write(path(texture.0), made(texture).to_ron().unwrap()).unwrap();
        }
        let text = std::fs::read_to_string(path(texture.0)).unwrap();
        assert!(text == made(texture).to_ron().unwrap(), "{}", texture.0);
    }
}

/// Root mean square in m/s^2.
pub(super) fn level(filter: &Filter) -> f64 {
    filter.variance().sqrt()
}

#[test]
fn harder_and_faster_is_louder() {
    for (name, file) in shipped() {
        let models = file.texture.models();
        let sounding: Vec<&Model> = models.iter().filter(|m| m.variance > 0.0).collect();
        assert_eq!((sounding.len(), models.len()), (15, 20));
        let mut compared = 0;
        for a in &sounding {
            assert!((0.02..5.0).contains(&level(&a.filter())), "{name}: {} m/s^2", level(&a.filter()));
            for b in &sounding {
                if b.speed_mm_s > 1.2 * a.speed_mm_s && b.force_n > 1.2 * a.force_n {
                    assert!(level(&b.filter()) > 1.2 * level(&a.filter()), "{name}");
                    compared += 1;
                }
            }
        }
        assert!(compared > 20);
    }
}

fn edges(texture: &Texture) -> Vec<[usize; 2]> {
    let sides = |&[a, b, c]: &[usize; 3]| [[a, b], [b, c], [c, a]];
    let mut edges: Vec<[usize; 2]> =
        texture.triangles().corners().iter().flat_map(sides).map(|[a, b]| [a.min(b), a.max(b)]).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Whether every mixture of two lists, turned into a polynomial, is stable.
fn all_stable([a, b]: [&[f64]; 2], polynomial: impl Fn(&[f64]) -> Vec<f64>) -> bool {
    (0..=200).map(|i| f64::from(i) / 200.0).all(|part| {
        let mixed: Vec<f64> = a.iter().zip(b).map(|(x, y)| x + part * (y - x)).collect();
        is_stable(&polynomial(&mixed))
    })
}

/// Numbers of edges: all, and those on which some mixture is not stable, of coefficients and of line spectral
/// frequencies.
fn unstable_edges(texture: &Texture) -> [usize; 3] {
    let models = texture.models();
    let from_lines = |lines: &[f64]| {
        let mut polynomial = vec![0.0; lines.len()];
        line_spectrum::to_polynomial(lines, &mut polynomial);
        polynomial
    };
    let lines: Vec<Vec<f64>> =
        models.iter().map(|m| line_spectrum::from_polynomial(&m.ar).expect("a model is stable")).collect();
    edges(texture).iter().fold([0; 3], |[all, of_coefficients, of_lines], edge| {
        let coefficients = all_stable(edge.map(|i| &models[i].ar[..]), <[f64]>::to_vec);
        let frequencies = all_stable(edge.map(|i| &lines[i][..]), from_lines);
        [all + 1, of_coefficients + usize::from(!coefficients), of_lines + usize::from(!frequencies)]
    })
}

fn xml_files(folder: &Path) -> Vec<PathBuf> {
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let files = |path: PathBuf| match path.extension() {
        _ if path.is_dir() => xml_files(&path),
        Some(extension) if extension.eq_ignore_ascii_case("xml") => vec![path],
        _ => Vec::new(),
    };
    paths.flat_map(files).collect()
}

/// The toolkit's licence forbids passing its files on; none are in this project.
#[test]
fn hatt_edges_are_stable_by_line_spectral_frequencies() {
    let Some(folder) = std::env::var_os("HATT_DIR") else {
        // `eprintln!` shows only in failed tests.
        let _ = std::io::stderr().write_all(b"skipped: HATT_DIR does not name the toolkit's folder\n");
        return;
    };
    let sources = xml_files(Path::new(&folder)).into_iter().map(|path| Source::read(path).unwrap());
    // The toolkit's recordings are XML too.
    let sets = sources.filter(|source| source.text().to_ascii_lowercase().contains("<modelset"));
    let textures: Vec<Texture> = sets.map(|source| toolkit::parse(&source).unwrap()).collect();
    let orders = || textures.iter().flat_map(|t| t.models()).map(|m| m.ar.len());
    let found = textures.iter().map(unstable_edges).fold([0; 3], |a, b| [0, 1, 2].map(|i| a[i] + b[i]));
    assert_eq!((textures.len(), orders().min(), orders().max()), (100, Some(14), Some(20)));
    assert_eq!(found, [8007, 13, 0]);
}

#[test]
fn mixture_by_frequencies_is_stable_by_coefficients_not() {
    for (name, file) in shipped() {
        let texture = &file.texture;
        // Second-order polynomials are stable in a triangle of the plane, and so are their mixtures.
        // Higher orders need not be.
        assert_eq!(unstable_edges(texture), [48, if name == "ringing" { 22 } else { 0 }, 0], "{name}");
        for edge in edges(texture) {
            let [from, to] = edge.map(|i| texture.models()[i].place());
            for part in (0..=100).map(|i| f64::from(i) / 100.0) {
                let [speed, force] = [0, 1].map(|k| from[k] + part * (to[k] - from[k]));
                let filter = texture.at(speed, force);
                assert!(is_stable(filter.ar()) && is_stable(filter.ma()), "{name} {speed} {force}");
                assert!(line_spectrum::from_polynomial(filter.ar()).is_some());
            }
        }
    }
}
