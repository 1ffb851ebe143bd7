use super::*;
use crate::Stft;
use std::f64::consts::TAU;

fn conversion(in_hz: u32, out_hz: u32, phase: FilterPhase) -> Conversion {
    Conversion { in_hz, out_hz, tick_num: 500, tick_den: 1, passband: Conversion::PASSBAND, phase }
}

/// Runs `seconds` of a signal of time through ticks of `c`, starting at tick `first`.
fn run<T: Float>(c: &Conversion, first: u64, seconds: f64, x: impl Fn(f64) -> f64) -> Vec<T> {
    let mut r = Resampler::<T>::new(c).unwrap();
    let ticks = (seconds * f64::from(c.tick_num) / f64::from(c.tick_den)) as u64;
    let start = |k: u64, rate: u32| k * u64::from(rate) * u64::from(c.tick_den) / u64::from(c.tick_num);
    let mut all = Vec::new();
    for k in first..first + ticks {
        let (a, b) = (start(k, c.in_hz), start(k + 1, c.in_hz));
        let input: Vec<T> = (a..b).map(|n| T::of(x(n as f64 / f64::from(c.in_hz)))).collect();
        let (p, q) = (start(k, c.out_hz), start(k + 1, c.out_hz));
        let mut out = vec![T::zero(); (q - p) as usize];
        r.process(a, &input, p, &mut out);
        assert!(r.next == Some(b), "an output reached for an input that had not come");
        all.extend(out);
    }
    all
}

/// Amplitude and phase (turns, of a sine) at `f`, by correlation over whole periods of `f` (a whole
/// number) in the last second.
fn at(y: &[f64], rate: u32, f: f64) -> (f64, f64) {
    let from = y.len() - rate as usize;
    let (mut s, mut c) = (0.0, 0.0);
    for (i, y) in y.iter().enumerate().skip(from) {
        let (sin, cos) = (TAU * f * (i as f64 / f64::from(rate))).sin_cos();
        s += y * sin;
        c += y * cos;
    }
    let half = f64::from(rate) / 2.0;
    ((s.hypot(c)) / half, c.atan2(s) / TAU)
}

const PAIRS: [(u32, u32); 8] = [
    (2500, 48_000),
    (2500, 44_100),
    (500, 48_000),
    (4000, 48_000),
    (48_000, 2500),
    (48_000, 44_100),
    (2500, 44_099),
    (44_100, 48_000),
];

#[test]
fn pass_band_is_flat_and_linear_phase_states_its_delay() {
    for (a, b) in PAIRS {
        let c = conversion(a, b, FilterPhase::Linear);
        let (num, den) = Resampler::<f64>::new(&c).unwrap().latency();
        let edge = 0.4 * f64::from(a.min(b));
        for part in [0.02, 0.25, 0.5, 0.75, 0.9, 1.0] {
            let f = (edge * part).round();
            let y = run::<f64>(&c, 0, 1.5, |t| (TAU * f * t).sin());
            let (gain, turns) = at(&y, b, f);
            assert!((20.0 * gain.log10()).abs() < 0.001, "{a} to {b}: {} dB at {f} Hz", 20.0 * gain.log10());
            let late = turns + f * num as f64 / den as f64;
            assert!((late - late.round()).abs() < 1e-5, "{a} to {b}: {late} turns at {f} Hz");
        }
    }
}

#[test]
fn minimum_phase_is_flat_and_states_its_group_delay() {
    for (a, b) in PAIRS {
        let c = conversion(a, b, FilterPhase::Minimum);
        let (num, den) = Resampler::<f64>::new(&c).unwrap().latency();
        let edge = 0.4 * f64::from(a.min(b));
        for part in [0.05, 0.5, 0.9, 1.0] {
            let f = (edge * part).round();
            let (gain, _) = at(&run::<f64>(&c, 0, 1.5, |t| (TAU * f * t).sin()), b, f);
            assert!((20.0 * gain.log10()).abs() < 0.01, "{a} to {b}: {} dB at {f} Hz", 20.0 * gain.log10());
        }
        let f = (edge / 4.0).round();
        let phase = |f: f64| at(&run::<f64>(&c, 0, 1.5, |t| (TAU * f * t).sin()), b, f).1;
        let slope = phase(f - 1.0) - phase(f + 1.0);
        let delay = (slope - slope.round()) / 2.0;
        let stated = num as f64 / den as f64;
        assert!((delay - stated).abs() < 0.002 * stated, "{a} to {b}: {delay} s, stated {stated}");
        let linear = Resampler::<f64>::new(&conversion(a, b, FilterPhase::Linear)).unwrap().latency();
        assert!(stated < 0.3 * linear.0 as f64 / linear.1 as f64, "{a} to {b}: {stated} s is not short");
    }
}

/// The largest line of a signal's spectrum re a unit sine, in dB, more than 0.1 of the lower rate from `f`.
fn largest_elsewhere(y: &[f64], rate: u32, f: f64, lower: f64) -> f64 {
    let mut stft = Stft::<f64>::new(rate as usize);
    let bins = stft.process(&y[y.len() - rate as usize..]);
    let far = bins.iter().enumerate().filter(|&(k, _)| (k as f64 - f).abs() > 0.1 * lower);
    20.0 * far.map(|(_, x)| x.norm()).fold(0.0, f64::max).log10()
}

#[test]
fn images_and_aliases_are_below_85_db() {
    for (a, b) in PAIRS {
        for phase in [FilterPhase::Linear, FilterPhase::Minimum] {
            let lower = f64::from(a.min(b));
            for part in [0.03, 0.21, 0.4] {
                let f = (part * lower).round();
                let y = run::<f64>(&conversion(a, b, phase), 0, 1.5, |t| (TAU * f * t).sin());
                let db = largest_elsewhere(&y, b, f, lower);
                assert!(db < -85.0, "{a} to {b}, {phase:?}: {db} dB beside {f} Hz");
            }
        }
    }
    // What lies above the lower rate's band does not fold back.
    let y = run::<f64>(&conversion(48_000, 2500, FilterPhase::Linear), 0, 1.5, |t| (TAU * 1600.0 * t).sin());
    assert!(largest_elsewhere(&y, 2500, -1e9, 1.0) < -85.0);
}

#[test]
fn outputs_match_scipy() {
    // scipy 1.17.1: h = sinc(i / L - 14) kaiser(28 L + 1, 0.1102 * 79.3), x = sin(0.7 n) + 0.5 cos(0.011
    // n^2), n < 60; upfirdn(h, x, L, M)[k]
    let x: Vec<f64> = (0..60).map(f64::from).map(|n| (0.7 * n).sin() + 0.5 * (0.011 * n * n).cos()).collect();
    for (out_hz, k, v) in [
        (48_000, 1, -2.492882706204573e-06),
        (48_000, 17, -2.5584822154616916e-05),
        (48_000, 300, 1.4043642253546602),
        (48_000, 1000, 0.5140060591739991),
        (44_100, 17, -9.226652955346951e-06),
        (44_100, 300, 1.3582800244507642),
        (44_100, 640, 0.4512088362481826),
        (44_100, 1000, -0.8165570995883318),
    ] {
        let mut r = Resampler::<f64>::new(&conversion(2500, out_hz, FilterPhase::Linear)).unwrap();
        let mut y = vec![0.0; 60 * out_hz as usize / 2500];
        r.process(0, &x, 0, &mut y);
        assert!((y[k] - v).abs() < 1e-11, "{out_hz}, {k}: {} is not {v}", y[k]);
    }
    // The same for 48000 to 2500: h = 5/96 sinc(u) kaiser(u / 14), u = 5/96 (i / 5 - 269), x = sin(0.02
    // n) + 0.3 cos(0.5 n).
    let x: Vec<f64> = (0..3000).map(f64::from).map(|n| (0.02 * n).sin() + 0.3 * (0.5 * n).cos()).collect();
    let mut r = Resampler::<f64>::new(&conversion(48_000, 2500, FilterPhase::Linear)).unwrap();
    let mut y = vec![0.0; 156];
    r.process(0, &x, 0, &mut y);
    for (k, v) in [
        (5, -1.662415384528898e-05),
        (50, 0.9501145280549086),
        (100, 0.9994379425032448),
        (150, 0.9272699889551501),
    ] {
        assert!((y[k] - v).abs() < 1e-11, "{k}: {} is not {v}", y[k]);
    }
}

#[test]
fn tick_length_changes_no_sample() {
    let x = |t: f64| (TAU * 313.0 * t).sin() + 0.3 * (TAU * 77.0 * t).cos();
    for (a, b) in
        [(2500, 48_000), (2500, 44_100), (48_000, 2500), (500, 44_100), (44_100, 48_000), (2500, 2500)]
    {
        // 0.5 s in one tick, and in ticks of whole numbers of inputs.
        let c = conversion(a, b, FilterPhase::Linear);
        let whole = run::<f32>(&Conversion { tick_num: 2, ..c }, 0, 0.5, x);
        assert_eq!(whole.len(), b as usize / 2);
        for tick in [4, 100, 250, 500].into_iter().filter(|&t| a % t == 0) {
            let y = run::<f32>(&Conversion { tick_num: tick, ..c }, 0, 0.5, x);
            assert!(y == whole, "{a} to {b} at {tick} Hz");
        }
        // Ticks that do not: one more input sample late, alike among themselves.
        let tick = |num, den| Conversion { tick_num: num, tick_den: den, ..c };
        let late = run::<f32>(&tick(997, 1), 0, 0.5, x);
        for (num, den) in [(4000, 1), (3000, 1), (1000, 7)] {
            if !(u64::from(a) * u64::from(den)).is_multiple_of(u64::from(num)) {
                let y = run::<f32>(&tick(num, den), 0, 0.5, x);
                let both = y.len().min(late.len());
                assert!(both > b as usize / 3);
                assert!(y[..both] == late[..both], "{a} to {b} at {num}/{den} Hz");
            }
        }
        if a != b {
            let latency = |num| Resampler::<f32>::new(&tick(num, 1)).unwrap().latency();
            assert_eq!(latency(997), (latency(2).0 + 1, u64::from(a)));
        }
    }
}

#[test]
fn sample_position_is_exact_after_years() {
    let c = conversion(2500, 44_100, FilterPhase::Linear);
    let tick_by_tick = |seconds: u64| {
        let mut r = Resampler::<f32>::new(&c).unwrap();
        let mut all = Vec::new();
        for k in 0..250 {
            let input: Vec<f32> = (5 * k..5 * k + 5).map(|n| (n as f32 * 0.3).sin()).collect();
            let (a, b) = (k * 44_100 / 500, (k + 1) * 44_100 / 500);
            let mut out = vec![0.0; (b - a) as usize];
            r.process(seconds * 2500 + 5 * k, &input, seconds * 44_100 + a, &mut out);
            all.extend(out);
        }
        all
    };
    let now = tick_by_tick(0);
    assert!(now.iter().any(|y| y.abs() > 0.9));
    assert!(tick_by_tick(1 << 33) == now);
}

#[test]
fn gap_is_silence_and_an_earlier_index_starts_anew() {
    let c = conversion(2500, 48_000, FilterPhase::Linear);
    let mut r = Resampler::<f64>::new(&c).unwrap();
    let (mut out, ones) = ([0f64; 96], [1.0; 5]);
    for k in 0..20 {
        r.process(5 * k, &ones, 96 * k, &mut out);
    }
    assert!((out[95] - 1.0).abs() < 1e-3);
    // A gap as long as the filter leaves nothing behind.
    r.process(5 * 1000, &[0.0; 5], 96 * 1000, &mut out);
    assert_eq!(out, [0.0; 96]);
    for k in 1001..1020 {
        r.process(5 * k, &ones, 96 * k, &mut out);
    }
    r.process(0, &[0.0; 5], 0, &mut out);
    assert_eq!(out, [0.0; 96]);
    // Indices that do not belong together.
    r.process(5, &ones, u64::MAX, &mut out);
    assert_eq!(out, [0.0; 96]);
    r.process(u64::MAX, &ones, 0, &mut out);
    r.process::<f64>(u64::MAX - 3, &[], u64::MAX - 3, &mut []);
    r.reset();
    r.process(0, &[0.0; 5], 0, &mut out);
    assert_eq!(out, [0.0; 96]);
}

#[test]
fn impossible_conversion_is_refused() {
    let c = conversion(2500, 48_000, FilterPhase::Linear);
    for (refused, why) in [
        (Conversion { in_hz: 0, ..c }, "a rate is 0"),
        (Conversion { tick_num: 0, ..c }, "a rate is 0"),
        (Conversion { passband: 0.5, ..c }, "the pass band"),
        (Conversion { passband: f64::NAN, ..c }, "the pass band"),
        (Conversion { out_hz: 4_294_967_291, ..c }, "the ratio of the rates"),
        (Conversion { in_hz: 4_294_967_291, ..c }, "the ratio of the rates"),
    ] {
        assert!(Resampler::<f32>::new(&refused).unwrap_err().0.contains(why), "{refused:?}");
    }
}

#[test]
fn equal_rates_pass_through_without_delay() {
    let c = Conversion { tick_num: 4000, ..conversion(2500, 2500, FilterPhase::Minimum) };
    assert_eq!(Resampler::<f32>::new(&c).unwrap().latency(), (0, 1));
    let y = run::<f64>(&c, 0, 0.1, |t| t);
    assert!(y.iter().enumerate().all(|(i, y)| *y == i as f64 / 2500.0));
}

#[test]
fn minimum_phase_delay_matches_the_docs() {
    let ms = |in_hz| {
        let r = Resampler::<f32>::new(&conversion(in_hz, 48_000, FilterPhase::Minimum)).unwrap();
        r.latency().0 as f64 / r.latency().1 as f64 * 1e3
    };
    assert!((ms(2500) - 0.96).abs() < 0.005 && (ms(500) - 4.79).abs() < 0.005);
}
