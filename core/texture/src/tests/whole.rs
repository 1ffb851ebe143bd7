//! Networks whose large layers are computed in whole numbers, where that is hard.

use super::networks::{Layer, Net, Random, Spelling, Writer, bytes, model, motions, textures};
use crate::{Choice, Model, Precision, Runner};

const INT8: Precision = Precision::Int8;

/// Layers of these widths without anything between them, so that what they hand on has both signs; the last
/// answers 100 numbers.
fn linear(widths: &[usize], seed: u64) -> Model {
    let mut w = Writer::new(Spelling::default());
    let mut r = Random(seed);
    let mut y = w.concat(&["force", "speed", "texture"]);
    let mut inputs = 286;
    for &outputs in widths.iter().chain(&[100]) {
        let limit = (3.0 / inputs as f64).sqrt();
        let layer = Layer { weights: r.vector(inputs * outputs, limit), bias: r.vector(outputs, 0.5) };
        y = w.product(&y, &layer);
        // Separates layers that would merge.
        let low = w.constant(&[], &[-1.0]);
        y = w.node("Max", &[&y, &low], vec![]);
        inputs = outputs;
    }
    Model::from_bytes(&bytes(&w.finish(&y)), "made.onnx").unwrap()
}

fn run(runner: &mut Runner, (force, speed): &(Vec<f32>, Vec<f32>)) -> [f32; 100] {
    let mut out = [7.0; 100];
    runner.run(0, force, speed, &mut out).unwrap();
    out
}

#[test]
fn many_inputs_of_both_signs_are_summed_right() {
    // 600 inputs at 127 and 32767 would overflow 32 bits; 598 are not a multiple of four.
    for widths in [&[598, 200][..], &[600, 600, 300]] {
        let model = linear(widths, 3);
        assert_eq!(model.not_lowered_because(), None);
        let textures = textures(2, 4);
        let mut double = model.runner(&textures, Precision::F64, Choice::Auto).unwrap();
        for isa in INT8.isas() {
            let mut packed = model.runner(&textures, INT8, Choice::Packed(isa)).unwrap();
            let info = packed.describe();
            assert!(info.weights_bytes < 2 * info.multiply_adds, "{} bytes", info.weights_bytes);
            let (mut worst, mut full_scale, mut negative) = (0f32, 0f32, false);
            for motion in motions(40, 8).iter().skip(2) {
                let (exact, found) = (run(&mut double, motion), run(&mut packed, motion));
                for (x, y) in exact.iter().zip(found) {
                    worst = worst.max((x - y).abs());
                    full_scale = full_scale.max(x.abs());
                    negative |= *x < 0.0;
                }
            }
            assert!(negative && worst < 1e-2 * full_scale, "{isa:?} {widths:?}: {worst} of {full_scale}");
        }
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    for model in [
        Model::from_bytes(&bytes(&model(&Net::random(5), Spelling::default())), "n").unwrap(),
        linear(&[598, 201], 9),
    ] {
        let textures = textures(1, 6);
        for precision in [Precision::F32, Precision::F16, INT8] {
            let make = |isa| model.runner(&textures, precision, Choice::Packed(isa)).unwrap();
            let mut runners: Vec<Runner> = precision.isas().into_iter().map(make).collect();
            for motion in motions(30, 2) {
                let found: Vec<[u32; 100]> =
                    runners.iter_mut().map(|r| run(r, &motion).map(f32::to_bits)).collect();
                assert!(found.windows(2).all(|pair| pair[0] == pair[1]), "{precision:?}");
            }
        }
    }
}

#[test]
fn non_finite_input_is_passed_on_and_the_next_run_is_right() {
    let model = linear(&[400, 200], 7);
    let textures = textures(1, 2);
    let motion = &motions(1, 5)[2];
    for isa in INT8.isas() {
        let mut packed = model.runner(&textures, INT8, Choice::Packed(isa)).unwrap();
        let before = run(&mut packed, motion);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let (mut force, speed) = motion.clone();
            force[3] = bad;
            let out = run(&mut packed, &(force, speed));
            assert!(out.iter().any(|x| !x.is_finite()), "{isa:?} {bad}");
        }
        assert_eq!(before.map(f32::to_bits), run(&mut packed, motion).map(f32::to_bits));
        // With all inputs zero the biases remain.
        let still = run(&mut packed, &(vec![0.0; 10], vec![0.0; 20]));
        assert!(still.iter().all(|x| x.is_finite()));
    }
}

#[test]
fn insufficient_int8_weights_become_f16_and_are_reported() {
    // What a column is made of differs by more than 8 bits can say, and cancels.
    let mut made = Net::random(10);
    for (k, row) in made.predictor[2].weights.chunks_exact_mut(200).enumerate().take(2) {
        row.fill([10.3, -10.2][k]);
    }
    for row in made.predictor[1].weights.chunks_exact_mut(300) {
        row[1] = row[0];
    }
    made.predictor[1].bias[..2].fill(0.3);
    let model = Model::from_bytes(&bytes(&model(&made, Spelling::default())), "made.onnx").unwrap();
    let runner = model.runner(&textures(1, 5), INT8, Choice::Auto).unwrap();
    assert!(runner.describe().report.contains("int8 weights refused: "), "{}", runner.describe().report);
    assert!(runner.is_allocation_free());
}

#[test]
fn small_f16_weights_count_while_denormals_are_flushed() {
    // Scaled to the largest of their column, these are subnormal halves.
    let mut made = Net::random(11);
    for (i, weight) in made.predictor[1].weights.iter_mut().enumerate() {
        *weight *= if i % 7 == 0 { 1.0 } else { 1e-6 };
    }
    let model = Model::from_bytes(&bytes(&model(&made, Spelling::default())), "n").unwrap();
    let motion = &motions(1, 5)[2];
    for isa in Precision::F16.isas() {
        let mut runner = model.runner(&textures(1, 2), Precision::F16, Choice::Packed(isa)).unwrap();
        let before = run(&mut runner, motion);
        let _flushed = asperity_numbers::denormals::Flushed::new();
        assert_eq!(before.map(f32::to_bits), run(&mut runner, motion).map(f32::to_bits), "{isa:?}");
    }
}
