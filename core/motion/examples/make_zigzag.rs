//! Makes the shipped stroke: `cargo run -p asperity-motion --example make_zigzag [FILE]`.
//!
//! Eight seconds as a person would explore a surface: approach, strokes that get faster and firmer, a
//! pause with a press, a hard stroke, lift-off and return through the air, two more strokes, lift-off.
//! The default file is `graphs/trajectories/zigzag.csv`.

use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_motion::{Tremor, minimum_jerk};

/// Stiffness in N/mm for depths; the floor of the shipped graph has the same.
pub(crate) const STIFFNESS_N_PER_MM: f64 = 0.5;
/// The sensor's step in mm.
pub(crate) const QUANTUM_MM: f64 = 0.055;
const RATE_HZ: f64 = 500.0;

/// A minimum-jerk movement from rest to rest. Times in s, points in mm.
struct Move {
    begin: f64,
    end: f64,
    from: [f64; 3],
    to: [f64; 3],
}

/// Movements one after another.
struct Moves(Vec<Move>);

impl Moves {
    /// A movement to a point within a time. It is a pause if the point stays.
    fn within(&mut self, to: [f64; 3], seconds: f64) -> &mut Self {
        let (begin, from) = self.0.last().map_or((0.0, START), |last| (last.end, last.to));
        self.0.push(Move { begin, end: begin + seconds, from, to });
        self
    }

    /// A stroke to (`x`, `y`) in mm at a mean speed in mm/s, arriving with a force in N.
    fn stroke(&mut self, x: f64, y: f64, mm_s: f64, newton: f64) -> &mut Self {
        let from = self.0.last().map_or(START, |last| last.to);
        let seconds = (x - from[0]).hypot(y - from[1]) / mm_s;
        self.within([x, y, -newton / STIFFNESS_N_PER_MM], seconds)
    }
}

const START: [f64; 3] = [-25.3, -15.4, 8.03];

/// The stroke as a CSV text.
pub(crate) fn csv() -> String {
    let mut text = String::from(
        "# A made stroke, as a person would explore a surface in the plane z = 0 (z up, 0.5 N/mm inside): \
         approach,\n\
         # strokes at 40 to 96 mm/s on average and up to 180, 0.3 to 2.5 N, a pause, a lift-off and return.\n\
         # Made by `cargo run -p asperity-motion --example make_zigzag`; positions are rounded to 0.055 mm.\n\
         t_s,x_mm,y_mm,z_mm\n",
    );
    let mut moves = Moves(Vec::new());
    moves.within([-25.3, -15.4, -0.6], 0.5).stroke(24.75, -9.9, 40.0, 0.6).stroke(-25.3, -4.95, 60.0, 1.0);
    moves.stroke(24.75, 0.0, 80.0, 1.5).stroke(-25.3, 4.95, 96.0, 1.0);
    moves.within([-25.3, 4.95, -4.0], 0.3).within([-25.3, 4.95, -4.0], 0.4).stroke(24.75, 9.9, 70.0, 2.5);
    moves.within([20.9, 11.0, 6.05], 0.3).within([-9.9, 14.85, 6.05], 0.45);
    moves.within([-9.9, 14.85, -1.2], 0.3).stroke(24.75, 4.95, 85.0, 0.8).stroke(-25.3, -4.95, 50.0, 0.3);
    moves.within([-25.3, -4.95, 8.03], 0.4);
    let tremor = Tremor::new(0.04, 7);
    let end = moves.0.last().map_or(0.0, |last| last.end);
    for i in 0..=(end * RATE_HZ).floor() as u32 {
        let t = f64::from(i) / RATE_HZ;
        let at = moves.0.iter().find(|it| t < it.end).or(moves.0.last());
        let Some(Move { begin, end, from, to }) = at else { break };
        let (part, shake) = (minimum_jerk((t - begin) / (end - begin)), tremor.at(t));
        let [x, y, z] = [0, 1, 2].map(|k| {
            let exact = from[k] + part * (to[k] - from[k]) + shake[k];
            (exact / QUANTUM_MM).round() * QUANTUM_MM + 0.0
        });
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
