//! Facts about the hundred files of the Penn Haptic Texture Toolkit, for whoever has them:
//!
//! ```text
//! HATT_DIR=/path/to/HaTT cargo test -p asperity-data hatt::facts -- --nocapture
//! ```
//!
//! The toolkit's licence forbids passing the files on; none are in this project. Without them this is said,
//! and the same is counted of textures of ours that are written as the toolkit writes its own.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use crate::{folder, hatt};
use asperity_autoregressive::{Texture, TextureFile, is_stable, line_spectrum};
use asperity_diagnostics::Source;

/// Mixtures of an edge to check, beside its ends.
const PARTS: u32 = 200;

fn edges(texture: &Texture) -> Vec<[usize; 2]> {
    let sides = |&[a, b, c]: &[usize; 3]| [[a, b], [b, c], [c, a]];
    let mut edges: Vec<[usize; 2]> =
        texture.triangles().corners().iter().flat_map(sides).map(|[a, b]| [a.min(b), a.max(b)]).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Whether every mixture of two lists, turned into a polynomial, is stable.
fn all_stable(a: &[f64], b: &[f64], polynomial: impl Fn(&[f64]) -> Vec<f64>) -> bool {
    (0..=PARTS).all(|i| {
        let part = f64::from(i) / f64::from(PARTS);
        let mixed: Vec<f64> = a.iter().zip(b).map(|(x, y)| x + part * (y - x)).collect();
        is_stable(&polynomial(&mixed))
    })
}

/// Figures of a folder.
#[derive(Debug, PartialEq)]
struct Counts {
    textures: usize,
    edges: usize,
    /// Edges on which some mixture is not stable: of coefficients, and of line spectral frequencies.
    unstable: [usize; 2],
    /// Least and greatest order.
    orders: [usize; 2],
}

fn counts(folder: &Path) -> Counts {
    let paths = folder::tree(folder).unwrap_or_else(|e| panic!("{e}"));
    let mut it = Counts { textures: 0, edges: 0, unstable: [0, 0], orders: [usize::MAX, 0] };
    for path in paths.into_iter().filter(|path| folder::ends_with(path, &["xml"])) {
        let source = Source::read(&path).unwrap_or_else(|e| panic!("{e}"));
        if !source.text().to_ascii_lowercase().contains("<modelset") {
            continue;
        }
        let texture = hatt::parse(&source).unwrap_or_else(|e| panic!("{e}"));
        it.textures += 1;
        let models = texture.models();
        let lines: Vec<Vec<f64>> = models
            .iter()
            .map(|m| {
                it.orders = [it.orders[0].min(m.ar.len()), it.orders[1].max(m.ar.len())];
                let lines = line_spectrum::from_polynomial(&m.ar).expect("a model is stable");
                let rise = lines.windows(2).all(|pair| pair[0] < pair[1]);
                assert!(rise, "{}: frequencies that do not rise", path.display());
                lines
            })
            .collect();
        for [a, b] in edges(&texture) {
            it.edges += 1;
            it.unstable[0] += usize::from(!all_stable(&models[a].ar, &models[b].ar, <[f64]>::to_vec));
            it.unstable[1] += usize::from(!all_stable(&lines[a], &lines[b], |lines| {
                let mut polynomial = vec![0.0; lines.len()];
                line_spectrum::to_polynomial(lines, &mut polynomial);
                polynomial
            }));
        }
    }
    it
}

/// Thirteen edges are unstable when coefficients are interpolated; none is with line spectral frequencies.
#[test]
fn hatt_edges_are_stable_by_line_spectral_frequencies() {
    let Some(folder) = std::env::var_os("HATT_DIR") else {
        // `eprintln!` shows only in failed tests.
        let said = "skipped: HATT_DIR does not name the folder of the toolkit's files";
        writeln!(std::io::stderr(), "{said}").expect("somebody hears");
        return;
    };
    let found = counts(Path::new(&folder));
    println!("{found:?}");
    assert_eq!(found, Counts { textures: 100, edges: 8007, unstable: [13, 0], orders: [14, 20] });
}

/// A texture as the toolkit writes it, with coefficients to nine digits.
fn xml(texture: &Texture) -> String {
    let row = |values: &[f64]| values.iter().map(|x| format!("{x:.9}")).collect::<Vec<_>>().join(" ");
    let mut text = format!("<modelSet>\n<SampleRate>{}</SampleRate>\n", texture.rate_hz());
    let corners: Vec<String> =
        texture.triangles().corners().iter().flatten().map(|i| (i + 1).to_string()).collect();
    writeln!(text, "<tri>{}</tri>", corners.join(" ")).expect("a text");
    for m in texture.models() {
        let lines = line_spectrum::from_polynomial(&m.ar).expect("a model is stable");
        writeln!(
            text,
            "<model><ARcoeff>1 {}</ARcoeff><ARlsf>{}</ARlsf><var>{}</var><gain>{}</gain>\
             <speedMod>{}</speedMod><forceMod>{}</forceMod></model>",
            row(&m.ar),
            row(&lines),
            m.variance,
            m.gain,
            m.speed_mm_s,
            m.force_n
        )
        .expect("a text");
    }
    text + "</modelSet>\n"
}

/// Some edges of the made textures are unstable when coefficients are interpolated; none is otherwise.
#[test]
fn made_edges_are_stable_by_line_spectral_frequencies() {
    let made = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../graphs/models/made_ar");
    let dir = tempfile::tempdir().expect("a folder");
    // As deep as the toolkit's folders, beside another file.
    std::fs::create_dir_all(dir.path().join("Models/XML")).expect("a folder");
    std::fs::write(dir.path().join("other.xml"), "<html/>").expect("a file");
    for (name, orders, unstable) in [("ringing", 8, 22), ("rough", 7, 0), ("smooth", 3, 0)] {
        let file = TextureFile::read(made.join(format!("{name}.ron"))).unwrap_or_else(|e| panic!("{e}"));
        std::fs::write(dir.path().join("Models/XML/m.xml"), xml(&file.texture)).expect("a file");
        let found = counts(dir.path());
        assert_eq!((found.textures, found.unstable, found.orders), (1, [unstable, 0], [orders; 2]), "{name}");
        assert!(found.edges > 40, "{name}: {}", found.edges);
    }
}
