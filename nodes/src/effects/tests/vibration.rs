//! `vibration`.

use std::f64::consts::TAU;

use crate::bench::{Bench, largest_step};
use crate::effects::vibration::Sine;
use asperity_dsp::filter::Sample as _;

const SOURCES: [&str; 3] = [
    "(frequency_hz: 120, amplitude_m_s2: 2)",
    "(frequency_hz: 77.7, amplitude_m_s2: 3)",
    "(frequency_hz: 300, amplitude_m_s2: 1)",
];

fn bench(rates: (u32, u32), slot: impl Fn(u64) -> f64 + Send + Sync + 'static) -> Bench {
    let bench = Bench::new("vibration", "slot", move |tick| vec![vec![slot(tick)]]);
    bench.rates(rates).list("sources", &SOURCES).set("fade_ms", "20")
}

/// Samples of a source.
fn source(hz: f64, amplitude: f64, rate: u32, count: usize) -> Vec<f32> {
    let mut out = vec![0.0; count];
    Sine::new(hz, amplitude, rate).unwrap().process(0, &mut out);
    out.into_iter().map(f32::narrow).collect()
}

#[test]
fn sources_crossfade_linearly_and_sleep_after_fading_out() {
    for (tick_hz, rate) in [(500, 48_000), (500, 44_100), (4000, 48_000)] {
        // Ticks of 20 ms.
        let fade = u64::from(tick_hz / 50);
        let slot = move |tick: u64| match tick / fade {
            0 => -1.0,
            1..5 => 0.0,
            5..9 => 1.0,
            9..20 => -1.0,
            20..24 => 1.0,
            _ => -1.0,
        };
        let (run, calls) = bench((tick_hz, rate), slot).run("it", 30 * fade);
        let out = run.audio;
        let (a, b) = (source(120.0, 2.0, rate, out.len()), source(77.7, 3.0, rate, out.len()));
        let span = f64::from(rate) / 50.0;
        for (n, y) in out.iter().enumerate() {
            let t = (n + 1) as f64 / span;
            let ramp = |from: f64| (t - from).clamp(0.0, 1.0);
            let (in_a, in_b) = (ramp(1.0) - ramp(5.0), ramp(5.0) - ramp(9.0) + ramp(20.0) - ramp(24.0));
            let want = in_a * f64::from(a[n]) + in_b * f64::from(b[n]);
            assert!((f64::from(*y) - want).abs() < 2e-6, "{n}: {y}, not {want}");
        }
        // Steady, it is its kernel to the bit.
        let steady = (2.0 * span) as usize + 2..(5.0 * span) as usize;
        assert_eq!(out[steady.clone()], a[steady]);
        // Of the first tick, two stretches of 9 and 5 fades with the tick that finds them faded.
        assert_eq!(calls, 1 + (9 * fade + 1) + (5 * fade + 1));
    }
}

#[test]
fn a_slot_that_comes_back_turns_round_and_no_change_is_a_step() {
    // Faster than a fade, through all of them, and more than can sound at a time.
    let slot = |tick: u64| match tick {
        0..20 => 0.0,
        20..23 => 1.0,
        23..26 => 0.0,
        26..28 => 2.0,
        28..31 => -1.0,
        31..60 => 0.0,
        60..160 => (tick % 3) as f64,
        160..260 => (tick % 4) as f64 - 1.0,
        _ => 2.0,
    };
    let (run, _) = bench((500, 48_000), slot).run("it", 300);
    let out = run.audio;
    let a = source(120.0, 2.0, 48_000, out.len());
    let b = source(77.7, 3.0, 48_000, out.len());
    // 6 ms of 20 to the other and back.
    for n in 20 * 96..26 * 96 {
        let gone = (n + 1 - 20 * 96).min(26 * 96 - (n + 1)) as f64 / 960.0;
        let want = (1.0 - gone) * f64::from(a[n]) + gone * f64::from(b[n]);
        assert!((f64::from(out[n]) - want).abs() < 2e-6, "{n}");
    }
    // No step beyond those of all three at once and the steepest of their fades.
    let steady = TAU * (2.0 * 120.0 + 3.0 * 77.7 + 300.0) / 48_000.0;
    assert!(f64::from(largest_step(&out)) < steady + 6.0 / 960.0, "{}", largest_step(&out));
    let end = source(300.0, 1.0, 48_000, out.len());
    assert_eq!(out[290 * 96..], end[290 * 96..]);
}

#[test]
fn what_cannot_sound_is_refused_at_the_rate_there_is() {
    let bench = Bench::new("vibration", "slot", |_| vec![vec![0.0]]).rates((500, 8000));
    let bench = bench.list("sources", &["(frequency_hz: 5000, amplitude_m_s2: 2)"]);
    let e = bench.engine("it", true).unwrap_err();
    assert!(e.contains("a frequency of 5000 Hz"), "{e}");
}
