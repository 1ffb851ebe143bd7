//! Effects as a tick thread runs them.

use std::sync::Arc;

use asperity_nodes::effects::friction::{Dahl, LuGre, LuGreSettings, ViscousCoulomb};
use asperity_nodes::effects::magnet::Pull;
use asperity_nodes::effects::path::{Parts, Path, Smoothing};
use asperity_nodes::effects::relief::{Follower, HeightSpline, ReliefSettings};
use asperity_nodes::effects::tap::{DecayingSinusoid, Recording, TapSettings, Taps, Transient};
use asperity_nodes::effects::vibration::Sine;
use asperity_nodes::effects::viscosity::Drag;
use asperity_nodes::effects::waveform::{Reader, WaveformQuantity, WaveformTable};
use asperity_surfaces::topography::HeightField;
use harness::counting::allocations;

const RATE: u32 = 48_000;

struct All {
    path: Path,
    viscous: ViscousCoulomb,
    dahl: Dahl,
    lugre: LuGre,
    magnet: Pull,
    viscosity: Drag,
    taps: [Taps; 2],
    vibration: Sine,
    waveform: Reader,
    relief: Follower,
    heights: HeightSpline,
}

fn sinusoids(count: usize) -> Transient {
    let one =
        |n: usize| DecayingSinusoid { frequency_hz: 120.0 + 90.0 * n as f64, decay_ms: 40.0, gain: 200.0 };
    Transient::Sinusoids((0..count).map(one).collect())
}

fn all() -> All {
    let values: Vec<f64> =
        (0..100_000).map(|n| (f64::from(n) * 0.37).sin() + (f64::from(n) * 0.011).cos()).collect();
    let quantity = WaveformQuantity::Acceleration { reference_speed_mm_s: 80.0, speed_exponent: 1.0 };
    let table = WaveformTable::new(&values, 0.02, 10.0, quantity).unwrap();
    let recording = Recording {
        samples: (0..500).map(|n| (n as f32 * 0.2).sin()).collect(),
        rate_hz: 10_000.0,
        speed_mm_s: 50.0,
    };
    let tap = |t: &Transient| Taps::new(t, TapSettings::default(), RATE).unwrap();
    let field = HeightField::from_fn(1024, 0.04, |x, y| 0.01 * (3.1 * x).sin() * (2.3 * y).cos());
    All {
        path: Path::new(Smoothing::Hermite, 500),
        viscous: ViscousCoulomb::new(0.5, 0.004).unwrap(),
        dahl: Dahl::new(0.5, 2.0).unwrap(),
        lugre: LuGre::new(LuGreSettings::default()).unwrap(),
        magnet: Pull::new(0.5, 1.0, 5.0).unwrap(),
        viscosity: Drag::new(3.0, 2.0).unwrap(),
        taps: [tap(&sinusoids(3)), tap(&Transient::Recorded(recording))],
        vibration: Sine::new(123.0, 1.0, RATE).unwrap(),
        waveform: Reader::new(Arc::new(table)),
        relief: Follower::new(ReliefSettings::default(), RATE).unwrap(),
        heights: HeightSpline::new(&field),
    }
}

#[test]
fn a_tick_of_all_effects_does_not_allocate() {
    let mut it = all();
    let mut out = [0.0_f32; 96];
    let mut sums = [0.0_f64; 9];
    let ((), count) = allocations(|| {
        for tick in 0..2000_u64 {
            let t = tick as f64 / 500.0;
            let mut velocity = [90.0 * t.cos(), 60.0 * (2.0 * t).cos()];
            let position = [90.0 * t.sin(), 30.0 * (2.0 * t).sin()];
            if tick % 100 == 7 {
                velocity[0] = f64::NAN;
            }
            let normal = 1.0 + t.sin();
            it.path.advance(position, velocity);
            let parts = Parts::new(tick, 96 * tick, RATE, 500);
            let (a, b) = (it.viscous.force_n(velocity, normal), it.dahl.step(velocity, normal, 2e-3));
            let c = it.lugre.step(velocity, normal, 2e-3);
            let d = it.viscosity.force_n([velocity[0], velocity[1], 3.0]);
            for (sum, x) in sums.iter_mut().zip([a[1], b[1], c[1], d[1], it.magnet.force_n(3.0 * t.sin())]) {
                *sum += x.abs();
            }
            for (tap, sum) in it.taps.iter_mut().zip(&mut sums[5..]) {
                if tick % 13 == 0 {
                    tap.strike(96 * tick, 0.3, 70.0);
                }
                tap.process(96 * tick, &mut out);
                *sum += out.iter().map(|x| f64::from(x.abs())).sum::<f64>();
            }
            it.vibration.process(96 * tick, &mut out);
            it.waveform.process(&it.path, &parts, &mut out);
            sums[7] += out.iter().map(|x| f64::from(x.abs())).sum::<f64>();
            it.relief.process(&it.heights, &it.path, &parts, &mut out);
            sums[8] += out.iter().map(|x| f64::from(x.abs())).sum::<f64>();
        }
    });
    assert_eq!(count, 0);
    assert!(sums.iter().all(|sum| sum.is_finite() && *sum > 10.0), "{sums:?}");
}
