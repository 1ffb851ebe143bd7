//! scratch
use asperity_dataset::{made, pattern};
use asperity_world::topography::made_surfaces;
fn main() {
    let want: Vec<String> = std::env::args().skip(1).collect();
    let settings = made::Settings::default();
    for s in made_surfaces() {
        if !want.iter().any(|w| s.name.contains(w.as_str())) { continue; }
        let t = std::time::Instant::now();
        let strokes = made::straight_strokes(&s, &settings);
        let a = t.elapsed();
        let found = if std::env::var("DBG").is_ok() { println!("{}", s.name); pattern::waves_only(&strokes) } else { pattern::find(&strokes) };
        println!("{}: strokes {a:?}, all {:?}\n  {:?}", s.name, t.elapsed(), found.events);
        for w in &found.waves {
            println!("  k {:?}  {:?}", w.per_mm, w.harmonics.iter().map(|h| (h.share, h.phase)).collect::<Vec<_>>());
        }
        pattern::report(&strokes, &found);
    }
}
