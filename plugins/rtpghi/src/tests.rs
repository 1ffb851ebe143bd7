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

const BOTH: [&[(&str, f64)]; 2] = [&[("look_ahead", 0.0)], &[("look_ahead", 1.0)]];

#[test]
fn rtpghi_survives_odd_missing_and_bad_frames() {
    survival::survives::<Rtpghi>(&BOTH);
}

#[test]
fn rtpghi_does_not_drift_in_a_million_frames() {
    BOTH.iter().for_each(|p| survival::hours_do_not_wear_the_phase::<Rtpghi>(p, 1e-6));
}

#[test]
fn rtpghi_goes_on_from_what_another_remembers() {
    survival::what_is_remembered_goes_on::<Rtpghi>(BOTH[0], BOTH[1]);
    survival::what_is_remembered_goes_on::<Rtpghi>(BOTH[1], BOTH[0]);
}

/// Counts allocations.
#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn no_tick_of_rtpghi_allocates() {
    survival::no_tick_allocates::<Rtpghi>([0.0, 1.0]);
}
