//! `gsrtisi_la` against the published scores, and with frames that are odd, missing or bad.

use harness::counting::Counting;
use harness::retrieval::{VECTORS, convergence, invert, published, vector};
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
            let db = convergence::<GsrtisiLa>(&magnitudes, rate_hz, &params, 1.0);
            // Two of the methods were published for 2.5 kHz alone.
            let Some([reference, ..]) = published(name, method) else { continue };
            println!("{name}, {method}: {db:.2} dB, published {reference:.2} dB");
            assert!(db < reference + 1.5, "{name}, {method}: {db} dB, published {reference} dB");
        }
    }
}

#[test]
fn gsrtisi_la_scores_do_not_hang_on_the_unit() {
    let magnitudes = vector("texture_2500", 2500);
    for scale in [1e-12, 1.1, 1e12] {
        let db = convergence::<GsrtisiLa>(&magnitudes, 2500, &[], scale);
        println!("times {scale:e}: {db:.2} dB");
        assert!(db < -18.7, "times {scale:e}: {db} dB");
    }
}

#[test]
fn a_coarse_grid_finds_what_the_signals_own_finds() {
    // 101 bins of 4800 samples are found on a grid of 216 samples a frame, of 250 samples on their own.
    let (params, magnitudes) = ([("look_ahead", 4.0)], vector("chirp_2500", 2500));
    let signal = invert::<GsrtisiLa>(&magnitudes, 2500, &params, 1.0);
    let scaled: Vec<f32> = magnitudes.iter().map(|m| m * 4410.0 / 250.0).collect();
    let fine = invert::<GsrtisiLa>(&scaled, 44_100, &params, 1.0);
    let score = |y: &[f64], m: &[f32], hz| {
        asperity_accuracy::phase::score(m, &asperity_accuracy::phase::framing(hz, 101), y)
            .expect("a score")
            .convergence_db
    };
    let (own, coarse) = (score(&signal, &magnitudes, 2500), score(&fine, &scaled, 44_100));
    println!("{own:.2} dB at 2500 Hz, {coarse:.2} dB at 44.1 kHz");
    assert!(coarse < own + 1.5, "{coarse} dB, {own} dB");
}

const SETTINGS: [&[(&str, f64)]; 3] = [
    &[("look_ahead", 0.0), ("iterations", 1.0)],
    &[("look_ahead", 1.0), ("iterations", 2.0)],
    &[("look_ahead", 4.0), ("iterations", 4.0)],
];

#[test]
fn gsrtisi_la_survives_odd_missing_and_bad_frames() {
    survival::survives::<GsrtisiLa>(&SETTINGS);
}

#[test]
fn gsrtisi_la_does_not_wear_in_a_million_frames() {
    SETTINGS[..2].iter().for_each(|p| survival::hours_do_not_wear_the_phase::<GsrtisiLa>(p, 1e-3));
}

#[test]
fn gsrtisi_la_goes_on_from_what_another_remembers() {
    survival::what_is_remembered_goes_on::<GsrtisiLa>(SETTINGS[2], SETTINGS[1]);
    survival::what_is_remembered_goes_on::<GsrtisiLa>(SETTINGS[0], SETTINGS[2]);
}

/// Counts allocations.
#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_tick_of_gsrtisi_la_allocates() {
    survival::no_tick_allocates::<GsrtisiLa>([0.0, 4.0]);
}
