//! Makes the shipped stroke: `cargo run -p asperity-motion --example make_zigzag [FILE]`.
//!
//! Eight seconds as a person would explore a surface: approach, strokes that get faster and firmer, a
//! pause with a press, a hard stroke, lift-off and return through the air, two more strokes, lift-off.
//! The default file is `graphs/trajectories/zigzag.csv`.

use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_motion::{Itinerary, Move, Tremor};

/// Stiffness in N/mm for depths; the floor of the shipped graph has the same.
pub(crate) const STIFFNESS_N_PER_MM: f64 = 0.5;
/// The sensor's step in mm.
pub(crate) const QUANTUM_MM: f64 = 0.055;
const RATE_HZ: f64 = 500.0;

/// A stroke to (`x`, `y`) in mm at a mean speed in mm/s, arriving with a force in N.
fn stroke(from: &mut [f64; 3], x: f64, y: f64, mm_s: f64, newton: f64) -> Move {
    let seconds = (x - from[0]).hypot(y - from[1]) / mm_s;
    *from = [x, y, -newton / STIFFNESS_N_PER_MM];
    Move { to: *from, seconds }
}

/// A movement to (`x`, `y`, `z`) in mm within a time.
fn within(from: &mut [f64; 3], to: [f64; 3], seconds: f64) -> Move {
    *from = to;
    Move { to, seconds }
}

/// The stroke before sampling.
pub(crate) fn itinerary() -> Itinerary {
    let start = [-25.3, -15.4, 8.03];
    let p = &mut start.clone();
    let moves = [
        within(p, [-25.3, -15.4, -0.6], 0.5),
        stroke(p, 24.75, -9.9, 40.0, 0.6),
        stroke(p, -25.3, -4.95, 60.0, 1.0),
        stroke(p, 24.75, 0.0, 80.0, 1.5),
        stroke(p, -25.3, 4.95, 96.0, 1.0),
        within(p, [-25.3, 4.95, -4.0], 0.3),
        within(p, [-25.3, 4.95, -4.0], 0.4),
        stroke(p, 24.75, 9.9, 70.0, 2.5),
        within(p, [20.9, 11.0, 6.05], 0.3),
        within(p, [-9.9, 14.85, 6.05], 0.45),
        within(p, [-9.9, 14.85, -1.2], 0.3),
        stroke(p, 24.75, 4.95, 85.0, 0.8),
        stroke(p, -25.3, -4.95, 50.0, 0.3),
        within(p, [-25.3, -4.95, 8.03], 0.4),
    ];
    Itinerary::new(start, &moves, Tremor::new(0.04, 7), QUANTUM_MM)
}

/// The stroke as a CSV text.
pub(crate) fn csv() -> String {
    let stroke = itinerary();
    let mut text = String::from(
        "# A made stroke, as a person would explore a surface in the plane z = 0 (z up, 0.5 N/mm inside): \
         approach,\n\
         # strokes at 40 to 96 mm/s on average and up to 180, 0.3 to 2.5 N, a pause, a lift-off and return.\n\
         # Made by `cargo run -p asperity-motion --example make_zigzag`; positions are rounded to 0.055 mm.\n\
         t_s,x_mm,y_mm,z_mm\n",
    );
    for i in 0..=(stroke.duration_s() * RATE_HZ).floor() as u32 {
        let t = f64::from(i) / RATE_HZ;
        let [x, y, z] = stroke.sample(t).position.map(|v| v + 0.0);
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{t:.3},{x:.3},{y:.3},{z:.3}");
    }
    text.replace("-0.000", "0.000")
}

fn main() -> std::io::Result<()> {
    let shipped = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../graphs/trajectories/zigzag.csv");
    let path = std::env::args_os().nth(1).map_or_else(shipped, PathBuf::from);
    std::fs::write(&path, csv())?;
    println!("wrote {}", path.display());
    Ok(())
}
