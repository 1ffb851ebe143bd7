//! Synthesised signals have the magnitudes of the closed form.

use std::f64::consts::TAU;
use std::sync::Arc;

use super::super::{Frames, Model};
use super::*;
use asperity_dsp::frame::BINS;

/// Poles at `radius e^{+-i angle}`.
fn resonance(radius: f64, hz: f64, rate_hz: f64) -> Vec<f64> {
    vec![-2.0 * radius * (TAU * hz / rate_hz).cos(), radius * radius]
}

fn model(ar: Vec<f64>, ma: Vec<f64>, speed_mm_s: f64, force_n: f64) -> Model {
    Model { ar, ma, variance: 0.04, gain: 1.5, speed_mm_s, force_n }
}

/// Mean square amplitudes of `count` frames that overlap by half, by the defining sum.
fn averaged(synthesis: &mut Synthesis, rate_hz: usize, count: usize) -> [f64; BINS] {
    let len = rate_hz / 10;
    let mut signal = vec![0.0f32; len / 2 * (count + 1) + 4000];
    synthesis.process(0, &mut signal);
    let window: Vec<f64> = (0..len).map(|i| 0.5 - 0.5 * (TAU * i as f64 / len as f64).cos()).collect();
    let bins = (rate_hz / 20).min(BINS);
    let turns: Vec<(f64, f64)> = (0..len).map(|i| (TAU * i as f64 / len as f64).sin_cos()).collect();
    let mut power = [0.0; BINS];
    for frame in signal[4000..].windows(len).step_by(len / 2).take(count) {
        for (bin, power) in power.iter_mut().take(bins).enumerate() {
            let (mut re, mut im) = (0.0, 0.0);
            for (i, (x, w)) in frame.iter().zip(&window).enumerate() {
                let (sin, cos) = turns[i * (bin + 1) % len];
                re += w * f64::from(*x) * cos;
                im += w * f64::from(*x) * sin;
            }
            *power += 16.0 * (re * re + im * im) / (len * len * count) as f64;
        }
    }
    power
}

fn decibels(a: f64, b: f64) -> f64 {
    10.0 * (a / b).log10()
}

#[test]
fn frames_have_the_powers_of_the_closed_form() {
    let with_zeros = model([-1.3, 0.95, -0.2].to_vec(), vec![0.5, 0.2], 50.0, 1.0);
    let sharp = model(resonance(0.998, 200.0, 1000.0), vec![], 50.0, 1.0);
    for (name, m) in [("broad", with_zeros), ("sharp", sharp)] {
        let texture = Arc::new(Texture::new(1000.0, vec![m], None).unwrap());
        let expected = Frames::new(1000.0).unwrap().expected_power(&texture.at(50.0, 1.0));
        let mut synthesis = Synthesis::new(texture, 7);
        synthesis.touch(50.0, 1.0);
        let found = averaged(&mut synthesis, 1000, 6000);
        for bin in 0..50 {
            // 6000 overlapping frames of a sharp resonance are some 1500 independent ones: a deviation
            // of 0.11 dB.
            let off = decibels(found[bin], expected[bin]);
            assert!(off.abs() < 0.6, "{name}, {} Hz: {off} dB", 10 * (bin + 1));
        }
        assert!(expected[50..].iter().all(|p| *p == 0.0), "nothing above half the rate");
    }
}

#[test]
fn short_form_is_wrong_at_a_resonance() {
    let frames = Frames::new(1000.0).unwrap();
    // S(w_k) sum w^2 as an amplitude: 4 / (sum w)^2 * 3 N / 8 = 6 / N
    let off = |filter: &Filter, bin: usize| {
        let short = filter.power(TAU * bin as f64 / 100.0) * 6.0 / 100.0;
        decibels(short, frames.expected_power(filter)[bin - 1])
    };
    let flat = Filter::new(&[-0.5], &[], 1.0);
    assert!((1..50).all(|bin| off(&flat, bin).abs() < 0.05));
    let sharp = Filter::new(&resonance(0.998, 200.0, 1000.0), &[], 1.0);
    let (peak, beside) = (off(&sharp, 20), off(&sharp, 21));
    assert!((peak - 11.9).abs() < 0.1 && (beside + 12.4).abs() < 0.1, "{peak} {beside}");
}

#[test]
fn rate_of_10_khz_reaches_every_bin() {
    let frames = Frames::new(10_000.0).unwrap();
    assert_eq!((frames.known_bins(), Frames::new(1000.0).unwrap().known_bins()), (100, 50));
    let texture = Arc::new(Texture::new(10_000.0, vec![model(vec![-0.9], vec![], 1.0, 1.0)], None).unwrap());
    let expected = frames.expected_power(&texture.at(9.0, 9.0));
    let mut synthesis = Synthesis::new(texture, 3);
    synthesis.touch(9.0, 9.0);
    let found = averaged(&mut synthesis, 10_000, 400);
    let off = (0..BINS).map(|k| decibels(found[k], expected[k])).sum::<f64>() / 100.0;
    assert!(off.abs() < 0.2, "{off} dB");
    assert!((0..BINS).all(|k| decibels(found[k], expected[k]).abs() < 1.5));
}

/// Three models whose resonance moves with speed and is louder with force.
fn three() -> Texture {
    let mut models = vec![
        model(resonance(0.95, 100.0, 1000.0), vec![0.3], 20.0, 0.5),
        model(resonance(0.95, 300.0, 1000.0), vec![0.3], 200.0, 0.5),
        model(resonance(0.95, 200.0, 1000.0), vec![0.3], 110.0, 3.0),
    ];
    models[2].variance = 0.4;
    Texture::new(1000.0, models, None).unwrap()
}

#[test]
fn texture_holds_outside_the_hull_and_is_silent_untouched() {
    let texture = three();
    assert_eq!(texture.at(20.0, 0.01), texture.at(20.0, 0.5));
    assert_eq!(texture.at(1e12, 0.5), texture.at(200.0, 0.5));
    for (speed, force) in [(0.0, 1.0), (50.0, 0.0), (-3.0, 1.0), (f64::NAN, 1.0), (50.0, f64::NAN)] {
        let filter = texture.at(speed, force);
        assert_eq!(filter.deviation, 0.0, "{speed} {force}");
        assert!(filter.ar().iter().all(|a| a.is_finite()));
    }
}

#[test]
fn signal_resumes_from_state_and_dies_away_untouched() {
    let texture = Arc::new(three());
    let mut one = Synthesis::new(texture.clone(), 5);
    one.touch(100.0, 1.0);
    one.process(0, &mut [0.0; 333]);
    let mut bytes = vec![0; State::measure(|s| one.state(s))];
    State::save(&mut bytes, |s| one.state(s)).unwrap();
    let mut other = Synthesis::new(texture, 5);
    assert!(State::restore(&bytes, |s| other.state(s)));
    other.touch(100.0, 1.0);
    let (mut a, mut b) = ([0.0; 50], [0.0; 50]);
    one.process(333, &mut a);
    other.process(333, &mut b);
    assert_eq!(a, b);
    one.touch(0.0, 1.0);
    let mut tail = vec![0.0; 4000];
    one.process(383, &mut tail);
    assert!(tail[0] != 0.0 && tail[3999] == 0.0);
    assert_eq!(one.states, [0.0; MAX_ORDER]);
}

#[test]
fn bad_textures_are_refused_with_the_model_number() {
    let good = || model(vec![-0.5], vec![], 1.0, 1.0);
    for (models, wanted) in [
        (vec![], "a texture without models"),
        (
            vec![good(), model(vec![-1.5], vec![], 2.0, 1.0)],
            "model 2: the autoregressive part of a model is not stable",
        ),
        (vec![model(vec![], vec![1.5], 2.0, 1.0)], "minimum phase"),
        (vec![good(), model(vec![-0.5, 0.1], vec![], 2.0, 1.0)], "model 2: 2 and 0 coefficients"),
        (vec![Model { variance: f64::NAN, ..good() }], "the variance of a model is NaN"),
        (vec![Model { gain: -1.0, ..good() }], "the gain of a model is -1"),
        (vec![model(vec![0.0; 65], vec![], 1.0, 1.0)], "a model of 65"),
    ] {
        let found = Texture::new(1000.0, models, None).unwrap_err().to_string();
        assert!(found.contains(wanted), "{found}\nwanted {wanted}");
    }
    assert!(Texture::new(f64::NAN, vec![good()], None).is_err());
    assert!(Frames::new(50.0).is_err() && Frames::new(f64::NAN).is_err());
}
