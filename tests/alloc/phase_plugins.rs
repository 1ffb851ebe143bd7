//! No tick of a shipped phase-retrieval plugin allocates.

use asperity_sdk::Node;
use gsrtisi_la::GsrtisiLa;
use harness::counting::allocations;
use harness::retrieval::{Rig, layout, noise};
use rtpghi::Rtpghi;

/// Frames that are odd or missing, a state handed over, a reset.
fn no_tick_allocates<N: Node>(look_aheads: [f64; 2]) {
    for (rate_hz, bins) in [(500, 26), (2500, 101), (44_100, 101), (4800, 241)] {
        for look_ahead in look_aheads {
            let mut rig = Rig::new::<N>(layout(rate_hz, bins), &[("look_ahead", look_ahead)]);
            let mut frame = vec![0.0; bins as usize];
            let mut bytes = vec![0; rig.node.state_size()];
            let ((), count) = allocations(|| {
                for n in 0..2000 {
                    let odd = n % 7 == 0;
                    for (k, m) in frame.iter_mut().enumerate() {
                        *m = if odd && k % 3 == 0 { f32::NAN } else { noise(n / 3, k as u64) };
                    }
                    rig.step((n % 11 != 0).then_some(&frame));
                    if n == 1000 {
                        let len = rig.node.save(&mut bytes).expect("room");
                        assert!(rig.node.restore(&bytes[..len]));
                    }
                    if n == 1500 {
                        rig.node.reset().expect("no fault");
                    }
                }
            });
            assert_eq!(count, 0, "{rate_hz} Hz, {bins} bins, look ahead {look_ahead}");
            assert!(rig.out().is_some(), "the last frame came out");
        }
    }
}

#[test]
fn no_tick_of_rtpghi_allocates() {
    no_tick_allocates::<Rtpghi>([0.0, 1.0]);
}

#[test]
fn no_tick_of_gsrtisi_la_allocates() {
    no_tick_allocates::<GsrtisiLa>([0.0, 4.0]);
}
