//! Networks that are not plain, or not exact enough, run all the same, and the report says how.

use super::networks::{Layer, Net, Random, Spelling, Writer, bytes, model, textures};
use crate::onnx::ModelProto;
use crate::{Choice, Executor, Isa, Model, Precision, Runner};

fn load(model: &ModelProto) -> Model {
    Model::from_bytes(&bytes(model), "made.onnx").unwrap()
}

fn run(runner: &mut Runner, force: &[f32], speed: &[f32]) -> [f32; 100] {
    let mut out = [f32::NAN; 100];
    runner.run(0, force, speed, &mut out).unwrap();
    out
}

/// All inputs joined and multiplied into 100 outputs; `finish` adds the rest.
fn one_layer(seed: u64, finish: impl FnOnce(&mut Writer, String) -> String) -> ModelProto {
    let mut w = Writer::new(Spelling::default());
    let all = w.concat(&["force", "speed", "texture"]);
    let mut r = Random(seed);
    let layer = Layer { weights: r.vector(286 * 100, 0.1), bias: r.vector(100, 1.0) };
    let y = w.product(&all, &layer);
    let y = finish(&mut w, y);
    w.finish(&y)
}

#[test]
fn network_with_unknown_activation_runs_by_tract() {
    let made = one_layer(1, |w, y| w.node("Softplus", &[&y], vec![]));
    let model = load(&made);
    assert!(model.not_lowered_because().unwrap().contains("Softplus"));
    let mut runner = model.runner(&textures(1, 2), Precision::F32, Choice::Auto).unwrap();
    assert_eq!(runner.describe().executor, Executor::Tract);
    assert!(!runner.is_allocation_free());
    assert!(runner.describe().report.contains("Softplus"), "{}", runner.describe().report);
    let out = run(&mut runner, &[1.0; 10], &[10.0; 20]);
    assert!(out.iter().all(|&x| x >= 0.0) && out.iter().any(|&x| x > 0.0));
    let e = model.runner(&textures(1, 2), Precision::F32, Choice::Packed(Isa::Portable)).unwrap_err();
    assert!(e.to_string().contains("Softplus"), "{e}");
}

#[test]
fn residual_sums_and_final_operators_are_packed() {
    let mut r = Random(8);
    let layer = Layer { weights: r.vector(100 * 100, 0.2), bias: r.vector(100, 0.5) };
    let made = one_layer(2, |w, y| {
        let a = w.node("Relu", &[&y], vec![]);
        let b = w.product(&a, &layer);
        let sum = w.node("Add", &[&b, &a], vec![]);
        let low = w.constant(&[1], &[0.125]);
        let floored = w.node("Max", &[&sum, &low], vec![]);
        let scale = w.constant(&[1, 100], &(0..100).map(|i| -0.5 - i as f32 * 0.01).collect::<Vec<_>>());
        let scaled = w.node("Mul", &[&floored, &scale], vec![]);
        let ten = w.constant(&[], &[10.0]);
        let turned = w.node("Sub", &[&ten, &scaled], vec![]);
        let high = w.constant(&[], &[11.5]);
        w.node("Min", &[&turned, &high], vec![])
    });
    let model = load(&made);
    assert_eq!(model.not_lowered_because(), None);
    let textures = textures(1, 3);
    let mut tract = model.runner(&textures, Precision::F32, Choice::Tract).unwrap();
    for isa in Isa::available() {
        let mut packed = model.runner(&textures, Precision::F32, Choice::Packed(isa)).unwrap();
        let (a, b) = (run(&mut tract, &[1.0; 10], &[10.0; 20]), run(&mut packed, &[1.0; 10], &[10.0; 20]));
        assert!(a.contains(&11.5) && a.iter().any(|&x| x < 11.5), "{a:?}");
        assert!(a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-4), "{isa:?}\n{a:?}\n{b:?}");
    }
}

#[test]
fn texture_encoder_in_model_is_folded_per_material() {
    let mut r = Random(9);
    let encoder = Layer { weights: r.vector(256 * 32, 0.2), bias: r.vector(32, 0.2) };
    let head = Layer { weights: r.vector(62 * 100, 0.3), bias: r.vector(100, 0.2) };
    let mut w = Writer::new(Spelling::default());
    let code = w.product("texture", &encoder);
    let code = w.node("Relu", &[&code], vec![]);
    let all = w.concat(&["force", &code, "speed"]);
    let y = w.product(&all, &head);
    let y = w.node("Relu", &[&y], vec![]);
    let model = load(&w.finish(&y));
    let textures = textures(5, 4);
    let mut packed = model.runner(&textures, Precision::F32, Choice::Auto).unwrap();
    assert_eq!(packed.describe().multiply_adds, 30 * 100, "{}", packed.describe().report);
    let mut tract = model.runner(&textures, Precision::F32, Choice::Tract).unwrap();
    for m in 0..5 {
        let (mut a, mut b) = ([0.0; 100], [1.0; 100]);
        tract.run(m, &[0.5; 10], &[3.0; 20], &mut a).unwrap();
        packed.run(m, &[0.5; 10], &[3.0; 20], &mut b).unwrap();
        assert!(a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-4), "material {m}");
    }
}

#[test]
fn cancelling_half_weights_fall_back_to_single_ones() {
    // Two large weights of nearly one size: f16 rounds away their difference.
    let mut made = Net::random(10);
    let after = &mut made.predictor[2];
    for j in 0..200 {
        after.weights[j] = 100.3;
        after.weights[200 + j] = -100.2;
    }
    let before = &mut made.predictor[1];
    for row in before.weights.chunks_exact_mut(300) {
        row[1] = row[0];
    }
    before.bias[..2].fill(5.0);
    let model = load(&model(&made, Spelling::default()));
    let runner = model.runner(&textures(1, 5), Precision::F16, Choice::Auto).unwrap();
    let info = runner.describe();
    assert!(matches!(info.executor, Executor::Packed { precision: Precision::F32, .. }), "{}", info.report);
    assert!(info.report.contains("f16 weights refused"), "{}", info.report);
}

#[test]
fn folding_that_changes_the_result_falls_back_to_tract() {
    // (x - 3e7) / 1 in f32 loses most of x; folded into a bias it would not. tract's result counts.
    let mut made = Net::random(11);
    made.force_mean = vec![3e7; 10];
    made.force_deviation = vec![1.0; 10];
    made.force[0].bias = made.force[0].bias.iter().map(|b| b + 3e7).collect();
    for (i, w) in made.force[0].weights.iter_mut().enumerate() {
        *w = if i % 11 == 0 { 1.0 } else { 0.0 };
    }
    let model = load(&model(&made, Spelling::default()));
    let runner = model.runner(&textures(1, 5), Precision::F32, Choice::Auto).unwrap();
    let info = runner.describe();
    assert_eq!(info.executor, Executor::Tract, "{}", info.report);
    assert!(info.report.contains("differs from tract by"), "{}", info.report);
}

#[test]
fn a_model_deaf_to_motion_is_left_to_tract() {
    let mut w = Writer::new(Spelling::default());
    let mut r = Random(12);
    let layer = Layer { weights: r.vector(256 * 100, 0.1), bias: r.vector(100, 1.0) };
    let y = w.product("texture", &layer);
    let model = load(&w.finish(&y));
    let runner = model.runner(&textures(1, 5), Precision::F32, Choice::Auto).unwrap();
    assert_eq!(runner.describe().executor, Executor::Tract);
    assert!(runner.describe().report.contains("does not depend on force or speed"));
}
