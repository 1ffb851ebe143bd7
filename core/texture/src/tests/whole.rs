//! Networks whose large layers are computed in whole numbers, where that is hard.

use super::networks::{Net, Random, Spelling, Writer, model, motions, textures};
use super::{load, made, run};
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
        y = w.product(&y, &r.layer(inputs, outputs, (3.0 / inputs as f64).sqrt(), 0.5));
        // Separates layers that would merge.
        let low = w.constant(&[], &[-1.0]);
        y = w.node("Max", &[&y, &low], vec![]);
        inputs = outputs;
    }
    load(&w.finish(&y)).unwrap()
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
            for (force, speed) in motions(40, 8).iter().skip(2) {
                let found = run(&mut packed, 0, force, speed);
                for (x, y) in run(&mut double, 0, force, speed).iter().zip(found) {
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
    for model in [load(&made(5)).unwrap(), linear(&[598, 201], 9)] {
        let textures = textures(1, 6);
        for precision in [Precision::F32, Precision::F16, INT8] {
            let make = |isa| model.runner(&textures, precision, Choice::Packed(isa)).unwrap();
            let mut runners: Vec<Runner> = precision.isas().into_iter().map(make).collect();
            for (force, speed) in motions(30, 2) {
                let found: Vec<[u32; 100]> =
                    runners.iter_mut().map(|r| run(r, 0, &force, &speed).map(f32::to_bits)).collect();
                assert!(found.windows(2).all(|pair| pair[0] == pair[1]), "{precision:?}");
            }
        }
    }
}

#[test]
fn non_finite_input_is_passed_on_and_the_next_run_is_right() {
    let model = linear(&[400, 200], 7);
    let (force, speed) = &motions(1, 5)[2];
    for isa in INT8.isas() {
        let mut packed = model.runner(&textures(1, 2), INT8, Choice::Packed(isa)).unwrap();
        let before = run(&mut packed, 0, force, speed);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut force = force.clone();
            force[3] = bad;
            let out = run(&mut packed, 0, &force, speed);
            assert!(out.iter().any(|x| !x.is_finite()), "{isa:?} {bad}");
        }
        assert_eq!(before.map(f32::to_bits), run(&mut packed, 0, force, speed).map(f32::to_bits));
        // With all inputs zero the biases remain.
        assert!(run(&mut packed, 0, &[0.0; 10], &[0.0; 20]).iter().all(|x| x.is_finite()));
    }
}

#[test]
fn small_f16_weights_count_while_denormals_are_flushed() {
    // Scaled to the largest of their column, these are subnormal halves.
    let mut net = Net::random(11);
    for (i, weight) in net.predictor[1].weights.iter_mut().enumerate() {
        *weight *= if i % 7 == 0 { 1.0 } else { 1e-6 };
    }
    let model = load(&model(&net, Spelling::default())).unwrap();
    let (force, speed) = &motions(1, 5)[2];
    for isa in Precision::F16.isas() {
        let mut runner = model.runner(&textures(1, 2), Precision::F16, Choice::Packed(isa)).unwrap();
        let before = run(&mut runner, 0, force, speed);
        let _flushed = asperity_numbers::denormals::Flushed::new();
        assert_eq!(before.map(f32::to_bits), run(&mut runner, 0, force, speed).map(f32::to_bits), "{isa:?}");
    }
}
