//! Cost of the inverse, the limiter and the guard per block of 96 samples: `cargo run --release --example actuator_cost`.
//!
//! Prints microseconds, median and 99th percentile of 20000 blocks, back to back.

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use asperity_actuator::{
    ActuatorProfile, Drive, Dynamics, Inverse, InverseSettings, Limiter, LimiterSettings,
};
use asperity_node::Guard as _;

const RATE: f64 = 48_000.0;
const BLOCKS: usize = 20_000;

fn main() -> Result<(), Box<dyn Error>> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/actuators/hapcoil_one.ron");
    let dynamics = Dynamics::new(&ActuatorProfile::read(file)?, 100.0)?;
    for drive in [Drive::Current, Drive::Voltage] {
        let mut inverse = Inverse::new(&dynamics, drive, RATE, InverseSettings::default())?;
        time(&format!("inverse, {drive:?}"), 2.0, |x, y| inverse.process(x, y));
        for (what, level) in [("idle", 0.2), ("at work", 5.0)] {
            let mut limiter = Limiter::new(&dynamics, drive, RATE, LimiterSettings::default())?;
            let peak = limiter.limits().peak;
            time(&format!("limiter {what}, {drive:?}"), level * peak, |x, y| limiter.process(x, y));
            let mut guard = limiter.guard();
            time(&format!("guard {what}, {drive:?}"), level * peak, |x, y| {
                y.copy_from_slice(x);
                guard.hold(y, 1, 1.0);
            });
        }
    }
    Ok(())
}

fn time(what: &str, amplitude: f64, mut process: impl FnMut(&[f32], &mut [f32])) {
    let (mut x, mut y) = ([0.0f32; 96], [0.0f32; 96]);
    let mut us = Vec::with_capacity(BLOCKS);
    for block in 0..BLOCKS {
        for (n, x) in x.iter_mut().enumerate() {
            let t = (block * 96 + n) as f64 / RATE;
            *x = (amplitude * ((t * 408.0).sin() + (t * 2700.0).sin()) * 0.5) as f32;
        }
        let start = Instant::now();
        process(black_box(&x), black_box(&mut y));
        us.push(start.elapsed().as_secs_f64() * 1e6);
    }
    us.sort_by(f64::total_cmp);
    println!("{what:28} p50 {:6.3} us   p99 {:6.3} us", us[BLOCKS / 2], us[BLOCKS * 99 / 100]);
}
