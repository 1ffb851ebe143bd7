//! A texture beside the recording that it was fitted to.

use std::f64::consts::TAU;
use std::sync::Arc;

use super::super::{Filter, Model};
use super::tests::{Recorded, noise, poles, stay};
use super::*;

/// The root mean square of a band of a third of an octave, from the closed form at 1 kHz.
fn closed(filter: &Filter, centre_hz: f64) -> f64 {
    let (low, high) = (centre_hz * 10f64.powf(-0.05), centre_hz * 10f64.powf(0.05));
    let at = |i: i32| low + (high - low) * (f64::from(i) + 0.5) / 200.0;
    let mean = (0..200).map(|i| filter.power(TAU * at(i) / 1000.0)).sum::<f64>() / 200.0;
    // One-sided: twice the density times the width.
    (2.0 * mean / 1000.0 * (high - low)).sqrt()
}

fn two() -> (Recorded, [Filter; 2]) {
    let of = [[[90.0, 30.0], [310.0, 50.0]], [[60.0, 40.0], [180.0, 40.0]]].map(|p| poles(&p, 1000.0));
    let stays = [stay(40.0, 1.0, 40.0, &of[0], 0.1), stay(150.0, 1.0, 40.0, &of[1], 0.3)];
    (Recorded::new(1000.0, &stays, 0.0, 5), [Filter::new(&of[0], &[], 0.1), Filter::new(&of[1], &[], 0.3)])
}

#[test]
fn bands_of_the_recording_are_those_of_its_spectrum_and_of_the_fit_nearly_the_same() {
    let (recorded, truth) = two();
    let (texture, report) = recorded.fit(&Settings::default());
    let texture = Arc::new(texture);
    let found = recorded.recording().compare(&Settings::default(), &texture, &report).unwrap();
    assert_eq!(found.models.len(), 2);
    assert!((found.all.seconds - 80.0).abs() < 0.2 && (found.models[0].seconds - 40.0).abs() < 0.2);
    for (model, truth) in found.models.iter().zip(&truth) {
        assert_eq!(model.bands.len(), 13);
        let own = texture.models()[usize::from(truth.deviation > 0.2)].filter();
        for band in &model.bands {
            let db = |x: f64, y: f64| 20.0 * (x / y).log10();
            // 40 s of a band of 5.8 Hz have a deviation of 0.29 dB.
            let off = db(band.recorded_m_s2, closed(truth, band.centre_hz));
            assert!(off.abs() < 1.0, "{band:?}: {off} dB");
            let off = db(band.rendered_m_s2, closed(&own, band.centre_hz));
            assert!(off.abs() < 0.6, "{band:?}: {off} dB");
            assert!((band.off_db() - db(band.rendered_m_s2, band.recorded_m_s2)).abs() < 1e-9);
        }
        assert!(model.level_off_db().abs() < 0.4, "{} dB", model.level_off_db());
        let worst = model.worst().unwrap();
        assert!(worst.off_db().abs() < 1.5, "{worst:?}");
        // A mean square is the density's integral.
        let mut square = [0.0];
        truth.autocovariance(&mut square);
        let sum = Compared::DENSITY_STEP_HZ * model.density.iter().sum::<f64>();
        assert!((sum / square[0] - 1.0).abs() < 0.08, "{sum}, not {}", square[0]);
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
fn a_texture_that_is_too_loud_or_sounds_elsewhere_is_told() {
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
fn slow_models_have_fewer_bands_and_short_pieces_no_density() {
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
