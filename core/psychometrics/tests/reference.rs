//! Comparison with the values that reference.py took from questplus, scipy.optimize and scipy.stats.

use asperity_psychometrics::*;
use serde::Deserialize;

#[derive(Deserialize)]
struct Reference {
    functions: Vec<Value>,
    weibull: Vec<Trial>,
    gaussian: Vec<Trial>,
    fits: Vec<Fitted>,
}

#[derive(Deserialize)]
struct Value {
    shape: Shape,
    axis: Axis,
    level: f64,
    threshold: f64,
    slope: f64,
    f: f64,
}

/// A trial of QUEST+, and the posterior after it: threshold, slope, guess and lapse.
#[derive(Deserialize)]
struct Trial {
    level: f64,
    entropy: f64,
    correct: bool,
    mean: [f64; 4],
    mode: [f64; 4],
    sd: [f64; 4],
}

#[derive(Deserialize)]
struct Fitted {
    shape: Shape,
    axis: Axis,
    guess: f64,
    lapse_up_to: Option<f64>,
    rows: Vec<Row>,
    threshold: f64,
    slope: f64,
    lapse: f64,
    threshold_interval: [f64; 2],
    slope_interval: [f64; 2],
    log_likelihood: f64,
    deviance: f64,
    p_value: f64,
}

fn reference() -> Reference {
    serde_json::from_str(include_str!("reference.json")).unwrap()
}

#[track_caller]
fn near(ours: f64, theirs: f64, tolerance: f64) {
    assert!((ours - theirs).abs() <= tolerance * theirs.abs().max(1.0), "{ours} instead of {theirs}");
}

#[test]
fn functions_match_scipy() {
    for Value { shape, axis, level, threshold, slope, f } in reference().functions {
        let function = Function { shape, axis, threshold, slope, guess: 0.0, lapse: 0.0 };
        let p = function.probability(level);
        assert!((p / f - 1.0).abs() < 1e-12, "{function:?}: {p} instead of {f}");
        near(function.level_at(f).unwrap(), level, 1e-12);
    }
}

/// Levels, answers and posteriors of a whole run. The expected entropy is the mean over both answers.
fn compare(settings: QuestSettings, trials: &[Trial], slope: fn(f64) -> f64) {
    let mut quest = Quest::new(QuestSettings { trials: trials.len() as u32, ..settings }).unwrap();
    for trial in trials {
        assert_eq!(quest.next_level(), Some(trial.level));
        let p = quest.chance().unwrap();
        let after = |correct| {
            let mut next = quest.clone();
            next.answer(correct);
            next.posterior().entropy
        };
        near(p * after(true) + (1.0 - p) * after(false), trial.entropy, 1e-10);
        quest.answer(trial.correct);
        let posterior = quest.posterior();
        for (i, ours) in
            [posterior.threshold, posterior.slope, posterior.guess, posterior.lapse].iter().enumerate()
        {
            if i == 1 {
                near(slope(ours.mode), trial.mode[i], 1e-12);
            } else {
                near(ours.mean, trial.mean[i], 1e-10);
                near(ours.sd, trial.sd[i], 1e-7);
                near(ours.mode, trial.mode[i], 0.0);
            }
        }
    }
    assert_eq!(quest.next_level(), None);
}

#[test]
fn quest_of_weibull_matches_questplus() {
    let settings = QuestSettings {
        shape: Shape::Weibull,
        axis: Axis::Decibel,
        levels: Grid::Linear { from: -40.0, to: 0.0, count: 41 },
        threshold: Grid::Linear { from: -39.0, to: -1.0, count: 20 },
        slope: Grid::Values { of: vec![2.0, 3.5, 5.0] },
        guess: Grid::Values { of: vec![0.5] },
        lapse: Grid::Values { of: vec![0.0, 0.02, 0.05] },
        trials: 1,
        threshold_sd: None,
    };
    compare(settings, &reference().weibull, |slope| slope);
}

#[test]
fn quest_of_gaussian_matches_questplus() {
    let settings = QuestSettings {
        shape: Shape::Gaussian,
        axis: Axis::Linear,
        levels: Grid::Linear { from: -2.0, to: 2.0, count: 33 },
        threshold: Grid::Linear { from: -1.5, to: 1.5, count: 25 },
        slope: Grid::Values { of: vec![0.5, 1.0, 2.0, 4.0] },
        guess: Grid::Values { of: vec![0.0] },
        lapse: Grid::Values { of: vec![0.01] },
        trials: 1,
        threshold_sd: None,
    };
    compare(settings, &reference().gaussian, |slope| 1.0 / slope);
}

/// scipy's simplex finds the top to about 1e-8, the root of the deviance that an interval ends at to 1e-9.
#[test]
fn fits_match_scipy_optimize_within_1e_6() {
    for theirs in reference().fits {
        let Fitted { shape, axis, guess, lapse_up_to, .. } = theirs;
        let settings = FitSettings { shape, axis, guess, lapse: 0.0, lapse_up_to, confidence: 0.95 };
        let ours = fit(&theirs.rows, &settings).unwrap();
        near(ours.function.threshold, theirs.threshold, 1e-6);
        near(ours.function.slope, theirs.slope, 1e-6);
        near(ours.function.lapse, theirs.lapse, 1e-6);
        for (ours, theirs) in
            [(ours.threshold, theirs.threshold_interval), (ours.slope, theirs.slope_interval)]
        {
            near(ours.low.unwrap(), theirs[0], 1e-6);
            near(ours.high.unwrap(), theirs[1], 1e-6);
        }
        near(ours.log_likelihood, theirs.log_likelihood, 1e-12);
        near(ours.deviance, theirs.deviance, 1e-10);
        near(ours.p_value.unwrap(), theirs.p_value, 1e-9);
    }
}
