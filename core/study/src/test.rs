//! Statistical tests that a part declares.

use asperity_diagnostics::ron::{Record, Value};
use asperity_diagnostics::{Diagnostic, Place, one_of};
use asperity_statistics::{Alternative, Correction};

use crate::file::{Factor, Part, Stimulus, variant, words};
use crate::question::QuestionKind;

/// A declared test of the answers to a question.
#[derive(Clone, Debug)]
pub struct Test {
    /// Index of the question in its part.
    pub question: usize,
    /// Factors whose levels are tested one by one, as indices. The answers of other factors' levels are
    /// averaged.
    pub each: Vec<usize>,
    /// Which test.
    pub kind: TestKind,
    /// Level of significance before a correction.
    pub alpha: f64,
    /// Its place in the file.
    pub place: Place,
}

/// Kinds of tests.
#[derive(Clone, Debug)]
pub enum TestKind {
    /// Friedman's test over the kinds of trials, then Wilcoxon's signed-rank test of pairs where it is
    /// significant.
    Friedman {
        /// Pairs of kinds of trials, as indices.
        pairs: Vec<[usize; 2]>,
        /// Correction of the pairs' p-values.
        correction: Correction,
    },
    /// Wilcoxon's signed-rank test of pairs of kinds of trials.
    Wilcoxon {
        /// Pairs of kinds of trials, as indices.
        pairs: Vec<[usize; 2]>,
        /// Side of the test.
        alternative: Alternative,
        /// Correction of the pairs' p-values.
        correction: Correction,
    },
    /// Exact binomial test that a stimulus is chosen as often as by chance.
    Binomial {
        /// Index of the stimulus.
        chosen: usize,
        /// Side of the test.
        alternative: Alternative,
    },
    /// Abilities of stimuli from paired preferences (Bradley and Terry 1952).
    BradleyTerry,
}

pub(crate) fn read(
    value: &Value,
    part: &Part,
    factors: &[Factor],
    stimuli: &[Stimulus],
) -> Result<Test, Diagnostic> {
    let name = variant(value, &["friedman", "wilcoxon", "binomial", "bradley_terry"])?;
    let mut record = value.record(name)?;
    let of = record.required("of")?;
    let asked = words(of)?;
    let names = || part.ask.iter().map(|q| q.name.as_str());
    let question = names().position(|name| name == asked).ok_or_else(|| {
        of.error(format!("this part asks no question `{asked}`")).help(one_of(&asked, names()))
    })?;
    let scale = matches!(part.ask[question].kind, QuestionKind::Scale { .. });
    let which = part.ask[question].kind == QuestionKind::Which;
    if if matches!(name, "friedman" | "wilcoxon") { !scale } else { !which } {
        let wanted = if which { "a `scale`" } else { "a `which`" };
        let wanted = if matches!(name, "friedman" | "wilcoxon") { "a `scale`" } else { wanted };
        return Err(of.error(format!("`{name}` tests the answers to {wanted}")));
    }
    let mut each = Vec::new();
    for v in record.optional("each").map_or(Ok(&[][..]), Value::list)? {
        let varies = part.over.iter().map(|(factor, _)| (*factor, factors[*factor].name.as_str()));
        let wanted = v.text()?;
        let Some((factor, _)) = varies.clone().find(|(_, name)| *name == wanted) else {
            let help = one_of(wanted, varies.map(|(_, name)| name));
            return Err(v.error(format!("no factor `{wanted}` varies in this part")).help(help));
        };
        each.push(factor);
    }
    let alpha = record.optional("alpha").map_or(Ok(0.05), |v| v.f64_in(1e-6..=0.5, ""))?;
    let kind = match name {
        "friedman" => {
            if part.show.len() < 3 {
                return Err(value
                    .error(format!(
                        "`friedman` compares three kinds of trials or more, and `show` has {}",
                        part.show.len()
                    ))
                    .help("wilcoxon(of: ...) compares two"));
            }
            TestKind::Friedman {
                pairs: pairs(&mut record, part, stimuli)?,
                correction: correction(&mut record)?,
            }
        }
        "wilcoxon" => TestKind::Wilcoxon {
            pairs: pairs(&mut record, part, stimuli)?,
            alternative: alternative(&mut record)?,
            correction: correction(&mut record)?,
        },
        "binomial" => {
            let chosen = record.required("chosen")?;
            let wanted = chosen.text()?;
            let shown = || part.show.iter().flatten().map(|s| stimuli[*s].name.as_str());
            let at = stimuli.iter().position(|s| s.name == wanted && shown().any(|name| name == wanted));
            let Some(at) = at else {
                let help = one_of(wanted, shown());
                return Err(chosen.error(format!("this part shows no stimulus `{wanted}`")).help(help));
            };
            TestKind::Binomial { chosen: at, alternative: alternative(&mut record)? }
        }
        _ => TestKind::BradleyTerry,
    };
    record.finish()?;
    Ok(Test { question, each, kind, alpha, place: value.place() })
}

/// Pairs of kinds of trials by their labels, such as `("NN-Real", "AR-Real")`; all pairs by default.
fn pairs(record: &mut Record<'_>, part: &Part, stimuli: &[Stimulus]) -> Result<Vec<[usize; 2]>, Diagnostic> {
    let labels: Vec<String> = (0..part.show.len()).map(|kind| part.label(kind, stimuli)).collect();
    let Some(listed) = record.optional("pairs") else {
        let from = |a: usize| (a + 1..labels.len()).map(move |b| [a, b]);
        return Ok((0..labels.len()).flat_map(from).collect());
    };
    let kind = |v: &Value| {
        let wanted = v.text()?;
        let at = labels.iter().position(|label| label == wanted);
        at.ok_or_else(|| {
            let help = one_of(wanted, labels.iter().map(String::as_str));
            v.error(format!("no kind of trial `{wanted}`")).help(help)
        })
    };
    let pair = |v: &Value| match v.list()? {
        [a, b] => Ok([kind(a)?, kind(b)?]),
        other => Err(v.error(format!("a pair of {}", other.len())).help("(\"first\", \"second\")")),
    };
    listed.list()?.iter().map(pair).collect()
}

fn alternative(record: &mut Record<'_>) -> Result<Alternative, Diagnostic> {
    let named = record.optional("alternative").map(|v| v.choice(&["two_sided", "greater", "less"]));
    Ok(match named.transpose()? {
        Some("greater") => Alternative::Greater,
        Some("less") => Alternative::Less,
        _ => Alternative::TwoSided,
    })
}

fn correction(record: &mut Record<'_>) -> Result<Correction, Diagnostic> {
    let named = record.optional("correction").map(|v| v.choice(&["bonferroni", "holm"]));
    Ok(match named.transpose()? {
        Some("holm") => Correction::Holm,
        _ => Correction::Bonferroni,
    })
}

impl Part {
    /// Label of a kind of trial: its stimuli, such as `NN-Real`.
    pub fn label(&self, kind: usize, stimuli: &[Stimulus]) -> String {
        let names: Vec<&str> = self.show[kind].iter().map(|s| stimuli[*s].name.as_str()).collect();
        names.join("-")
    }
}
