//! Recordings of several axes.

use super::super::Filter;
use super::tests::{Recorded, accounts, bands_off, noise, poles, stay};
use super::*;

/// Three axes with a resonance of their own each, loud at one speed and 30 dB quieter at another, gravity on one of them.
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
fn the_powers_of_three_axes_add_up_and_the_quiet_stays_quiet() {
    let (axes, polynomials) = three();
    let acceleration_m_s2 = axes.iter().map(|a| a.acceleration.as_slice()).collect();
    let recording = Recording { acceleration_m_s2, ..axes[0].recording() };
    let (texture, report) = recording.fit(&Settings::default()).unwrap();
    accounts(&report);
    assert_eq!(texture.models().len(), 2, "{report:#?}");
    for (model, deviation) in texture.models().iter().zip([0.0316, 1.0]) {
        let power = |hz: f64| -> f64 {
            let of = |a: &Vec<f64>| Filter::new(a, &[], deviation).power(std::f64::consts::TAU * hz / 1000.0);
            polynomials.iter().map(of).sum()
        };
        for band in 14..=26 {
            let centre = 10f64.powf(f64::from(band) / 10.0);
            let sum = |of: &dyn Fn(f64) -> f64| -> f64 {
                (-50..=50).map(|i| of(centre * 10f64.powf(f64::from(i) / 1000.0))).sum()
            };
            let found = sum(&|hz| model.filter().power(std::f64::consts::TAU * hz / 1000.0));
            let off = 10.0 * (found / sum(&power)).log10();
            assert!(off.abs() < 1.5, "{} mm/s, {centre:.0} Hz: {off} dB", model.speed_mm_s);
        }
    }
}

#[test]
fn an_axis_that_gives_nothing_changes_nothing() {
    let one = noise(6.0);
    let (dead, constant) = (vec![0.0; 6000], vec![-9.81; 6000]);
    let alone = one.recording().fit(&Settings::default()).unwrap();
    for others in [vec![&dead], vec![&constant, &dead]] {
        let mut axes: Vec<&[f64]> = others.iter().map(|a| a.as_slice()).collect();
        axes.push(&one.acceleration);
        let recording = Recording { acceleration_m_s2: axes, ..one.recording() };
        let (texture, report) = recording.fit(&Settings::default()).unwrap();
        assert_eq!(report.segments.len(), alone.1.segments.len());
        let off = bands_off(&texture.models()[0].filter(), 1000.0, &alone.0.models()[0].filter(), 1000.0);
        assert!(off.abs() < 1e-6, "{off} dB");
    }
}

#[test]
fn what_is_wrong_with_one_axis_is_seen_and_no_signal_is_none_on_any() {
    let one = noise(6.0);
    let mut other = noise(6.0).acceleration;
    let fit = |other: &[f64]| {
        let recording = Recording { acceleration_m_s2: vec![&one.acceleration, other], ..one.recording() };
        recording.fit(&Settings::default()).map(|(_, report)| report)
    };
    // At its limit for 30 ms, and three blocks before and behind.
    other[2000..2030].fill(50.0);
    let clipped = fit(&other).unwrap().dropped_s(Why::Clipped);
    assert!((clipped - 0.09).abs() < 1e-9, "{clipped}");
    // A click on one axis.
    let mut other = noise(6.0).acceleration;
    other[4005] = 200.0;
    let click = fit(&other).unwrap().dropped_s(Why::Click);
    assert!((click - 0.03).abs() < 1e-9, "{click}");
    // One axis drops out: the others are there still. Both do: nothing is.
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
