//! No input makes a method panic. Settings that it takes give finite levels and estimates.

use proptest::prelude::*;

use crate::*;

/// Numbers of every kind, and often usual ones.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![any::<f64>(), -3.0..3.0, Just(0.0), Just(1.0), Just(0.5)]
}

fn shape() -> impl Strategy<Value = Shape> {
    prop_oneof![Just(Shape::Weibull), Just(Shape::Logistic), Just(Shape::Gaussian)]
}

fn axis() -> impl Strategy<Value = Axis> {
    prop_oneof![Just(Axis::Linear), Just(Axis::Log10), Just(Axis::Decibel)]
}

fn grid() -> impl Strategy<Value = Grid> {
    prop_oneof![
        prop::collection::vec(number(), 0..4).prop_map(|of| Grid::Values { of }),
        (number(), number(), 0..6_u32).prop_map(|(from, to, count)| Grid::Linear { from, to, count }),
        (number(), number(), 0..6_u32).prop_map(|(from, to, count)| Grid::Logarithmic { from, to, count }),
    ]
}

proptest! {
    #[test]
    fn function_of_any_numbers_returns(
        shape in shape(), axis in axis(), n in prop::array::uniform6(number())
    ) {
        let [threshold, slope, guess, lapse, level, p] = n;
        let function = Function { shape, axis, threshold, slope, guess, lapse };
        let probability = function.probability(level);
        if function.check().is_ok() && !level.is_nan() && !probability.is_nan() {
            prop_assert!((0.0..=1.0).contains(&probability), "{probability}");
        }
        let _ = (function.level_at(p), function.pse(), function.jnd());
        let _ = Observer { function, seed: 1 }.answer(0, level);
    }

    #[test]
    fn staircase_of_any_settings_stays_within_bounds(
        n in prop::array::uniform4(number()), sizes in prop::collection::vec(number(), 0..4),
        ratios in any::<bool>(), down in 0..4_u32, up in 0..4_u32, average in 0..4_u32,
        answers in prop::collection::vec(any::<bool>(), 0..60)
    ) {
        let [start, floor, ceiling, up_over_down] = n;
        let steps = if ratios { Steps::Multiply { by: sizes } } else { Steps::Add { by: sizes } };
        let settings = StaircaseSettings {
            start, floor, ceiling, steps, down, up, up_over_down, trials: 50, reversals: None, average
        };
        if let Ok(mut staircase) = Staircase::new(settings) {
            for answer in answers {
                staircase.answer(answer);
                prop_assert!(staircase.next_level().is_none_or(|l| (floor..=ceiling).contains(&l)));
            }
            prop_assert!(staircase.estimate().is_none_or(|e| (0.0..1.0).contains(&e.target)));
        }
    }

    #[test]
    fn quest_of_any_settings_presents_its_levels(
        shape in shape(), axis in axis(), grids in prop::array::uniform5(grid()), sd in number(),
        answers in prop::collection::vec(any::<bool>(), 0..20)
    ) {
        let [levels, threshold, slope, guess, lapse] = grids;
        let settings = QuestSettings {
            shape, axis, levels, threshold, slope, guess, lapse, trials: 15, threshold_sd: Some(sd)
        };
        if let Ok(mut quest) = Quest::new(settings) {
            for answer in answers {
                quest.answer(answer);
                prop_assert!(quest.next_level().is_none_or(f64::is_finite));
            }
            prop_assert!(quest.posterior().entropy >= 0.0, "{:?}", quest.posterior());
        }
    }

    #[test]
    fn fit_of_any_rows_returns_a_function(
        shape in shape(), axis in axis(), guess in number(), lapse in number(), most in number(),
        fitted in any::<bool>(), rows in prop::collection::vec((number(), 0..9_u32, 0..9_u32), 0..6)
    ) {
        let row = |(level, correct, wrong)| Row { level, correct, total: correct + wrong };
        let rows: Vec<Row> = rows.into_iter().map(row).collect();
        let lapse_up_to = fitted.then_some(most);
        let settings = FitSettings { shape, axis, guess, lapse, lapse_up_to, confidence: 0.95 };
        if let Ok(fit) = fit(&rows, &settings) {
            prop_assert_eq!(fit.function.check(), Ok(()));
            prop_assert!(fit.deviance.is_finite() && fit.p_value.is_none_or(|p| (0.0..=1.0).contains(&p)));
        }
    }
}
