//! A thousand simulated studies of a hundred trials: estimates have the bias and spread that the docs state.

use asperity_psychometrics::*;

const TRIALS: u32 = 100;

/// Two alternatives: threshold 0.1 mm, Weibull, in dB.
const CHOICE: Function = Function {
    shape: Shape::Weibull,
    axis: Axis::Decibel,
    threshold: -20.0,
    slope: 3.5,
    guess: 0.5,
    lapse: 0.02,
};

/// A comparison with a standard of 1 N.
const COMPARISON: Function = Function {
    shape: Shape::Gaussian,
    axis: Axis::Linear,
    threshold: 1.0,
    slope: 4.0,
    guess: 0.0,
    lapse: 0.02,
};

/// Mean and standard deviation of estimated quantities over the true one, from a thousand observers.
fn ratios(function: Function, level: f64, study: impl Fn(Observer) -> f64) -> [f64; 2] {
    let truth = function.axis.quantity(level);
    let of = |seed| function.axis.quantity(study(Observer { function, seed })) / truth;
    let all: Vec<f64> = (0..1000).map(of).collect();
    let mean = all.iter().sum::<f64>() / 1000.0;
    [mean, (all.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / 1000.0).sqrt()]
}

#[track_caller]
fn staircase(function: Function, down: u32, up: u32, steps: Steps, [floor, start, ceiling]: [f64; 3]) {
    let settings = StaircaseSettings {
        start,
        floor,
        ceiling,
        steps,
        down,
        up,
        up_over_down: 1.0,
        trials: TRIALS,
        reversals: None,
        average: 10,
    };
    let level = function.level_at(settings.target()).unwrap();
    let [mean, sd] = ratios(function, level, |observer| {
        let mut staircase = Staircase::new(settings.clone()).unwrap();
        for trial in 0.. {
            let Some(level) = staircase.next_level() else { break };
            staircase.answer(observer.answer(trial, level));
        }
        staircase.estimate().unwrap().level
    });
    println!("{down} down, {up} up: mean {mean:.4}, deviation {sd:.4} of the target's level");
    assert!((mean - 1.0).abs() < 0.05, "{mean}");
}

/// The last step of 1 dB is a quarter of the rise from 25 to 75 % of F.
fn decibels() -> (Steps, [f64; 3]) {
    (Steps::Add { by: vec![4.0, 2.0, 1.0] }, [-60.0, -8.0, 0.0])
}

#[test]
fn two_down_one_up_in_db_is_within_5_percent() {
    let (steps, levels) = decibels();
    staircase(CHOICE, 2, 1, steps, levels);
}

#[test]
fn three_down_one_up_in_db_is_within_5_percent() {
    let (steps, levels) = decibels();
    staircase(CHOICE, 3, 1, steps, levels);
}

#[test]
fn three_down_one_up_of_ratios_is_within_5_percent() {
    let linear = Function { axis: Axis::Linear, threshold: 0.1, ..CHOICE };
    staircase(linear, 3, 1, Steps::Multiply { by: vec![1.6, 1.25, 1.12] }, [0.001, 0.4, 1.0]);
}

#[test]
fn two_down_one_up_of_ratios_is_within_5_percent() {
    let linear = Function { axis: Axis::Linear, threshold: 0.1, ..CHOICE };
    staircase(linear, 2, 1, Steps::Multiply { by: vec![1.6, 1.25, 1.12] }, [0.001, 0.4, 1.0]);
}

#[test]
fn one_up_one_down_is_within_5_percent() {
    staircase(COMPARISON, 1, 1, Steps::Add { by: vec![0.3, 0.15, 0.08] }, [0.0, 1.8, 2.0]);
}

/// The true parameters lie between the values of the grids.
fn quest_plus(function: Function, settings: &QuestSettings) -> [f64; 2] {
    let fresh = Quest::new(settings.clone()).unwrap();
    let [mean, sd] = ratios(function, function.threshold, |observer| {
        let mut quest = fresh.clone();
        for trial in 0.. {
            let Some(level) = quest.next_level() else { break };
            quest.answer(observer.answer(trial, level));
        }
        quest.posterior().threshold.mean
    });
    println!("QUEST+: mean {mean:.4}, deviation {sd:.4} of the true threshold");
    [mean, sd]
}

#[test]
fn quest_threshold_in_db_is_within_2_percent() {
    let settings = QuestSettings {
        shape: Shape::Weibull,
        axis: Axis::Decibel,
        levels: Grid::Linear { from: -40.0, to: 0.0, count: 41 },
        threshold: Grid::Linear { from: -40.5, to: 0.5, count: 42 },
        slope: Grid::Values { of: vec![2.0, 3.0, 4.5] },
        guess: Grid::Values { of: vec![0.5] },
        lapse: Grid::Values { of: vec![0.0, 0.04] },
        trials: TRIALS,
        threshold_sd: None,
    };
    let [mean, sd] = quest_plus(CHOICE, &settings);
    assert!((mean - 1.0).abs() < 0.02 && sd < 0.15, "{mean} {sd}");
}

#[test]
fn quest_pse_of_comparison_is_within_2_percent() {
    let settings = QuestSettings {
        shape: Shape::Gaussian,
        axis: Axis::Linear,
        levels: Grid::Linear { from: 0.0, to: 2.0, count: 41 },
        threshold: Grid::Linear { from: 0.0, to: 2.0, count: 40 },
        slope: Grid::Logarithmic { from: 1.5, to: 12.0, count: 4 },
        guess: Grid::Values { of: vec![0.0] },
        lapse: Grid::Values { of: vec![0.02] },
        trials: TRIALS,
        threshold_sd: None,
    };
    let [mean, sd] = quest_plus(COMPARISON, &settings);
    assert!((mean - 1.0).abs() < 0.02 && sd < 0.1, "{mean} {sd}");
}

/// With 300 data sets, the share of intervals that hold the truth has a standard deviation of 1.3 %.
#[test]
fn fit_intervals_hold_the_truth_in_95_percent() {
    let settings = FitSettings {
        shape: Shape::Gaussian,
        axis: Axis::Linear,
        guess: 0.0,
        lapse: 0.02,
        lapse_up_to: None,
        confidence: 0.95,
    };
    let holds = |interval: Interval, truth: f64| {
        interval.low.is_none_or(|low| low <= truth) && interval.high.is_none_or(|high| truth <= high)
    };
    let mut held = [0.0; 2];
    for seed in 0..300 {
        let observer = Observer { function: COMPARISON, seed };
        let trials = (0..140).map(|i| (i, 0.4 + 0.2 * (i % 7) as f64));
        let one = |(i, level)| Row { level, correct: observer.answer(i, level).into(), total: 1 };
        let fit = fit(&trials.map(one).collect::<Vec<_>>(), &settings).unwrap();
        held[0] += f64::from(u8::from(holds(fit.threshold, COMPARISON.threshold))) / 300.0;
        held[1] += f64::from(u8::from(holds(fit.slope, COMPARISON.slope))) / 300.0;
    }
    println!("intervals hold the threshold in {:.3}, the slope in {:.3}", held[0], held[1]);
    assert!(held.iter().all(|share| (0.92..=0.98).contains(share)), "{held:?}");
}
