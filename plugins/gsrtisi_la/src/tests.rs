//! `gsrtisi_la` against the published scores, and with frames that are odd or missing.

use harness::retrieval::{VECTORS, convergence, published, vector};
use harness::survival;

use crate::GsrtisiLa;

/// Look ahead, iterations, and what `sc.json` calls that.
const METHODS: [(i32, i32, &str); 4] =
    [(0, 5, "gsrtisi_it5"), (1, 5, "gsrtisila1_it5"), (4, 4, "gsrtisila4_it4"), (10, 4, "gsrtisila10_it4")];

#[test]
fn gsrtisi_la_reaches_the_published_scores() {
    for (name, rate_hz) in VECTORS {
        let magnitudes = vector(name, rate_hz);
        for (look_ahead, iterations, method) in METHODS {
            let params = [("look_ahead", f64::from(look_ahead)), ("iterations", f64::from(iterations))];
            let db = convergence::<GsrtisiLa>(&magnitudes, rate_hz, &params);
            // Two of the methods were published for 2.5 kHz alone.
            let Some([reference, ..]) = published(name, method) else { continue };
            println!("{name}, {method}: {db:.2} dB, published {reference:.2} dB");
            assert!(db < reference + 1.5, "{name}, {method}: {db} dB, published {reference} dB");
        }
    }
}

#[test]
fn a_coarse_grid_finds_what_the_signals_own_finds() {
    // 101 bins of 4800 samples are found on a grid of 216 samples a frame, of 250 samples on their own.
    let (params, magnitudes) = ([("look_ahead", 4.0)], vector("chirp_2500", 2500));
    let scaled: Vec<f32> = magnitudes.iter().map(|m| m * 4410.0 / 250.0).collect();
    let own = convergence::<GsrtisiLa>(&magnitudes, 2500, &params);
    let coarse = convergence::<GsrtisiLa>(&scaled, 44_100, &params);
    println!("{own:.2} dB at 2500 Hz, {coarse:.2} dB at 44.1 kHz");
    assert!(coarse < own + 1.5, "{coarse} dB, {own} dB");
}

const SETTINGS: [&[(&str, f64)]; 3] = [
    &[("look_ahead", 0.0), ("iterations", 1.0)],
    &[("look_ahead", 1.0), ("iterations", 2.0)],
    &[("look_ahead", 4.0), ("iterations", 4.0)],
];

#[test]
fn gsrtisi_la_puts_out_each_frame_with_its_magnitudes() {
    survival::frames_come_out::<GsrtisiLa>(&SETTINGS);
}
