//! scratch
use asperity_dataset::{made, pattern};
use asperity_world::material::Library;
use rayon::prelude::*;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let out = std::env::args().nth(2).unwrap();
    let want: Vec<String> = std::env::args().skip(3).collect();
    let library = Library::read(&path).unwrap();
    let mut materials = library.materials().to_vec();
    let settings = made::Settings::default();
    materials.par_iter_mut().for_each(|m| {
        if !want.is_empty() && !want.iter().any(|w| m.name.contains(w.as_str())) {
            return;
        }
        let Ok(s) = made::surface(&m.name) else { return };
        let strokes = made::straight_strokes(&s, &settings);
        m.pattern = pattern::find(&strokes);
        let report = pattern::report(&strokes, &m.pattern);
        let waves: Vec<_> = m
            .pattern
            .waves
            .iter()
            .map(|w| (w.per_mm, w.harmonics.iter().map(|h| h.share).take(4).collect::<Vec<_>>()))
            .collect();
        println!(
            "{} | {} | {:?} | {:?}\n{report}",
            m.name,
            m.family.as_deref().unwrap_or(""),
            m.pattern.events,
            waves
        );
    });
    std::fs::write(&out, Library::new(&path, Some("encoder.onnx".to_owned()), materials).to_ron()).unwrap();
}
