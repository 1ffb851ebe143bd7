//! `waveform` and `relief`.

use std::sync::Arc;

use asperity_diagnostics::{Source, ron};
use asperity_dsp::filter::Section;
use asperity_scene::Heights;

use super::wav;
use crate::bench::{Bench, facts, files, largest_step, spans};
use crate::effects::gliding::Kernel as _;
use crate::effects::path::{Parts, Path};
use crate::effects::relief::{Follower, HeightSpline};
use crate::effects::waveform::{Reader, WaveformQuantity, WaveformTable};

/// Slot, place, stroke and level of a tick.
type Told = (f64, [f64; 2], f64, f64);

fn bench<T: AsRef<str>>(
    rates: (u32, u32),
    (kind, list): (&str, &str),
    texts: &[T],
    play: impl Fn(u64) -> Told + Send + Sync + 'static,
) -> Bench {
    let play = move |tick| {
        let (slot, place, stroke, level) = play(tick);
        vec![vec![slot], place.to_vec(), vec![stroke], vec![level]]
    };
    Bench::new(kind, "slot place stroke level", play).rates(rates).list(list, texts)
}

const USUAL: (u32, u32) = (500, 48_000);
const WAVEFORM: (&str, &str) = ("waveform", "loops");
const RELIEF: (&str, &str) = ("relief", "reliefs");
const LOOP: &str =
    "waveform(segments: [(0, 0), (0.3, 1), (1, 0)], spacing_mm: 0.02, reference_speed_mm_s: 80)";
const OTHER: &str = "waveform(segments: [(0, 0), (0.5, 0.02), (1.3, 0)], quantity: height, gain: 0.5)";
const HEIGHTS: &str = "made(surface: \"hessian\", side: 64, step_mm: 0.1)";

/// Round and round at some 100 mm/s.
fn place(tick: u64, tick_hz: u32) -> [f64; 2] {
    let t = tick as f64 / f64::from(tick_hz);
    [20.0 * (5.0 * t).cos(), 15.0 * (6.0 * t).sin()]
}

fn loops() -> [Reader; 2] {
    let drawn = WaveformQuantity::Acceleration { reference_speed_mm_s: 80.0, speed_exponent: 1.0 };
    let table = |segments: &[(f64, f64)], spacing, quantity| {
        Arc::new(WaveformTable::from_segments(segments, spacing, 0.0, quantity).unwrap())
    };
    [
        Reader::new(table(&[(0.0, 0.0), (0.3, 1.0), (1.0, 0.0)], 0.02, drawn), 1.0),
        Reader::new(table(&[(0.0, 0.0), (0.5, 0.02), (1.3, 0.0)], 0.05, WaveformQuantity::Height), 0.5),
    ]
}

/// The path of every tick from `begin` on by positions alone, as the node has it. The first tick has none;
/// the second begins with the velocity of the first two.
fn paths(
    ticks: std::ops::Range<u64>,
    tick_hz: u32,
    place: impl Fn(u64) -> [f64; 2],
) -> impl Iterator<Item = (u64, Path)> {
    let mut path = Path::new(tick_hz);
    let begin = ticks.start;
    ticks.skip(1).map(move |tick| {
        let (now, before) = (place(tick), place(tick - 1));
        let velocity = [0, 1].map(|i| (now[i] - before[i]) * f64::from(tick_hz));
        path.advance(now, if tick == begin + 1 { velocity } else { [f64::NAN; 2] });
        (tick, path)
    })
}

#[test]
fn a_waveform_is_its_kernel_along_the_path_of_places() {
    for (tick_hz, rate) in [(500, 48_000), (500, 44_100), (4000, 48_000), (333, 44_100)] {
        let texts = [LOOP.to_owned(), format!("[{LOOP}, {OTHER}]")];
        let play = move |tick: u64| (if tick < 200 { 0.0 } else { 1.0 }, place(tick, tick_hz), 0.0, 1.0);
        let (run, _) = bench((tick_hz, rate), WAVEFORM, &texts, play).run("it", 400);
        let [drawn, height] = loops();
        let mut on = vec![drawn.clone()];
        for ((tick, path), (_, first, len)) in
            paths(0..400, tick_hz, |t| place(t, tick_hz)).zip(spans(400, rate, tick_hz).skip(1))
        {
            if tick == 200 {
                on = vec![drawn.clone(), height.clone()];
            }
            let parts = Parts::new(tick, first, rate, tick_hz);
            let mut want = vec![0.0_f64; len];
            for kernel in &mut on {
                let mut part = vec![0.0_f64; len];
                kernel.process(&path, &parts, &mut part);
                want.iter_mut().zip(part).for_each(|(sum, x)| *sum += x);
            }
            if tick == 1 || tick == 200 {
                want.iter_mut().enumerate().for_each(|(n, x)| *x *= parts.at(n));
            }
            for (y, x) in run.audio[first as usize..].iter().zip(want) {
                assert_eq!(*y, x as f32, "tick {tick}");
            }
        }
        assert!(run.audio.iter().take(rate as usize / tick_hz as usize).all(|y| *y == 0.0));
        assert!(run.audio.iter().any(|y| y.abs() > 0.3));
    }
}

#[test]
fn a_stroke_that_begins_elsewhere_is_no_way_between() {
    // 80 mm/s, put down 90 mm away in tick 100: no sample is louder for it.
    let play = |moved: bool| {
        move |tick: u64| {
            let elsewhere = moved && tick >= 100;
            let x = 0.16 * tick as f64 + if elsewhere { 90.0 } else { 0.0 };
            (0.0, [x, 0.0], f64::from(u8::from(elsewhere)), 1.0)
        }
    };
    let run = |moved| bench(USUAL, WAVEFORM, &[LOOP], play(moved)).run("it", 200).0.audio;
    let (plain, moved) = (run(false), run(true));
    assert!(moved[9600..9696].iter().all(|y| *y == 0.0), "the tick of a new stroke has no speed yet");
    let most = |x: &[f32]| x.iter().fold(0.0_f32, |m, y| m.max(y.abs()));
    assert!(most(&moved) <= 1.001 * most(&plain), "{} {}", most(&moved), most(&plain));
    assert_eq!(moved[..9600], plain[..9600]);
    // It goes on in the loop where it was: what was not played is a tick behind.
    let gap = moved[9792..].iter().zip(&plain[9696..]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(gap < 1e-3, "{gap}");
}

#[test]
fn relief_is_its_kernel_along_path_smoothed_or_not() {
    let heights = Heights::parse(&ron::parse(&Source::new("", HEIGHTS)).unwrap()).unwrap();
    let spline = HeightSpline::new(&heights.field().unwrap());
    for (tick_hz, rate, smooth) in
        [(500, 48_000, 0.0), (500, 44_100, 20.0), (4000, 48_000, 20.0), (4000, 44_100, 0.0)]
    {
        let text = format!("relief(heights: {HEIGHTS}, cutoff_hz: 800, max_m_s2: 100, gain: 0.5)");
        let play = move |tick: u64| (0.0, place(tick, tick_hz), 5.0, 1.0);
        let bench = bench((tick_hz, rate), RELIEF, &[text], play).set("smooth_hz", &format!("{smooth:?}"));
        let (run, _) = bench.run("it", 300);
        let low_pass = |smooth| Section::butterworth_low_pass(smooth).bilinear(f64::from(tick_hz), smooth);
        let mut filters = (smooth > 0.0).then(|| [low_pass(smooth).unwrap(); 2]);
        let smoothed = (0..300).map(|tick| {
            let mut at = place(tick, tick_hz);
            for (x, filter) in at.iter_mut().zip(filters.iter_mut().flatten()) {
                if tick == 0 {
                    filter.reset_to(*x);
                }
                *x = filter.step(*x);
            }
            at
        });
        let smoothed: Vec<[f64; 2]> = smoothed.collect();
        let mut kernel = Follower::new(800.0, 100.0, rate).unwrap();
        for ((tick, path), (_, first, len)) in
            paths(0..300, tick_hz, |t| smoothed[t as usize]).zip(spans(300, rate, tick_hz).skip(1))
        {
            let mut want = vec![0.0_f64; len];
            let parts = Parts::new(tick, first, rate, tick_hz);
            kernel.process((|x, y| spline.jet(x, y), spline.step_mm()), &path, &parts, &mut want);
            for (n, (y, x)) in run.audio[first as usize..].iter().zip(want).enumerate() {
                let x = if tick == 1 { 0.5 * x * parts.at(n) } else { 0.5 * x };
                assert_eq!(*y, x as f32, "tick {tick}");
            }
        }
        assert!(run.audio.iter().any(|y| y.abs() > 0.3));
    }
}

#[test]
fn heights_that_several_slots_want_are_there_once() {
    let relief = |more: &str| format!("relief(heights: {HEIGHTS}{more})");
    let other = "relief(heights: made(surface: \"hessian\", side: 64, step_mm: 0.1, piece: 2))".to_owned();
    let reliefs = [relief(""), relief(", gain: 2"), other, relief(", cutoff_hz: 300")];
    let bench = bench(USUAL, RELIEF, &reliefs, |_| (0.0, [0.0; 2], 0.0, 1.0));
    assert_eq!(facts(&mut bench.engine("it", true).unwrap()), ["slots 4", "height_fields 2"]);
}

// Behind a level, `waveform` and `relief` start and stop without a click. They do the same asleep or not.
#[test]
fn level_starts_and_stops_textures_without_click() {
    // Open for three quarters of a period of 400 ticks, with ramps of 20 ms.
    let level = |tick: u64, tick_hz: u32| {
        let (t, ramp) = ((tick % 400) as f64, 0.02 * f64::from(tick_hz));
        ((t - 50.0) / ramp).clamp(0.0, 1.0).min(((350.0 - t) / ramp).clamp(0.0, 1.0))
    };
    let relief = format!("relief(heights: {HEIGHTS})");
    for (of, text) in [(WAVEFORM, LOOP), (RELIEF, &relief)] {
        for (tick_hz, rate) in [(500, 48_000), (500, 44_100), (4000, 48_000)] {
            let [steady, gated] = [false, true].map(|gated| {
                bench((tick_hz, rate), of, &[text], move |tick| {
                    let level = if gated { level(tick, tick_hz) } else { 1.0 };
                    (0.0, place(tick, tick_hz), 0.0, level)
                })
            });
            let (steady, _) = steady.run("it", 4000);
            let (gated, calls) = gated.behind_level().run("level", 4000);
            assert!(calls < 3100, "{calls}");
            // But for its very first samples, which no level faded in.
            let (own, most) = (largest_step(&steady.audio[400..]), largest_step(&gated.audio));
            assert!(
                // Loops begin at other places.
                most <= 1.01 * own && most > 0.3 * own,
                "{of:?}: a step of {most}, where {own} is the largest of the steady signal"
            );
        }
    }
}

#[test]
fn no_slot_is_silent() {
    let play = |tick: u64| ((tick / 10 % 4) as f64 - 1.0, place(tick, 500), 0.0, 1.0);
    let (run, _) = bench(USUAL, WAVEFORM, &[LOOP, "[]"], play).run("it", 80);
    for (tick, first, len) in spans(80, 48_000, 500) {
        let sounds = run.audio[first as usize..][..len].iter().any(|y| *y != 0.0);
        assert_eq!(sounds, tick / 10 % 4 == 1, "tick {tick}");
    }
}

// At its own speed, a recorded waveform is the recording. Faster, it is higher and louder.
#[test]
fn recorded_waveform_at_its_speed_is_the_recording() {
    let dir = tempfile::tempdir().unwrap();
    // 100 Hz at half of full scale, whole periods.
    let wave = |n| (0.5 * (std::f64::consts::TAU * 0.00625 * f64::from(n)).sin()) as f32;
    wav(&dir.path().join("felt.wav"), 1, 16_000, &(0..16_000).map(wave).collect::<Vec<f32>>());
    let text = "waveform(recording: (file: \"felt.wav\", speed_mm_s: 80, full_scale_m_s2: 6))";
    let file = dir.path().join("g.ron");
    for (speed, hz) in [(80.0, 100.0), (160.0, 200.0)] {
        let play = move |tick: u64| (0.0, [speed * tick as f64 / 500.0, 0.0], 0.0, 1.0);
        let bench = bench(USUAL, WAVEFORM, &[text], play).file(file.to_str().unwrap());
        let (run, _) = bench.run("it", 300);
        // Half a second behind the beginning: its component at that frequency, and what is left.
        let part = &run.audio[4800..28_800];
        let turn = |n: usize| std::f64::consts::TAU * hz * n as f64 / 48_000.0;
        let [s, c] = [f64::sin, f64::cos].map(|of: fn(f64) -> f64| {
            part.iter().enumerate().map(|(n, y)| f64::from(*y) * of(turn(n))).sum::<f64>() / 12_000.0
        });
        let power = part.iter().map(|y| f64::from(*y).powi(2)).sum::<f64>() / 24_000.0;
        let amplitude = s.hypot(c);
        assert!((amplitude - 3.0 * speed / 80.0).abs() < 0.01 * amplitude, "{speed}: {amplitude}");
        assert!((power - 0.5 * amplitude * amplitude).abs() < 1e-3 * power, "nothing else sounds");
        assert_eq!(files(&bench), [dir.path().join("felt.wav")]);
    }
}
