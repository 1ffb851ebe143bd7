//! What holds of the Penn Haptic Texture Toolkit's hundred files, for whoever has them:
//!
//! ```text
//! HATT_DIR=/path/to/HaTT cargo test -p asperity-dataset --test hatt_facts -- --ignored --nocapture
//! ```
//!
//! The toolkit's licence forbids passing the files on; none are in this project.

use std::path::{Path, PathBuf};

use asperity_dataset::hatt;
use asperity_source::Source;
use asperity_world::autoregressive::{Texture, is_stable, line_spectrum};

/// Mixtures of an edge that are looked at, beside its ends.
const PARTS: u32 = 200;

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("xml")) {
            found.push(path);
        }
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

/// Whether every mixture of two lists, as it is turned into a polynomial, is stable.
fn all_stable(a: &[f64], b: &[f64], polynomial: impl Fn(&[f64]) -> Vec<f64>) -> bool {
    (0..=PARTS).all(|i| {
        let part = f64::from(i) / f64::from(PARTS);
        let mixed: Vec<f64> = a.iter().zip(b).map(|(x, y)| x + part * (y - x)).collect();
        is_stable(&polynomial(&mixed))
    })
}

#[test]
#[ignore = "HATT_DIR names the folder of the toolkit's files"]
fn thirteen_edges_are_unstable_by_coefficients_and_none_by_line_spectral_frequencies() {
    let folder = std::env::var_os("HATT_DIR").expect("HATT_DIR is not set");
    let mut paths = Vec::new();
    files(Path::new(&folder), &mut paths);
    paths.sort();
    let (mut textures, mut count, mut direct, mut by_lines) = (0, 0, 0, 0);
    for path in paths {
        let source = Source::read(&path).unwrap_or_else(|e| panic!("{e}"));
        if !source.text().to_ascii_lowercase().contains("<modelset") {
            continue;
        }
        let texture = hatt::parse(&source).unwrap_or_else(|e| panic!("{e}"));
        textures += 1;
        let models = texture.models();
        let lines: Vec<Vec<f64>> = models
            .iter()
            .map(|m| {
                assert!((14..=20).contains(&m.ar.len()), "{}: order {}", path.display(), m.ar.len());
                let lines = line_spectrum::from_polynomial(&m.ar).expect("a model is stable");
                assert!(line_spectrum::are_valid(&lines), "{}: frequencies that do not rise", path.display());
                lines
            })
            .collect();
        for [a, b] in edges(&texture) {
            count += 1;
            direct += usize::from(!all_stable(&models[a].ar, &models[b].ar, <[f64]>::to_vec));
            by_lines += usize::from(!all_stable(&lines[a], &lines[b], |lines| {
                let mut polynomial = vec![0.0; lines.len()];
                line_spectrum::to_polynomial(lines, &mut polynomial);
                polynomial
            }));
        }
    }
    println!(
        "{textures} files, {count} edges, unstable: {direct} by coefficients, {by_lines} by frequencies"
    );
    assert_eq!((textures, count, direct, by_lines), (100, 8007, 13, 0));
}
