//! Packed kernels against tract and against a plain f64 evaluation, for every spelling and instruction set.

use super::networks::{Net, Product, Spelling, heads, model, motions, scattering, textures};
use super::{SHIPPED, load, made};
use crate::onnx::StringStringEntryProto;
use crate::{Answer, Choice, Executor, Isa, Library, Model, NOISE_RATIO, Precision};
use std::ops::Range;

/// Packed precisions and the range of their errors: rounding is not free.
const PACKED: [(Precision, Range<f64>); 3] =
    [(Precision::F32, 0.0..1e-5), (Precision::F16, 1e-6..5e-4), (Precision::Int8, 1e-4..1e-2)];

type Way = (Precision, Choice);

/// All ways to run a network with their errors.
fn ways() -> Vec<(Way, Range<f64>)> {
    let mut ways = vec![
        ((Precision::F32, Choice::Tract), 0.0..1e-5),
        // The rounding of magnitudes to f32 remains.
        ((Precision::F64, Choice::Auto), 0.0..6e-8),
    ];
    for (precision, within) in PACKED {
        let packed = |isa| ((precision, Choice::Packed(isa)), within.clone());
        ways.extend(precision.isas().into_iter().map(packed));
    }
    ways
}

fn spellings() -> Vec<Spelling> {
    let d = Spelling::default();
    vec![
        d,
        Spelling { product: Product::Gemm, concat_axis: -1, ..d },
        Spelling { product: Product::MatMulAdd, typed_data: true, ..d },
        Spelling { constant_nodes: true, multiply: true, ..d },
        Spelling { no_ops: true, free_batch: true, clip: true, ..d },
        Spelling { other_names: true, clip: true, opset: 10, ..d },
    ]
}

/// Answers to ordinary and large motions over three textures.
fn answers(model: &Model, (precision, choice): Way, mut each: impl FnMut(&Answer, [&[f32]; 3])) {
    let textures = textures(3, 5);
    let mut runner = model.runner(&textures, precision, choice).unwrap();
    for (force, speed) in motions(20, 6).iter().filter(|(f, _)| f[0] < 10.0) {
        for (m, texture) in textures.iter().enumerate() {
            let mut answer = Answer { magnitudes: [f32::NAN; 100], ..Answer::default() };
            runner.answer(m, force, speed, &mut answer).unwrap();
            assert_eq!(super::run(&mut runner, m, force, speed), answer.magnitudes);
            each(&answer, [force, speed, texture]);
        }
    }
}

/// Largest difference from exact values, and the largest of these.
#[derive(Default)]
struct Worst(f64, f64);

impl Worst {
    fn take(&mut self, found: &[f32], exact: &[f64]) {
        for (y, exact) in found.iter().zip(exact) {
            *self = Worst(self.0.max((f64::from(*y) - exact).abs()), self.1.max(*exact));
        }
    }

    fn part(&self) -> f64 {
        assert!(self.1 > 0.01, "a network that gives nothing tests nothing");
        self.0 / self.1
    }
}

/// Largest difference from the f64 evaluation as a share of its largest value.
fn error_vs_f64(net: &Net, model: &Model, way: Way) -> f64 {
    let mut worst = Worst::default();
    answers(model, way, |answer, [f, s, t]| worst.take(&answer.magnitudes, &net.evaluate(f, s, t)));
    worst.part()
}

#[test]
fn every_spelling_of_the_network_is_packed_and_right() {
    let net = Net::random(1);
    for spelling in spellings() {
        let model = load(&model(&net, spelling)).unwrap();
        assert_eq!(model.not_lowered_because(), None, "{spelling:?}");
        for (precision, most) in [(Precision::F32, 1e-5), (Precision::F64, 6e-8)] {
            let runner = model.runner(&textures(2, 3), precision, Choice::Auto).unwrap();
            let info = runner.describe();
            assert!(runner.is_allocation_free(), "{spelling:?}: {}", info.report);
            assert_eq!(info.executor == Executor::Double, precision == Precision::F64);
            let error = error_vs_f64(&net, &model, (precision, Choice::Auto));
            assert!(error < most, "{spelling:?} {precision:?}: {error}");
        }
    }
    let model = load(&made(2)).unwrap();
    let refused = model.runner(&textures(1, 1), Precision::F64, Choice::Packed(Isa::Portable)).unwrap_err();
    assert!(refused.to_string().contains("f64 has no packed kernels"), "{refused}");
}

#[test]
fn every_instruction_set_agrees_with_f64_in_every_precision() {
    let net = Net::random(2);
    let model = load(&made(2)).unwrap();
    for (way, within) in ways() {
        let error = error_vs_f64(&net, &model, way);
        assert!(within.contains(&error), "{way:?}: {error}");
    }
}

#[test]
fn exponentials_are_packed_and_right_in_every_precision() {
    let mut net = Net::random(4);
    net.output_scale = (0..100).map(|i| 0.04 * (i as f32 - 70.0)).collect();
    let mut file = model(&net, Spelling::default());
    file.graph.as_mut().unwrap().node.last_mut().unwrap().op_type = "Exp".into();
    for (key, value) in [("force_max_n", "3.5"), ("speed_max_mm_s", "300")] {
        file.metadata_props.push(StringStringEntryProto { key: key.into(), value: value.into() });
    }
    let model = load(&file).unwrap();
    for (way, _) in ways().into_iter().filter(|(way, _)| way.1 != Choice::Tract) {
        let runner = model.runner(&textures(2, 5), way.0, way.1).unwrap();
        assert_ne!(runner.describe().executor, Executor::Tract, "{way:?}");
        let (mut worst, mut range) = (0f64, [f64::MAX, 0.0]);
        answers(&model, way, |answer, [f, s, t]| {
            for (y, log) in answer.magnitudes.iter().zip(net.evaluate(f, s, t)) {
                worst = worst.max((f64::from(*y) / log.exp() - 1.0).abs());
                range = [range[0].min(log.exp()), range[1].max(log.exp())];
            }
        });
        assert!(range[0] < 1e-2 && range[1] > 2.0, "{range:?}");
        let most = match way.0 {
            Precision::F32 => 3e-5,
            Precision::F16 => 5e-3,
            Precision::Int8 => 5e-2,
            Precision::F64 => 1e-6,
        };
        assert!(worst < most, "{way:?}: {worst}");
    }
}

/// Largest errors of ratio and variance as parts of their largest values.
fn scatter_errors(seed: u64, heads_seed: u64, spelling: Spelling, way: Way) -> [f64; 2] {
    let (net, heads) = (Net::random(seed), heads(heads_seed));
    let model = load(&scattering(&net, spelling, &heads)).unwrap();
    assert!(model.answers_scatter() && model.not_lowered_because().is_none(), "{spelling:?}");
    // The same network with a head in place of its last layer.
    let exact = heads.map(|(_, head)| {
        let mut net = Net { output_scale: vec![1.0; 100], ..net.clone() };
        *net.predictor.last_mut().unwrap() = head;
        net
    });
    let mut worst = [Worst::default(), Worst::default()];
    answers(&model, way, |answer, [f, s, t]| {
        let ratio: Vec<f64> = exact[0].evaluate(f, s, t).iter().map(|x| x.min(1.0)).collect();
        worst[0].take(&answer.ratio, &ratio);
        worst[1].take(&[answer.variance], &exact[1].evaluate(f, s, t));
    });
    worst.map(|worst| worst.part())
}

#[test]
fn scatter_agrees_with_f64_in_every_precision() {
    for (way, within) in ways() {
        let errors = scatter_errors(2, 8, Spelling::default(), way);
        assert!(errors.iter().all(|e| *e < within.end.max(1e-6)), "{way:?}: {errors:?}");
    }
}

#[test]
fn scatter_is_found_by_name_in_every_spelling() {
    for spelling in spellings() {
        let errors = scatter_errors(1, 3, spelling, (Precision::F32, Choice::Auto));
        assert!(errors.iter().all(|e| *e < 1e-5), "{spelling:?}: {errors:?}");
    }
}

#[test]
fn model_without_scatter_answers_noise() {
    let model = load(&made(1)).unwrap();
    assert!(!model.answers_scatter());
    for choice in [Choice::Auto, Choice::Tract] {
        let mut runner = model.runner(&textures(1, 1), Precision::F32, choice).unwrap();
        let mut answer = Answer { ratio: [0.0; 100], variance: 7.0, ..Answer::default() };
        runner.answer(0, &[1.0; 10], &[50.0; 20], &mut answer).unwrap();
        assert!(!runner.answers_scatter() && answer.magnitudes.iter().any(|m| *m > 0.0));
        assert_eq!((answer.ratio, answer.variance), ([NOISE_RATIO; 100], 0.0));
    }
}

#[test]
fn scatter_stays_in_its_range_whatever_comes_in() {
    let mut heads = heads(4);
    heads[0].1.weights.iter_mut().for_each(|w| *w *= 1e3);
    let model = load(&scattering(&Net::random(1), Spelling::default(), &heads)).unwrap();
    for choice in [Choice::Auto, Choice::Tract] {
        let mut runner = model.runner(&textures(1, 1), Precision::F32, choice).unwrap();
        assert!(runner.answers_scatter());
        let mut answer = Answer::default();
        for force in [1.0, f32::NAN, f32::INFINITY, f32::MAX] {
            runner.answer(0, &[force; 10], &[50.0; 20], &mut answer).unwrap();
            assert!(answer.ratio.iter().all(|r| (0.0..=1.0).contains(r)), "{force}: {:?}", answer.ratio);
            assert!((0.0..=f32::MAX).contains(&answer.variance), "{force}: {}", answer.variance);
        }
        runner.answer(0, &[1.0; 10], &[50.0; 20], &mut answer).unwrap();
        assert!(answer.ratio.contains(&0.0) && answer.ratio.contains(&1.0));
        let before = answer.clone();
        assert!(runner.answer(1, &[1.0; 10], &[50.0; 20], &mut answer).is_err());
        assert!(runner.answer(0, &[1.0; 9], &[50.0; 20], &mut answer).is_err());
        assert_eq!(answer, before);
    }
}

#[test]
fn the_texture_part_is_folded_away() {
    let model = load(&made(1)).unwrap();
    let best = Isa::best();
    let info = |precision: Precision, choice| {
        model.runner(&textures(1, 1), precision, choice).unwrap().describe().clone()
    };
    let single = info(Precision::F32, Choice::Auto);
    // 496,500 in all; 256 x 300 of them belong to the texture.
    assert_eq!(single.multiply_adds, 496_500 - 256 * 300);
    let least = 4 * single.multiply_adds;
    assert!((least..least + least / 20).contains(&single.weights_bytes), "{} bytes", single.weights_bytes);
    assert_eq!(single.executor, Executor::Packed { isa: best, precision: Precision::F32 });
    assert!(single.max_error_vs_tract.unwrap() < 1e-5, "{}", single.report);
    // Half the bytes, or a quarter, except for the smallest layers.
    let half = info(Precision::F16, Choice::Packed(best));
    let quarter = info(Precision::Int8, Choice::Packed(Precision::Int8.isas()[0]));
    for (bytes, most) in [(2 * half.weights_bytes, 106), (4 * quarter.weights_bytes, 118)] {
        assert!((single.weights_bytes + 1..single.weights_bytes * most / 100).contains(&bytes), "{bytes}");
    }
    assert_eq!(half.executor, Executor::Packed { isa: best, precision: Precision::F16 });
    assert!((1e-6..1e-3).contains(&half.max_error_vs_tract.unwrap()), "{}", half.report);
}

#[test]
fn weights_are_read_whole() {
    let sum = |seed, choice| {
        let model = load(&made(seed)).unwrap();
        model.runner(&textures(1, 1), Precision::F32, choice).unwrap().read_weights()
    };
    let first = sum(6, Choice::Auto);
    assert!(first.is_some_and(|sum| sum != 0));
    assert_eq!(first, sum(6, Choice::Packed(Isa::best())));
    assert_ne!(first, sum(7, Choice::Auto));
    assert_eq!(sum(6, Choice::Tract), None);
}

#[test]
fn the_shipped_model_runs_in_every_precision() {
    let model = Model::load(format!("{SHIPPED}texture.onnx")).unwrap();
    assert_eq!(model.not_lowered_because(), None);
    let library = Library::read(format!("{SHIPPED}materials.ron")).unwrap();
    let vectors: Vec<_> = library.materials().iter().map(|m| m.vector.as_slice()).collect();
    assert!(vectors.len() >= 8);
    for ((precision, choice), within) in ways().into_iter().skip(1) {
        let info = model.runner(&vectors, precision, choice).unwrap().describe().clone();
        // An exponential turns an error of the logarithm into a relative one.
        let most = match precision {
            Precision::F64 => 1e-5,
            Precision::Int8 => 5e-2,
            _ => within.end.max(1e-4),
        };
        assert!(info.max_error_vs_tract.unwrap() < most, "{}", info.report);
        if let Choice::Packed(isa) = choice {
            assert_eq!(info.executor, Executor::Packed { isa, precision });
            assert_eq!(info.multiply_adds, 446_000, "{}", info.report);
        } else {
            assert_eq!(info.executor, Executor::Double);
        }
    }
}
