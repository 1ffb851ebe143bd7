//! Properties over simulated data, with fixed seeds, and figures of the published study.

use asperity_numbers::Random;
use asperity_statistics::*;

/// Number of simulated experiments, and people in each.
const RUNS: usize = 10_000;
const PEOPLE: usize = 25;
const LEVEL: f64 = 0.05;

/// Three standard errors of a share over all runs.
fn noise(share: f64) -> f64 {
    3.0 * (share * (1.0 - share) / RUNS as f64).sqrt()
}

/// Share of p-values up to the level, and the largest of these: the attainable size of a discrete test.
fn rejections(mut p: impl FnMut(&mut Random) -> f64) -> (f64, f64) {
    let mut random = Random::new(11);
    let rejected: Vec<f64> = (0..RUNS).map(|_| p(&mut random)).filter(|&p| p <= LEVEL).collect();
    let rate = rejected.len() as f64 / RUNS as f64;
    let size = rejected.iter().fold(0.0, |m: f64, &p| m.max(p));
    println!("rate {rate}, attainable size {size:.5}");
    (rate, size)
}

#[test]
fn null_rejections_of_exact_binomial_have_its_size() {
    let (rate, size) = rejections(|random| {
        let successes = (0..PEOPLE).filter(|_| random.chance(0.5)).count();
        binomial_test(successes, PEOPLE, 0.5, Alternative::Greater).unwrap().p
    });
    assert!((rate - size).abs() < noise(size));
}

#[test]
fn null_rejections_of_exact_signed_rank_have_its_size() {
    let (rate, size) = rejections(|random| {
        let d: Vec<f64> = (0..PEOPLE).map(|_| random.normal()).collect();
        wilcoxon(&d, Alternative::TwoSided, Zeros::Drop, Method::Exact).unwrap().p
    });
    assert!((rate - size).abs() < noise(size));
}

#[test]
fn null_rejections_with_ties_stay_below_the_level() {
    let (rate, _) = rejections(|random| {
        let rating = |random: &mut Random| (4.0 + 1.5 * random.normal()).round().clamp(1.0, 7.0);
        let d: Vec<f64> = (0..PEOPLE).map(|_| rating(random) - rating(random)).collect();
        wilcoxon(&d, Alternative::TwoSided, Zeros::Drop, Method::ExactWithTies).unwrap().p
    });
    assert!(rate < LEVEL + noise(LEVEL));
}

#[test]
fn null_rejections_of_friedman_stay_near_the_level() {
    let table = |random: &mut Random| -> Vec<[f64; 3]> {
        (0..PEOPLE).map(|_| [random.normal(), random.normal(), random.normal()]).collect()
    };
    let (chi_square, _) = rejections(|random| friedman(&table(random)).unwrap().chi_square.p);
    assert!(chi_square < LEVEL + noise(LEVEL));
    let (f, _) = rejections(|random| friedman(&table(random)).unwrap().f.p);
    assert!(f < LEVEL + noise(LEVEL));
}

#[test]
fn ability_intervals_cover_the_truth() {
    const TRUTH: [f64; 4] = [0.9, 0.2, -0.3, -0.8];
    const RUNS: usize = 3000;
    let mut random = Random::new(7);
    let (mut abilities, mut differences) = ([0; 4], [[0; 4]; 4]);
    for _ in 0..RUNS {
        let mut wins = [[0.0; 4]; 4];
        for i in 0..4 {
            for j in 0..i {
                let p = 1.0 / (1.0 + (TRUTH[j] - TRUTH[i]).exp());
                let won = (0..40).filter(|_| random.chance(p)).count() as f64;
                (wins[i][j], wins[j][i]) = (won, 40.0 - won);
            }
        }
        let fit = bradley_terry(&wins, Estimator::MaximumLikelihood).unwrap();
        let covers = |interval: Interval, truth| usize::from((interval.low..=interval.high).contains(&truth));
        for i in 0..4 {
            abilities[i] += covers(fit.ability(i, 0.95).unwrap(), TRUTH[i]);
            for j in 0..i {
                differences[i][j] += covers(fit.difference(i, j, 0.95).unwrap(), TRUTH[i] - TRUTH[j]);
            }
        }
    }
    let counts = abilities.into_iter().chain((0..4).flat_map(|i| differences[i][..i].to_vec()));
    let shares: Vec<f64> = counts.map(|covered| covered as f64 / RUNS as f64).collect();
    println!("coverage {shares:.4?}");
    assert!(shares.iter().all(|share| (0.93..=0.97).contains(share)));
}

#[test]
fn published_p_values_are_reached() {
    let binomial = |k| binomial_test(k, 25, 0.5, Alternative::Greater).unwrap().p;
    assert_eq!(format!("{:.5} {:.5}", binomial(19), binomial(20)), "0.00732 0.00204");
    let mut d: Vec<f64> = (1..=25).map(f64::from).collect();
    let exact = |d: &[f64]| wilcoxon(d, Alternative::TwoSided, Zeros::Drop, Method::Exact).unwrap().p;
    assert_eq!(exact(&d), 2.0 / f64::from(1 << 25));
    d[0] = -1.0;
    assert_eq!(exact(&d), 4.0 / f64::from(1 << 25));
    d[0] = 1.0;
    let normal = Method::Normal { corrected: true };
    let test = wilcoxon(&d, Alternative::TwoSided, Zeros::Drop, normal).unwrap();
    assert_eq!(format!("{:.1e}", test.p), "1.3e-5");
    assert_eq!(
        test.variant.to_string(),
        "Wilcoxon signed-rank, two-sided, normal approximation with continuity correction, zeros dropped"
    );
}

#[test]
fn automatic_method_is_normal_above_50() {
    let method = |n: u32| {
        let d: Vec<f64> = (1..=n).map(f64::from).collect();
        wilcoxon(&d, Alternative::Less, Zeros::Drop, Method::Auto { corrected: true }).unwrap().variant
    };
    let expected =
        |method| Variant::SignedRank { alternative: Alternative::Less, zeros: Zeros::Drop, method };
    assert_eq!(method(50), expected(Method::Exact));
    assert_eq!(method(51), expected(Method::Normal { corrected: true }));
}

#[test]
fn missing_values_and_zeros_are_counted() {
    let d = differences(&[1.0, f64::NAN, 3.0, 4.0], &[1.0, 2.0, f64::INFINITY, 2.0]).unwrap();
    let test = |zeros| wilcoxon(&d, Alternative::Greater, zeros, Method::ExactWithTies).unwrap();
    assert_eq!((test(Zeros::Drop).n, test(Zeros::Drop).excluded), (1, 3));
    assert_eq!((test(Zeros::Pratt).n, test(Zeros::Pratt).excluded), (2, 2));
    let f = friedman(&[[1.0, 2.0, 3.0], [1.0, f64::NAN, 3.0], [1.0, 2.0, 3.0]]).unwrap();
    assert_eq!((f.f.n, f.f.excluded, f.w, f.f.p), (2, 1, 1.0, 0.0));
}

#[test]
fn symmetric_sample_has_no_skewness() {
    let d: Vec<f64> = (0..9).map(f64::from).collect();
    let test = skewness_test(&d, Alternative::TwoSided).unwrap();
    assert_eq!((test.statistic, test.p), (0.0, 1.0));
}

#[test]
fn designs_without_estimate_name_the_items() {
    let fit = |wins: &[[f64; 4]; 4]| bradley_terry(wins, Estimator::MaximumLikelihood);
    let mut wins = [[0.0, 3.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]];
    assert_eq!(fit(&wins), Err(Error::Disconnected { items: vec![2, 3] }));
    let penalised = bradley_terry(&wins, Estimator::Penalised).unwrap();
    assert_eq!((penalised.equality.n, penalised.estimator), (7, Estimator::Penalised));
    wins[1][2] = 5.0;
    assert_eq!(fit(&wins), Err(Error::Unbounded { unbeaten: vec![0, 1], winless: vec![2, 3] }));
    wins[3][0] = 0.5;
    assert!(fit(&wins).is_ok());
    assert!(bradley_terry(&[[0.0, 1e9], [0.5, 0.0]], Estimator::MaximumLikelihood).is_ok());
    // Two items: the ability difference is the log odds.
    let two = bradley_terry(&[[0.0, 30.0], [10.0, 0.0]], Estimator::MaximumLikelihood).unwrap();
    let interval = two.difference(0, 1, 0.95).unwrap();
    let half = 1.959_963_984_540_054 * (1.0f64 / 30.0 + 0.1).sqrt();
    assert!(
        (interval.estimate - 3f64.ln()).abs() < 1e-12 && (interval.high - 3f64.ln() - half).abs() < 1e-12
    );
}

#[test]
fn odd_input_gives_no_panic_and_no_nan() {
    const ODD: [f64; 12] = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        0.0,
        -0.0,
        f64::MAX,
        f64::MIN,
        5e-324,
        1e-170,
        1e155,
        1.0,
        2.0,
    ];
    let mut random = Random::new(3);
    for _ in 0..20_000 {
        let n = random.below(16);
        let mut draw = |n: usize| -> Vec<f64> { (0..n).map(|_| ODD[random.below(ODD.len())]).collect() };
        let (x, y, argument) = (draw(n), draw(n), draw(1)[0]);
        let table: Vec<Vec<f64>> = (0..n).map(|_| draw(n)).collect();
        let mut outcomes = Vec::new();
        let mut figures = Vec::new();
        for side in [Alternative::TwoSided, Alternative::Greater, Alternative::Less] {
            outcomes.extend(skewness_test(&x, side).ok());
            outcomes.extend(binomial_test(n / 2, n, argument, side).ok());
            outcomes.extend(binomial_test(n, n / 2, argument, side).ok());
            for zeros in [Zeros::Drop, Zeros::Pratt, Zeros::Split] {
                let normal = Method::Normal { corrected: true };
                for method in
                    [Method::Auto { corrected: false }, Method::Exact, Method::ExactWithTies, normal]
                {
                    outcomes.extend(wilcoxon(&x, side, zeros, method).ok());
                }
            }
        }
        outcomes.extend(friedman(&table).ok().into_iter().flat_map(|f| [f.chi_square, f.f]));
        for estimator in [Estimator::MaximumLikelihood, Estimator::Penalised] {
            if let Ok(fit) = bradley_terry(&table, estimator) {
                outcomes.push(fit.equality);
                figures.extend(fit.ability(0, argument).ok().map(|i| i.high));
                figures.extend(fit.abilities);
                figures.extend(fit.covariance.concat());
            }
        }
        if let Ok(d) = describe(&x) {
            figures.extend([d.mean, d.deviation.unwrap_or(0.0), d.median]);
            figures.extend([d.quartiles, d.whiskers].concat());
        }
        figures.extend(wilson_interval(n / 2, n, argument).ok().map(|i| i.low));
        figures.extend(common_language_effect(&x, &y).ok().map(|e| e.size));
        figures.extend(rank_biserial(&x, &y).ok().map(|e| e.size));
        figures.extend(adjust(&x, Correction::Holm).p.into_iter().flatten());
        assert!(figures.iter().all(|v| v.is_finite()), "{figures:?}");
        assert!(outcomes.iter().all(|o| !o.statistic.is_nan() && (0.0..=1.0).contains(&o.p)), "{outcomes:?}");
    }
}
