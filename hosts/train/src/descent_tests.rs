use super::*;
use crate::layer::{Layer, Weights};
use asperity_numbers::Random;
use burn::tensor::{Device, TensorData};

const STEPS: usize = 60;

/// Learns y = 2 a - b + 1, with a stop request after step `stop_at`.
fn learn(folder: &Path, stop_at: Option<usize>) -> Result<(Weights, Losses), Failure> {
    let device = Device::flex().autodiff();
    let stop = Stop::default();
    let stage =
        Stage { name: "line", steps: STEPS, learning_rate: 0.1, second_decay: 0.99, folder, stop: &stop };
    let layer = Layer::new(2, 1, 1.0, &mut Random::new(5), &device);
    let draw = |step: usize| {
        let mut random = Random::new(step as u64);
        let inputs: Vec<f32> = (0..16).map(|_| random.range(-1.0, 1.0) as f32).collect();
        let wanted: Vec<f32> = inputs.chunks_exact(2).map(|x| 2.0 * x[0] - x[1] + 1.0).collect();
        (step, inputs, wanted)
    };
    let loss = |layer: &Layer, (step, inputs, wanted): (usize, Vec<f32>, Vec<f32>)| {
        if Some(step) == stop_at {
            assert!(stop.ask() && !stop.ask(), "seen to, and not twice");
        }
        let tensor = |x: Vec<f32>, width| Tensor::<2>::from_data(TensorData::new(x, [8, width]), &device);
        (layer.forward(tensor(inputs, 2)) - tensor(wanted, 1)).powi_scalar(2).mean()
    };
    let (layer, losses) = stage.descend(layer, draw, loss, |_| {})?;
    Ok((layer.weights(), losses))
}

#[test]
fn run_stopped_twice_ends_at_the_same_bits() {
    let [whole, parts] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let (weights, losses) = learn(whole.path(), None).unwrap();
    assert!(losses.last().unwrap().1 < 0.05 * losses[0].1, "{losses:?}");
    for stop_at in [17, 40] {
        assert!(matches!(learn(parts.path(), Some(stop_at)), Err(Failure::Stopped)));
    }
    assert_eq!(learn(parts.path(), None).unwrap(), (weights, losses));
}

#[test]
fn stop_request_without_kept_state_is_ignored() {
    assert!(!Stop::default().ask());
}

#[test]
fn a_stage_that_is_done_is_not_done_again() {
    let folder = tempfile::tempdir().unwrap();
    let first = learn(folder.path(), None).unwrap();
    // A finished stage takes no step, so the stop never comes.
    assert_eq!(learn(folder.path(), Some(0)).unwrap(), first);
}

#[test]
fn a_broken_checkpoint_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    learn(folder.path(), None).unwrap();
    let path = folder.path().join("line.checkpoint");
    let bytes = std::fs::read(&path).unwrap();
    let mut flipped = bytes.clone();
    let last = bytes.len() - 1;
    flipped[last] ^= 1;
    for broken in [&bytes[..0], &bytes[..7], &bytes[..40], &bytes[..bytes.len() / 2], &flipped] {
        std::fs::write(&path, broken).unwrap();
        let Err(Failure::Input(e)) = learn(folder.path(), None) else { panic!("taken") };
        assert!(e.to_string().contains("line.checkpoint") && e.to_string().contains("not a whole"), "{e}");
    }
}
