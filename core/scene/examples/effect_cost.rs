//! What a tick of each effect costs: medians over 101 runs of 200 ticks, nanoseconds.
//!
//! `cargo run --release -p asperity-scene --example effect_cost`

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use asperity_scene::effect::friction::{Dahl, LuGre, LuGreSettings, ViscousCoulomb};
use asperity_scene::effect::{
    DecayingSinusoid, EffectError, HeightSpline, Heights, Magnet, Parts, Path, Relief, ReliefSettings,
    Smoothing, Tap, TapSettings, Transient, Vibration, Viscosity, Waveform, WaveformQuantity, WaveformTable,
};
use asperity_surfaces::topography::HeightField;

const RATE: u32 = 48_000;

fn cost(what: &str, mut call: impl FnMut(u64)) {
    let mut tick = 0;
    let mut times: Vec<f64> = (0..101)
        .map(|_| {
            let began = Instant::now();
            for _ in 0..200 {
                call(tick);
                tick += 1;
            }
            began.elapsed().as_nanos() as f64 / 200.0
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("{what}: {:.0}", times[50]);
}

fn sinusoids(count: usize, decay_ms: f64) -> Transient {
    let one = |n: usize| DecayingSinusoid { frequency_hz: 120.0 + 90.0 * n as f64, decay_ms, gain: 200.0 };
    Transient::Sinusoids((0..count).map(one).collect())
}

fn main() -> Result<(), EffectError> {
    // Ways and velocities, made beforehand: 16 s at 500 Hz.
    let ways: Vec<([f64; 2], [f64; 2])> = (0..8192_u32)
        .map(|n| {
            let t = f64::from(n) / 500.0;
            ([90.0 * t.sin(), 30.0 * (2.0 * t).sin()], [90.0 * t.cos(), 60.0 * (2.0 * t).cos()])
        })
        .collect();
    let way = |n: u64| ways[n as usize % ways.len()];
    let mut out = [0.0_f32; 96];

    let viscous = ViscousCoulomb::new(0.5, 0.004)?;
    cost("viscous Coulomb friction", |n| {
        black_box(viscous.force_n(way(n).1, 1.0));
    });
    let mut dahl = Dahl::new(0.5, 2.0)?;
    cost("Dahl's friction", |n| {
        black_box(dahl.step(way(n).1, 1.0, 2e-3));
    });
    let mut lugre = LuGre::new(LuGreSettings::default())?;
    cost("LuGre friction", |n| {
        black_box(lugre.step(way(n).1, 1.0, 2e-3));
    });
    let magnet = Magnet::new(0.5, 1.0, 5.0)?;
    cost("magnet", |n| {
        black_box(magnet.force_n(0.05 * way(n).0[0]));
    });
    let viscosity = Viscosity::new(3.0, 2.0)?;
    cost("viscosity", |n| {
        let [x, y] = way(n).1;
        black_box(viscosity.force_n([x, y, 0.0]));
    });
    let vibration = Vibration::new(123.0, 1.0, RATE)?;
    cost("vibration, 96 samples", |n| vibration.process(96 * n, black_box(&mut out)));

    let mut tap = Tap::new(&sinusoids(3, 1e5), TapSettings::default(), RATE)?;
    cost("no tap, 96 samples", |n| {
        tap.process(96 * n, black_box(&mut out));
    });
    tap.strike(0, 0.0, 100.0);
    cost("a tap of three sinusoids, 96 samples", |n| {
        tap.process(96 * n, black_box(&mut out));
    });
    for n in 0..4 {
        tap.strike(3_000_000 + 1000 * n, 0.0, 100.0);
    }
    cost("four taps of three sinusoids, 96 samples", |n| {
        tap.process(3_004_000 + 96 * n, black_box(&mut out));
    });
    let mut tap = Tap::new(&sinusoids(8, 40.0), TapSettings::default(), RATE)?;
    cost("a strike of eight sinusoids", |n| {
        black_box(tap.strike(96 * n, 0.5, 100.0));
        tap.reset();
    });

    let mut path = Path::new(Smoothing::Hermite, 500);
    cost("path", |n| {
        let (position, velocity) = way(n);
        path.advance(position, velocity);
        black_box(&path);
    });
    let values = vec![1.0; 100_000];
    let began = Instant::now();
    let quantity = WaveformQuantity::Acceleration { reference_speed_mm_s: 80.0, speed_exponent: 1.0 };
    let table = WaveformTable::new(&values, 0.02, 10.0, quantity)?;
    println!("a table of 100 000 values: {} ms", began.elapsed().as_millis());
    let mut waveform = Waveform::new(Arc::new(table));
    cost("waveform, 96 samples", |n| {
        let (position, velocity) = way(n);
        path.advance(position, velocity);
        waveform.process(&path, &Parts::new(n, 96 * n, RATE, 500), black_box(&mut out));
    });
    let field = HeightField::from_fn(1024, 0.04, |x, y| 0.01 * (3.1 * x).sin() * (2.3 * y).cos());
    let began = Instant::now();
    let heights = HeightSpline::new(&field);
    println!("a spline of 1024 x 1024 points: {} ms", began.elapsed().as_millis());
    let mut relief = Relief::new(ReliefSettings::default(), RATE)?;
    cost("relief, 96 samples", |n| {
        let (position, velocity) = way(n);
        path.advance(position, velocity);
        relief.process(&heights, &path, &Parts::new(n, 96 * n, RATE, 500), black_box(&mut out));
    });
    cost("a place of a spline", |n| {
        let [x, y] = way(n).0;
        black_box(heights.jet(x, y));
    });
    Ok(())
}
