//! Agreement with SciPy, Pingouin, statsmodels and Matplotlib. `reference.py` made the tables.

use asperity_statistics::*;

/// Largest deviation allowed: relative for p-values of any size (1.8e-12 and less occur), else relative to at
/// least 1. The largest that occurs is 2.2e-12.
const TOLERANCE: f64 = 1e-11;

/// Cells of a table's rows.
fn rows(text: &str) -> impl Iterator<Item = Vec<&str>> {
    text.lines().filter(|line| !line.starts_with('#')).skip(1).map(|line| line.split(',').collect())
}

fn numbers(cell: &str) -> Vec<f64> {
    cell.split_whitespace().map(|word| word.parse().unwrap()).collect()
}

fn side(name: &str) -> Alternative {
    [Alternative::TwoSided, Alternative::Greater, Alternative::Less]
        [["two-sided", "greater", "less"].iter().position(|&n| n == name).unwrap()]
}

/// Largest deviations so far, by name.
#[derive(Default)]
struct Worst(Vec<(&'static str, f64)>);

impl Worst {
    fn note(&mut self, name: &'static str, deviation: f64) {
        assert!(deviation <= TOLERANCE, "{name} deviates by {deviation}");
        match self.0.iter_mut().find(|(n, _)| *n == name) {
            Some((_, worst)) => *worst = worst.max(deviation),
            None => self.0.push((name, deviation)),
        }
    }

    /// Compares p-values by relative deviation.
    fn p(&mut self, name: &'static str, got: f64, expected: f64) {
        let deviation = if got == expected { 0.0 } else { (got / expected - 1.0).abs() };
        self.note(name, if deviation.is_nan() { f64::INFINITY } else { deviation });
    }

    /// Compares other figures, relative to the larger of 1 and the figure.
    fn figures(&mut self, name: &'static str, got: &[f64], expected: &[f64]) {
        assert_eq!(got.len(), expected.len(), "{name}");
        for (a, b) in got.iter().zip(expected) {
            let deviation = if a == b { 0.0 } else { (a - b).abs() / b.abs().max(1.0) };
            self.note(name, if deviation.is_nan() { f64::INFINITY } else { deviation });
        }
    }
}

impl Drop for Worst {
    fn drop(&mut self) {
        for (name, deviation) in &self.0 {
            println!("{name}: {deviation:.1e}");
        }
    }
}

#[test]
fn thousand_tables_match_reference() {
    let mut worst = Worst::default();
    let mut count = 0;
    for row in rows(include_str!("data/tables.csv")) {
        let columns: Vec<Vec<f64>> = row[0].split('|').map(numbers).collect();
        let (a, b, side) = (&columns[0], &columns[1], side(row[1]));
        let zeros = match row[2] {
            "wilcox" => Zeros::Drop,
            "pratt" => Zeros::Pratt,
            _ => Zeros::Split,
        };

        let d = describe(a).unwrap();
        let [q1, q3] = d.quartiles;
        let [low, high] = d.whiskers;
        let got = [d.mean, d.deviation.unwrap(), d.median, q1, q3, low, high];
        worst.figures("describe", &got, &numbers(row[3]));
        worst.figures("outliers", &d.outliers, &numbers(row[4]));
        if let [z, p] = numbers(row[5])[..] {
            let test = skewness_test(a, side).unwrap();
            worst.figures("skewness z", &[test.statistic], &[z]);
            worst.p("skewness p", test.p, p);
        }

        let signed = differences(a, b).unwrap();
        let test = |method| wilcoxon(&signed, side, zeros, method).unwrap();
        let expected = numbers(row[7]);
        worst.figures("signed-rank statistic", &[test(Method::Exact).statistic], &numbers(row[6]));
        worst.p("signed-rank p, exact", test(Method::Exact).p, expected[0]);
        worst.p("signed-rank p, normal", test(Method::Normal { corrected: false }).p, expected[1]);
        worst.p("signed-rank p, corrected", test(Method::Normal { corrected: true }).p, expected[2]);
        worst.p("signed-rank p, automatic", test(Method::Auto { corrected: true }).p, expected[3]);
        if let [p] = numbers(row[8])[..] {
            worst.p("signed-rank p, exact with ties", test(Method::ExactWithTies).p, p);
        }
        let effects = [common_language_effect(a, b).unwrap().size, rank_biserial(a, b).unwrap().size];
        worst.figures("effects", &effects, &numbers(row[9]));

        let people: Vec<Vec<f64>> =
            (0..a.len()).map(|person| columns.iter().map(|c| c[person]).collect()).collect();
        let f = friedman(&people).unwrap();
        let expected = numbers(row[10]);
        let Variant::FriedmanF { freedom: [first, second] } = f.f.variant else { panic!() };
        worst.figures(
            "friedman figures",
            &[f.chi_square.statistic, f.w, f.f.statistic, first, second],
            &[expected[0], expected[2], expected[3], expected[4], expected[5]],
        );
        worst.p("friedman p, chi-square", f.chi_square.p, expected[1]);
        worst.p("friedman p, F", f.f.p, expected[6]);
        count += 1;
    }
    assert_eq!(count, 1000);
}

#[test]
fn proportions_match_reference() {
    let mut worst = Worst::default();
    for row in rows(include_str!("data/proportions.csv")) {
        let (k, n) = (row[0].parse().unwrap(), row[1].parse().unwrap());
        let test = binomial_test(k, n, row[2].parse().unwrap(), side(row[3])).unwrap();
        worst.p("binomial p", test.p, row[4].parse().unwrap());
        let wilson = wilson_interval(k, n, row[5].parse().unwrap()).unwrap();
        worst.figures("wilson", &[wilson.low, wilson.high], &numbers(row[6]));
    }
}

#[test]
fn adjusted_p_values_match_reference() {
    let mut worst = Worst::default();
    for row in rows(include_str!("data/corrections.csv")) {
        let p = numbers(row[0]);
        for (correction, cell) in [(Correction::Bonferroni, row[1]), (Correction::Holm, row[2])] {
            let adjusted = adjust(&p, correction);
            assert_eq!(adjusted.excluded, p.iter().filter(|v| v.is_nan()).count());
            for (got, expected) in adjusted.p.iter().zip(numbers(cell)) {
                assert_eq!(got.is_none(), expected.is_nan());
                got.inspect(|&p| worst.p("adjusted p", p, expected));
            }
        }
    }
}

#[test]
fn preferences_match_reference() {
    let mut worst = Worst::default();
    for row in rows(include_str!("data/preferences.csv")) {
        let items: usize = row[0].parse().unwrap();
        let wins = numbers(row[1]);
        let wins: Vec<&[f64]> = wins.chunks(items).collect();
        let fit = bradley_terry(&wins, Estimator::MaximumLikelihood).unwrap();
        worst.figures("abilities", &fit.abilities, &numbers(row[2]));
        worst.figures("covariance", &fit.covariance.concat(), &numbers(row[3]));
        let ratio = numbers(row[4]);
        worst.figures("likelihood ratio", &[fit.equality.statistic], &ratio[..1]);
        worst.p("likelihood ratio p", fit.equality.p, ratio[1]);
        let penalised = bradley_terry(&wins, Estimator::Penalised).unwrap();
        worst.figures("penalised abilities", &penalised.abilities, &numbers(row[5]));
        worst.figures("penalised covariance", &penalised.covariance.concat(), &numbers(row[6]));
    }
}
