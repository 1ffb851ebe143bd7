use super::*;
use crate::Stft;

/// A deterministic sum of sines below `top_hz`, at any sample.
fn signal(i: u64, rate: f64, top_hz: f64) -> f64 {
    let t = i as f64 / rate;
    (1..20)
        .map(|k| (std::f64::consts::TAU * (top_hz * f64::from(k) / 20.3) * t + f64::from(k * k)).sin())
        .sum()
}

/// Amplitudes of a Hann-windowed frame.
fn analyse(start: u64, f: &Framing, x: impl Fn(u64) -> f64) -> Vec<Complex<f64>> {
    let frame: Vec<f64> = (start..start + f.fft_len as u64).map(x).collect();
    Stft::new(f.fft_len).process(&frame).to_vec()
}

/// Runs `ticks` ticks and returns everything that came out.
fn round_trip(f: Framing, ticks: u64, tick_hz: u64, x: impl Fn(u64) -> f64) -> Vec<f64> {
    let mut ola = OverlapAdd::<f64>::new(f).unwrap();
    let (mut all, mut frame) = (Vec::new(), 0);
    for k in 0..ticks {
        let (a, b) = (k * u64::from(f.rate_hz) / tick_hz, (k + 1) * u64::from(f.rate_hz) / tick_hz);
        while f.start(frame) < b {
            ola.add_frame(f.start(frame), &analyse(f.start(frame), &f, &x)).unwrap();
            frame += 1;
        }
        let mut out = vec![0.0; (b - a) as usize];
        ola.emit(a, &mut out);
        all.extend(out);
    }
    all
}

fn full(rate_hz: u32, fft_len: usize, frame_num: u32, frame_den: u32) -> Framing {
    Framing { rate_hz, fft_len, bins: fft_len / 2 + 1, frame_num, frame_den }
}

#[test]
fn consistent_stream_is_restored_at_any_hop() {
    for (f, tick) in [
        (full(2500, 250, 500, 1), 500),
        (full(500, 50, 500, 1), 500),
        (full(44_100, 4410, 500, 1), 500),
        (full(44_100, 4410, 500, 3), 1000),
        (full(48_000, 4800, 500, 1), 1000),
        (full(2500, 251, 333, 1), 4000),
        (full(2500, 250, 500, 37), 100),
    ] {
        let ticks = (3 * f.fft_len as u64 * tick).div_ceil(u64::from(f.rate_hz));
        let rate = f64::from(f.rate_hz);
        let y = round_trip(f, ticks, tick, |i| signal(i, rate, 0.4 * rate));
        for (i, y) in y.iter().enumerate().skip(f.fft_len) {
            let x = signal(i as u64, rate, 0.4 * rate);
            assert!((y - x).abs() < 1e-11, "{f:?}: sample {i}: {y} is not {x}");
        }
    }
}

#[test]
fn stream_start_is_a_window_weighted_fade_in() {
    let f = full(2500, 250, 500, 1);
    let y = round_trip(f, 60, 500, |_| 1.0);
    let w = hann::<f64>(250);
    for (i, y) in y.iter().enumerate().take(250) {
        let have: f64 = (0..=i / 5).map(|n| w[i - 5 * n].powi(2)).sum();
        let all: f64 = (0..50).map(|n| w[i % 5 + 5 * n].powi(2)).sum();
        assert!((y - have / all).abs() < 1e-12, "{i}");
    }
}

#[test]
fn missing_frame_removes_only_its_weight() {
    let f = full(2500, 250, 500, 1);
    let mut ola = OverlapAdd::<f64>::new(f).unwrap();
    let mut all = Vec::new();
    for n in 0..160 {
        if n != 80 {
            ola.add_frame(f.start(n), &analyse(f.start(n), &f, |_| 1.0)).unwrap();
        }
        let mut out = [0.0; 5];
        ola.emit(5 * n, &mut out);
        all.extend(out);
    }
    let w = hann::<f64>(250);
    for (i, y) in all.iter().enumerate().skip(250) {
        let all: f64 = (0..50).map(|n| w[i % 5 + 5 * n].powi(2)).sum();
        let lost = i.checked_sub(400).and_then(|j| w.get(j)).map_or(0.0, |w| w * w);
        assert!((y - (1.0 - lost / all)).abs() < 1e-12, "{i}");
    }
}

#[test]
fn block_length_changes_no_sample() {
    let f = Framing { bins: 101, ..full(44_100, 4410, 500, 1) };
    let run = |sizes: &[usize]| {
        let mut ola = OverlapAdd::<f32>::new(f).unwrap();
        let (mut all, mut frame, mut i) = (Vec::new(), 0, 0);
        while all.len() < 20_000 {
            let mut out = vec![0.0; sizes[i % sizes.len()]];
            i += 1;
            while f.start(frame) < (all.len() + out.len()) as u64 {
                let s: Vec<_> =
                    (0..101).map(|k| Complex::new((k as f32 + frame as f32).sin(), 0.3)).collect();
                ola.add_frame(f.start(frame), &s).unwrap();
                frame += 1;
            }
            ola.emit(all.len() as u64, &mut out);
            all.extend(out);
        }
        all.truncate(20_000);
        all.iter().map(|v: &f32| v.to_bits()).collect::<Vec<_>>()
    };
    let whole = run(&[88, 89]);
    assert_eq!(whole, run(&[1, 0, 5, 0, 0, 160]));
    assert_eq!(whole, run(&[88]));
}

#[test]
fn frame_out_of_reach_is_refused_and_a_late_one_is_cut() {
    let f = full(2500, 250, 500, 1);
    let mut ola = OverlapAdd::<f64>::new(f).unwrap();
    let spectrum = analyse(0, &f, |_| 1.0);
    let mut out = [0.0; 300];
    ola.emit(1000, &mut out);
    assert_eq!(ola.position(), 1300);
    assert_eq!(ola.add_frame(1050, &spectrum).unwrap_err().0, TOO_LATE);
    assert_eq!(ola.add_frame(2000, &spectrum).unwrap_err().0, TOO_EARLY);
    let refused = ola.add_frame(1300, &[Complex::new(f64::NAN, 0.0)]).unwrap_err();
    assert!(refused.0.contains("not a finite number"));
    ola.add_frame(1200, &spectrum).unwrap();
    ola.emit(1300, &mut out);
    let (w, all) = (hann::<f64>(250), (0..50).map(|n| hann::<f64>(250)[5 * n].powi(2)).sum::<f64>());
    for (i, y) in out.iter().enumerate().take(150) {
        // The sum of windows is the same at every offset: 50 samples of a raised cosine.
        assert!((y - w[i + 100].powi(2) / all).abs() < 1e-12, "{i}");
    }
    assert!(out[150..].iter().all(|&y| y == 0.0));
    ola.add_frame(1600, &spectrum).unwrap();
    ola.emit(10_000_000_000, &mut out);
    assert!(out.iter().all(|&y| y == 0.0), "what a jump left out stayed");
    ola.emit(7, &mut out);
    assert_eq!(ola.position(), 307);
}

#[test]
fn largest_numbers_stay_finite_and_fade() {
    let f = Framing { rate_hz: 2500, fft_len: 250, bins: 126, frame_num: 500, frame_den: 1 };
    let mut add = OverlapAdd::<f32>::new(f).unwrap();
    for n in 0..200 {
        let value = if n < 60 { f32::MAX } else { 0.0 };
        add.add_frame(5 * n, &[Complex::new(value, -value); 126]).unwrap();
        let mut out = [0f32; 5];
        add.emit(5 * n, &mut out);
        assert!(out.iter().all(|y| y.is_finite()), "frame {n}");
        assert!(n < 115 || out == [0.0; 5], "frame {n}: {out:?}");
    }
}
