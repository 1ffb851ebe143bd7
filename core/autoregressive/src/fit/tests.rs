//! Signals of known models come back, and what is no texture is dropped or refused.

use std::f64::consts::{PI, TAU};

use proptest::prelude::*;

use super::super::{Filter, is_stable};
use super::*;
use asperity_numbers::Random;

/// Poles at frequencies in Hz with bandwidths in Hz.
pub(super) fn poles(resonances: &[[f64; 2]], rate_hz: f64) -> Vec<f64> {
    let mut a = vec![1.0];
    for [hz, bandwidth_hz] in resonances {
        let radius = (-PI * bandwidth_hz / rate_hz).exp();
        let factor = [1.0, -2.0 * radius * (TAU * hz / rate_hz).cos(), radius * radius];
        let mut product = vec![0.0; a.len() + 2];
        for (i, x) in a.iter().enumerate() {
            for (j, y) in factor.iter().enumerate() {
                product[i + j] += x * y;
            }
        }
        a = product;
    }
    a.split_off(1)
}

/// A stretch at one speed in mm/s and force in N, and what sounds there: a filter and a level as its deviation.
pub(super) struct Stay {
    speed: f64,
    force: f64,
    seconds: f64,
    filter: Filter,
}

pub(super) fn stay(speed: f64, force: f64, seconds: f64, ar: &[f64], deviation: f64) -> Stay {
    Stay { speed, force, seconds, filter: Filter::new(ar, &[], deviation) }
}

pub(super) struct Recorded {
    pub(super) rate_hz: f64,
    pub(super) force: Vec<f64>,
    pub(super) speed: Vec<f64>,
    pub(super) acceleration: Vec<f64>,
}

impl Recorded {
    /// Stays one after the other, with `ramp_s` from each to the next; the history of the signal is kept.
    pub(super) fn new(rate_hz: f64, stays: &[Stay], ramp_s: f64, seed: u64) -> Self {
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

    pub(super) fn recording(&self) -> Recording<'_> {
        Recording {
            rate_hz: self.rate_hz,
            force_n: &self.force,
            speed_mm_s: &self.speed,
            acceleration_m_s2: vec![&self.acceleration],
        }
    }

    pub(super) fn fit(&self, settings: &Settings) -> (Texture, Report) {
        let (texture, report) = self.recording().fit(settings).unwrap();
        accounts(&report);
        (texture, report)
    }

    fn error(&self) -> String {
        self.recording().fit(&Settings::default()).unwrap_err().to_string()
    }
}

/// Every block is in one stretch, fitted or not.
pub(super) fn accounts(report: &Report) {
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

/// The largest difference in dB in third-octave bands from 25 to 400 Hz; spectra a Hz.
pub(super) fn bands_off(found: &Filter, found_hz: f64, truth: &Filter, truth_hz: f64) -> f64 {
    let mut worst: f64 = 0.0;
    for band in 14..=26 {
        let centre = 10f64.powf(f64::from(band) / 10.0);
        let (low, high) = (centre * 10f64.powf(-0.05), centre * 10f64.powf(0.05));
        let power = |filter: &Filter, rate_hz: f64| {
            let at = |i: i32| low + (high - low) * (f64::from(i) + 0.5) / 200.0;
            (0..200).map(|i| filter.power(TAU * at(i) / rate_hz) / rate_hz).sum::<f64>()
        };
        let off = 10.0 * (power(found, found_hz) / power(truth, truth_hz)).log10();
        worst = if off.abs() > worst.abs() { off } else { worst };
    }
    worst
}

#[test]
fn one_known_model_comes_back_with_its_order() {
    for (resonances, order) in
        [(vec![[120.0, 30.0], [310.0, 50.0]], 4), (vec![[60.0, 40.0], [180.0, 20.0], [400.0, 60.0]], 6)]
    {
        let ar = poles(&resonances, 1000.0);
        let recorded = Recorded::new(1000.0, &[stay(100.0, 1.0, 30.0, &ar, 0.3)], 0.0, 5);
        let (texture, report) = recorded.fit(&without_high_pass(Criterion::Bic));
        assert_eq!((report.order, texture.models().len(), report.segments.len()), (order, 1, 1));
        assert_eq!(report.criterion.len(), 24);
        assert_eq!(report.criterion[order - 1], (order, 0.0));
        // An order too few explains far less, one too many hardly more: the logarithm of 30000 samples is 10.3.
        assert!(report.criterion[order - 2].1 > 1000.0 && report.criterion[order].1 < 10.4);
        let model = &texture.models()[0];
        let off = model.ar.iter().zip(&ar).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(off < 0.03, "{off}");
        assert!((model.speed_mm_s - 100.0).abs() < 1e-9 && (model.force_n - 1.0).abs() < 1e-9);
        // Of 30000 independent samples the deviation of the variance is 0.8 %.
        assert!((report.segments[0].residual_variance / 0.09 - 1.0).abs() < 0.03);
        let off = bands_off(&model.filter(), 1000.0, &Filter::new(&ar, &[], 0.3), 1000.0);
        assert!(off.abs() < 0.5, "{off} dB");
        let (_, by_aicc) = recorded.fit(&without_high_pass(Criterion::Aicc));
        assert!((order..=order + 3).contains(&by_aicc.order), "{}", by_aicc.order);
        let given = Settings { order: Order::Given(9), ..Settings::default() };
        let (texture, report) = recorded.fit(&given);
        assert_eq!((report.order, texture.models()[0].ar.len(), report.criterion.len()), (9, 9, 0));
    }
}

#[test]
fn the_high_pass_takes_slow_motion_and_leaves_the_texture() {
    let ar = poles(&[[120.0, 30.0], [310.0, 50.0]], 1000.0);
    let mut recorded = Recorded::new(1000.0, &[stay(100.0, 1.0, 30.0, &ar, 0.3)], 0.0, 5);
    for (n, x) in recorded.acceleration.iter_mut().enumerate() {
        *x += 9.81 + 20.0 * (TAU * 0.7 * n as f64 / 1000.0).sin();
    }
    let truth = Filter::new(&ar, &[], 0.3);
    let (texture, report) = recorded.fit(&Settings::default());
    let off = bands_off(&texture.models()[0].filter(), 1000.0, &truth, 1000.0);
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
fn stays_at_several_speeds_and_forces_become_the_corners() {
    let order: Vec<Stay> = four().into_iter().chain(four()).collect();
    let recorded = Recorded::new(1000.0, &order, 0.3, 17);
    let (texture, report) = recorded.fit(&Settings::default());
    assert_eq!(texture.models().len(), 4, "{report:#?}");
    assert_eq!(texture.triangles().corners().len(), 2);
    for truth in four() {
        let near = |m: &&super::super::Model| {
            (m.speed_mm_s - truth.speed).abs() < 0.05 * truth.speed
                && (m.force_n - truth.force).abs() < 0.05 * truth.force
        };
        let model = texture.models().iter().find(near).unwrap_or_else(|| panic!("{:?}", texture.models()));
        let off = bands_off(&model.filter(), 1000.0, &truth.filter, 1000.0);
        assert!(off.abs() < 1.5, "{} mm/s {} N: {off} dB", truth.speed, truth.force);
    }
    // Ramps of 0.3 s go from 40 to 150 mm/s: most of each is neither.
    let unsteady = report.dropped_s(Why::Unsteady);
    assert!((0.7..2.2).contains(&unsteady), "{unsteady}");
    let fitted: f64 = report.segments.iter().map(|s| s.length_s).sum();
    assert!(fitted > 31.0, "{fitted}");
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
    let level = |ar: &[f64]| {
        let mut r = [0.0];
        Filter::new(ar, &[], 1.0).autocovariance(&mut r);
        0.5 / r[0].sqrt()
    };
    for seed in 0..6 {
        // The same speed, force and level: the shape alone tells.
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
        // They are at one speed and force, and so one model, of their mean level.
        assert_eq!(texture.models().len(), 1);
        let mut r = [0.0];
        texture.models()[0].filter().autocovariance(&mut r);
        assert!((r[0] / 0.25 - 1.0).abs() < 0.15, "{}", r[0]);
    }
    // One spectrum throughout is one piece.
    for seed in 0..10 {
        let recorded = Recorded::new(1000.0, &[stay(80.0, 1.0, 9.0, &one, 1.0)], 0.0, 100 + seed);
        assert_eq!(recorded.fit(&Settings::default()).1.segments.len(), 1, "seed {seed}");
    }
}

#[test]
fn faster_recordings_are_brought_to_the_models_rate() {
    for rate_hz in [2500.0, 5000.0, 9999.0] {
        // With as much above what a model of 1 kHz can hold as below.
        let ar = poles(&[[120.0, 40.0], [310.0, 60.0], [800.0, 60.0]], rate_hz);
        let stays = [stay(100.0, 1.0, 12.0, &ar, 0.3), stay(30.0, 1.0, 12.0, &ar, 0.1)];
        let recorded = Recorded::new(rate_hz, &stays, 0.0, 9);
        let (texture, report) = recorded.fit(&Settings::default());
        assert_eq!((texture.rate_hz(), texture.models().len()), (1000.0, 2), "{report:#?}");
        assert!((report.duration_s - 24.0).abs() < 0.02);
        for (model, deviation) in texture.models().iter().zip([0.1, 0.3]) {
            let truth = Filter::new(&ar, &[], deviation);
            let off = bands_off(&model.filter(), 1000.0, &truth, rate_hz);
            assert!(off.abs() < 1.2, "{rate_hz} Hz: {off} dB");
        }
        // The border lies where it lay: the filter's delay is taken out.
        assert!((report.segments[1].start_s - 12.0).abs() < 0.0351, "{report:#?}");
    }
    let recorded = Recorded::new(5000.0, &[stay(50.0, 1.0, 5.0, &[-0.5], 0.3)], 0.0, 9);
    let settings = Settings { model_hz: 5000, ..Settings::default() };
    assert_eq!(recorded.fit(&settings).0.rate_hz(), 5000.0);
}

pub(super) fn noise(seconds: f64) -> Recorded {
    Recorded::new(1000.0, &[stay(50.0, 1.0, seconds, &[-0.5, 0.2], 0.3)], 0.0, 1)
}

#[test]
fn what_cannot_be_fitted_is_refused_in_words_that_help() {
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
        (
            with(|r| r.acceleration.iter_mut().for_each(|x| *x = x.signum())),
            "with the acceleration at its limit",
        ),
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
fn a_pure_tone_has_a_model_of_its_frequency_and_level() {
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
    let mut r = [0.0];
    filter.autocovariance(&mut r);
    assert!((r[0] / 2.0 - 1.0).abs() < 0.02, "a sine of 2 has a mean square of 2, not {}", r[0]);
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
    // The block of each, one before and one behind.
    assert!((click - 0.06).abs() < 1e-9, "{click} s");
    assert_eq!(report.segments.len(), 3, "{report:#?}");
    let off = bands_off(&texture.models()[0].filter(), 1000.0, &truth, 1000.0);
    assert!(off.abs() < 1.0, "{off} dB");
    assert_eq!(clean().fit(&Settings::default()).1.dropped, []);

    let mut limited = clean();
    for x in &mut limited.acceleration[4000..4400] {
        *x = (20.0 * *x).clamp(-8.0, 8.0);
    }
    let (texture, report) = limited.fit(&Settings::default());
    assert!(report.dropped_s(Why::Clipped) > 0.15, "{report:#?}");
    let off = bands_off(&texture.models()[0].filter(), 1000.0, &truth, 1000.0);
    assert!(off.abs() < 1.0, "{off} dB");
    assert!(report.segments.iter().all(|s| s.mean_square < 2.0 * report.segments[0].mean_square));

    // Bumps that come again and again are the texture.
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
    // The mean of five blocks decides: at each border to what is fast it takes two blocks off what is slow.
    let (_, report) = recorded.fit(&Settings::default());
    for (why, seconds) in [(Why::NoContact, 2.0), (Why::Slow, 1.08)] {
        assert!((report.dropped_s(why) - seconds).abs() < 0.06, "{why}: {report:#?}");
    }
    assert!((report.dropped_s(Why::Short) - 0.1).abs() < 0.06, "{report:#?}");
}

#[test]
fn a_recording_that_ends_within_a_block_is_fitted_up_to_there() {
    for (seconds, whole) in [(4.024_402, 4.02), (2.509_423, 2.5), (1.0, 1.0)] {
        let (_, report) = noise(seconds).fit(&Settings::default());
        assert!((report.duration_s - whole).abs() < 1e-9 && report.segments.len() == 1, "{report:#?}");
        assert!((report.segments[0].length_s - whole).abs() < 1e-9);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn whatever_was_recorded_gives_a_texture_or_an_error(
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
                let file = super::super::TextureFile { description, origin, texture };
                prop_assert!(file.to_ron().is_ok());
            }
            Err(e) => prop_assert!(e.message.starts_with("no stretch of 0.2 s to fit: "), "{e}"),
        }
    }
}
