//! `rtpghi` against the published scores, over the shipped vectors.

mod common;

use common::{VECTORS, convergence, published, vector};
use rtpghi::Rtpghi;

#[test]
fn rtpghi_reaches_the_published_scores() {
    for (name, rate_hz) in VECTORS {
        let magnitudes = vector(name, rate_hz);
        for look_ahead in [0, 1] {
            let reference = published(name, &format!("rtpghi{look_ahead}")).expect("a score");
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
fn rtpghi_scores_are_independent_of_seed_and_unit() {
    let magnitudes = vector("texture_2500", 2500);
    for (seed, scale) in [(2.0, 1.0), (3.0, 1.0), (4.0, 1e-12), (5.0, 1e12)] {
        let db = convergence::<Rtpghi>(&magnitudes, 2500, &[("seed", seed)], scale);
        println!("seed {seed}, times {scale:e}: {db:.2} dB");
        assert!(db < -15.5, "seed {seed}, times {scale:e}: {db} dB");
    }
}
