//! Signals of known models come back. Recordings without a texture are refused.

use std::f64::consts::TAU;
use std::sync::Arc;

use proptest::prelude::*;

use super::super::testing::{bands, off_db, poles};
use super::super::{Filter, Model, TextureFile, is_stable};
use super::*;
use asperity_numbers::Random;

/// A stretch at one speed in mm/s and force in N, with its filter.
struct Stay {
    speed: f64,
    force: f64,
    seconds: f64,
    filter: Filter,
}

fn stay(speed: f64, force: f64, seconds: f64, ar: &[f64], deviation: f64) -> Stay {
    Stay { speed, force, seconds, filter: Filter::new(ar, &[], deviation) }
}

struct Recorded {
    rate_hz: f64,
    force: Vec<f64>,
    speed: Vec<f64>,
    acceleration: Vec<f64>,
}

impl Recorded {
    /// Stays one after the other, with `ramp_s` from each to the next. The signal's history goes on.
    fn new(rate_hz: f64, stays: &[Stay], ramp_s: f64, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut it = Self { rate_hz, force: vec![], speed: vec![], acceleration: vec![] };
        let mut history = vec![0.0; 64];
        for (i, stay) in stays.iter().enumerate() {
            let next = stays.get(i + 1).unwrap_or(stay);
            let (hold, ramp) = ((stay.seconds * rate_hz) as usize, (ramp_s * rate_hz) as usize);
            for n in 0..hold + ramp {
                let part = n.saturating_sub(hold) as f64 / ramp.max(1) as f64;
                it.speed.push(stay.speed + part * (next.speed - stay.speed));
                it.force.push(stay.force + part * (next.force - stay.force));
                let back: f64 = stay.filter.ar().iter().zip(&history).map(|(a, x)| a * x).sum();
                let sample = stay.filter.deviation * random.normal() - back;
                history.rotate_right(1);
                history[0] = sample;
                it.acceleration.push(sample);
            }
        }
        it
    }

    fn recording(&self) -> Recording<'_> {
        Recording {
            rate_hz: self.rate_hz,
            force_n: &self.force,
            speed_mm_s: &self.speed,
            acceleration_m_s2: vec![&self.acceleration],
        }
    }

    fn fit(&self, settings: &Settings) -> (Texture, Report) {
        let (texture, report) = self.recording().fit(settings).unwrap();
        accounts(&report);
        (texture, report)
    }

    fn error(&self) -> String {
        self.recording().fit(&Settings::default()).unwrap_err().to_string()
    }
}

/// Every block is in one stretch, fitted or dropped.
fn accounts(report: &Report) {
    let mut all: Vec<[f64; 2]> = report.segments.iter().map(|s| [s.start_s, s.length_s]).collect();
    assert!(all.is_sorted_by(|a, b| a[0] < b[0]));
    all.extend(report.dropped.iter().map(|d| [d.start_s, d.length_s]));
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut end = 0.0;
    for [start, length] in all {
        assert!((start - end).abs() < 1e-6 && length > 0.0, "{start} s after {end} s");
        end = start + length;
    }
    assert!((end - report.duration_s).abs() < 1e-6);
}

fn without_high_pass(by: Criterion) -> Settings {
    Settings { high_pass_hz: 0.0, order: Order::Best { most: 24, by }, ..Settings::default() }
}

/// The largest difference in dB in third-octave bands from 25 to 400 Hz.
fn bands_off(found: &Filter, truth: &Filter, truth_hz: f64) -> f64 {
    off_db(&bands(found, 1000.0), &bands(truth, truth_hz), 0.0)
}

#[test]
fn known_model_comes_back_with_its_order() {
    for (resonances, order) in
        [(vec![[120.0, 30.0], [310.0, 50.0]], 4), (vec![[60.0, 40.0], [180.0, 20.0], [400.0, 60.0]], 6)]
    {
        let ar = poles(&resonances, 1000.0);
        let recorded = Recorded::new(1000.0, &[stay(100.0, 1.0, 30.0, &ar, 0.3)], 0.0, 5);
        let (texture, report) = recorded.fit(&without_high_pass(Criterion::Bic));
        assert_eq!((report.order, texture.models().len(), report.segments.len()), (order, 1, 1));
        assert_eq!(report.criterion.len(), 24);
        assert_eq!(report.criterion[order - 1], (order, 0.0));
        // A lower order explains far less, a higher one hardly more: the logarithm of 30000 samples is 10.3.
        assert!(report.criterion[order - 2].1 > 1000.0 && report.criterion[order].1 < 10.4);
        let model = &texture.models()[0];
        let off = model.ar.iter().zip(&ar).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(off < 0.03, "{off}");
        assert!((model.speed_mm_s - 100.0).abs() < 1e-9 && (model.force_n - 1.0).abs() < 1e-9);
        // The variance of 30000 independent samples has a deviation of 0.8 %.
        assert!((report.segments[0].residual_variance / 0.09 - 1.0).abs() < 0.03);
        let off = bands_off(&model.filter(), &Filter::new(&ar, &[], 0.3), 1000.0);
        assert!(off < 0.5, "{off} dB");
        let (_, by_aicc) = recorded.fit(&without_high_pass(Criterion::Aicc));
        assert!((order..=order + 3).contains(&by_aicc.order), "{}", by_aicc.order);
        let given = Settings { order: Order::Given(9), ..Settings::default() };
        let (texture, report) = recorded.fit(&given);
        assert_eq!((report.order, texture.models()[0].ar.len(), report.criterion.len()), (9, 9, 0));
    }
}

#[test]
fn high_pass_removes_slow_motion_only() {
    let ar = poles(&[[120.0, 30.0], [310.0, 50.0]], 1000.0);
    let mut recorded = Recorded::new(1000.0, &[stay(100.0, 1.0, 30.0, &ar, 0.3)], 0.0, 5);
    for (n, x) in recorded.acceleration.iter_mut().enumerate() {
        *x += 9.81 + 20.0 * (TAU * 0.7 * n as f64 / 1000.0).sin();
    }
    let truth = Filter::new(&ar, &[], 0.3);
    let (texture, report) = recorded.fit(&Settings::default());
    let off = bands_off(&texture.models()[0].filter(), &truth, 1000.0);
    assert!(off.abs() < 1.0, "{off} dB of order {}", report.order);
}

/// Four corners of speed and force, each with a spectrum and level of its own.
fn four() -> [Stay; 4] {
    [
        stay(40.0, 0.5, 4.0, &poles(&[[60.0, 40.0], [200.0, 80.0]], 1000.0), 0.1),
        stay(150.0, 0.5, 4.0, &poles(&[[150.0, 40.0], [250.0, 80.0]], 1000.0), 0.3),
        stay(150.0, 2.0, 4.0, &poles(&[[180.0, 30.0], [320.0, 50.0]], 1000.0), 0.5),
        stay(40.0, 2.0, 4.0, &poles(&[[90.0, 30.0], [260.0, 50.0]], 1000.0), 0.2),
    ]
}

#[test]
fn borders_are_where_speed_or_force_jump() {
    let recorded = Recorded::new(1000.0, &four(), 0.0, 3);
    let (_, report) = recorded.fit(&Settings::default());
    for border in [4.0, 8.0, 12.0] {
        // Speeds are smoothed over 50 ms.
        let near = |t: f64| (t - border).abs() < 0.0351;
        assert!(report.segments.iter().any(|s| near(s.start_s)), "{border}: {report:#?}");
        assert!(report.segments.iter().any(|s| near(s.start_s + s.length_s)), "{border}: {report:#?}");
    }
}

#[test]
fn borders_are_where_the_spectrum_changes() {
    let (one, other) =
        (poles(&[[100.0, 30.0], [250.0, 50.0]], 1000.0), poles(&[[160.0, 30.0], [330.0, 50.0]], 1000.0));
    let level = |ar: &[f64]| 0.5 / Filter::new(ar, &[], 1.0).variance().sqrt();
    for seed in 0..6 {
        // Same speed, force and level: only the shape differs.
        let stays = [
            stay(80.0, 1.0, 3.0, &one, level(&one)),
            stay(80.0, 1.0, 2.0, &other, level(&other)),
            stay(80.0, 1.0, 4.0, &one, level(&one)),
        ];
        let recorded = Recorded::new(1000.0, &stays, 0.0, seed);
        let (texture, report) = recorded.fit(&Settings::default());
        let starts: Vec<f64> = report.segments.iter().map(|s| s.start_s).collect();
        assert_eq!(starts.len(), 3, "{starts:?}");
        assert!((starts[1] - 3.0).abs() < 0.051 && (starts[2] - 5.0).abs() < 0.051, "{starts:?}");
        // One speed and force, so one model with their mean level.
        assert_eq!(texture.models().len(), 1);
        let variance = texture.models()[0].filter().variance();
        assert!((variance / 0.25 - 1.0).abs() < 0.15, "{variance}");
    }
    // One spectrum throughout is one piece.
    for seed in 0..10 {
        let recorded = Recorded::new(1000.0, &[stay(80.0, 1.0, 9.0, &one, 1.0)], 0.0, 100 + seed);
        assert_eq!(recorded.fit(&Settings::default()).1.segments.len(), 1, "seed {seed}");
    }
}

#[test]
fn fast_recordings_are_resampled_to_the_models_rate() {
    for rate_hz in [2500.0, 5000.0, 9999.0] {
        // As much above the band of a 1 kHz model as below.
        let ar = poles(&[[120.0, 40.0], [310.0, 60.0], [800.0, 60.0]], rate_hz);
        let stays = [stay(100.0, 1.0, 12.0, &ar, 0.3), stay(30.0, 1.0, 12.0, &ar, 0.1)];
        let recorded = Recorded::new(rate_hz, &stays, 0.0, 9);
        let (texture, report) = recorded.fit(&Settings::default());
        assert_eq!((texture.rate_hz(), texture.models().len()), (1000.0, 2), "{report:#?}");
        assert!((report.duration_s - 24.0).abs() < 0.02);
        for (model, deviation) in texture.models().iter().zip([0.1, 0.3]) {
            let truth = Filter::new(&ar, &[], deviation);
            let off = bands_off(&model.filter(), &truth, rate_hz);
            assert!(off.abs() < 1.2, "{rate_hz} Hz: {off} dB");
        }
        // The border keeps its place: the filter's delay is removed.
        assert!((report.segments[1].start_s - 12.0).abs() < 0.0351, "{report:#?}");
    }
    let recorded = Recorded::new(5000.0, &[stay(50.0, 1.0, 5.0, &[-0.5], 0.3)], 0.0, 9);
    let settings = Settings { model_hz: 5000, ..Settings::default() };
    assert_eq!(recorded.fit(&settings).0.rate_hz(), 5000.0);
}

#[test]
fn power_above_half_the_rate_is_told_and_bands_reach_it() {
    // White noise at 5 kHz: four fifths of its power are above 500 Hz.
    let recorded = Recorded::new(5000.0, &[stay(50.0, 1.0, 8.0, &[], 0.3)], 0.0, 9);
    let above = recorded.fit(&Settings::default()).1.above;
    assert!((above - 0.8).abs() < 0.03, "{above}");
    let settings = Settings { model_hz: 5000, ..Settings::default() };
    let (texture, report) = recorded.fit(&settings);
    assert_eq!(report.above, 0.0);
    let all = recorded.recording().compare(&settings, &Arc::new(texture), &report).unwrap().all;
    let highest = all.bands.last().unwrap().centre_hz;
    assert!((highest - 1995.3).abs() < 0.1, "{highest}");
    assert!(all.worst().unwrap().off_db().abs() < 1.5, "{:?}", all.worst());
}

#[test]
fn stay_that_is_dead_for_the_most_part_is_left_out() {
    let ar = poles(&[[120.0, 30.0], [310.0, 50.0]], 1000.0);
    let mut recorded = Recorded::new(1000.0, &[stay(100.0, 1.0, 12.0, &ar, 0.3)], 0.0, 5);
    let truth = recorded.fit(&Settings::default()).0.models()[0].filter().variance();
    recorded.acceleration[4000..11_000].iter_mut().for_each(|x| *x *= 1e-3);
    let (texture, report) = recorded.fit(&Settings::default());
    let dead = report.dropped_s(Why::Dead);
    assert!((dead - 7.0).abs() < 0.1, "{report:#?}");
    let off = 10.0 * (texture.models()[0].filter().variance() / truth).log10();
    assert!(texture.models().len() == 1 && off.abs() < 0.5, "{off} dB");
}

#[test]
fn texture_with_few_bumps_has_no_dead_stretch() {
    // A bump every half second, 30 ms long: most of the time the tool is in silence.
    let mut recorded = noise(12.0);
    for (n, x) in recorded.acceleration.iter_mut().enumerate() {
        *x *= if n % 500 < 30 { 1.0 } else { 1e-3 };
    }
    let dead = recorded.fit(&Settings::default()).1.dropped_s(Why::Dead);
    assert_eq!(dead, 0.0);
}

fn noise(seconds: f64) -> Recorded {
    Recorded::new(1000.0, &[stay(50.0, 1.0, seconds, &[-0.5, 0.2], 0.3)], 0.0, 1)
}

#[test]
fn bad_recordings_and_settings_are_refused_with_help() {
    let with = |change: fn(&mut Recorded)| {
        let mut recorded = noise(3.0);
        change(&mut recorded);
        recorded.error()
    };
    for (found, wanted) in [
        (with(|r| r.acceleration[1234] = f64::NAN), "the acceleration is NaN at sample 1234, at 1.2340 s"),
        (with(|r| r.force[7] = f64::NEG_INFINITY), "the force is -inf at sample 7"),
        (with(|r| r.speed[0] = 1e6), "the speed is 1000000 at sample 0"),
        (with(|r| r.speed.truncate(9)), "3000 samples of force, and 9 of speed"),
        (with(|r| r.rate_hz = 500.0), "a recording at 500 Hz"),
        (with(|r| r.rate_hz = f64::NAN), "a recording at NaN Hz"),
        (with(|r| r.rate_hz = 44_100.0), "1000 to 10000 Hz"),
        (
            with(|r| r.speed.fill(0.1)),
            "the tool never moves: its speed is 0.100 mm/s at most; is it in mm/s?",
        ),
        (with(|r| r.force.fill(0.0)), "the force is 0.0000 N at most"),
        (with(|r| r.acceleration.fill(0.0)), "3.00 s without a change of acceleration"),
        (with(|r| r.acceleration.fill(0.0)), "is it the right channel?"),
        (with(|r| r.acceleration.iter_mut().for_each(|x| *x = x.signum())), "the acceleration at its limit"),
        (
            with(|r| (0..3000).for_each(|n| r.speed[n] = 100.0 + 80.0 * (TAU * n as f64 / 200.0).sin())),
            "3.00 s with speed or force changing (hold speed and force for a second",
        ),
        (noise(0.1).error(), "a recording of 0.100 s"),
        (
            Recorded { rate_hz: 1000.0, force: vec![], speed: vec![], acceleration: vec![] }.error(),
            "a recording of 0.000 s",
        ),
    ] {
        assert!(found.contains(wanted), "{found}\nwanted {wanted}");
    }
    let set = |change: fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        noise(1.0).recording().fit(&settings).unwrap_err().to_string()
    };
    for (found, wanted) in [
        (set(|s| s.model_hz = 2000), "models at 2000 Hz of a recording at 1000 Hz"),
        (set(|s| s.model_hz = 100), "a rate of models of 100 Hz (500 to 10000 Hz)"),
        (set(|s| s.order = Order::Given(0)), "an order of 0"),
        (set(|s| s.order = Order::Given(65)), "(1 to 64)"),
        (set(|s| s.order = Order::Given(64)), "models of order 64 of pieces of 0.2 s (pieces of 0.256 s"),
        (set(|s| s.high_pass_hz = f64::NAN), "a corner of the high-pass of NaN Hz"),
        (set(|s| s.shortest_s = 0.0), "a shortest piece of 0 s"),
        (set(|s| s.tolerance.force_n = 0.0), "a tolerance of force of 0 N"),
        (set(|s| s.most_models = 0), "a number of models of 0"),
    ] {
        assert!(found.contains(wanted), "{found}\nwanted {wanted}");
    }
}

#[test]
fn pure_tone_has_a_model_of_its_frequency_and_level() {
    let mut recorded = noise(4.0);
    for (n, x) in recorded.acceleration.iter_mut().enumerate() {
        *x = 2.0 * (TAU * 137.0 * n as f64 / 1000.0).sin();
    }
    let (texture, _) = recorded.fit(&Settings::default());
    let filter = texture.models()[0].filter();
    let peak = (1..500).max_by(|a, b| {
        let power = |hz: &i32| filter.power(TAU * f64::from(*hz) / 1000.0);
        power(a).total_cmp(&power(b))
    });
    assert_eq!(peak, Some(137));
    let variance = filter.variance();
    assert!((variance / 2.0 - 1.0).abs() < 0.02, "a sine of 2 has a mean square of 2, not {variance}");
    assert!(is_stable(filter.ar()));
}

#[test]
fn clicks_and_limits_are_dropped_and_change_little() {
    let ar = poles(&[[120.0, 30.0], [310.0, 50.0]], 1000.0);
    let truth = Filter::new(&ar, &[], 0.3);
    let clean = || Recorded::new(1000.0, &[stay(100.0, 1.0, 10.0, &ar, 0.3)], 0.0, 5);
    let mut clicks = clean();
    clicks.acceleration[3333] += 300.0;
    clicks.acceleration[7007] -= 150.0;
    let (texture, report) = clicks.fit(&Settings::default());
    let click = report.dropped_s(Why::Click);
    // The block of each click, one before and one behind.
    assert!((click - 0.06).abs() < 1e-9, "{click} s");
    assert_eq!(report.segments.len(), 3, "{report:#?}");
    let off = bands_off(&texture.models()[0].filter(), &truth, 1000.0);
    assert!(off.abs() < 1.0, "{off} dB");
    assert_eq!(clean().fit(&Settings::default()).1.dropped, []);

    let mut limited = clean();
    for x in &mut limited.acceleration[4000..4400] {
        *x = (20.0 * *x).clamp(-8.0, 8.0);
    }
    let (texture, report) = limited.fit(&Settings::default());
    assert!(report.dropped_s(Why::Clipped) > 0.15, "{report:#?}");
    let off = bands_off(&texture.models()[0].filter(), &truth, 1000.0);
    assert!(off.abs() < 1.0, "{off} dB");
    assert!(report.segments.iter().all(|s| s.mean_square < 2.0 * report.segments[0].mean_square));

    // Bumps that repeat are the texture.
    let mut bumps = clean();
    bumps.acceleration.iter_mut().step_by(100).for_each(|x| *x += 60.0);
    assert_eq!(bumps.fit(&Settings::default()).1.dropped_s(Why::Click), 0.0);
}

#[test]
fn contact_and_motion_bound_what_is_fitted() {
    let mut recorded = noise(9.0);
    recorded.force[..2000].fill(0.0);
    recorded.speed[4000..5000].fill(2.0);
    recorded.speed[7000..7100].fill(2.0);
    recorded.speed[7200..7300].fill(2.0);
    // The mean of five blocks decides. Each border to fast motion takes two blocks off a slow stretch.
    let (_, report) = recorded.fit(&Settings::default());
    for (why, seconds) in [(Why::NoContact, 2.0), (Why::Slow, 1.08)] {
        assert!((report.dropped_s(why) - seconds).abs() < 0.06, "{why}: {report:#?}");
    }
    assert!((report.dropped_s(Why::Short) - 0.1).abs() < 0.06, "{report:#?}");
}

#[test]
fn recording_ending_within_a_block_is_fitted_to_there() {
    for (seconds, whole) in [(4.024_402, 4.02), (2.509_423, 2.5), (1.0, 1.0)] {
        let (_, report) = noise(seconds).fit(&Settings::default());
        assert!((report.duration_s - whole).abs() < 1e-9 && report.segments.len() == 1, "{report:#?}");
        assert!((report.segments[0].length_s - whole).abs() < 1e-9);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn any_recording_gives_a_texture_or_an_error(
        seed: u64, seconds in 0.3..6.0f64, jumps in 0..30usize, size in -9.0..2.0f64, quantum in 0..3usize,
    ) {
        let mut random = Random::new(seed);
        let mut recorded = noise(seconds);
        let count = recorded.force.len();
        for _ in 0..jumps {
            let from = random.below(count);
            let to = (from + random.below(1500)).min(count);
            let (speed, force, gain) =
                (random.range(-50.0, 300.0), random.range(-0.5, 3.0), 10f64.powf(random.range(-3.0, 1.0)));
            recorded.speed[from..to].fill(speed);
            recorded.force[from..to].iter_mut().for_each(|f| *f = force + 0.1 * *f);
            recorded.acceleration[from..to].iter_mut().for_each(|x| *x *= gain);
        }
        let scale = 10f64.powf(size);
        let step = [0.0, 0.1, 3.0][quantum];
        for x in &mut recorded.acceleration {
            *x *= scale;
            if step > 0.0 {
                *x = (*x / step).round() * step;
            }
        }
        match recorded.recording().fit(&Settings::default()) {
            Ok((texture, report)) => {
                accounts(&report);
                for m in texture.models() {
                    prop_assert!(m.check().is_ok());
                }
                let (description, origin) = (String::new(), String::new());
                let file = TextureFile { description, origin, texture };
                prop_assert!(file.to_ron().is_ok());
            }
            Err(e) => prop_assert!(e.message.starts_with("no stretch of 0.2 s to fit: "), "{e}"),
        }
    }
}

// Merging of pieces into models.

#[test]
fn no_more_models_than_asked_for() {
    let stays: Vec<Stay> = (0..20)
        .map(|i| stay(20.0 * 1.3f64.powi(i % 10), 0.4 + f64::from(i / 10), 1.0, &[-0.5], 0.3))
        .collect();
    let recorded = Recorded::new(1000.0, &stays, 0.0, 2);
    let count = |most_models| {
        let settings = Settings { most_models, ..Settings::default() };
        let (texture, report) = recorded.fit(&settings);
        assert!(report.segments.iter().all(|s| s.model < texture.models().len()));
        texture.models().len()
    };
    let free = count(64);
    assert!((12..=20).contains(&free), "{free}");
    assert!((3..=6).contains(&count(6)));
    assert_eq!(count(1), 1);
}

/// 84 and 118 mm/s are within a fifth of 100, but not of each other. So the order decides: the longest
/// is first, whenever it was.
#[test]
fn shorter_pieces_go_to_the_longest_near_them() {
    let pieces = [(84.0, 1.0), (100.0, 4.0), (118.0, 1.0)];
    for order in [[0, 1, 2], [1, 0, 2], [2, 0, 1]] {
        let stays: Vec<Stay> = order
            .iter()
            .flat_map(|&i| {
                let (speed, seconds) = pieces[i];
                [(1.0, seconds), (0.0, 0.5)].map(|(force, s)| stay(speed, force, s, &[-0.5], 0.3))
            })
            .collect();
        let (texture, report) = Recorded::new(1000.0, &stays, 0.0, 4).fit(&Settings::default());
        assert_eq!((texture.models().len(), report.segments.len()), (1, 3), "{order:?}: {report:#?}");
        let mean = texture.models()[0].speed_mm_s;
        assert!((mean - 602.0 / 6.0).abs() < 0.5, "{order:?}: {mean} mm/s");
    }
}

/// The way is ten times as loud and has a tenth of the power of the stays. If it counted, it would make
/// 0.8 dB or more.
#[test]
fn short_way_between_long_stays_has_no_model() {
    let fitted = |way: Stay| {
        let stays = [stay(60.0, 1.0, 6.0, &[-0.5], 0.3), way, stay(60.0, 3.0, 6.0, &[-0.5], 0.3)];
        Recorded::new(1000.0, &stays, 0.0, 4).fit(&Settings::default())
    };
    let levels = |texture: &Texture| -> Vec<f64> {
        let level = |m: &Model| 10.0 * (m.filter().variance() / (0.09 / 0.75)).log10();
        texture.models().iter().map(level).collect()
    };
    let (texture, report) = fitted(stay(60.0, 1.4, 0.3, &[-0.5], 3.0));
    assert_eq!(texture.models().len(), 2, "{report:#?}");
    assert!(report.segments.iter().any(|s| (s.force_n - 1.4).abs() < 0.1 && s.model == 0), "{report:#?}");
    assert!(levels(&texture).iter().all(|db| db.abs() < 0.3), "{:?}", levels(&texture));
    // Longer than a tenth, or far away, it has a model of its own.
    for way in [stay(60.0, 1.4, 1.0, &[-0.5], 3.0), stay(200.0, 1.4, 0.3, &[-0.5], 3.0)] {
        let (texture, report) = fitted(way);
        assert_eq!(texture.models().len(), 3, "{report:#?}");
        assert!(levels(&texture).iter().any(|db| *db > 15.0), "{:?}", levels(&texture));
    }
}

// Recordings of several axes.

/// Three axes with a resonance each, loud at one speed and 30 dB quieter at another. One has gravity.
fn three() -> ([Recorded; 3], Vec<Vec<f64>>) {
    let of = [[90.0, 30.0], [180.0, 40.0], [330.0, 60.0]].map(|resonance| poles(&[resonance], 1000.0));
    let recorded = std::array::from_fn(|i| {
        let stays = [stay(150.0, 1.0, 20.0, &of[i], 1.0), stay(40.0, 1.0, 20.0, &of[i], 0.0316)];
        let mut axis = Recorded::new(1000.0, &stays, 0.0, 40 + i as u64);
        axis.acceleration.iter_mut().for_each(|x| *x += if i == 1 { 9.81 } else { 0.0 });
        axis
    });
    (recorded, of.to_vec())
}

#[test]
fn powers_of_three_axes_add_up_and_quiet_stays_quiet() {
    let (axes, polynomials) = three();
    let acceleration_m_s2 = axes.iter().map(|a| a.acceleration.as_slice()).collect();
    let recording = Recording { acceleration_m_s2, ..axes[0].recording() };
    let (texture, report) = recording.fit(&Settings::default()).unwrap();
    accounts(&report);
    assert_eq!(texture.models().len(), 2, "{report:#?}");
    for (model, deviation) in texture.models().iter().zip([0.0316, 1.0]) {
        let of = polynomials.iter().map(|a| bands(&Filter::new(a, &[], deviation), 1000.0));
        let sum = of.reduce(|a, b| a.iter().zip(b).map(|(x, y)| x + y).collect()).unwrap();
        let off = off_db(&bands(&model.filter(), 1000.0), &sum, 0.0);
        assert!(off < 1.5, "{} mm/s: {off} dB", model.speed_mm_s);
    }
}

#[test]
fn one_bad_axis_is_seen_and_one_still_axis_is_not_still() {
    let one = noise(6.0);
    let mut other = noise(6.0).acceleration;
    let fit = |other: &[f64]| {
        let recording = Recording { acceleration_m_s2: vec![&one.acceleration, other], ..one.recording() };
        recording.fit(&Settings::default()).map(|(_, report)| report)
    };
    // At its limit for 30 ms, plus three blocks before and behind.
    other[2000..2030].fill(50.0);
    let clipped = fit(&other).unwrap().dropped_s(Why::Clipped);
    assert!((clipped - 0.09).abs() < 1e-9, "{clipped}");
    // A click on one axis.
    let mut other = noise(6.0).acceleration;
    other[4005] = 200.0;
    let click = fit(&other).unwrap().dropped_s(Why::Click);
    assert!((click - 0.03).abs() < 1e-9, "{click}");
    // One axis drops out: the others remain. Both drop out: nothing remains.
    let mut other = noise(6.0).acceleration;
    other[3000..3500].fill(0.25);
    assert_eq!(fit(&other).unwrap().dropped_s(Why::Still), 0.0);
    let mut both = noise(6.0);
    both.acceleration[3000..3500].fill(0.25);
    let recording = Recording { acceleration_m_s2: vec![&both.acceleration, &other], ..both.recording() };
    let still = recording.fit(&Settings::default()).unwrap().1.dropped_s(Why::Still);
    assert!((still - 0.5).abs() < 1e-9, "{still}");
    other[17] = f64::NAN;
    assert!(fit(&other).unwrap_err().message.starts_with("the acceleration is NaN at sample 17"));
    assert!(fit(&other[..9]).unwrap_err().message.contains("and 9 of acceleration"));
    let axes = |count: usize| {
        let acceleration_m_s2 = vec![one.acceleration.as_slice(); count];
        let recording = Recording { acceleration_m_s2, ..one.recording() };
        recording.fit(&Settings::default()).map_err(|e| e.message)
    };
    assert!(axes(3).is_ok());
    assert_eq!(
        (axes(0).unwrap_err(), axes(4).unwrap_err()),
        ("0 axes of acceleration".into(), "4 axes of acceleration".into())
    );
}

// Comparison of a texture with the recording that it was fitted to.

fn two() -> (Recorded, [Filter; 2]) {
    let of = [[[90.0, 30.0], [310.0, 50.0]], [[60.0, 40.0], [180.0, 40.0]]].map(|p| poles(&p, 1000.0));
    let stays = [stay(40.0, 1.0, 40.0, &of[0], 0.1), stay(150.0, 1.0, 40.0, &of[1], 0.3)];
    (Recorded::new(1000.0, &stays, 0.0, 5), [Filter::new(&of[0], &[], 0.1), Filter::new(&of[1], &[], 0.3)])
}

#[test]
fn compared_bands_match_the_closed_form() {
    let (recorded, truth) = two();
    let (texture, report) = recorded.fit(&Settings::default());
    let texture = Arc::new(texture);
    let found = recorded.recording().compare(&Settings::default(), &texture, &report).unwrap();
    assert_eq!(found.models.len(), 2);
    assert!((found.all.seconds - 80.0).abs() < 0.2 && (found.models[0].seconds - 40.0).abs() < 0.2);
    for (model, truth) in found.models.iter().zip(&truth) {
        assert_eq!(model.bands.len(), 13);
        let own = texture.models()[usize::from(truth.deviation > 0.2)].filter();
        let of = |of: fn(&Band) -> f64| model.bands.iter().map(|b| of(b).powi(2)).collect::<Vec<f64>>();
        let (recorded, rendered) = (of(|b| b.recorded_m_s2), of(|b| b.rendered_m_s2));
        // 40 s of a band of 5.8 Hz have a deviation of 0.29 dB.
        let off = off_db(&recorded, &bands(truth, 1000.0), 0.0);
        assert!(off < 1.0, "{off} dB");
        let off = off_db(&rendered, &bands(&own, 1000.0), 0.0);
        assert!(off < 0.6, "{off} dB");
        for (band, (x, y)) in model.bands.iter().zip(rendered.iter().zip(&recorded)) {
            assert!((band.off_db() - 10.0 * (x / y).log10()).abs() < 1e-9);
        }
        assert!(model.level_off_db().abs() < 0.4, "{} dB", model.level_off_db());
        let worst = model.worst().unwrap();
        assert!(worst.off_db().abs() < 1.5, "{worst:?}");
        // A mean square is the density's integral.
        let sum = Compared::DENSITY_STEP_HZ * model.density.iter().sum::<f64>();
        assert!((sum / truth.variance() - 1.0).abs() < 0.08, "{sum}, not {}", truth.variance());
        for hz in [60.0, 90.0, 180.0, 310.0] {
            let want = 2.0 * truth.power(TAU * hz / 1000.0) / 1000.0;
            let off = 10.0 * (model.density[(hz / 5.0) as usize] / want).log10();
            assert!(off.abs() < 1.5, "{hz} Hz: {off} dB");
        }
    }
    let again = recorded.recording().compare(&Settings::default(), &texture, &report).unwrap();
    assert_eq!(again, found);
}

#[test]
fn comparison_shows_wrong_levels_and_bands() {
    let (recorded, _) = two();
    let (texture, report) = recorded.fit(&Settings::default());
    let compare = |models: Vec<Model>| {
        let texture = Arc::new(Texture::new(1000.0, models, None).unwrap());
        recorded.recording().compare(&Settings::default(), &texture, &report).unwrap()
    };
    let plain = compare(texture.models().to_vec());
    let louder = texture.models().iter().map(|m| Model { gain: 2.0 * m.gain, ..m.clone() });
    let louder = compare(louder.collect());
    for (a, b) in plain.models.iter().zip(&louder.models) {
        assert!((b.level_off_db() - a.level_off_db() - 6.02).abs() < 0.01);
    }
    let elsewhere =
        texture.models().iter().map(|m| Model { ar: poles(&[[250.0, 20.0]], 1000.0), ..m.clone() });
    let elsewhere = compare(elsewhere.collect());
    assert!(elsewhere.models.iter().all(|m| m.worst().unwrap().off_db().abs() > 6.0));
}

#[test]
fn slow_models_have_fewer_bands_short_pieces_no_density() {
    let recorded = noise(8.0);
    let settings = Settings { model_hz: 500, ..Settings::default() };
    let (texture, report) = recorded.fit(&settings);
    let found = recorded.recording().compare(&settings, &Arc::new(texture), &report).unwrap();
    let highest = found.all.bands.last().unwrap().centre_hz;
    assert!((highest - 199.5).abs() < 0.1, "{highest}");
    assert!(found.all.worst().unwrap().off_db().abs() < 2.5, "{:?}", found.all.worst());

    let mut short = noise(3.0);
    for (n, speed) in short.speed.iter_mut().enumerate() {
        *speed = if n / 120 % 2 == 0 { 50.0 } else { 150.0 };
    }
    let settings = Settings { shortest_s: 0.1, order: Order::Given(2), ..Settings::default() };
    let (texture, report) = short.fit(&settings);
    let found = short.recording().compare(&settings, &Arc::new(texture), &report).unwrap();
    assert!(report.segments.iter().all(|s| s.length_s < 0.2) && found.all.density.is_empty());
    assert!(found.all.bands.iter().skip(6).all(|b| b.off_db().abs() < 3.0), "{:?}", found.all.bands);
}
