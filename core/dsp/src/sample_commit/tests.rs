use super::*;
use crate::Stft;
use crate::testing::{LOW, saved};
use std::f64::consts::TAU;

fn settings(emission: i32) -> Settings {
    Settings { emission, ..Settings::default() }
}

fn kernel(emission: i32) -> SampleCommit<f32> {
    SampleCommit::new(LOW, settings(emission), 1).unwrap()
}

/// Magnitudes of `frames` frames of a signal, by a transform that the kernel does not use.
fn analyse(f: &Framing, frames: u64, x: impl Fn(u64) -> f64) -> Vec<Vec<f32>> {
    let mut stft = Stft::<f64>::new(f.fft_len);
    let mut frame = |start: u64| -> Vec<f32> {
        let cut: Vec<f64> = (start..start + f.fft_len as u64).map(&x).collect();
        stft.process(&cut).iter().take(f.bins).map(|c| c.norm() as f32).collect()
    };
    (0..frames).map(|n| frame(f.start(n))).collect()
}

/// Pushes a frame a hop and returns all samples, and those of `after` hops after the last frame; sample 0
/// of the answer is sample 0 of the frames, whatever the emission.
fn run(c: &mut SampleCommit<f32>, frames: &[Vec<f32>], after: u64) -> Vec<f32> {
    let f = c.framing();
    let mut all = vec![0.0; usize::try_from(-c.delay()).unwrap_or(0)];
    for n in 0..frames.len() as u64 + after {
        if let Some(frame) = frames.get(n as usize) {
            c.push(n, frame).unwrap();
        }
        let mut out = vec![9.0; (f.start(n + 1) - f.start(n)) as usize];
        c.emit(f.start(n), &mut out);
        all.extend(out);
    }
    all.split_off(usize::try_from(c.delay()).unwrap_or(0))
}

/// Pushes frame `n` and returns the samples of its hop.
fn hop(c: &mut SampleCommit<f32>, n: u64, frame: &[f32]) -> [f32; 5] {
    let mut out = [9.0; 5];
    c.push(n, frame).unwrap();
    c.emit(5 * n, &mut out);
    out
}
/// Spectral convergence in dB over frames from `from` on that the signal covers, and its level over the
/// frames'.
fn score(f: &Framing, frames: &[Vec<f32>], y: &[f32], from: usize) -> (f64, f64) {
    let at = |i: u64| y.get(i as usize).map_or(0.0, |&y| f64::from(y));
    let last =
        (from..frames.len()).take_while(|&n| f.start(n as u64) as usize + f.fft_len <= y.len()).count();
    let have = analyse(f, (from + last) as u64, at);
    let (mut error, mut want, mut got) = (0.0, 0.0, 0.0);
    for (a, b) in have.iter().zip(frames).skip(from) {
        for (&a, &b) in a.iter().zip(b) {
            let (a, b) = (f64::from(a), f64::from(b));
            (error, want, got) = (error + (a - b).powi(2), want + b * b, got + a * a);
        }
    }
    (10.0 * (error / want).log10(), 10.0 * (got / want).log10())
}

/// A noise of many sines below `top_hz`, any sample at once.
fn noise(i: u64, rate: f64, top_hz: f64) -> f64 {
    let sine = |k: u32| {
        let (f, p) = (uniform(7, 0, u64::from(k)), uniform(7, 1, u64::from(k)));
        (TAU * (f * top_hz * i as f64 / rate + p)).sin()
    };
    (0..60).map(sine).sum::<f64>() / 30f64.sqrt()
}

fn tone(i: u64, rate: f64, hz: f64) -> f64 {
    (TAU * hz * i as f64 / rate + 0.3).sin()
}

#[test]
fn sample_commit_follows_a_tone_and_a_noise() {
    for (emission, tone_db, noise_db) in
        [(0, -75.0, -24.0), (-20, -70.0, -18.0), (-25, -65.0, -16.0), (4, -75.0, -24.0)]
    {
        let frames = analyse(&LOW, 300, |i| tone(i, 2500.0, 153.7));
        let (db, level) = score(&LOW, &frames, &run(&mut kernel(emission), &frames, 0), 70);
        assert!(db < tone_db && level.abs() < 0.01, "a tone at {emission}: {db} dB, level {level} dB");
        let frames = analyse(&LOW, 400, |i| noise(i, 2500.0, 900.0));
        let (db, level) = score(&LOW, &frames, &run(&mut kernel(emission), &frames, 0), 70);
        assert!(db < noise_db && level.abs() < 0.2, "a noise at {emission}: {db} dB, level {level} dB");
    }
}

/// 40 bursts a second, unevenly: a tone of 220 Hz each that decays with 4 ms. Seconds of it at 2500 Hz.
fn bursts(seconds: f64) -> Vec<f64> {
    let mut x = vec![0.0; (seconds * 2500.0) as usize];
    let (mut start, mut count) = (0.03, 0);
    while start < seconds {
        let first = (start * 2500.0).ceil() as usize;
        for (i, x) in x.iter_mut().enumerate().skip(first).take(120) {
            let t = i as f64 / 2500.0 - start;
            *x += (TAU * 220.0 * t).sin() * (-t / 0.004).exp();
        }
        start += 0.025 * (0.7 + 0.6 * uniform(11, 0, count));
        count += 1;
    }
    x
}

#[test]
fn bursts_settle_within_seconds_for_every_seed() {
    let x = bursts(6.0);
    let frames = analyse(&LOW, 2900, |i| x[i as usize]);
    let mut all = Vec::new();
    for seed in 0..12 {
        let mut c = SampleCommit::<f32>::new(LOW, settings(0), seed).unwrap();
        let y = run(&mut c, &frames, 0);
        let (db, level) = score(&LOW, &frames[..1400], &y[..7000], 750);
        assert!(db < -38.0 && level.abs() < 0.01, "seed {seed}: {db} dB, level {level} dB");
        let (late_db, _) = score(&LOW, &frames, &y, 2250);
        assert!(late_db < -43.0, "seed {seed}: {late_db} dB later on");
        println!("seed {seed}: {db:.1} dB, then {late_db:.1}");
        all.push(db);
    }
    all.sort_by(f64::total_cmp);
    assert!(all[6] < -39.5, "{all:?}");
}

/// The level in dB re what is wanted, and the peak re the largest that a signal of these magnitudes can
/// have in the middle of a window.
fn loudness(frames: &[Vec<f32>], settings: Settings) -> (f64, f64) {
    let mut c = SampleCommit::<f32>::new(LOW, settings, 1).unwrap();
    let y = run(&mut c, frames, 0);
    let most = frames.iter().map(|f| f.iter().sum::<f32>() / 2.0).fold(0.0, f32::max);
    let peak = y.iter().map(|y| y.abs()).fold(0.0, f32::max);
    (score(&LOW, frames, &y, 60).1, f64::from(peak / most))
}

#[test]
fn level_is_bounded_for_all_settings() {
    let smooth: Vec<f32> = (0..101).map(|k| 0.2 / (1.0 + (k as f32 - 12.0).powi(2) / 90.0) + 0.02).collect();
    let x = bursts(0.7);
    let signals = [
        ("smooth", vec![smooth; 250]),
        ("noise", analyse(&LOW, 250, |i| noise(i, 2500.0, 900.0))),
        ("bursts", analyse(&LOW, 250, |i| x[i as usize])),
    ];
    let check = |frames, passes, momentum, emission| {
        for (name, signal) in &signals {
            let s = Settings { frames, passes, momentum, emission };
            let (level, peak) = loudness(signal, s);
            assert!(level.abs() < 2.0 && peak < 2.0, "{name} at {s:?}: {level} dB, peak {peak}");
        }
    };
    for frames in [1, 2, 3, 5] {
        for passes in [1, 2, 5] {
            for momentum in [0.0, 0.5, 0.9, 0.99] {
                for emission in [-25, -20, -10, -5, 0, 10] {
                    check(frames, passes, momentum, emission);
                }
                check(frames, passes, momentum, 100);
            }
        }
    }
}

#[test]
fn alternating_hops_use_their_true_starts() {
    let f = Framing { rate_hz: 44_100, fft_len: 4410, ..LOW };
    let frames = analyse(&f, 160, |i| tone(i, 44_100.0, 333.3));
    let mut c = SampleCommit::new(f, settings(0), 1).unwrap();
    let (db, level) = score(&f, &frames, &run(&mut c, &frames, 0), 70);
    assert!(db < -55.0 && level.abs() < 0.02, "{db} dB, level {level} dB");
}

#[test]
fn emission_shifts_the_output_by_whole_hops() {
    let delay = |rate_hz: u32, emission| {
        let f = Framing { rate_hz, fft_len: rate_hz as usize / 10, bins: 26, ..LOW };
        SampleCommit::<f32>::new(f, settings(emission), 1).unwrap().delay()
    };
    assert_eq!([-25, -1, 0, 3].map(|e| delay(2500, e)), [-125, -5, 0, 15]);
    assert_eq!([-25, -1, 0, 3].map(|e| delay(44_100, e)), [-2205, -88, 0, 264]);
    // Where a burst lies in the output: its centre of energy.
    let burst = |i: u64| tone(i, 2500.0, 200.0) * (-(i as f64 - 1000.0).powi(2) / 5000.0).exp();
    let frames = analyse(&LOW, 400, burst);
    for emission in [-20, -10, 0, 5] {
        let y = run(&mut kernel(emission), &frames, 10);
        let (sum, moment) = y.iter().enumerate().fold((0.0, 0.0), |(s, m), (i, &y)| {
            let e = f64::from(y * y);
            (s + e, m + e * i as f64)
        });
        assert!((moment / sum - 1000.0).abs() < 5.0, "{emission}: {}", moment / sum);
    }
}

#[test]
fn later_frame_changes_no_emitted_sample() {
    let frames = analyse(&LOW, 200, |i| noise(i, 2500.0, 900.0));
    let other = analyse(&LOW, 200, |i| 3.0 * tone(i, 2500.0, 95.0));
    for emission in [-25, -20, 0, 3] {
        let whole = run(&mut kernel(emission), &frames, 0);
        let mut mixed = frames[..120].to_vec();
        mixed.extend_from_slice(&other[120..]);
        // Frame 120 comes with the samples from its start less the delay on.
        let until = (600 - kernel(emission).delay()) as usize;
        for cut in [run(&mut kernel(emission), &frames[..120], 80), run(&mut kernel(emission), &mixed, 0)] {
            assert!(cut[..until] == whole[..until], "{emission}");
            assert!(cut[until..] != whole[until..], "{emission}: the test compares nothing");
        }
    }
}

#[test]
fn block_length_changes_no_sample() {
    let frames = analyse(&LOW, 150, |i| noise(i, 2500.0, 900.0));
    let whole = run(&mut kernel(-20), &frames, 60);
    let mut c = kernel(-20);
    let mut parts = vec![0.0; 100];
    for n in 0..210u64 {
        if let Some(frame) = frames.get(n as usize) {
            c.push(n, frame).unwrap();
        }
        let mut at = 5 * n;
        for len in [0usize, 2, 1, 0, 2] {
            let mut out = vec![9.0; len];
            c.emit(at, &mut out);
            at += len as u64;
            parts.extend(out);
        }
    }
    assert!(parts == whole);
}

#[test]
fn tick_length_other_than_the_hop_works() {
    let frames = analyse(&LOW, 300, |i| tone(i, 2500.0, 153.7));
    for (tick_hz, emission) in [(700, 0), (4000, -20), (600, -20), (1000, 2)] {
        let mut c = kernel(emission);
        let (mut y, mut n) = (vec![0.0; usize::try_from(-c.delay()).unwrap_or(0)], 0);
        for tick in 0..tick_hz * 3 / 5 {
            let (start, end) = (tick * 2500 / tick_hz, (tick + 1) * 2500 / tick_hz);
            c.seek(start);
            // A frame comes in the tick in whose time it starts, also where that tick has no sample.
            if n * tick_hz < (tick + 1) * 500 {
                c.push(n, &frames[n as usize]).unwrap();
                n += 1;
            }
            let mut out = vec![0.0; (end - start) as usize];
            c.emit(start, &mut out);
            y.extend(out);
        }
        let y = y.split_off(usize::try_from(c.delay()).unwrap_or(0));
        let (db, level) = score(&LOW, &frames, &y, 70);
        assert!(db < -60.0 && level.abs() < 0.01, "{tick_hz} Hz, {emission}: {db} dB, level {level} dB");
    }
}

#[test]
fn bad_magnitudes_count_as_0() {
    let clean = analyse(&LOW, 150, |i| noise(i, 2500.0, 900.0));
    let (mut bad, mut zero) = (clean.clone(), clean);
    for (k, value) in [(3, f32::NAN), (60, f32::INFINITY), (61, f32::NEG_INFINITY), (90, -1.0)] {
        bad[100][k] = value;
        zero[100][k] = 0.0;
    }
    assert!(run(&mut kernel(0), &bad, 50) == run(&mut kernel(0), &zero, 50));
    let mut c = kernel(0);
    assert_eq!(c.push(0, &bad[100]), Ok(4));
    assert_eq!(c.push(1, &[1.0; 50]), Ok(0), "missing bins are 0");
    assert_eq!(c.push(2, &[f32::NAN; 200]), Ok(101), "bins that are not carried do not count");
    let mut out = [9.0f32; 50];
    c.emit(0, &mut out);
    assert!(out.iter().all(|y| y.is_finite()));
}

#[test]
fn billionfold_change_of_level_is_followed() {
    let frames = analyse(&LOW, 600, |i| noise(i, 2500.0, 900.0));
    let level = |n: usize| if (200..400).contains(&n) { 1e9f32 } else { 1.0 };
    let moved: Vec<Vec<f32>> =
        frames.iter().enumerate().map(|(n, f)| f.iter().map(|m| m * level(n)).collect()).collect();
    let y = run(&mut kernel(0), &moved, 0);
    let rms = |r: std::ops::Range<usize>| {
        (y[r.clone()].iter().map(|&y| f64::from(y).powi(2)).sum::<f64>() / r.len() as f64).sqrt()
    };
    assert!((0.7..1.3).contains(&(rms(1300..1900) / 1e9)) && (0.7..1.3).contains(&rms(2500..2990)));
}

#[test]
fn largest_numbers_stay_finite() {
    let mut c = kernel(0);
    for n in 0..60 {
        assert!(hop(&mut c, n, &[f32::MAX; 101]).iter().all(|y| y.is_finite()));
    }
    // And are got over.
    for n in 60..300 {
        let out = hop(&mut c, n, &tone_frame());
        assert!(out.iter().all(|y| y.is_finite()), "frame {n}");
        assert!(n < 200 || out.iter().all(|y| y.abs() < 3.0), "frame {n}: {out:?}");
    }
}

#[test]
fn soft_tone_after_a_huge_one_is_heard() {
    let tone = |scale: f32, count: usize| vec![tone_frame().map(|m| m * scale).to_vec(); count];
    let rms = |y: &[f32]| (y.iter().map(|&y| f64::from(y).powi(2)).sum::<f64>() / y.len() as f64).sqrt();
    for emission in [0, -20, -25] {
        let plain = rms(&run(&mut kernel(emission), &tone(1.0, 360), 0)[1550..1800]);
        for quiet in [1e-8f32, 1e-10, 1e-12, 1e-30] {
            let frames = [tone(1e30, 60), tone(quiet, 300)].concat();
            let y = run(&mut kernel(emission), &frames, 0);
            assert!(y.iter().all(|y| y.is_finite()), "{quiet} at {emission}");
            let scaled: Vec<f32> = y[1550..1800].iter().map(|y| y / quiet).collect();
            let off = 20.0 * (rms(&scaled) / plain).log10();
            assert!(off.abs() < 1.0, "{quiet} at {emission} is {off} dB off");
        }
    }
}

/// A frame of a tone between bins.
fn tone_frame() -> [f32; 101] {
    let mut frame = [0.0; 101];
    frame[15..18].copy_from_slice(&[0.5, 1.0, 0.5]);
    frame
}

#[test]
fn odd_spectra_keep_their_level() {
    let frame = |of: &dyn Fn(usize) -> f32| (0..101).map(of).collect::<Vec<f32>>();
    let one = |k: usize| frame(&|j| if j == k { 1.0 } else { 0.0 });
    for (name, frame) in [
        ("flat", frame(&|_| 0.1)),
        ("bin 40", one(40)),
        ("bin 0", one(0)),
        ("bin 100", one(100)),
        ("ties", frame(&|k| if k / 2 % 2 == 0 { 0.2 } else { 0.1 })),
        ("floor", frame(&|k| if k == 40 { 1.0 } else { 0.04 })),
    ] {
        let frames = vec![frame; 300];
        for emission in [0, -20] {
            let y = run(&mut kernel(emission), &frames, 0);
            assert!(y.iter().all(|y| y.is_finite()), "{name}");
            let (db, level) = score(&LOW, &frames, &y, 100);
            assert!(level.abs() < 4.0 && db < -3.0, "{name} at {emission}: {db} dB, level {level} dB");
        }
    }
}

#[test]
fn silence_is_exact_and_an_onset_does_not_click() {
    let gate = |i: u64| 0.5 - 0.5 * (TAU * ((i as f64 - 500.0) / 100.0).clamp(0.0, 0.5)).cos();
    let frames = analyse(&LOW, 400, |i| gate(i) * tone(i, 2500.0, 120.0));
    for emission in [0, -20] {
        let y = run(&mut kernel(emission), &frames, 0);
        assert!(y[..250].iter().all(|&y| y == 0.0), "before the first frame that is not silent");
        let largest = y.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
        assert!(largest < 1.5 * (TAU * 120.0 / 2500.0) as f32, "{emission}: a step of {largest}");
    }
    let mut frames = frames;
    frames.extend(vec![vec![0.0; 101]; 100]);
    let y = run(&mut kernel(0), &frames, 0);
    assert!(y[399 * 5..].iter().any(|&y| y != 0.0));
    assert!(y[399 * 5 + 250..].iter().all(|&y| y == 0.0), "a window after the last frame that sounds");
}

#[test]
fn stream_fades_in_and_out() {
    let slope = (TAU * 120.0 / 2500.0) as f32;
    let frames = analyse(&LOW, 200, |i| tone(i, 2500.0, 120.0));
    for emission in [0, -10, -20, -25, 5] {
        let mut c = kernel(emission);
        let mut y = run(&mut c, &frames, 120);
        y.insert(0, 0.0);
        let (at, largest) = (1..y.len())
            .map(|i| (i, (y[i] - y[i - 1]).abs()))
            .fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
        assert!(largest < 1.8 * slope, "{emission}: a step of {largest} at {at}, the tone's own is {slope}");
        assert!(y.iter().all(|y| y.abs() < 1.5), "{emission}");
        assert!(y[199 * 5 + 230..].iter().all(|y| y.abs() < 0.05), "{emission}: cut off at the end");
        assert!(
            y[1..].iter().skip(199 * 5 + 250).all(|&y| y == 0.0),
            "{emission}: after the last frame's end"
        );
        assert!(c.is_fresh() && c.is_silent(), "{emission}");
    }
}

#[test]
fn missing_frames_are_silence() {
    let frames = analyse(&LOW, 200, |i| noise(i, 2500.0, 900.0));
    let (mut gappy, mut silent) = (kernel(0), kernel(0));
    for (n, frame) in frames.iter().enumerate() {
        let missing = (100..110).contains(&n) || n == 150;
        let mut a = [0.0f32; 5];
        if !missing {
            gappy.push(n as u64, frame).unwrap();
        }
        gappy.emit(5 * n as u64, &mut a);
        assert!(a == hop(&mut silent, n as u64, if missing { &[] } else { frame }), "frame {n}");
    }
}

#[test]
fn reset_or_long_gap_starts_afresh() {
    let frames = analyse(&LOW, 150, |i| noise(i, 2500.0, 900.0));
    let mut c = kernel(-20);
    let first = run(&mut c, &frames, 0);
    c.reset(0);
    assert!(run(&mut c, &frames, 100)[..first.len()] == first);
    // The same frames far later, at a number that leaves the same choice of frames to the seed.
    c.seek(1_000_000);
    assert!(c.is_fresh());
    let mut later = kernel(-20);
    later.reset(1_000_000);
    for (n, frame) in (200_000..).zip(&frames) {
        assert!(hop(&mut c, n, frame) == hop(&mut later, n, frame));
    }
}

#[test]
fn frames_out_of_reach_or_out_of_order_are_refused() {
    let frame = [1.0f32; 101];
    let mut c = kernel(0);
    let refused = |why: &'static str| Err(Refused(why.into()));
    assert_eq!(c.push(1000, &frame), refused(TOO_EARLY));
    c.seek(5000);
    for (n, want) in
        [(900, refused(TOO_LATE)), (1000, Ok(0)), (1000, refused(TOO_LATE)), (999, refused(TOO_LATE))]
    {
        assert_eq!(c.push(n, &frame), want, "{n}");
    }
    assert_eq!(c.push(1001, &frame), Ok(0));
}

#[test]
fn level_stays_over_a_million_frames() {
    let f = Framing { rate_hz: 500, fft_len: 50, bins: 26, ..LOW };
    let s = Settings { frames: 3, passes: 1, emission: 0, ..Settings::default() };
    let mut c = SampleCommit::<f32>::new(f, s, 1).unwrap();
    let far = 1u64 << 40;
    c.reset(far);
    let frames = analyse(&f, 500, |i| noise(i, 500.0, 200.0));
    let mut power = Vec::new();
    for n in 0..1_000_000u64 {
        // Back and forth, so that there is no jump.
        let at = n as usize % 998;
        c.push(far + n, &frames[at.min(998 - at)]).unwrap();
        let mut out = [0.0f32];
        c.emit(far + n, &mut out);
        if n % 99_800 == 0 {
            power.push(0.0);
        }
        *power.last_mut().unwrap() += f64::from(out[0] * out[0]) / 99_800.0;
    }
    for p in &power[1..power.len() - 1] {
        assert!((10.0 * (p / power[0]).log10()).abs() < 0.3, "{power:?}");
    }
}

#[test]
fn saved_state_continues_and_other_layouts_are_refused() {
    let frames = analyse(&LOW, 150, |i| noise(i, 2500.0, 900.0));
    let mut old = kernel(-20);
    run(&mut old, &frames[..77], 0);
    let bytes = saved(|s| old.state(s));
    assert_eq!(bytes.len(), State::measure(|s| old.state(s)));
    let mut new = kernel(-20);
    assert!(State::restore(&bytes, |s| new.state(s)));
    for n in 77..150u64 {
        let frame = &frames[n as usize];
        assert!(hop(&mut old, n, frame) == hop(&mut new, n, frame), "frame {n}");
    }
    assert!(!State::restore(&bytes, |s| kernel(-19).state(s)));
    let other = Framing { bins: 100, ..LOW };
    assert!(!State::restore(&bytes, |s| SampleCommit::<f32>::new(other, settings(-20), 1).unwrap().state(s)));
    // Whatever the bytes are, what is left can be used.
    for at in (0..bytes.len()).rev().take(120) {
        let mut broken = bytes.clone();
        broken[at] ^= 0xff;
        let mut c = kernel(-20);
        let _ = State::restore(&broken, |s| c.state(s));
        let _ = c.push(77, &frames[77]);
        c.emit(385, &mut [0.0; 5]);
    }
}

#[test]
fn impossible_settings_are_refused() {
    let s = settings(0);
    for (framing, settings, want) in [
        (LOW, Settings { frames: 0, ..s }, Err("frames and passes are 1 to 100")),
        (LOW, Settings { passes: MAX_WORK + 1, ..s }, Err("frames and passes are 1 to 100")),
        (LOW, Settings { momentum: 1.0, ..s }, Err("momentum")),
        (LOW, Settings { momentum: f64::NAN, ..s }, Err("momentum")),
        (LOW, settings(-50), Err("from the end of a window")),
        (LOW, settings(i32::MAX), Err("from the end of a window")),
        (LOW, settings(-49), Ok(-245)),
        (LOW, settings(500), Ok(2500)),
        (Framing { bins: 0, ..LOW }, s, Err("a number of bins is 0")),
    ] {
        match (SampleCommit::<f32>::new(framing, settings, 1), want) {
            (Ok(made), Ok(delay)) => assert_eq!(made.delay(), delay),
            (Err(found), Err(why)) => assert!(found.0.contains(why), "{found}"),
            (found, want) => panic!("{settings:?}: {found:?}, not {want:?}"),
        }
    }
}
