//! Encoders from ONNX files: what they answer, and files that are none.

use super::networks::{Random, bytes, encoder, node, value_info};
use super::{SHIPPED, load, made};
use crate::onnx::{GraphProto, ModelProto, StringStringEntryProto};
use crate::picture::{IMAGE, Image};
use crate::{Encoder, Model, Target};
use asperity_diagnostics::Diagnostic;

fn image(seed: u64) -> Image {
    let mut r = Random(seed);
    // Each colour and each part has its own mean, so that none is mistaken for another.
    let pixels = (0..IMAGE[0] * IMAGE[1] * 3)
        .map(|i| (60.0 * r.unit() + 60.0 * ((i % 3) as f64) + 60.0 * (i as f64 / 147_456.0)) as u8)
        .collect();
    Image { size: IMAGE, pixels }
}

fn loaded(model: &ModelProto) -> Result<Encoder, Diagnostic> {
    Encoder::from_bytes(&bytes(model), "some/where.onnx")
}

fn error(change: impl FnOnce(&mut GraphProto)) -> String {
    let mut m = encoder(&[0.1; 3 * 12 * 16], 0.0);
    change(m.graph.as_mut().unwrap());
    loaded(&m).unwrap_err().to_string()
}

#[test]
fn encoder_input_is_red_green_blue_from_0_to_1_by_rows() {
    let weights = Random(3).vector(3 * 12 * 16, 1.0);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("e.onnx");
    std::fs::write(&path, bytes(&encoder(&weights, 0.25))).unwrap();
    let encoder = Encoder::load(&path).unwrap();
    for seed in [1, 2] {
        let image = image(seed);
        let found = encoder.encode(&image).unwrap();
        // By hand: means over tiles of 16 x 16, weighted and summed, plus n / 4 in number n.
        let mut sum = 0.0;
        for row in 0..IMAGE[0] {
            for column in 0..IMAGE[1] {
                for channel in 0..3 {
                    let x = f64::from(image.pixels[3 * (row * IMAGE[1] + column) + channel]) / 255.0;
                    let weight = weights[channel * 192 + (row / 16) * 16 + column / 16];
                    sum += x / 256.0 * f64::from(weight);
                }
            }
        }
        for (n, x) in found.iter().enumerate() {
            let want = sum * (1.0 + n as f64 / 256.0) + 0.25 * n as f64;
            assert!((f64::from(*x) - want).abs() < 1e-3, "{n}: {x} {want}");
        }
    }
}

#[test]
fn non_finite_answer_is_an_error() {
    let big = loaded(&encoder(&[1e38; 576], 0.0)).unwrap();
    let black = Image { size: IMAGE, pixels: vec![0; 147_456] };
    assert!(big.encode(&black).unwrap().iter().all(|x| *x == 0.0));
    let e = big.encode(&image(1)).unwrap_err().to_string();
    assert!(e.starts_with("some/where.onnx: number 0 of the encoder's output is not finite"), "{e}");
}

#[test]
fn an_image_of_another_size_is_refused() {
    let encoder = loaded(&encoder(&[1.0; 576], 0.0)).unwrap();
    for (size, n) in [([192, 256], 147_455), ([256, 192], 147_456), ([0, 0], 0)] {
        let e = encoder.encode(&Image { size, pixels: vec![0; n] }).unwrap_err().to_string();
        assert!(e.contains("192 rows of 256"), "{e}");
    }
}

#[test]
fn non_encoder_files_are_refused_with_their_contents() {
    type Change = fn(&mut GraphProto);
    let cases: [(Change, &str); 6] = [
        (|g| *g = made(1).graph.unwrap(), "3 inputs, not 1; found inputs: force [1,10]"),
        (
            |g| g.input[0] = value_info("image", &[Some(1), Some(3), Some(256), Some(192)]),
            "the input does not fit; found inputs: image [1,3,256,192]",
        ),
        (
            |g| g.input[0].r#type.as_mut().unwrap().tensor_type.as_mut().unwrap().elem_type = 2,
            "the input does not fit",
        ),
        (|g| g.output[0] = value_info("texture", &[None, Some(255)]), "the output does not fit"),
        (|g| g.initializer[0].raw_data[..4].copy_from_slice(&f32::NAN.to_le_bytes()), "not finite"),
        // An open shape is checked by its result.
        (
            |g| {
                g.output[0] = value_info("tiles", &[None, None]);
                let input = g.node[1].output[0].clone();
                g.node.push(node("Identity", &[&input], "tiles", vec![]));
            },
            "answers 576 numbers, not 256",
        ),
    ];
    for (change, text) in cases {
        let e = error(change);
        assert!(e.contains(text), "{e}");
    }
    let e = load(&encoder(&[1.0; 576], 0.0)).unwrap_err().to_string();
    assert!(e.contains("1 inputs, not 3"), "{e}");
    let whole = bytes(&encoder(&[1.0; 576], 0.0));
    for part in 0..20 {
        assert!(Encoder::from_bytes(&whole[..whole.len() * part / 20], "cut.onnx").is_err(), "{part}");
    }
    let missing = Encoder::load("no/such.onnx").unwrap_err().to_string();
    assert!(missing.starts_with("no/such.onnx: cannot read this file"), "{missing}");
}

#[test]
fn a_free_batch_size_and_other_names_and_outputs_are_taken() {
    let mut m = encoder(&[1.0; 576], 0.0);
    let graph = m.graph.as_mut().unwrap();
    graph.input[0] = value_info("image", &[None, Some(3), Some(192), Some(256)]);
    graph.output.insert(0, value_info("unused", &[None, Some(576)]));
    graph.node[1].output[0] = "unused".into();
    graph.node[2].input[0] = "unused".into();
    let encoder = loaded(&m).unwrap();
    let white = Image { size: IMAGE, pixels: vec![255; 147_456] };
    assert!((encoder.encode(&white).unwrap()[0] - 576.0).abs() < 1e-2);
}

/// A network whose file states these facts.
fn stating(pairs: &[(&str, &str)]) -> Result<Model, Diagnostic> {
    let mut m = made(1);
    let entry = |(k, v): &(&str, &str)| StringStringEntryProto { key: (*k).into(), value: (*v).into() };
    m.metadata_props = pairs.iter().map(entry).collect();
    load(&m)
}

#[test]
fn target_is_read_from_the_file_and_another_is_refused() {
    let with = |pairs: &[(&str, &str)]| stating(pairs).map(|m| m.target());
    assert_eq!(with(&[]).unwrap(), Target::RootMeanSquare);
    assert_eq!(with(&[("target", "rms")]).unwrap(), Target::RootMeanSquare);
    assert_eq!(with(&[("target", "mean")]).unwrap(), Target::Mean);
    let e = with(&[("target", "median")]).unwrap_err().to_string();
    assert!(
        e.contains("where.onnx: this model's `target` is \"median\"") && e.contains("rms or mean"),
        "{e}"
    );
}

#[test]
fn shipped_networks_say_what_their_magnitudes_are() {
    for (file, target) in [("texture.onnx", Target::RootMeanSquare), ("texture_mean.onnx", Target::Mean)] {
        assert_eq!(Model::load(format!("{SHIPPED}{file}")).unwrap().target(), target, "{file}");
    }
}

#[test]
fn trained_range_is_read_from_the_file_or_refused() {
    let with = |pairs: &[(&str, &str)]| {
        stating(pairs).map(|m| (m.trained().force_max_n, m.trained().speed_max_mm_s))
    };
    assert_eq!(with(&[]).unwrap(), (None, None));
    assert_eq!(with(&[("x", "1"), ("force_max_n", "3.3")]).unwrap(), (Some(3.3), None));
    assert_eq!(
        with(&[("speed_max_mm_s", "300"), ("force_max_n", "1e1")]).unwrap(),
        (Some(10.0), Some(300.0))
    );
    for bad in ["", "0", "-1", "NaN", "inf", "3,5", "1e300"] {
        let e = with(&[("force_max_n", bad)]).unwrap_err().to_string();
        assert!(e.contains(&format!("where.onnx: this model's `force_max_n` is \"{bad}\"")), "{e}");
    }
}
