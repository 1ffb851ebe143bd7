//! Checks that a tick of a phase-retrieval node does not touch the allocator.
#![allow(unreachable_pub)] // for the test that includes it

use asperity_sdk::Node;
use assert_no_alloc::{AllocDisabler, assert_no_alloc, violation_count};

use crate::common::{Rig, layout, noise};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// Runs a node with a look-ahead of 0 and of `most` frames.
pub fn no_tick_allocates<N: Node>(most: f64) {
    assert_no_alloc(|| drop(std::hint::black_box(vec![1_u8; 64])));
    let baseline = violation_count();
    assert!(baseline > 0, "the instrument must see an allocation");
    for (rate_hz, bins) in [(500, 26), (2500, 101), (44_100, 101), (4800, 241)] {
        for look_ahead in [0.0, most] {
            let mut rig = Rig::new::<N>(layout(rate_hz, bins), &[("look_ahead", look_ahead)]);
            let mut frame = vec![0.0; bins as usize];
            let mut bytes = vec![0; rig.node.state_size()];
            assert_no_alloc(|| {
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
            assert!(rig.out().is_some(), "the last frame came out");
        }
    }
    assert_eq!(violation_count(), baseline);
}
