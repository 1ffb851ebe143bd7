//! Which pieces become one model.

use super::super::Model;
use super::tests::{Recorded, Stay, stay};
use super::*;

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

/// 84 and 118 mm/s are within a fifth of 100, and not of each other: who comes first decides, and that is the longest, whenever it was.
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

/// Ten times as loud, and a tenth of the power of what is held: counted, it would be 0.8 dB and more.
#[test]
fn a_short_way_between_long_stays_is_no_model_and_changes_none() {
    let fitted = |way: Stay| {
        let stays = [stay(60.0, 1.0, 6.0, &[-0.5], 0.3), way, stay(60.0, 3.0, 6.0, &[-0.5], 0.3)];
        Recorded::new(1000.0, &stays, 0.0, 4).fit(&Settings::default())
    };
    let levels = |texture: &Texture| -> Vec<f64> {
        let level = |m: &Model| {
            let mut r = [0.0];
            m.filter().autocovariance(&mut r);
            10.0 * (r[0] / (0.09 / 0.75)).log10()
        };
        texture.models().iter().map(level).collect()
    };
    let (texture, report) = fitted(stay(60.0, 1.4, 0.3, &[-0.5], 3.0));
    assert_eq!(texture.models().len(), 2, "{report:#?}");
    assert!(report.segments.iter().any(|s| (s.force_n - 1.4).abs() < 0.1 && s.model == 0), "{report:#?}");
    assert!(levels(&texture).iter().all(|db| db.abs() < 0.3), "{:?}", levels(&texture));
    // Longer than a tenth, or far away, it is one of its own.
    for way in [stay(60.0, 1.4, 1.0, &[-0.5], 3.0), stay(200.0, 1.4, 0.3, &[-0.5], 3.0)] {
        let (texture, report) = fitted(way);
        assert_eq!(texture.models().len(), 3, "{report:#?}");
        assert!(levels(&texture).iter().any(|db| *db > 15.0), "{:?}", levels(&texture));
    }
}
