//! Declared tests.

use std::collections::{BTreeMap, BTreeSet};

use asperity_statistics::{
    Alternative, Correction, Error, Estimator, Method, Outcome, Zeros, adjust, binomial_test, bradley_terry,
    common_language_effect, differences, friedman, wilcoxon,
};
use serde::Serialize;

use super::{CONFIDENCE, Means, cells, levels_of, people, rows, stimuli};
use crate::file::{Experiment, Part};
use crate::question::Answer;
use crate::table::{Row, Table};
use crate::test::{Test, TestKind};

/// A declared test with its findings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tested {
    /// Name of the question.
    pub question: String,
    /// Name of the test.
    pub test: &'static str,
    /// Level of significance before a correction.
    pub alpha: f64,
    /// Factors whose levels are tested one by one.
    pub each: Vec<String>,
    /// Findings of the test, by cell and pair.
    pub findings: Vec<Finding>,
    /// Findings of the post-hoc pairs after Friedman's test, also of those that were not made.
    pub post_hoc: Vec<Finding>,
    /// Correction of the pairs' p-values.
    pub correction: Option<&'static str>,
    /// Number of pairs that were tested in this declaration: the family of the correction.
    pub made: usize,
    /// Bonferroni's cut-off: alpha over `made`.
    pub cut_off: Option<f64>,
    /// Abilities by the Bradley-Terry model.
    pub abilities: Vec<Ability>,
}

/// Finding of one test.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Finding {
    /// Level of each factor of `each`.
    pub levels: Vec<String>,
    /// The pair, or the chosen stimulus; empty for a test of all kinds.
    pub of: String,
    /// People that entered.
    pub people: usize,
    /// People left out: an answer that the test needs is missing.
    pub left_out: usize,
    /// Number of observations: people, differences that are not zero, or answers.
    pub n: usize,
    /// Differences of zero, left out.
    pub zeros: usize,
    /// Name and variant of the test.
    pub variant: String,
    /// Test statistic; infinite if all people rank alike.
    pub statistic: Option<f64>,
    /// p-value.
    pub p: Option<f64>,
    /// p-value after the correction.
    pub adjusted: Option<f64>,
    /// Effect size: Kendall's W, the common language effect size, or the share.
    pub effect: Option<f64>,
    /// Whether the p-value, after a correction, is below alpha.
    pub is_significant: bool,
    /// Reason for no p-value.
    pub why: Option<String>,
}

/// Ability of a stimulus.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ability {
    /// Level of each factor of `each`.
    pub levels: Vec<String>,
    /// The stimulus.
    pub stimulus: String,
    /// Comparisons that it won.
    pub wins: f64,
    /// All its comparisons.
    pub comparisons: f64,
    /// Ability on the log scale, and the ends of its 95 % interval.
    pub ability: [f64; 3],
}

/// A p-value of a declared test in a cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PValue {
    /// Part, question, test, pair and levels.
    pub name: String,
    /// p-value; after a correction, the adjusted one. `None` if the test was not made.
    pub p: Option<f64>,
    /// Whether it is below alpha.
    pub is_significant: bool,
}

/// Reason for no post-hoc test.
pub(super) const NOT_SIGNIFICANT: &str = "Friedman's test is not significant";

impl Tested {
    pub(super) fn p_values(&self, part: &str) -> Vec<PValue> {
        let name = |test: &str, finding: &Finding| {
            let mut name = format!("{part}, {}: {test}", self.question);
            for text in [finding.of.as_str()].into_iter().chain(finding.levels.iter().map(String::as_str)) {
                if !text.is_empty() {
                    name += &format!(", {text}");
                }
            }
            name
        };
        let of = |test: &str, finding: &Finding| PValue {
            name: name(test, finding),
            p: finding.adjusted.or(finding.p),
            is_significant: finding.is_significant,
        };
        let post_hoc = self.post_hoc.iter().map(|finding| of("post-hoc Wilcoxon", finding));
        self.findings.iter().map(|finding| of(self.test, finding)).chain(post_hoc).collect()
    }
}

pub(super) fn tested(experiment: &Experiment, table: &Table, part: &Part, test: &Test) -> Tested {
    let question = &part.ask[test.question].name;
    let all = Cells { experiment, table, part, test, question };
    let mut it = Tested {
        question: question.clone(),
        test: "",
        alpha: test.alpha,
        each: test.each.iter().map(|factor| experiment.factors[*factor].name.clone()).collect(),
        findings: Vec::new(),
        post_hoc: Vec::new(),
        correction: None,
        made: 0,
        cut_off: None,
        abilities: Vec::new(),
    };
    match &test.kind {
        TestKind::Friedman { pairs, correction } => {
            it.test = "Friedman";
            let means = all.means();
            for cell in all.cells() {
                let found = all.friedman(&means, &cell);
                let pair = |pair: &[usize; 2]| match found.is_significant {
                    true => all.pair(&means, &cell, *pair, Alternative::TwoSided),
                    false => Finding {
                        levels: cell.clone(),
                        of: all.pair_name(*pair),
                        why: Some(NOT_SIGNIFICANT.into()),
                        ..Finding::default()
                    },
                };
                it.post_hoc.extend(pairs.iter().map(pair));
                it.findings.push(found);
            }
            let mut family = std::mem::take(&mut it.post_hoc);
            it.correct(&mut family, *correction);
            it.post_hoc = family;
        }
        TestKind::Wilcoxon { pairs, alternative, correction } => {
            it.test = "Wilcoxon";
            let means = all.means();
            let in_cell = |cell: Vec<String>| {
                let one = |pair: &[usize; 2]| all.pair(&means, &cell, *pair, *alternative);
                pairs.iter().map(one).collect::<Vec<_>>()
            };
            let mut family: Vec<Finding> = all.cells().into_iter().flat_map(in_cell).collect();
            it.correct(&mut family, *correction);
            it.findings = family;
        }
        TestKind::Binomial { chosen, alternative } => {
            it.test = "Binomial";
            let chosen = &experiment.stimuli[*chosen].name;
            let one = |cell: Vec<String>| all.binomial(&cell, chosen, *alternative);
            it.findings = all.cells().into_iter().map(one).collect();
        }
        TestKind::BradleyTerry => {
            it.test = "Bradley-Terry";
            for cell in all.cells() {
                let (found, abilities) = all.bradley_terry(&cell);
                it.findings.push(found);
                it.abilities.extend(abilities);
            }
        }
    }
    it
}

impl Tested {
    /// Corrects the p-values of a family of tests. Tests that were not made do not count.
    fn correct(&mut self, family: &mut [Finding], correction: Correction) {
        let p: Vec<f64> = family.iter().map(|finding| finding.p.unwrap_or(f64::NAN)).collect();
        let adjusted = adjust(&p, correction);
        for (finding, p) in family.iter_mut().zip(adjusted.p) {
            finding.adjusted = p;
            finding.is_significant = p.is_some_and(|p| p < self.alpha);
        }
        self.made = adjusted.n;
        let bonferroni = correction == Correction::Bonferroni;
        self.correction = Some(if bonferroni { "Bonferroni" } else { "Holm" });
        self.cut_off = (bonferroni && self.made > 0).then(|| self.alpha / self.made as f64);
    }
}

/// The cells of a test.
struct Cells<'a> {
    experiment: &'a Experiment,
    table: &'a Table,
    part: &'a Part,
    test: &'a Test,
    question: &'a str,
}

impl Cells<'_> {
    fn cells(&self) -> Vec<Vec<String>> {
        cells(self.experiment, self.part, &self.test.each)
    }

    fn rows<'s>(&'s self, cell: &'s [String]) -> impl Iterator<Item = &'s Row> {
        let levels = |row: &Row| levels_of(self.experiment, &self.test.each, row);
        rows(self.table, &self.part.name, self.question)
            .filter(move |row| levels(row).as_deref() == Some(cell))
    }

    fn means(&self) -> Means {
        let by = |row: &Row| Some((levels_of(self.experiment, &self.test.each, row)?, row.kind.clone()));
        self.table.means(&self.part.name, self.question, by)
    }

    fn label(&self, kind: usize) -> String {
        self.part.label(kind, &self.experiment.stimuli)
    }

    fn pair_name(&self, [a, b]: [usize; 2]) -> String {
        format!("{} against {}", self.label(a), self.label(b))
    }

    /// Values of the people who answered all of some kinds, one row a person.
    fn complete(&self, means: &Means, cell: &[String], kinds: &[usize]) -> Vec<Vec<f64>> {
        let keys: Vec<_> = kinds.iter().map(|kind| (cell.to_vec(), self.label(*kind))).collect();
        let row = |of: &BTreeMap<_, f64>| keys.iter().map(|key| of.get(key).copied()).collect();
        means.values().filter_map(row).collect()
    }

    fn finding(&self, cell: &[String], people_in: usize) -> Finding {
        Finding {
            levels: cell.to_vec(),
            people: people_in,
            left_out: people(self.table).len().saturating_sub(people_in),
            n: people_in,
            ..Finding::default()
        }
    }

    fn friedman(&self, means: &Means, cell: &[String]) -> Finding {
        let kinds: Vec<usize> = (0..self.part.show.len()).collect();
        let complete = self.complete(means, cell, &kinds);
        let it = self.finding(cell, complete.len());
        let even: Vec<Vec<f64>> = complete.into_iter().map(|row| rounded(&row)).collect();
        match friedman(&even) {
            Ok(found) => Finding { effect: Some(found.w), ..it.with(&found.chi_square, self.test.alpha) },
            Err(e) => it.without(&e, "each person's answers are equal"),
        }
    }

    fn pair(&self, means: &Means, cell: &[String], pair: [usize; 2], alternative: Alternative) -> Finding {
        let complete = self.complete(means, cell, &pair);
        let (x, y): (Vec<f64>, Vec<f64>) = complete.iter().map(|row| (row[0], row[1])).unzip();
        let it = Finding { of: self.pair_name(pair), ..self.finding(cell, x.len()) };
        let test = || {
            let d = rounded(&differences(&x, &y)?);
            let exact = wilcoxon(&d, alternative, Zeros::Drop, Method::ExactWithTies);
            match exact {
                Err(Error::TooMany { .. }) => {
                    wilcoxon(&d, alternative, Zeros::Drop, Method::Normal { corrected: true })
                }
                other => other,
            }
        };
        match test() {
            Ok(found) => Finding {
                zeros: found.excluded,
                effect: common_language_effect(&rounded(&x), &rounded(&y)).ok().map(|effect| effect.size),
                ..it.with(&found, self.test.alpha)
            },
            Err(e) => Finding { zeros: x.len(), n: 0, ..it.without(&e, "all differences are zero") },
        }
    }

    fn binomial(&self, cell: &[String], chosen: &str, alternative: Alternative) -> Finding {
        let shown: Vec<&Row> =
            self.rows(cell).filter(|row| row.places.iter().any(|place| place == chosen)).collect();
        let who: BTreeSet<&str> = shown.iter().map(|row| row.participant.as_str()).collect();
        let it = Finding { of: chosen.into(), n: shown.len(), ..self.finding(cell, who.len()) };
        let places = |row: &&Row| {
            let own = row.places.iter().filter(|place| *place == chosen).count();
            (own, row.places.len())
        };
        let chances: BTreeSet<(usize, usize)> = shown.iter().map(places).collect();
        if chances.len() > 1 {
            let why = "trials show different numbers of stimuli, so chance differs";
            return Finding { why: Some(why.into()), ..it };
        }
        let chance = chances.first().map_or(0.5, |(own, all)| *own as f64 / *all as f64);
        let wins = shown.iter().filter(|row| row.answer == Answer::Stimulus(chosen.into())).count();
        match binomial_test(wins, shown.len(), chance, alternative) {
            Ok(found) => Finding {
                effect: Some(found.statistic),
                statistic: Some(wins as f64),
                ..it.with(&found, self.test.alpha)
            },
            Err(e) => it.without(&e, ""),
        }
    }

    fn bradley_terry(&self, cell: &[String]) -> (Finding, Vec<Ability>) {
        let items = stimuli(self.experiment, self.part);
        let at = |name: &str| items.iter().position(|item| item == name);
        let mut wins = vec![vec![0.0; items.len()]; items.len()];
        let mut who = BTreeSet::new();
        for row in self.rows(cell) {
            let Answer::Stimulus(chosen) = &row.answer else { continue };
            who.insert(row.participant.as_str());
            // Of three or more, the chosen one wins against each other one.
            for other in row.places.iter().filter(|place| *place != chosen) {
                if let (Some(winner), Some(loser)) = (at(chosen), at(other)) {
                    wins[winner][loser] += 1.0;
                }
            }
        }
        let it = self.finding(cell, who.len());
        let fitted = match bradley_terry(&wins, Estimator::MaximumLikelihood) {
            Err(Error::Unbounded { .. }) => bradley_terry(&wins, Estimator::Penalised),
            other => other,
        };
        let fit = match fitted {
            Ok(fit) => fit,
            Err(Error::Disconnected { items: apart }) => {
                let names: Vec<&str> = apart.iter().map(|i| items[*i].as_str()).collect();
                let why = format!("no comparison links {} to {}", names.join(", "), items[0]);
                return (Finding { why: Some(why), ..it }, Vec::new());
            }
            Err(e) => return (it.without(&e, ""), Vec::new()),
        };
        let ability = |(i, stimulus): (usize, &String)| {
            let won: f64 = wins[i].iter().sum();
            let lost: f64 = wins.iter().map(|row| row[i]).sum();
            let interval = fit.ability(i, CONFIDENCE).ok()?;
            Some(Ability {
                levels: cell.to_vec(),
                stimulus: stimulus.clone(),
                wins: won,
                comparisons: won + lost,
                ability: [interval.estimate, interval.low, interval.high],
            })
        };
        (it.with(&fit.equality, self.test.alpha), items.iter().enumerate().filter_map(ability).collect())
    }
}

impl Finding {
    fn with(self, found: &Outcome, alpha: f64) -> Self {
        Self {
            n: found.n,
            variant: found.variant.to_string(),
            statistic: Some(found.statistic),
            p: Some(found.p),
            is_significant: found.p < alpha,
            ..self
        }
    }

    fn without(self, error: &Error, flat: &str) -> Self {
        let why = match error {
            Error::NoVariation if !flat.is_empty() => flat.to_owned(),
            other => other.to_string(),
        };
        Self { why: Some(why), ..self }
    }
}

/// Values without the rounding errors of means, so that equal ones tie.
fn rounded(x: &[f64]) -> Vec<f64> {
    x.iter().map(|x| (x * 1e9).round() / 1e9).collect()
}
