//! `tap`.

use std::f64::consts::TAU;

use super::wav;
use crate::bench::{Bench, facts, files, largest_step, run};

/// Slot, speed and moment of the contact in a tick.
type Contact = (f64, f64, f64);

fn bench<T: AsRef<str>>(
    rates: (u32, u32),
    taps: &[T],
    contact: impl Fn(u64) -> Option<Contact> + Send + Sync + 'static,
) -> Bench {
    let play = move |tick| {
        let (slot, approach, moment) = contact(tick).unwrap_or((-1.0, 0.0, 0.3));
        vec![vec![slot], vec![approach], vec![moment]]
    };
    Bench::new("tap", "slot approach moment", play).rates(rates).list("taps", taps)
}

const USUAL: (u32, u32) = (500, 48_000);
const HZ: f64 = 237.0;
const DECAY_S: f64 = 0.012;

/// A tap of 40 (m/s^2)/(m/s), `t` after a contact at 100 mm/s.
fn closed(t: f64) -> f64 {
    if t < 0.0 { 0.0 } else { 4.0 * (-t / DECAY_S).exp() * (TAU * HZ * t).sin() }
}

const ONE: &str = "(sinusoids: [(frequency_hz: 237, decay_ms: 12, gain: 40)], floor_m_s2: 1e-6)";

#[test]
fn a_contact_between_samples_sounds_one_tick_after_it_was() {
    for (tick_hz, rate) in [(500, 48_000), (500, 44_100), (4000, 48_000), (333, 44_100)] {
        let (hz, fs) = (f64::from(tick_hz), f64::from(rate));
        for (n, moment) in [0.0, 0.1, 1.0 / 3.0, 0.5, 0.77777, 0.999, 1.0].into_iter().enumerate() {
            let at = 10 + n as u64;
            let contact = move |tick| (tick == at).then_some((0.0, 100.0, moment));
            let bench = bench((tick_hz, rate), &[ONE], contact);
            let (run, calls) = bench.run("it", u64::from(tick_hz));
            // It was at this part of the time from the tick before to this one.
            let was = (at as f64 - 1.0 + moment) / hz;
            for (n, y) in run.audio.iter().enumerate() {
                let want = closed(n as f64 / fs - was - 1.0 / hz);
                assert!(
                    (f64::from(*y) - want).abs() < 2e-6,
                    "{tick_hz} Hz, {rate} Hz, {moment}: {y} at {n}, not {want}"
                );
            }
            assert!(run.audio.iter().any(|y| *y > 1.0));
            // 4 m/s^2 fall to 1e-6 in 15.2 times 12 ms.
            let ticks = 0.012 * 4e6_f64.ln() * hz;
            assert!((calls as f64 - ticks).abs() < 5.0, "{calls} calls for {ticks} ticks");
        }
    }
}

#[test]
fn contacts_that_are_none_do_not_sound() {
    let contacts = |tick: u64| match tick {
        5 => Some((-1.0, 100.0, 0.5)),
        10 => Some((2.0, 100.0, 0.5)),
        15 => Some((0.0, -100.0, 0.5)),
        // Slower than the least speed.
        20 => Some((0.0, 1.9, 0.5)),
        _ => None,
    };
    let (run, calls) = bench(USUAL, &[ONE, ONE], contacts).run("it", 50);
    assert!(run.audio.iter().all(|y| *y == 0.0));
    // The first of all, and for each two changes.
    assert_eq!(calls, 1 + 4 * 2);
}

#[test]
fn contacts_in_successive_ticks_are_same_asleep_or_awake() {
    // Ticks of 10 ms and taps that are over within one: equal speeds are no change that wakes.
    let short = "(sinusoids: [(frequency_hz: 900, decay_ms: 0.2, gain: 40)], debounce_ms: 2)";
    let contacts = |tick: u64| match tick {
        10..15 => Some((0.0, 100.0, 0.5)),
        15..18 => Some((1.0, 100.0, 0.25)),
        18..20 => Some((0.0, 1.0, 0.5)),
        20 => Some((0.0, 100.0, 0.5)),
        // Of the same speed as one that struck nothing.
        30 => Some((-1.0, 100.0, 0.5)),
        31 => Some((0.0, 100.0, 0.5)),
        _ => None,
    };
    let (run, _) = bench((100, 48_000), &[short, short], contacts).run("it", 40);
    let sounds = |tick: usize| run.audio[tick * 480..][..480].iter().any(|y| *y != 0.0);
    let heard: Vec<usize> = (0..40).filter(|t| sounds(*t)).collect();
    assert_eq!(heard, [10, 11, 12, 13, 14, 15, 16, 17, 20, 31]);
    // Many, of any speed at any moment.
    let many = |tick: u64| {
        let draw = |what: u64| asperity_node::random::uniform(3 + what, tick);
        (draw(0) < 0.15).then(|| ((draw(1) * 5.0 - 0.5).floor(), 300.0 * draw(2), draw(3)))
    };
    let (run, _) = bench((500, 44_100), &[ONE, short, ONE, ONE], many).run("it", 5000);
    assert!(run.audio.iter().any(|y| y.abs() > 5.0));
}

#[test]
fn taps_of_slots_add_and_ring_on_after_another_touch() {
    let contacts = |tick: u64| match tick {
        10 => Some((0.0, 100.0, 0.0)),
        13 => Some((1.0, 100.0, 0.5)),
        _ => None,
    };
    let (run, _) = bench(USUAL, &[ONE, ONE], contacts).run("it", 100);
    for (n, y) in run.audio.iter().enumerate() {
        let at = |sample: f64| closed((n as f64 - sample) / 48_000.0);
        let want = at(960.0) + at(13.5 * 96.0);
        assert!((f64::from(*y) - want).abs() < 4e-6, "{n}: {y}");
    }
}

// Where more slots are struck than can sound, the quietest fades and nothing steps.
#[test]
fn too_many_slots_fade_the_quietest_without_step() {
    let long = "(sinusoids: [(frequency_hz: 60, decay_ms: 3000, gain: 40)])";
    let contacts = |tick: u64| {
        ((10..130).contains(&tick) && tick.is_multiple_of(3)).then_some(((tick / 3 % 40) as f64, 100.0, 0.5))
    };
    let bench = bench((4000, 48_000), &[long; 40], contacts);
    let (out, _) = bench.run("it", 2000);
    // Eight of 4 m/s^2, and those that fade.
    let most = out.audio.iter().fold(0.0_f32, |m, y| m.max(y.abs()));
    assert!(most > 4.0 && most < 11.0 * 4.0, "{most}");
    let steepest = 4.0 * TAU * 60.0 / 48_000.0;
    assert!(
        f64::from(largest_step(&out.audio)) < 14.0 * steepest + 2.0 * 4.0 / 48.0,
        "{}",
        largest_step(&out.audio)
    );
    let mut engine = bench.engine("it", true).unwrap();
    run(&mut engine, "it", 300);
    assert_eq!(facts(&mut engine), ["slots 40", "contacts 40", "taps 40", "cut_short 32"]);
}

#[test]
fn a_thousand_slots_call_for_no_more_than_one() {
    let contacts = |slot: f64| move |tick: u64| (tick == 30).then_some((slot, 100.0, 0.5));
    let (one, calls) = bench(USUAL, &[ONE], contacts(0.0)).run("it", 200);
    let (thousand, of_all) = bench(USUAL, &[ONE; 1000], contacts(777.0)).run("it", 200);
    assert!(one == thousand && calls == of_all);
}

#[test]
fn recorded_tap_is_read_beside_graph_and_scaled_by_speed() {
    let dir = tempfile::tempdir().unwrap();
    let wave = |n: i32| (8000.0 * (f64::from(n) * 0.05).sin()) as i16;
    let samples: Vec<f32> = (0..2000).flat_map(|n| [wave(n), 77]).map(|x| f32::from(x) / 32_768.0).collect();
    wav(&dir.path().join("tap.wav"), 2, 48_000, &samples);
    let text = "(recording: (file: \"tap.wav\", speed_mm_s: 50, full_scale_m_s2: 20, gain: 2))";
    let contacts = |tick: u64| (tick == 10).then_some((0.0, 100.0, 0.0));
    let file = dir.path().join("g.ron");
    let bench = bench(USUAL, &[text], contacts).file(file.to_str().unwrap());
    let (out, _) = bench.run("it", 100);
    for n in 0..1800 {
        let want = 2.0 * 2.0 * 20.0 * f64::from(wave(n)) / 32_768.0;
        assert!((f64::from(out.audio[960 + n as usize]) - want).abs() < 1e-3, "{n}");
    }
    // A host sees when it changes.
    assert_eq!(files(&bench), [dir.path().join("tap.wav")]);
}
