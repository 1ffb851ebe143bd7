use super::*;
use crate::evaluation::{Model, evaluate};
use crate::onnx::encode;
use asperity_world::material::{Library, made_materials};

fn tiny(seed: u64, report: impl FnMut(Progress)) -> (Vec<MadeMaterial>, NetworkWeights) {
    let materials: Vec<_> = made_materials().unwrap().into_iter().take(3).collect();
    let settings = Settings { steps: 2 * REPORT_EVERY, batch: 32, seed, learning_rate: 1e-3 };
    let weights = train(&materials, &settings, report).unwrap();
    (materials, weights)
}

/// The network written out in f64: an evaluation that shares nothing with burn or tract.
fn by_hand(weights: &NetworkWeights, force: &[f32], speed: &[f32], texture: &[f32]) -> Vec<f64> {
    let chain = |layers: &[crate::network::Weights], x: Vec<f64>| {
        layers.iter().fold(x, |x, l| {
            (0..l.outputs)
                .map(|o| {
                    let sum: f64 = (0..l.inputs).map(|i| x[i] * f64::from(l.weight[i * l.outputs + o])).sum();
                    (f64::from(l.bias[o]) + sum).max(0.0)
                })
                .collect()
        })
    };
    let wide = |x: &[f32]| x.iter().copied().map(f64::from).collect::<Vec<_>>();
    let mut action = chain(&weights.force, wide(force));
    action.extend(chain(&weights.speed, wide(speed)));
    let mut x = wide(texture);
    x.extend(chain(&weights.action, action));
    chain(&weights.predictor, x)
}

#[test]
fn a_short_run_learns_and_its_file_answers_the_same_through_tract() {
    let mut losses = Vec::new();
    let (materials, weights) = tiny(2, |p| losses.push(p.loss));
    assert_eq!(losses.len(), 2);
    assert!(losses[1] < 0.7 * losses[0], "{losses:?}");

    let onnx = encode(&weights, &[("seed", "2".to_owned())]);
    let model = Model::load(&onnx).unwrap();
    let histories = Histories::new().unwrap();
    let mut random = Random::new(9);
    let mut loudest = 0.0f64;
    for _ in 0..20 {
        let h = histories.draw(&mut random);
        let vector = embed(&materials[random.below(3)].law);
        let got = model.run(&h.force, &h.velocity, &vector).unwrap();
        let want = by_hand(&weights, &h.force, &h.velocity, &vector);
        assert_eq!(got.len(), BINS);
        for (got, want) in got.iter().zip(want) {
            assert!(*got >= 0.0 && (f64::from(*got) - want).abs() < 1e-4, "{got} {want}");
            loudest = loudest.max(want);
        }
    }
    assert!(loudest > 0.05, "{loudest}: an answer that is nothing proves nothing");

    let evaluation = evaluate(&onnx, &Library::made(&materials), &materials).unwrap();
    assert_eq!(evaluation.scores.len(), 3);
    assert!(evaluation.frames > 500);
    for s in &evaluation.scores {
        assert!(
            s.bins > 5000 && s.mean_db.is_finite() && s.p90_db >= s.mean_db && s.baseline_db > 1.0,
            "{s:?}"
        );
    }
}

#[test]
fn the_same_seed_trains_the_same_bits() {
    assert_eq!(encode(&tiny(3, |_| ()).1, &[]), encode(&tiny(3, |_| ()).1, &[]));
}

#[test]
fn targets_are_expectations_above_the_floor_and_below_zero_for_silence() {
    assert!((target(0.02) - compressed(0.02)).abs() < 1e-4);
    assert!(target(0.0) < 0.0);
    let mut last = target(0.0);
    for i in 1..1000 {
        let next = target(i as f32 * 1e-4);
        assert!(next > last);
        last = next;
    }
}
