//! `gsrtisi_la` against the published scores, over the shipped vectors.

#[path = "../../rtpghi/tests/common/mod.rs"]
mod common;

use common::{VECTORS, convergence, published, vector};
use gsrtisi_la::GsrtisiLa;

/// Look ahead, iterations, and what `sc.json` calls that.
const SETTINGS: [(i32, i32, &str); 4] =
    [(0, 5, "gsrtisi_it5"), (1, 5, "gsrtisila1_it5"), (4, 4, "gsrtisila4_it4"), (10, 4, "gsrtisila10_it4")];

#[test]
fn gsrtisi_la_reaches_the_published_scores() {
    for (name, rate_hz) in VECTORS {
        let magnitudes = vector(name, rate_hz);
        for (look_ahead, iterations, method) in SETTINGS {
            let params = [("look_ahead", f64::from(look_ahead)), ("iterations", f64::from(iterations))];
            let db = convergence::<GsrtisiLa>(&magnitudes, rate_hz, &params, 1.0);
            // Two of the methods were published for 2.5 kHz alone.
            let Some(reference) = published(name, method) else { continue };
            println!("{name}, {method}: {db:.2} dB, published {reference:.2} dB");
            assert!(db < reference + 1.5, "{name}, {method}: {db} dB, published {reference} dB");
        }
    }
}

#[test]
fn gsrtisi_la_scores_are_independent_of_the_unit() {
    let magnitudes = vector("texture_2500", 2500);
    for scale in [1e-12, 1.1, 1e12] {
        let db = convergence::<GsrtisiLa>(&magnitudes, 2500, &[], scale);
        println!("times {scale:e}: {db:.2} dB");
        assert!(db < -18.7, "times {scale:e}: {db} dB");
    }
}

#[test]
fn coarse_grid_scores_as_the_full_grid() {
    // 101 bins of 4800 samples are found on a grid of 216 samples a frame, of 250 samples on their own.
    let (params, magnitudes) = ([("look_ahead", 4.0)], vector("chirp_2500", 2500));
    let signal = common::invert::<GsrtisiLa>(&magnitudes, 2500, &params, 1.0);
    let scaled: Vec<f32> = magnitudes.iter().map(|m| m * 4410.0 / 250.0).collect();
    let fine = common::invert::<GsrtisiLa>(&scaled, 44_100, &params, 1.0);
    let score = |y: &[f64], m: &[f32], hz| {
        asperity_accuracy::phase::score(m, &asperity_accuracy::phase::framing(hz, 101), y)
            .expect("a score")
            .convergence_db
    };
    let (own, coarse) = (score(&signal, &magnitudes, 2500), score(&fine, &scaled, 44_100));
    println!("{own:.2} dB at 2500 Hz, {coarse:.2} dB at 44.1 kHz");
    assert!(coarse < own + 1.5, "{coarse} dB, {own} dB");
}
