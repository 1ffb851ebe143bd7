//! `rtpghi` against the published scores, and with frames that are odd, missing or bad.

use harness::counting::Counting;
use harness::retrieval::{VECTORS, convergence, published, vector};
use harness::survival;

use crate::Rtpghi;

#[test]
fn rtpghi_reaches_the_published_scores() {
    for (name, rate_hz) in VECTORS {
        let magnitudes = vector(name, rate_hz);
        for look_ahead in [0, 1] {
            let reference = published(name, &format!("rtpghi{look_ahead}")).expect("a score")[0];
            let db =
                convergence::<Rtpghi>(&magnitudes, rate_hz, &[("look_ahead", f64::from(look_ahead))], 1.0);
            println!("{name}, look ahead {look_ahead}: {db:.2} dB, published {reference:.2} dB");
            assert!(
                db < reference + 1.5,
                "{name}, look ahead {look_ahead}: {db} dB, published {reference} dB"
            );
        }
    }
}

#[test]
fn rtpghi_scores_do_not_hang_on_the_seed_or_the_unit() {
    let magnitudes = vector("texture_2500", 2500);
    for (seed, scale) in [(2.0, 1.0), (3.0, 1.0), (4.0, 1e-12), (5.0, 1e12)] {
        let db = convergence::<Rtpghi>(&magnitudes, 2500, &[("seed", seed)], scale);
        println!("seed {seed}, times {scale:e}: {db:.2} dB");
        assert!(db < -15.5, "seed {seed}, times {scale:e}: {db} dB");
    }
}

const BOTH: [[(&str, f64); 1]; 2] = [[("look_ahead", 0.0)], [("look_ahead", 1.0)]];

#[test]
fn rtpghi_keeps_every_magnitude_of_odd_frames() {
    BOTH.iter().for_each(|p| survival::odd_frames_come_out::<Rtpghi>(p));
}

#[test]
fn rtpghi_puts_out_each_frame_beside_missing_ones() {
    BOTH.iter().for_each(|p| survival::frames_beside_gaps_come_out::<Rtpghi>(p));
}

#[test]
fn rtpghi_counts_what_is_no_magnitude() {
    BOTH.iter().for_each(|p| survival::bad_magnitudes_are_counted::<Rtpghi>(p));
}

#[test]
fn rtpghi_lets_a_tone_run_on_by_the_true_number_of_samples() {
    BOTH.iter().for_each(|p| survival::a_tone_runs_on::<Rtpghi>(p, 2e-3));
}

#[test]
fn rtpghi_does_not_drift_in_a_million_frames() {
    BOTH.iter().for_each(|p| survival::hours_do_not_wear_the_phase::<Rtpghi>(p, 1e-6));
}

#[test]
fn a_reset_rtpghi_is_a_fresh_one() {
    BOTH.iter().for_each(|p| survival::a_reset_node_is_a_fresh_one::<Rtpghi>(p));
}

#[test]
fn rtpghi_goes_on_from_what_another_remembers() {
    survival::what_is_remembered_goes_on::<Rtpghi>(&BOTH[0], &BOTH[1]);
    survival::what_is_remembered_goes_on::<Rtpghi>(&BOTH[1], &BOTH[0]);
}

/// Counts allocations.
#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_tick_of_rtpghi_allocates() {
    survival::no_tick_allocates::<Rtpghi>([0.0, 1.0]);
}
