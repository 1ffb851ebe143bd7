//! Synthesis of a texture as a tick thread does it.

use std::sync::Arc;

use asperity_autoregressive::{Model, Synthesis, Texture};
use harness::counting::allocations;

#[test]
fn synthesis_does_not_allocate() {
    let model = |speed_mm_s: f64, force_n: f64| Model {
        ar: vec![-1.2, 0.9, -0.2],
        ma: vec![0.3, 0.1],
        variance: 0.1,
        gain: 1.0,
        speed_mm_s,
        force_n,
    };
    let models = vec![model(20.0, 0.5), model(200.0, 0.5), model(100.0, 3.0), model(90.0, 1.0)];
    let mut synthesis = Synthesis::new(Arc::new(Texture::new(1000.0, models, None).unwrap()), 1);
    let mut samples = [0.0; 2];
    let mut largest: f32 = 0.0;
    let ((), count) = allocations(|| {
        for tick in 0..2000_u32 {
            let speed = if tick % 100 == 7 { f64::NAN } else { 0.3 * f64::from(tick % 1000) };
            synthesis.touch(speed, 0.002 * f64::from(tick));
            synthesis.process(2 * u64::from(tick), &mut samples);
            largest = samples.iter().fold(largest, |m, x| m.max(x.abs()));
        }
    });
    assert_eq!(count, 0);
    assert!(largest > 0.5 && largest < 20.0, "{largest}");
}
