//! `rtpghi` against the published scores, and with frames that are odd or missing.

use harness::retrieval::{VECTORS, convergence, published, vector};
use harness::survival;

use crate::Rtpghi;

#[test]
fn rtpghi_reaches_the_published_scores() {
    for (name, rate_hz) in VECTORS {
        let magnitudes = vector(name, rate_hz);
        for look_ahead in [0, 1] {
            let reference = published(name, &format!("rtpghi{look_ahead}")).expect("a score")[0];
            let db = convergence::<Rtpghi>(&magnitudes, rate_hz, &[("look_ahead", f64::from(look_ahead))]);
            println!("{name}, look ahead {look_ahead}: {db:.2} dB, published {reference:.2} dB");
            assert!(
                db < reference + 1.5,
                "{name}, look ahead {look_ahead}: {db} dB, published {reference} dB"
            );
        }
    }
}

#[test]
fn rtpghi_scores_do_not_hang_on_the_seed() {
    let magnitudes = vector("texture_2500", 2500);
    for seed in [2.0, 3.0] {
        let db = convergence::<Rtpghi>(&magnitudes, 2500, &[("seed", seed)]);
        assert!(db < -15.5, "seed {seed}: {db} dB");
    }
}

#[test]
fn rtpghi_puts_out_each_frame_with_its_magnitudes() {
    survival::frames_come_out::<Rtpghi>(&[&[("look_ahead", 0.0)], &[("look_ahead", 1.0)]]);
}
