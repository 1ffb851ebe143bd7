use super::*;
use crate::testing::{framing, line, peak, saved, steepest, tone};
use std::f64::consts::TAU;

fn new<T: Float>(f: Framing, partials: Partials) -> OscillatorBank<T> {
    OscillatorBank::new(f, partials, 1).unwrap()
}

const BOTH: [Partials; 2] = [Partials::Tracked, Partials::Noise];

/// Frames `frames`, each given when it is due, and the samples up to the one after; a frame that `mags`
/// has none for is missing.
fn run<T: Float>(
    bank: &mut OscillatorBank<T>,
    frames: std::ops::Range<u64>,
    mags: impl Fn(u64) -> Option<Vec<T>>,
) -> Vec<T> {
    let (f, first) = (bank.framing(), frames.start);
    let mut all = vec![T::zero(); (f.start(frames.end) - f.start(first)) as usize];
    for n in frames {
        if let Some(mags) = mags(n) {
            assert_eq!(bank.add_frame(n, f.start(n), &mags), 0);
        }
        let (from, to) = ((f.start(n) - f.start(first)) as usize, (f.start(n + 1) - f.start(first)) as usize);
        bank.emit(f.start(n), &mut all[from..to]);
    }
    all
}

/// How far samples are from the recurrence `y[t + 1] + y[t - 1] = 2 cos(w) y[t]` of a sinusoid at `freq`
/// bins.
fn off_tone(y: &[f64], freq: f64, fft_len: usize) -> f64 {
    let c = 2.0 * (TAU * freq / fft_len as f64).cos();
    y.windows(3).map(|y| (y[2] + y[0] - c * y[1]).abs()).fold(0.0, f64::max)
}

#[test]
fn voices_are_cosines_with_linear_amplitude_and_frequency() {
    // More voices than lanes and more samples than a block, some of them gliding.
    let voices: [Voice; 11] = std::array::from_fn(|i| {
        let (x, glide) = (i as f64, if i < 8 { 0.0 } else { 0.4 });
        Voice { turns: 0.1 * x, freqs: (9.0 * x, 9.0 * x + glide), amps: (1.0 - 0.1 * x, 0.1 * x) }
    });
    let (mut single, mut double) = ([1.0f32; 300], [1.0f64; 300]);
    Renderer::new(4800).add(&voices, &mut single);
    Renderer::new(4800).add(&voices, &mut double);
    for t in 0..300 {
        let x = f64::from(t) / 300.0;
        let voice = |v: &Voice| {
            let cycles = (v.freqs.0 + 0.5 * (v.freqs.1 - v.freqs.0) * x) * f64::from(t) / 4800.0;
            (v.amps.0 + (v.amps.1 - v.amps.0) * x) * (TAU * (v.turns + cycles)).cos()
        };
        let sum: f64 = voices.iter().map(voice).sum();
        assert!((double[t as usize] - 1.0 - sum).abs() < 1e-11, "sample {t}");
        // The amplitudes together are 5.5.
        assert!((f64::from(single[t as usize]) - 1.0 - sum).abs() < 5.5 * 3e-5, "sample {t}");
    }
}

#[test]
fn tracked_partial_is_its_peaks_sinusoid_after_one_hop() {
    for (rate, freq) in [(2500, 15.37), (48_000, 40.5), (48_000, 41.0), (48_000, 99.7), (44_100, 33.4)] {
        let f = framing(rate, 101);
        let mut bank = new::<f64>(f, Partials::Tracked);
        let y = run(&mut bank, 0..300, |_| Some(tone(freq, 101)));
        let hop = f.start(1) as usize;
        // Side lobes are maxima too; those of a Hann window are below 0.027.
        assert!((peak(&y[hop..]) - 1.0).abs() < 0.15, "{rate} Hz, {freq}: {}", peak(&y[hop..]));
        let mut alone = new::<f64>(f, Partials::Tracked);
        let mut lobe = tone(freq, 101);
        lobe.iter_mut().enumerate().for_each(|(k, m)| *m *= f64::from((k as f64 - freq).abs() < 2.0));
        let y = run(&mut alone, 0..300, |_| Some(lobe.clone()));
        assert!(off_tone(&y[hop..], freq, f.fft_len) < 1e-9, "{rate} Hz, {freq}");
        assert!((peak(&y[hop..]) - 1.0).abs() < 1e-2, "{rate} Hz, {freq}: {}", peak(&y[hop..]));
    }
}

#[test]
fn tracked_partial_keeps_its_phase_for_half_an_hour() {
    // On a bin, whose closed form is exact in integers, with 88 or 89 samples a hop.
    let f = framing(44_100, 5);
    let mut bank = new::<f32>(f, Partials::Tracked);
    let mags = |_| Some(vec![0.0, 0.0, 0.5, 1.0, 0.5]);
    let frames = 1_000_000;
    let first = run(&mut bank, 0..51, mags);
    let mut out = [0.0; 89];
    for n in 51..frames {
        bank.add_frame(n, f.start(n), &mags(n).unwrap());
        bank.emit(f.start(n), &mut out[..(f.start(n + 1) - f.start(n)) as usize]);
    }
    let late = run(&mut bank, frames..frames + 51, mags);
    // Bin 3 repeats every 1470 samples.
    let shift = (1470 - f.start(frames) % 1470) as usize;
    for (t, y) in late[shift..shift + 1470].iter().enumerate() {
        assert!((y - first[1470 + t]).abs() < 1e-4, "sample {t}: {y}, {}", first[1470 + t]);
    }
}

#[test]
fn step_is_followed_within_one_hop() {
    let (f, on, off) = (framing(48_000, 101), 20 * 96, 40 * 96);
    for partials in BOTH {
        let mags = |n: u64| Some(vec![if (20..40).contains(&n) { 1.0 } else { 0.0 }; 101]);
        let y = run(&mut new::<f64>(f, partials), 0..60, mags);
        assert_eq!(peak(&y[..on]), 0.0, "{partials:?}: silence before");
        assert_eq!(peak(&y[off + 96..]), 0.0, "{partials:?}: exact silence after the ramp");
        if partials == Partials::Tracked {
            assert!(off_tone(&y[on + 96..off], 50.0, 4800) < 1e-9);
            assert!(peak(&y[on + 96..on + 192]) > 1.0);
            continue;
        }
        // The ramp is straight.
        let steady = run(&mut new::<f64>(f, partials), 0..60, |_| Some(vec![1.0; 101]));
        for (t, (y, all)) in y.iter().zip(&steady).enumerate().take(off + 96).skip(on) {
            let up = ((t - on) as f64 / 96.0).min(1.0);
            let down = 1.0 - (t.saturating_sub(off) as f64 / 96.0);
            assert!((y - up * down * all).abs() < 1e-9, "sample {t}");
        }
    }
}

#[test]
fn noise_depends_on_the_sample_number_alone() {
    // A bank that joins late, and one that goes on where another graph left it 5.6 hours or years ago.
    let f = framing(44_100, 101);
    for join in [7, 10_000_000, 1_000_000_000_000] {
        let (mut early, mut late) = (new::<f64>(f, Partials::Noise), new::<f64>(f, Partials::Noise));
        early.reset(f.start(join - 5));
        late.reset(f.start(join));
        let flat = |_| Some(vec![1.0; 101]);
        run(&mut early, join - 5..join, flat);
        let (x, y) = (run(&mut early, join..join + 50, flat), run(&mut late, join..join + 50, flat));
        assert_eq!(x[89..], y[89..]);
        assert!(peak(&y) > 3.0 && peak(&y) < 60.0, "{}", peak(&y));
    }
}

#[test]
fn noise_phase_of_a_bin_is_continuous() {
    let f = framing(48_000, 101);
    let mut mags = vec![0.0; 101];
    // A bin whose phase is interpolated between two that are drawn.
    mags[42] = 1.0;
    let y = run(&mut new::<f64>(f, Partials::Noise), 0..1000, |_| Some(mags.clone()));
    // A phase changes by 8 Hz at most, and where that turns round by 16 Hz, so the recurrence is off by
    // 0.8 * TAU * 16 / 48000.
    assert!(off_tone(&y[96..], 42.0, 4800) < 1.7e-3, "{}", off_tone(&y[96..], 42.0, 4800));
}

#[test]
fn tracked_partial_follows_a_chirp_without_lag() {
    let (f, hops) = (framing(48_000, 101), 1000u64);
    let freq = |n: f64| 30.0 + 0.02 * n;
    let y = run(&mut new::<f64>(f, Partials::Tracked), 0..hops, |n| {
        Some(tone(freq(n as f64), 101).iter().map(|m| if *m > 0.03 { *m } else { 0.0 }).collect())
    });
    // Frame n is reached at the end of its hop; the phase is the integral of the frequency, whatever it
    // starts from.
    let (mut re, mut im) = (0.0, 0.0);
    for (t, y) in y.iter().enumerate().skip(96) {
        let n = t as f64 / 96.0 - 1.0;
        let (sin, cos) = (TAU * (30.0 * n + 0.01 * n * n) * 96.0 / 4800.0).sin_cos();
        (re, im) = (re + y * cos, im + y * sin);
    }
    let share = 2.0 * re.hypot(im) / (y.len() - 96) as f64;
    assert!((share - 1.0).abs() < 0.01, "{share} of the chirp is in phase");
}

#[test]
fn noise_keeps_the_energy_and_does_not_repeat() {
    let f = framing(2500, 101);
    let mags: Vec<f64> = (0..101).map(|k| if (4..98).contains(&k) { 1.0 } else { 0.0 }).collect();
    let y = run(&mut new(f, Partials::Noise), 0..10_000, |_| Some(mags.clone()));
    let mut stft = crate::Stft::new(250);
    let energies: Vec<f64> = y[250..]
        .chunks_exact(250)
        .map(|x| stft.process(x).iter().map(|c| c.norm_sqr()).sum::<f64>() / 94.0)
        .collect();
    let mean = energies.iter().sum::<f64>() / energies.len() as f64;
    assert!((10.0 * mean.log10()).abs() < 0.1, "{} dB", 10.0 * mean.log10());
    let y = &y[250..];
    let like = |lag: usize| {
        y.iter().zip(&y[lag..]).map(|(a, b)| a * b).sum::<f64>() / y.iter().map(|a| a * a).sum::<f64>()
    };
    // Oscillators at the bins' own frequencies would give 1 at each of these.
    let (one, two, four) = (like(250), like(500), like(1000));
    assert!(one < 0.5 && two.abs() < 0.2 && four.abs() < 0.1, "{one} {two} {four}");
}

#[test]
fn nothing_clicks_at_births_deaths_and_missing_frames() {
    // Partials that come and go at 100 to 390 Hz; every fifth frame is missing, and some in a row.
    let f = framing(48_000, 101);
    let mags = |n: u64| {
        let there = !n.is_multiple_of(5) && !(200..204).contains(&n);
        there.then(|| tone(10.0 + ((n / 3) % 30) as f64, 101))
    };
    for partials in BOTH {
        let y = run(&mut new(f, partials), 0..400, mags);
        assert!(peak(&y) > 0.5);
        // Two partials of amplitude 1 at most, and a ramp of each over half a hop or more.
        let most = 2.0 * (1.2 * TAU * 400.0 / 48_000.0 + 1.0 / 48.0);
        assert!(steepest(&y) < most, "{partials:?}: {} of {most}", steepest(&y));
    }
}

#[test]
fn bank_without_frames_is_silent_after_one_hop() {
    for partials in BOTH {
        let f = framing(2500, 101);
        let mut bank = new::<f64>(f, partials);
        let mut out = [9.0; 5];
        assert!(!bank.emit(0, &mut out), "nothing came yet");
        assert_eq!(out, [0.0; 5]);
        for n in 1..4 {
            bank.add_frame(n, f.start(n), &tone(40.3, 101));
            assert!(bank.emit(f.start(n), &mut out));
        }
        assert!(bank.emit(20, &mut out), "fading");
        assert!(peak(&out) > 0.0);
        assert!(!bank.emit(25, &mut out));
        assert_eq!(out, [0.0; 5]);
        // Frames of silence are silence.
        bank.add_frame(6, 30, &[0.0; 101]);
        assert!(!bank.emit(30, &mut out));
        assert_eq!(out, [0.0; 5]);
    }
}

#[test]
fn block_length_changes_no_sample() {
    // Frames at 300 a second and 44.1 kHz, asked for in ticks of 7 to 333 samples; each frame comes in
    // the tick it starts in.
    let f = Framing { frame_num: 300, ..framing(44_100, 101) };
    let total = f.start(60) as usize;
    for partials in BOTH {
        let whole = run(&mut new::<f32>(f, partials), 0..60, |n| Some(tone_single(10.0 + 0.1 * n as f64)));
        for tick in [7, 88, 147, 333] {
            let mut bank = new::<f32>(f, partials);
            let (mut out, mut at, mut frame) = (vec![0.0f32; total], 0, 0);
            while at < total {
                let end = (at + tick).min(total);
                // Of several frames in a tick, what comes before one is asked for first.
                while frame < 60 && f.start(frame) < end as u64 {
                    let start = (f.start(frame) as usize).max(at);
                    bank.emit(at as u64, &mut out[at..start]);
                    bank.add_frame(frame, f.start(frame), &tone_single(10.0 + 0.1 * frame as f64));
                    (at, frame) = (start, frame + 1);
                }
                bank.emit(at as u64, &mut out[at..end]);
                at = end;
            }
            assert_eq!(whole, out, "{partials:?}, {tick} samples a tick");
        }
    }
}

fn tone_single(freq: f64) -> Vec<f32> {
    tone(freq, 101).iter().map(|&m| m as f32).collect()
}

#[test]
fn early_and_late_frames_are_played_in_step() {
    let f = framing(2500, 101);
    let due = run(&mut new::<f64>(f, Partials::Noise), 0..40, |_| Some(vec![1.0; 101]));
    // One hop ahead: each frame still waits for its time.
    let mut bank = new::<f64>(f, Partials::Noise);
    let mut ahead = Vec::new();
    bank.add_frame(0, 0, &[1.0; 101]);
    for n in 0..40 {
        bank.add_frame(n + 1, f.start(n + 1), &[1.0; 101]);
        let mut out = [0.0; 5];
        bank.emit(f.start(n), &mut out);
        ahead.extend(out);
    }
    assert_eq!(due, ahead);
    // Two samples behind, always: no gap and no fade between frames.
    let (mut bank, mut behind) = (new::<f64>(f, Partials::Noise), [0.0; 202]);
    bank.emit(0, &mut behind[..2]);
    for n in 0..40 {
        bank.add_frame(n, f.start(n), &[1.0; 101]);
        let at = f.start(n) as usize + 2;
        bank.emit(at as u64, &mut behind[at..at + 5]);
    }
    let off = due[7..195].iter().zip(&behind[7..195]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 0.02 * peak(&due), "{off}");
}

#[test]
fn bank_counts_bad_magnitudes_as_silence() {
    for partials in BOTH {
        let mut bank = new::<f32>(framing(2500, 101), partials);
        let mut mags = tone_single(30.3);
        (mags[3], mags[60], mags[61], mags[90]) = (f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0);
        let mut out = [0f32; 5];
        assert_eq!(bank.add_frame(0, 0, &mags), 4);
        bank.emit(0, &mut out);
        assert!(out.iter().all(|y| y.is_finite()) && out.iter().any(|&y| y != 0.0));
        for (n, frame) in [[f32::MAX; 101], [f32::MIN_POSITIVE; 101], [1e-44; 101]].iter().enumerate() {
            let n = n as u64 + 1;
            assert_eq!(bank.add_frame(n, 5 * n, frame), 0);
            bank.emit(5 * n, &mut out);
            assert!(out.iter().all(|y| y.is_finite()), "{partials:?} {out:?}");
        }
        bank.add_frame(5, 25, &mags[..50]);
        bank.add_frame(u64::MAX, u64::MAX - 1, &mags);
        bank.emit(u64::MAX - 3, &mut out);
    }
}

#[test]
fn ties_flat_spectra_and_single_bins_are_tracked() {
    let f = framing(48_000, 101);
    let mut alone = vec![0.0; 101];
    alone[40] = 1.0;
    let mut plateau = vec![0.0; 101];
    plateau[20..25].fill(1.0);
    let between = tone(40.5, 101).iter().map(|m| if *m > 0.1 { *m } else { 0.0 }).collect();
    for (mags, freq) in [(vec![1.0; 101], 50.0), (alone, 40.0), (plateau, 22.0), (between, 40.5)] {
        let y = run(&mut new::<f64>(f, Partials::Tracked), 0..50, |_| Some(mags.clone()));
        assert!(off_tone(&y[96..], freq, 4800) < 1e-9, "{freq}");
        assert!(peak(&y[96..]) > 0.7 && peak(&y[96..]) < 1.5, "{freq}: {}", peak(&y[96..]));
    }
}

#[test]
fn noise_floor_does_not_break_up_a_partial() {
    let f = framing(48_000, 101);
    // 26 dB below the tone, another in every frame.
    let mags = |n: u64| {
        let floor = |k| 0.05 * crate::random::uniform(5, n, k as u64);
        Some(tone(40.3, 101).iter().enumerate().map(|(k, m)| m + floor(k)).collect())
    };
    let y = run(&mut new::<f64>(f, Partials::Tracked), 0..500, mags);
    // The tone's own share of a second, by its transform at 403 Hz.
    let amp = line(&y[96..], 403.0 / 48_000.0);
    assert!(amp > 0.7, "{amp}");
}

#[test]
fn bank_works_at_the_edges_of_a_layout() {
    for (fft_len, bins, num) in
        [(50, 26, 500), (51, 26, 500), (51, 1, 500), (2, 2, 500), (1, 1, 500), (50, 26, 7)]
    {
        let f = Framing { rate_hz: 500, fft_len, bins, frame_num: num, frame_den: 1 };
        for partials in BOTH {
            let y = run(&mut new::<f64>(f, partials), 0..50, |_| Some(vec![1.0; bins]));
            assert!(y.iter().all(|y| y.abs() < 30.0), "{f:?} {partials:?}");
            let y = run(&mut new::<f64>(f, partials), 0..50, |_| Some(tone(0.0, bins)));
            assert!(peak(&y) > 0.05, "a constant sounds: {f:?} {partials:?}");
        }
    }
    assert!(OscillatorBank::<f32>::new(framing(2500, 127), Partials::Noise, 1).is_err());
}

#[test]
fn restored_bank_continues_and_refuses_bad_state() {
    // Saved in the middle of a hop, with a frame to come.
    let f = framing(2500, 101);
    for partials in BOTH {
        let mut old = new::<f64>(f, partials);
        run(&mut old, 0..30, |n| Some(tone(30.3 + 0.01 * n as f64, 101)));
        old.add_frame(30, 150, &tone(30.6, 101));
        old.emit(150, &mut [0.0; 2]);
        old.add_frame(31, 155, &tone(30.6, 101));
        assert!(State::measure(|s| new::<f64>(f, partials).state(s)) >= State::measure(|s| old.state(s)));
        let mut bytes = saved(|s| old.state(s));
        let len = bytes.len();
        let mut on = new::<f64>(f, partials);
        assert!(State::restore(&bytes, |s| on.state(s)));
        let (mut x, mut y) = ([0.0; 20], [0.0; 20]);
        assert_eq!(old.emit(152, &mut x), on.emit(152, &mut y));
        assert_eq!(x, y);
        assert!(peak(&x) > 0.1);
        let mut other =
            new::<f64>(f, if partials == Partials::Noise { Partials::Tracked } else { Partials::Noise });
        assert!(!State::restore(&bytes, |s| other.state(s)));
        assert!(!State::restore(&bytes, |s| new::<f64>(framing(5000, 101), partials).state(s)));
        // An amplitude or phase, near the end of the bytes, that is none.
        for wild in [f64::NAN, -2.0, 1e308] {
            bytes[len - 8..].copy_from_slice(&wild.to_le_bytes());
            assert!(!State::restore(&bytes, |s| on.state(s)), "{partials:?} {wild}");
            assert!(!on.emit(on.position(), &mut y), "a bank that refused is reset");
        }
    }
}
