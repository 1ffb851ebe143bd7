//! Statistics of an encoder: distances, and files that are none.

use super::networks::{bytes, encoder};
use crate::Encoder;
use crate::picture::{IMAGE, Image};
use crate::statistics::{Layer, PICTURE, Statistics, features};
use asperity_diagnostics::{Source, fnv};

/// A layer with two features, variances 4 and 1 along the first and in all other directions.
fn layer() -> Layer {
    Layer {
        name: "tiles".into(),
        limit: 3.0,
        mean: vec![1.0, 2.0],
        deviation: vec![0.5, 2.0],
        rest: 1.0,
        axes: vec![(4.0, vec![1.0, 0.0])],
        centres: vec![vec![0.0, 0.0], vec![10.0, 0.0]],
    }
}

/// Of the picture, wide enough for any.
fn of_picture() -> Layer {
    let [mean, deviation] = [0.0, 100.0].map(|x| vec![x; 21]);
    let centres = vec![vec![0.0; 21]];
    Layer { name: PICTURE.into(), limit: 30.0, mean, deviation, rest: 1.0, axes: Vec::new(), centres }
}

#[test]
fn distance_is_mahalanobis_from_the_nearest_centre() {
    let distance = |x: [f64; 2]| layer().distance(&x);
    assert_eq!(distance([1.0, 2.0]), 0.0);
    // Scaled, (4, 3): 16 / 4 + 9.
    assert!((distance([3.0, 8.0]) - 13.0_f64.sqrt()).abs() < 1e-12);
    // Scaled, (9, 0): 1 from the second centre.
    assert!((distance([5.5, 2.0]) - 0.5).abs() < 1e-12);
}

#[test]
fn features_are_means_then_deviations_of_channels() {
    assert_eq!(features(&[1.0, 3.0, 5.0, 5.0], 2), Some(vec![2.0, 5.0, 1.0, 0.0]));
    assert_eq!(features(&[1.0; 4], 3), None);
    assert_eq!(features(&[], 0), None);
}

#[test]
fn statistics_read_back_and_judge_by_the_worst_layer() {
    let known = Statistics { encoder: fnv(b"encoder"), layers: vec![of_picture(), layer()] };
    let read = Statistics::parse(&Source::new("e.ron", known.to_ron()), b"encoder").unwrap();
    assert_eq!(read, known);
    let found = read.strangeness(&[vec![0.0; 21], vec![3.0, 8.0]]).unwrap();
    assert!(found.layer == "tiles" && found.limit == 3.0 && found.is_unlike(), "{found:?}");
    let found = read.strangeness(&[vec![f64::NAN; 21], vec![1.0, 2.0]]).unwrap();
    assert!(found.layer == PICTURE && found.is_unlike(), "{found:?}");
}

#[test]
fn bad_statistics_are_refused_where_they_are_bad() {
    let text = Statistics { encoder: fnv(b"encoder"), layers: vec![of_picture(), layer()] }.to_ron();
    let error = |text: &str, bytes: &[u8]| {
        Statistics::parse(&Source::new("e.ron", text), bytes).unwrap_err().to_string()
    };
    assert!(error(&text, b"another").starts_with("e.ron:4:14: these are statistics of another encoder"));
    for (from, to, what) in [
        ("\"picture\"", "\"colour\"", "the first layer is not `picture`"),
        ("limit: 3.0000e0", "limit: 0", "out of range"),
        ("rest: 1.0000e0", "rest: -1", "out of range"),
        ("deviation: [5.0000e-1, ", "deviation: [0.0, ", "out of range"),
        ("mean: [1.0000e0, 2.0000e0]", "mean: [1, 2, 3]", "a list of 3"),
        ("mean: [1.0000e0, 2.0000e0]", "mean: []", "a list of 0"),
        ("axis: [1.0000e0, 0.0000e0]", "axis: [1]", "a list of 1"),
        ("version: 1", "version: 2", "out of range"),
        ("rest:", "remainder:", "rest"),
    ] {
        assert!(text.contains(from), "{from} in {text}");
        let e = error(&text.replace(from, to), b"encoder");
        assert!(e.starts_with("e.ron:") && e.contains(what), "{e}");
    }
}

#[test]
fn encoder_finds_its_statistics_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("e.onnx");
    let model = encoder(&[0.1; 576], 0.0);
    let bytes = bytes(&model);
    std::fs::write(&path, &bytes).unwrap();
    let image = Image { size: IMAGE, pixels: vec![100; 147_456] };
    let plain = Encoder::load(&path).unwrap().look(&image).unwrap();
    assert_eq!(plain.strangeness, None);
    let tiles = model.graph.unwrap().node[0].output[0].clone();
    let three = |x: f64| vec![x; 6];
    let layer = |name: String| Layer {
        name,
        mean: three(0.0),
        deviation: three(1.0),
        axes: Vec::new(),
        centres: vec![three(0.0)],
        ..layer()
    };
    let write = |name: String| {
        let known = Statistics { encoder: fnv(&bytes), layers: vec![of_picture(), layer(name)] };
        std::fs::write(Statistics::beside(&path), known.to_ron()).unwrap();
        Encoder::load(&path)
    };
    let found = write(tiles).unwrap().look(&image).unwrap();
    assert_eq!(found.vector, plain.vector);
    // Three channels of the mean 100 / 255 without deviation.
    assert!((found.features[1][2] - 100.0 / 255.0).abs() < 1e-4 && found.features[1][3] < 1e-4);
    assert!(!found.strangeness.unwrap().is_unlike());
    let e = write("nowhere".into()).unwrap_err().to_string();
    assert!(e.contains("nothing gives the output \"nowhere\""), "{e}");
}
