use asperity_data::Parts;
use burn::module::Module as _;

use super::*;
use crate::descent::Stop;
use crate::encoder::Preset;
use crate::layer::numbers;
use crate::stages::Namer;

/// Three materials, two looks of each: 8960 numbers a look.
fn looks() -> Looks {
    let random = &mut Random::new(3);
    let mut some = || (0..2 * FEATURES).map(|_| random.range(0.0, 1.7) as f32).collect::<Vec<_>>();
    let seen = (0..3).map(|_| some()).collect();
    Looks { seen, strange: (0..3).map(|_| some()).collect(), scale: 1.0 }
}

fn learner(looks: &Looks, device: &Device) -> Learner {
    Learner::new(&Namer::new(Preset::Compact, 3, 1, device).classifier, looks, 1, device)
}

#[test]
fn scores_differ_by_sharpness_times_squared_distances() {
    let device = Device::flex();
    let learner = learner(&looks(), &device);
    let centres = numbers(learner.centres.val());
    let vector: Vec<f32> = (0..VECTOR_LEN).map(|i| (i % 7) as f32 * 0.1).collect();
    let scores = numbers(learner.scores(rows(vector.clone(), VECTOR_LEN, &device)));
    let squared = |class: usize| -> f64 {
        let centre = &centres[class * VECTOR_LEN..][..VECTOR_LEN];
        centre.iter().zip(&vector).map(|(c, x)| f64::from(c - x).powi(2)).sum()
    };
    for class in 1..3 {
        let wanted = -f64::from(SHARPNESS) * (squared(class) - squared(0));
        let found = f64::from(scores[class] - scores[0]);
        assert!(wanted.abs() > 0.01 && (found - wanted).abs() < 1e-4, "{class}: {found}, not {wanted}");
    }
}

#[test]
fn zero_name_weight_leaves_only_vibration_loss() {
    let device = Device::flex().autodiff();
    let looks = looks();
    let example = Example {
        force: [1.0; HISTORY],
        velocity: [50.0; 2 * HISTORY],
        magnitudes: std::array::from_fn(|bin| 1.0 + (bin % 5) as f32),
        other: None,
    };
    let subject = |name: &str| Subject {
        name: name.into(),
        description: String::new(),
        family: Some(if name == "a" { "x" } else { "y" }.into()),
        images: Parts::default(),
        examples: Parts { train: vec![example.clone()], held: Vec::new() },
        truth: Truth::Rms,
        notes: Vec::new(),
    };
    let subjects = ["a", "b", "c"].map(subject);
    let kin = Kin::of(subjects.iter().map(|s| s.family.as_deref()));
    let scaling = Scaling { force: (1.0, 0.0), speed: 0.01 };
    let (target, aim) = (Target::Rms, Aim::Relative);
    let settings = Touching { groups: 3, each: 2, seed: 1, target, aim, scaling };
    let moved = |naming_weight: f64| {
        let folder = tempfile::tempdir().unwrap();
        let stop = Stop::default();
        let (name, steps, learning_rate, second_decay) = ("feeling", 3, 1e-3, 0.99);
        let stage = Stage { name, steps, learning_rate, second_decay, folder: folder.path(), stop: &stop };
        let begun = learner(&looks, &device);
        let before = numbers(begun.valid().centres.val());
        let beside = (&looks, kin.as_ref(), naming_weight);
        let (done, losses) = feel(&stage, begun, &subjects, beside, settings, &device, |_| {}).unwrap();
        (before != numbers(done.valid().centres.val()), losses)
    };
    let (moves, alone) = moved(0.0);
    assert!(!moves, "centres are of names only");
    let (moves, both) = moved(0.2);
    assert!(moves && both != alone);
}
