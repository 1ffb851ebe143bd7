//! Packed kernels against tract and against a plain f64 evaluation, for every spelling and instruction set.

use super::networks::{Layer, Net, Product, Spelling, bytes, heads, model, motions, scattering, textures};
use crate::onnx::StringStringEntryProto;
use crate::{Answer, Choice, Executor, Isa, Model, NOISE_RATIO, Precision};

fn load(net: &Net, spelling: Spelling) -> Model {
    Model::from_bytes(&bytes(&model(net, spelling)), "made.onnx").unwrap()
}

/// Largest difference from the f64 evaluation as a share of its largest value, over ordinary and large
/// motions.
fn error_vs_f64(net: &Net, model: &Model, precision: Precision, choice: Choice) -> f64 {
    let textures = textures(3, 5);
    let mut runner = model.runner(&textures, precision, choice).unwrap();
    let (mut worst, mut full_scale) = (0f64, 0f64);
    for (force, speed) in motions(20, 6).into_iter().filter(|(f, _)| f[0] < 10.0) {
        for (m, texture) in textures.iter().enumerate() {
            let mut out = [f32::NAN; 100];
            runner.run(m, &force, &speed, &mut out).unwrap();
            for (&y, exact) in out.iter().zip(net.evaluate(&force, &speed, texture)) {
                worst = worst.max((f64::from(y) - exact).abs());
                full_scale = full_scale.max(exact);
            }
        }
    }
    assert!(full_scale > 0.01, "a network that gives nothing tests nothing");
    worst / full_scale
}

/// Packed precisions and the range of their errors: rounding is not free.
const PACKED: [(Precision, std::ops::Range<f64>); 3] =
    [(Precision::F32, 0.0..1e-5), (Precision::F16, 1e-6..5e-4), (Precision::Int8, 1e-4..1e-2)];

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

#[test]
fn every_spelling_of_the_network_is_packed_and_right() {
    let net = Net::random(1);
    for spelling in spellings() {
        let model = load(&net, spelling);
        assert_eq!(model.not_lowered_because(), None, "{spelling:?}");
        let runner = model.runner(&textures(2, 3), Precision::F32, Choice::Auto).unwrap();
        assert!(runner.is_allocation_free(), "{spelling:?}: {}", runner.describe().report);
        let error = error_vs_f64(&net, &model, Precision::F32, Choice::Auto);
        assert!(error < 1e-5, "{spelling:?}: {error}");
    }
}

#[test]
fn every_instruction_set_agrees_with_f64_in_every_precision() {
    let net = Net::random(2);
    let model = load(&net, Spelling::default());
    for (precision, within) in PACKED {
        for isa in precision.isas() {
            let error = error_vs_f64(&net, &model, precision, Choice::Packed(isa));
            assert!(within.contains(&error), "{isa:?} {precision:?}: {error}");
        }
    }
}

#[test]
fn exponentials_are_packed_and_right_in_every_precision() {
    let mut net = Net::random(4);
    net.output_scale = (0..100).map(|i| 0.04 * (i as f32 - 70.0)).collect();
    let mut file = model(&net, Spelling::default());
    let graph = file.graph.as_mut().unwrap();
    graph.node.last_mut().unwrap().op_type = "Exp".into();
    for (key, value) in [("force_max_n", "3.5"), ("speed_max_mm_s", "300")] {
        file.metadata_props.push(StringStringEntryProto { key: key.into(), value: value.into() });
    }
    let model = Model::from_bytes(&bytes(&file), "made.onnx").unwrap();
    let textures = textures(2, 5);
    let most = |precision| match precision {
        Precision::F32 => 3e-5,
        Precision::F16 => 5e-3,
        Precision::Int8 => 5e-2,
        Precision::F64 => 1e-6,
    };
    let packed = PACKED
        .iter()
        .flat_map(|(precision, _)| precision.isas().into_iter().map(|isa| (*precision, Choice::Packed(isa))));
    for (precision, choice) in packed.chain([(Precision::F64, Choice::Auto)]) {
        let mut runner = model.runner(&textures, precision, choice).unwrap();
        assert_ne!(runner.describe().executor, Executor::Tract, "{precision:?}");
        let (mut worst, mut range) = (0f64, [f64::MAX, 0.0]);
        for (force, speed) in motions(20, 6).into_iter().filter(|(f, _)| f[0] < 10.0) {
            for (m, texture) in textures.iter().enumerate() {
                let mut out = [f32::NAN; 100];
                runner.run(m, &force, &speed, &mut out).unwrap();
                for (&y, log) in out.iter().zip(net.evaluate(&force, &speed, texture)) {
                    worst = worst.max((f64::from(y) / log.exp() - 1.0).abs());
                    range = [range[0].min(log.exp()), range[1].max(log.exp())];
                }
            }
        }
        assert!(range[0] < 1e-2 && range[1] > 2.0, "{range:?}");
        assert!(worst < most(precision), "{precision:?} {choice:?}: {worst}");
    }
}

#[test]
fn double_precision_matches_the_f64_evaluation() {
    // The rounding of magnitudes to f32 remains.
    for spelling in spellings() {
        let net = Net::random(2);
        let model = load(&net, spelling);
        let runner = model.runner(&textures(1, 1), Precision::F64, Choice::Auto).unwrap();
        assert_eq!(runner.describe().executor, Executor::Double);
        assert!(runner.is_allocation_free());
        let error = error_vs_f64(&net, &model, Precision::F64, Choice::Auto);
        assert!(error < 6e-8, "{spelling:?}: {error}");
    }
    let model = load(&Net::random(2), Spelling::default());
    let refused = model.runner(&textures(1, 1), Precision::F64, Choice::Packed(Isa::Portable)).unwrap_err();
    assert!(refused.to_string().contains("f64 has no packed kernels"), "{refused}");
}

#[test]
fn instruction_sets_agree_with_each_other_and_with_tract() {
    let model = load(&Net::random(3), Spelling::default());
    let textures = textures(2, 9);
    let mut tract = model.runner(&textures, Precision::F32, Choice::Tract).unwrap();
    for (precision, _) in PACKED {
        for isa in precision.isas() {
            let mut packed = model.runner(&textures, precision, Choice::Packed(isa)).unwrap();
            for (force, speed) in motions(10, 4) {
                let (mut a, mut b) = ([0.0; 100], [0.0; 100]);
                tract.run(1, &force, &speed, &mut a).unwrap();
                packed.run(1, &force, &speed, &mut b).unwrap();
                let full_scale = a.iter().fold(0f32, |m, x| m.max(x.abs()));
                for (x, y) in a.iter().zip(b) {
                    let error = f64::from((x - y).abs() / full_scale);
                    assert!(error < precision.tolerance(), "{isa:?} {precision:?}: {x} {y}");
                }
            }
        }
    }
}

/// Largest errors of ratio and variance as parts of their largest values.
fn scatter_errors(
    net: &Net,
    heads: &[(&str, Layer)],
    spelling: Spelling,
    ways: (Precision, Choice),
) -> [f64; 2] {
    let model = Model::from_bytes(&bytes(&scattering(net, spelling, heads)), "made.onnx").unwrap();
    assert!(model.answers_scatter() && model.not_lowered_because().is_none(), "{spelling:?}");
    let textures = textures(3, 5);
    let mut runner = model.runner(&textures, ways.0, ways.1).unwrap();
    assert!(runner.answers_scatter());
    // The same network with a head in place of its last layer.
    let exact = heads.iter().map(|(_, head)| {
        let mut net = net.clone();
        *net.predictor.last_mut().unwrap() = head.clone();
        net.output_scale = vec![1.0; 100];
        net
    });
    let exact: Vec<Net> = exact.collect();
    let (mut worst, mut largest) = ([0f64; 2], [0f64; 2]);
    let mut answer = Answer::default();
    for (force, speed) in motions(20, 6).into_iter().filter(|(f, _)| f[0] < 10.0) {
        for (m, texture) in textures.iter().enumerate() {
            runner.answer(m, &force, &speed, &mut answer).unwrap();
            let mut magnitudes = [0.0; 100];
            runner.run(m, &force, &speed, &mut magnitudes).unwrap();
            assert_eq!(magnitudes, answer.magnitudes);
            for (which, found) in [&answer.ratio[..], &[answer.variance]].into_iter().enumerate() {
                for (&y, exact) in found.iter().zip(exact[which].evaluate(&force, &speed, texture)) {
                    let exact = if which == 0 { exact.min(1.0) } else { exact };
                    worst[which] = worst[which].max((f64::from(y) - exact).abs());
                    largest[which] = largest[which].max(exact);
                }
            }
        }
    }
    assert!(largest.iter().all(|x| *x > 0.1), "a network that gives nothing tests nothing: {largest:?}");
    [worst[0] / largest[0], worst[1] / largest[1]]
}

#[test]
fn scatter_agrees_with_f64_in_every_precision() {
    let (net, heads) = (Net::random(2), heads(8));
    let mut ways = vec![((Precision::F32, Choice::Tract), 1e-5), ((Precision::F64, Choice::Auto), 1e-6)];
    for (precision, within) in PACKED {
        ways.extend(precision.isas().into_iter().map(|isa| ((precision, Choice::Packed(isa)), within.end)));
    }
    for (ways, within) in ways {
        let errors = scatter_errors(&net, &heads, Spelling::default(), ways);
        assert!(errors.iter().all(|e| *e < within), "{ways:?}: {errors:?}");
    }
}

#[test]
fn scatter_is_found_by_name_in_every_spelling() {
    for spelling in spellings() {
        let errors = scatter_errors(&Net::random(1), &heads(3), spelling, (Precision::F32, Choice::Auto));
        assert!(errors.iter().all(|e| *e < 1e-5), "{spelling:?}: {errors:?}");
    }
}

#[test]
fn model_without_scatter_answers_noise() {
    let model = load(&Net::random(1), Spelling::default());
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
    let model =
        Model::from_bytes(&bytes(&scattering(&Net::random(1), Spelling::default(), &heads)), "m").unwrap();
    for choice in [Choice::Auto, Choice::Tract] {
        let mut runner = model.runner(&textures(1, 1), Precision::F32, choice).unwrap();
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
fn tract_itself_agrees_with_f64() {
    let net = Net::random(4);
    let error = error_vs_f64(&net, &load(&net, Spelling::default()), Precision::F32, Choice::Tract);
    assert!(error < 1e-5, "{error}");
}

#[test]
fn the_texture_part_is_folded_away() {
    let model = load(&Net::random(1), Spelling::default());
    let runner = model.runner(&textures(1, 1), Precision::F32, Choice::Auto).unwrap();
    let info = runner.describe();
    // 496,500 in all; 256 x 300 of them belong to the texture.
    assert_eq!(info.multiply_adds, 496_500 - 256 * 300);
    let least = 4 * info.multiply_adds;
    assert!((least..least + least / 20).contains(&info.weights_bytes), "{} bytes", info.weights_bytes);
    let half = model.runner(&textures(1, 1), Precision::F16, Choice::Packed(Isa::best())).unwrap();
    // Half the bytes, or a quarter, except for the smallest layers.
    let half_bytes = half.describe().weights_bytes * 2;
    assert!((info.weights_bytes + 1..info.weights_bytes * 106 / 100).contains(&half_bytes), "{half_bytes}");
    let quarter = model.runner(&textures(1, 1), Precision::Int8, Choice::Packed(Precision::Int8.isas()[0]));
    let quarter_bytes = quarter.unwrap().describe().weights_bytes * 4;
    assert!(
        (info.weights_bytes + 1..info.weights_bytes * 118 / 100).contains(&quarter_bytes),
        "{quarter_bytes}"
    );
    let best = Isa::best();
    assert_eq!(info.executor, Executor::Packed { isa: best, precision: Precision::F32 });
    assert_eq!(half.describe().executor, Executor::Packed { isa: best, precision: Precision::F16 });
    assert!(info.max_error_vs_tract.unwrap() < 1e-5, "{}", info.report);
    let error = half.describe().max_error_vs_tract.unwrap();
    assert!((1e-6..1e-3).contains(&error), "{}", half.describe().report);
}

#[test]
fn weights_are_read_whole() {
    let model = load(&Net::random(6), Spelling::default());
    let sums: Vec<u32> = [Choice::Auto, Choice::Packed(Isa::best())]
        .into_iter()
        .map(|c| model.runner(&textures(1, 1), Precision::F32, c).unwrap().read_weights().unwrap())
        .collect();
    assert_eq!(sums[0], sums[1]);
    assert_ne!(sums[0], 0);
    let other = load(&Net::random(7), Spelling::default());
    let sum = other.runner(&textures(1, 1), Precision::F32, Choice::Auto).unwrap().read_weights().unwrap();
    assert_ne!(sums[0], sum);
    assert_eq!(model.runner(&textures(1, 1), Precision::F32, Choice::Tract).unwrap().read_weights(), None);
}

#[test]
fn the_shipped_model_runs_in_every_precision() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/models/surfaces/texture.onnx");
    let model = Model::load(path).unwrap();
    assert_eq!(model.not_lowered_because(), None);
    // The library's vectors without its reader: numbers between `vector: [` and `]`.
    let library = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/models/surfaces/materials.ron");
    let text = std::fs::read_to_string(library).unwrap();
    let vectors: Vec<Vec<f32>> = text
        .split("vector: [")
        .skip(1)
        .map(|rest| {
            rest.split(']').next().unwrap().split(',').filter_map(|x| x.trim().parse().ok()).collect()
        })
        .collect();
    assert!(vectors.len() >= 8);
    for (precision, within) in PACKED {
        for isa in precision.isas() {
            let runner = model.runner(&vectors, precision, Choice::Packed(isa)).unwrap();
            let info = runner.describe();
            assert_eq!(info.executor, Executor::Packed { isa, precision });
            assert_eq!(info.multiply_adds, 446_000, "{}", info.report);
            // An exponential turns an error of the logarithm into a relative one.
            let most = if precision == Precision::Int8 { 5e-2 } else { within.end.max(1e-4) };
            assert!(info.max_error_vs_tract.unwrap() < most, "{}", info.report);
            eprintln!("{}, {} bytes", info.report, info.weights_bytes);
        }
    }
    let double = model.runner(&vectors, Precision::F64, Choice::Auto).unwrap();
    assert_eq!(double.describe().executor, Executor::Double);
    assert!(double.describe().max_error_vs_tract.unwrap() < 1e-5, "{}", double.describe().report);
}
