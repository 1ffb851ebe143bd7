//! Networks that are not plain, or not exact enough, run all the same, and the report says how.

use super::networks::{Layer, Net, Random, Spelling, Writer, model, textures};
use super::{load, run};
use crate::onnx::ModelProto;
use crate::{Choice, Executor, Isa, Model, Precision, Runner};

/// Inputs joined and multiplied into 100 outputs; `finish` adds the rest.
fn one_layer(
    inputs: &[(&str, usize)],
    seed: u64,
    finish: impl FnOnce(&mut Writer, String) -> String,
) -> ModelProto {
    let mut w = Writer::new(Spelling::default());
    let names: Vec<&str> = inputs.iter().map(|(name, _)| *name).collect();
    let all = w.concat(&names);
    let len: usize = inputs.iter().map(|(_, len)| len).sum();
    let y = w.product(&all, &Random(seed).layer(len, 100, 0.1, 1.0));
    let y = finish(&mut w, y);
    w.finish(&y)
}

const ALL: [(&str, usize); 3] = [("force", 10), ("speed", 20), ("texture", 256)];

fn auto(model: &Model, precision: Precision) -> Runner {
    model.runner(&textures(1, 5), precision, Choice::Auto).unwrap()
}

#[test]
fn network_with_unknown_activation_runs_by_tract() {
    let model = load(&one_layer(&ALL, 1, |w, y| w.node("Softplus", &[&y], vec![]))).unwrap();
    assert!(model.not_lowered_because().unwrap().contains("Softplus"));
    let mut runner = auto(&model, Precision::F32);
    assert_eq!(runner.describe().executor, Executor::Tract);
    assert!(!runner.is_allocation_free());
    assert!(runner.describe().report.contains("Softplus"), "{}", runner.describe().report);
    let out = run(&mut runner, 0, &[1.0; 10], &[10.0; 20]);
    assert!(out.iter().all(|&x| x >= 0.0) && out.iter().any(|&x| x > 0.0));
    let e = model.runner(&textures(1, 2), Precision::F32, Choice::Packed(Isa::Portable)).unwrap_err();
    assert!(e.to_string().contains("Softplus"), "{e}");
}

/// Checks that a packed network answers like tract, and returns tract's answer over the first material.
fn agrees_with_tract(model: &Model) -> [f32; 100] {
    assert_eq!(model.not_lowered_because(), None);
    let textures = textures(5, 3);
    let mut tract = model.runner(&textures, Precision::F32, Choice::Tract).unwrap();
    let mut answers = (0..5).map(|m| run(&mut tract, m, &[0.5; 10], &[3.0; 20]));
    let answers: [[f32; 100]; 5] = std::array::from_fn(|_| answers.next().unwrap());
    for isa in Isa::available() {
        let mut packed = model.runner(&textures, Precision::F32, Choice::Packed(isa)).unwrap();
        for (m, a) in answers.iter().enumerate() {
            let b = run(&mut packed, m, &[0.5; 10], &[3.0; 20]);
            assert!(a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-4), "{isa:?} {m}\n{a:?}\n{b:?}");
        }
    }
    answers[0]
}

#[test]
fn residual_sums_and_final_operators_are_packed() {
    let layer = Random(8).layer(100, 100, 0.2, 0.5);
    let made = one_layer(&ALL, 2, |w, y| {
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
    let found = agrees_with_tract(&load(&made).unwrap());
    assert!(found.contains(&11.5) && found.iter().any(|&x| x < 11.5), "{found:?}");
}

#[test]
fn texture_encoder_in_model_is_folded_per_material() {
    let mut r = Random(9);
    let (encoder, head) = (r.layer(256, 32, 0.2, 0.2), r.layer(62, 100, 0.3, 0.2));
    let mut w = Writer::new(Spelling::default());
    let code = w.product("texture", &encoder);
    let code = w.node("Relu", &[&code], vec![]);
    let all = w.concat(&["force", &code, "speed"]);
    let y = w.product(&all, &head);
    let y = w.node("Relu", &[&y], vec![]);
    let model = load(&w.finish(&y)).unwrap();
    agrees_with_tract(&model);
    assert_eq!(auto(&model, Precision::F32).describe().multiply_adds, 30 * 100);
}

#[test]
fn a_head_that_nothing_reads_costs_nothing() {
    let (first, second) = (Random(13).layer(10, 70, 0.3, 0.2), Random(14).layer(70, 50, 0.3, 0.2));
    let made = one_layer(&ALL, 3, |w, y| {
        let head = w.product("force", &first);
        let head = w.node("Relu", &[&head], vec![]);
        let head = w.product(&head, &second);
        w.node("Relu", &[&head], vec![]);
        w.node("Relu", &[&y], vec![])
    });
    let model = load(&made).unwrap();
    agrees_with_tract(&model);
    for (precision, count) in [(Precision::F32, 30 * 100), (Precision::F64, 286 * 100)] {
        assert_eq!(auto(&model, precision).describe().multiply_adds, count);
    }
}

#[test]
fn cancelling_half_weights_fall_back_to_single_ones() {
    // Two large weights of nearly one size: f16 rounds away their difference.
    let model = load(&model(&cancelling([100.3, -100.2], 5.0), Spelling::default())).unwrap();
    let runner = auto(&model, Precision::F16);
    let info = runner.describe();
    assert!(matches!(info.executor, Executor::Packed { precision: Precision::F32, .. }), "{}", info.report);
    assert!(info.report.contains("f16 weights refused"), "{}", info.report);
}

#[test]
fn insufficient_int8_weights_become_f16_and_are_reported() {
    // What a column is made of differs by more than 8 bits can say, and cancels.
    let model = load(&model(&cancelling([10.3, -10.2], 0.3), Spelling::default())).unwrap();
    let runner = auto(&model, Precision::Int8);
    assert!(runner.describe().report.contains("int8 weights refused: "), "{}", runner.describe().report);
    assert!(runner.is_allocation_free());
}

/// A network where two equal values meet these weights in every column of the next layer.
fn cancelling(weights: [f32; 2], bias: f32) -> Net {
    let mut net = Net::random(10);
    for (row, weight) in net.predictor[2].weights.chunks_exact_mut(200).zip(weights) {
        row.fill(weight);
    }
    let Layer { weights, bias: biases } = &mut net.predictor[1];
    weights.chunks_exact_mut(300).for_each(|row| row[1] = row[0]);
    biases[..2].fill(bias);
    net
}

#[test]
fn folding_that_changes_the_result_falls_back_to_tract() {
    // (x - 3e7) / 1 in f32 loses most of x; folded into a bias it would not. tract's result counts.
    let mut net = Net::random(11);
    net.force_mean = vec![3e7; 10];
    net.force_deviation = vec![1.0; 10];
    net.force[0].bias.iter_mut().for_each(|b| *b += 3e7);
    for (i, w) in net.force[0].weights.iter_mut().enumerate() {
        *w = if i % 11 == 0 { 1.0 } else { 0.0 };
    }
    let runner = auto(&load(&model(&net, Spelling::default())).unwrap(), Precision::F32);
    let info = runner.describe();
    assert_eq!(info.executor, Executor::Tract, "{}", info.report);
    assert!(info.report.contains("differs from tract by"), "{}", info.report);
}

#[test]
fn a_model_deaf_to_motion_is_left_to_tract() {
    let model = load(&one_layer(&ALL[2..], 12, |_, y| y)).unwrap();
    let runner = auto(&model, Precision::F32);
    assert_eq!(runner.describe().executor, Executor::Tract);
    assert!(runner.describe().report.contains("does not depend on force or speed"));
}
