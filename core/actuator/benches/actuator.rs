//! Time of the inverse, the limiter and the guard for 96 samples: idle, and at five times the peak.

use asperity_actuator::{
    ActuatorProfile, Drive, Dynamics, Inverse, InverseSettings, Limiter, LimiterSettings,
};
use asperity_node::Guard as _;
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;

const RATE: f64 = 48_000.0;

fn blocks(c: &mut Criterion) {
    let profile = ActuatorProfile::shipped("hapcoil_one").unwrap().unwrap();
    let dynamics = Dynamics::new(&profile, 100.0).unwrap();
    for drive in [Drive::Current, Drive::Voltage] {
        let mut inverse = Inverse::new(&dynamics, drive, RATE, InverseSettings::default()).unwrap();
        time(c, &format!("inverse/{drive:?}"), 2.0, |x, y| inverse.process(x, y));
        for (load, level) in [("idle", 0.2), ("at work", 5.0)] {
            let mut limiter = Limiter::new(&dynamics, drive, RATE, LimiterSettings::default()).unwrap();
            let mut guard = limiter.guard();
            let amplitude = level * limiter.limits().peak;
            time(c, &format!("limiter {load}/{drive:?}"), amplitude, |x, y| limiter.process(x, y));
            time(c, &format!("guard {load}/{drive:?}"), amplitude, |x, y| {
                y.copy_from_slice(x);
                guard.hold(y, 1, 1.0);
            });
        }
    }
}

/// Times blocks of two tones, one block after the other.
fn time(c: &mut Criterion, name: &str, amplitude: f64, mut process: impl FnMut(&[f32], &mut [f32])) {
    let tones = |n: usize| {
        let t = n as f64 / RATE;
        (amplitude * ((t * 408.0).sin() + (t * 2700.0).sin()) * 0.5) as f32
    };
    let signal: Vec<f32> = (0..96 * 1000).map(tones).collect();
    let (mut blocks, mut y) = (signal.chunks_exact(96).cycle(), [0.0f32; 96]);
    c.bench_function(name, |b| {
        b.iter(|| process(black_box(blocks.next().unwrap_or(&[])), black_box(&mut y)));
    });
}

criterion_group!(benches, blocks);
criterion_main!(benches);
