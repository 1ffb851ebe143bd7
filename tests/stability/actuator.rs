//! The inverse, the limiter, and what they do to a simulated actuator.

use asperity_actuator::{ActuatorProfile, Drive, Dynamics};
use asperity_checks::{Piece, Place, Sound, Stop, Subject, limited};
use asperity_node::Status;
use proptest::prelude::*;

use crate::{broken, called, fails, graph, holds, holds_on, plugin, subject};

/// A mutant whose output is changed sample by sample: by the sample, its number from the first that was asked
/// for, and the sample before it.
fn changed<'g>(
    subject: &Subject<'g>,
    kind: &str,
    change: impl Fn(f32, u64, f32) -> f32 + Clone + Send + Sync + 'static,
) -> Subject<'g> {
    broken(subject, kind, move |(n, last): &mut (u64, f32), tick| {
        for y in tick.outputs.audio(0) {
            *y = change(*y, *n, *last);
            (*n, *last) = (*n + 1, *y);
        }
    })
}

/// A limiter that does something else with its input, sample by sample: by the sample, and the output before
/// it.
fn in_place<'g>(
    subject: &Subject<'g>,
    does: impl Fn(f32, f32) -> f32 + Clone + Send + Sync + 'static,
) -> Subject<'g> {
    called(subject, "limiter", move |_| {
        let (does, mut last) = (does.clone(), 0.0);
        Box::new(move |_, tick| {
            let asked = tick.inputs.audio(0);
            for (y, x) in tick.outputs.audio(0).iter_mut().zip(asked) {
                last = does(*x, last);
                *y = last;
            }
            Ok(Status::Continue)
        })
    })
}

#[test]
fn inverse_band() {
    let subject = subject(None);
    holds("inverse_band", &subject);
    // As one without a high-pass does, it goes on for ever where a constant is asked for.
    let open = broken(&subject, "actuator_inverse", |(asked, count): &mut (f32, u64), tick| {
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
            *count = if *x == *asked && *x != 0.0 { *count + 1 } else { 0 };
            *asked = *x;
            *y += 1e-9 * (*count * *count) as f32;
        }
    });
    fails("inverse_band", &open, "left of a constant");
    // Plugins: too loud, and too loud where nothing is felt any more.
    let louder = changed(&subject, "actuator_inverse", |y, _, _| 1.05 * y);
    let bright = changed(&subject, "actuator_inverse", |y, _, last| 1.15 * y - 0.15 * last);
    for (mutant, why) in [(louder, "dB off the stated response"), (bright, "times the wanted acceleration")] {
        let kind = mutant.kind("actuator_inverse").expect("the kind");
        fails("inverse_band", &subject.clone().with(plugin(&kind, "an_inverse", |d| d)), why);
    }
}

#[test]
fn inverse_off() {
    let subject = subject(None);
    holds("inverse_off", &subject);
    // It rings on, at 100 Hz.
    let rings = changed(&subject, "actuator_inverse", |y, n, _| y + 1e-5 * (n as f32 * 0.013).sin());
    fails("inverse_off", &rings, "after the end");
}

#[test]
fn full_scale_at_resonance() {
    let subject = subject(None);
    holds("full_scale_at_resonance", &subject);
    let open = in_place(&subject, |x, _| 0.99 * x);
    fails("full_scale_at_resonance", &open, "of its stroke");
    let half_open = in_place(&subject, |x, _| 0.4 * x);
    fails("full_scale_at_resonance", &half_open, "of the rated current");
    let clicks = changed(&subject, "limiter", |y, n, _| if n == 100_000 { 0.9 * y + 0.02 } else { y });
    fails("full_scale_at_resonance", &clicks, "over the slew");
}

#[test]
fn limiter_random() {
    let subject = subject(None);
    holds("limiter_random", &subject);
    let mutants: [(&str, Subject<'static>); 4] = [
        ("over the peak", in_place(&subject, |x, last| last + (x - last).clamp(-0.004, 0.004))),
        // Now and then a sample that jumps, too short to warm the coil or to move it.
        (
            "over the slew",
            changed(&subject, "limiter", |y, n, _| if n % 5000 == 4999 { -0.3_f32.copysign(y) } else { y }),
        ),
        (
            "of the rated current",
            changed(&subject, "limiter", |y, n, last| {
                if n > 24_000 {
                    last + (0.3_f32.copysign((n % 960) as f32 - 479.5) - last).clamp(-0.004, 0.004)
                } else {
                    y
                }
            }),
        ),
        ("fault", changed(&subject, "limiter", |y, n, _| if n == 5000 { f32::INFINITY } else { y })),
    ];
    for (why, mutant) in mutants {
        fails("limiter_random", &mutant, why);
    }
}

#[test]
fn the_mean_and_the_stroke_are_held() {
    let subject = subject(None);
    let place = Place {
        kind: "limiter",
        actuator: ("hapcoil_one", 100.0),
        drive: Drive::Current,
        rate_hz: 8000,
        settings: Some((20_000.0, 20.0)),
    };
    let dynamics = ActuatorProfile::shipped("hapcoil_one").expect("a profile").expect("a profile");
    let hz = Dynamics::new(&dynamics, 100.0).expect("dynamics").natural_hz();
    // 0.05 A for ever, which the coil stands and a stylus feels as nothing; and all that is asked for, at
    // resonance.
    let passes_dc = in_place(&subject, |x, last| last + (x.clamp(-0.05, 0.05) - last).clamp(-1e-3, 1e-3));
    let open = in_place(&subject, |x, _| x);
    for (sound, mutant, why) in
        [(Sound::Constant, passes_dc, "the mean is"), (Sound::Sine(hz), open, "of its stroke")]
    {
        let pieces = [Piece { sound, peaks: 0.99, trusted: true, samples: 80_000 }];
        let stood = limited(&subject, place, 1, &pieces);
        assert!(matches!(stood, Ok(true)), "{stood:?}");
        let broken = limited(&mutant, place, 1, &pieces);
        assert!(matches!(&broken, Err(Stop::Failed(found)) if found.contains(why)), "{why}: {broken:?}");
    }
}

#[test]
fn own_limits() {
    let graphs = ["texture.ron", "heravi2024.ron", "voltage_amplifier.ron", "live.ron"].map(graph);
    holds_on("own_limits", &graphs);
    holds_on("own_limits", &["scenes/every_effect.ron", "scenes/side_by_side.ron"].map(graph));
    let subject = subject(Some(&graphs[0]));
    fails("own_limits", &in_place(&subject, |x, _| x), "over the peak");
    fails("own_limits", &in_place(&subject, |x, _| x.clamp(-0.1, 0.1)), "over the slew");
}

fn piece() -> impl Strategy<Value = Piece> {
    let hz = || (0.0..4.3f64).prop_map(|d| 10f64.powf(d));
    let sound = prop_oneof![
        1 => Just(Sound::Silence),
        2 => Just(Sound::Noise),
        3 => hz().prop_map(Sound::Sine),
        2 => hz().prop_map(Sound::Square),
        3 => (40.0..120.0f64).prop_map(Sound::Square),
        1 => Just(Sound::Constant),
        1 => Just(Sound::Pulses),
        1 => Just(Sound::Bits),
        3 => Just(Sound::Spite),
    ];
    let peaks = (-3.0..3.0f64).prop_map(|d| 10f64.powf(d));
    (sound, peaks, prop::bool::weighted(0.9), 1..6000u32).prop_map(|(sound, peaks, trusted, samples)| Piece {
        sound,
        peaks,
        trusted,
        samples,
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_input_breaks_what_the_limiter_promises(
        pieces in prop::collection::vec(piece(), 1..12),
        profile in prop::sample::select(vec!["hapcoil_one", "haptuator_mark_ii"]),
        grams in 5.0..2000.0f64,
        voltage in any::<bool>(),
        rate_hz in prop::sample::select(vec![8000, 44_100, 48_000, 96_000]),
        slew_hz in 500.0..20_000.0f64,
        dc_hz in 0.5..20.0f64,
        seed in any::<u64>(),
    ) {
        let drive = if voltage { Drive::Voltage } else { Drive::Current };
        let settings = Some((slew_hz, dc_hz));
        let place = Place { kind: "limiter", actuator: (profile, grams), drive, rate_hz, settings };
        let stood = limited(&subject(None), place, seed, &pieces);
        prop_assert!(stood.is_ok(), "{stood:?}");
    }
}
