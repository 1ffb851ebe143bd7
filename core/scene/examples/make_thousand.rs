//! Prints graphs/scenes/thousand.ron: 40 by 25 tiles of 10 mm, whose effects change from tile to tile.

const MATERIALS: [&str; 8] = [
    "canvas",
    "hessian",
    "oak",
    "denim",
    "sandpaper P80",
    "sine grating 1 mm",
    "brushed steel",
    "coarse loop pile",
];

fn main() {
    println!(
        "// A thousand tiles of 10 mm, 40 along x and 25 along y. \
         One is touched at a time, and costs as much as it would alone."
    );
    println!("// Made by `cargo run -p asperity-scene --example make_thousand`.");
    println!("Scene(\n    version: 1,\n    tick_hz: 500,\n    audio_hz: 48000,\n    seed: 2024,");
    println!("    input: stroke(shape: zigzag, extent_mm: 300.0, speed_mm_s: 120.0, duration_s: 8.0),");
    println!("    motion: (cutoff_hz: 20.0, cutoff_hz_per_mm_s: 1.0),");
    println!("    device: (max_force_n: 3.3, damping_ns_per_m: 2.0),");
    println!(
        "    network: (model: \"../models/surfaces/texture.onnx\", \
         library: \"../models/surfaces/materials.ron\", \
         synthesis_hz: 2500, precision: int8),"
    );
    println!("    gain: 0.2,\n    actuator: (profile: \"hapcoil_one\", handle_mass_g: 100.0),");
    println!("    output: audio_out(volts_at_full_scale: 1.0, amps_per_volt: 1.0),\n    surfaces: {{");
    for row in 0..25_usize {
        for column in 0..40_usize {
            let number = 40 * row + column;
            let (x, y) = (10.0 * column as f64 - 195.0, 10.0 * row as f64 - 120.0);
            let material = MATERIALS[(number * 7 + row) % MATERIALS.len()];
            let friction = [
                "",
                ", friction: viscous_coulomb(coefficient: 0.3, viscosity_s_per_mm: 0.0005)",
                ", friction: dahl(coefficient: 0.5)",
                ", friction: lugre",
            ][number % 4];
            let texture = match number % 5 {
                0 => "autoregressive(model: \"../models/made_ar/rough.ron\")",
                1 => {
                    "waveform(segments: [(0, 0), (0.5, 5), (1, 0), (1.5, -5), (2, 0)], \
                     spacing_mm: 0.05, reference_speed_mm_s: 100)"
                }
                _ => "network",
            };
            println!(
                "        \"{row}-{column}\": (shape: rectangle(size_mm: (10, 10)), place_mm: ({x}, {y}, 0), \
                 material: \"{material}\", effects: \
                 (stiffness: (stiffness_n_per_mm: 0.5){friction}, texture: {texture})),"
            );
        }
    }
    println!("    }},\n)");
}
