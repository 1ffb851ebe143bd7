//! A stylus that jumps.

use std::sync::Arc;

use crate::case::{Found, holds};
use crate::rig::Rig;
use crate::subject::Subject;

/// A circle of 20 mm at 60 mm/s, 2 mm deep.
fn circle(seconds: f64) -> [f64; 3] {
    let turn = seconds * 60.0 / 20.0;
    [20.0 * turn.cos(), 20.0 * turn.sin(), -2.0]
}

pub(super) fn teleport(subject: &Subject<'_>) -> Found {
    let hz = f64::from(subject.its_graph()?.tick_hz);
    let jump = (1.0 * hz) as u64;
    let play = |way: f64| {
        let motion = Arc::new(move |tick: u64| {
            let [x, y, z] = circle(tick as f64 / hz);
            // There and back within two ticks, so that both runs end at the same places.
            [if tick == jump { x + way } else { x }, y, z]
        });
        let mut rig = Rig::new(subject, motion, &[])?;
        let (mut last, mut most) = (Vec::new(), 0.0_f32);
        let ticks = rig.ticks(4.0);
        rig.run(ticks, |rig, tick| {
            for samples in rig.drive() {
                holds(samples.iter().all(|x| x.is_finite()), || {
                    format!("the drive is not finite at tick {tick}")
                })?;
                most = samples.iter().fold(most, |m, x| m.max(x.abs()));
                if tick > jump + rig.ticks(1.0) {
                    last.extend_from_slice(samples);
                }
            }
            Ok(())
        })?;
        holds(rig.engine.faults() == 0, || format!("{} faults", rig.engine.faults()))?;
        Ok::<_, crate::Not>((last, most))
    };
    let ((with, peak), (without, usual)) = (play(200.0)?, play(0.0)?);
    let rms = |x: &[f32]| (x.iter().map(|x| f64::from(x * x)).sum::<f64>() / x.len().max(1) as f64).sqrt();
    let (a, b) = (rms(&with), rms(&without));
    // Textures of random phases are other waveforms after the jump. The mean square of noise of a band of B Hz over T s deviates by 1 / sqrt(B T) of it: 200 Hz over 2 s
    // by 5 %, two of them from each other by 0.3 dB. 1 dB is three of those.
    let apart = (10.0_f64.powf(1.0 / 20.0) - 1.0) * b;
    holds((a - b).abs() <= apart.max(0.01 * f64::from(usual)), || {
        format!("1 s later its rms is {a:.4}, without the jump {b:.4}")
    })?;
    Ok(format!("peak {peak:.3}, {usual:.3} without the jump; rms a second later {a:.4} and {b:.4}"))
}
