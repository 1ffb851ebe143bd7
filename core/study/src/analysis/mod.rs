//! Figures of a study: descriptions of the answers, declared tests, thresholds.

mod inference;
mod markdown;
mod pictures;
mod report;
#[cfg(test)]
mod tests;
mod thresholds;

use std::collections::{BTreeMap, BTreeSet};

use asperity_statistics::{
    Alternative, Error, Interval, describe, mean_interval, median_interval, skewness_test, wilson_interval,
};
use serde::Serialize;

use crate::file::{Experiment, Part};
use crate::log::Event;
use crate::question::{Answer, Question, QuestionKind};
use crate::table::{Row, Session, Table};

pub use inference::{Ability, Finding, PValue, Tested};
pub use thresholds::{Condition, Threshold, Thresholds};

/// Probability that an interval holds the true value.
const CONFIDENCE: f64 = 0.95;
/// Screening of raters (ITU-R BS.1534-3, 4.1.2): the lowest rating of a hidden reference that they knew, and
/// the largest share of lower ones.
const KNOWN: f64 = 90.0;
const UNKNOWN_SHARE: f64 = 0.15;

/// Figures of a study, as plain data. [`report`](Self::report) writes them for people.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Analysis {
    /// Title of the study.
    pub title: String,
    /// Seed of all orders and sides.
    pub seed: u64,
    /// Planned number of participants.
    pub planned: u32,
    /// Participants with their counts.
    pub participants: Vec<Participant>,
    /// Showings that do not count.
    pub excluded: Vec<Excluded>,
    /// Remarks of the experimenter.
    pub notes: Vec<Note>,
    /// Differences between the participants' sessions, in sentences.
    pub warnings: Vec<String>,
    /// Parts, in their order.
    pub parts: Vec<PartFigures>,
    /// Questions of the survey.
    pub survey: Vec<Asked>,
}

/// A participant's counts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Participant {
    /// Code of the participant.
    pub code: String,
    /// Trials with answers.
    pub answered: usize,
    /// Trials still to answer.
    pub unanswered: usize,
    /// Showings that do not count.
    pub excluded: usize,
}

/// A showing of a trial that does not count.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Excluded {
    /// Code of the participant.
    pub participant: String,
    /// Name of the part.
    pub part: String,
    /// Number of the trial in the plan, from 0.
    pub trial: usize,
    /// Reason.
    pub why: String,
}

/// A remark of the experimenter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Note {
    /// Code of the participant.
    pub participant: String,
    /// Number of the trial under way.
    pub trial: Option<usize>,
    /// The remark.
    pub text: String,
}

/// Figures of a part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PartFigures {
    /// Name of the part.
    pub name: String,
    /// Planned trials of each participant; an adaptive method may take fewer.
    pub trials: usize,
    /// Names of the factors that vary, each with its levels.
    pub factors: Vec<(String, Vec<String>)>,
    /// Labels of the kinds of trials.
    pub kinds: Vec<String>,
    /// Questions with their figures.
    pub asked: Vec<Asked>,
    /// Declared tests.
    pub tests: Vec<Tested>,
}

/// A question with its figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Asked {
    /// Name of the question.
    pub name: String,
    /// Its text on the screen.
    pub text: String,
    /// The figures.
    pub figures: Figures,
}

/// Figures of the answers to a question.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Figures {
    /// Of a scale or of sliders.
    Numbers {
        /// Ends of the scale.
        range: [f64; 2],
        /// Labels of the ends.
        labels: [String; 2],
        /// Whether cells are stimuli of sliders. Those of a scale are kinds of trials.
        of_stimuli: bool,
        /// Samples, by cell.
        cells: Vec<Cell>,
        /// Answers of each number of a scale, over all cells.
        counts: Vec<(i64, usize)>,
        /// Screening by the hidden reference of sliders.
        screening: Option<Screening>,
    },
    /// Of *which* and of *same or different*.
    Shares(Vec<Share>),
    /// Of a question that judges a varied parameter.
    Thresholds(Thresholds),
    /// Free texts that are not blank.
    Texts(Vec<Told>),
}

/// Screening of raters by a hidden reference, as in MUSHRA.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Screening {
    /// The stimulus that is the reference, and also among those to rate.
    pub reference: String,
    /// People whose ratings are left out: code, ratings of the hidden reference below 90, and all of them.
    pub left_out: Vec<(String, usize, usize)>,
}

/// Sample of a cell: one value a person, the mean of their answers there.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// Level of each factor of the part.
    pub levels: Vec<String>,
    /// Kind of trial, or stimulus of a slider.
    pub kind: String,
    /// People without an answer there.
    pub missing: usize,
    /// The sample; `None` without answers.
    pub summary: Option<Summary>,
    /// Z and p of the two-sided skewness test (D'Agostino 1970).
    pub skewness: Option<[f64; 2]>,
    /// Reason for no skewness test.
    pub why: Option<String>,
}

/// Description of a sample.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Number of values.
    pub n: usize,
    /// Mean.
    pub mean: f64,
    /// 95 % interval of the mean (Student's t); `None` for one value.
    pub mean_95: Option<[f64; 2]>,
    /// Sample standard deviation; `None` for one value.
    pub sd: Option<f64>,
    /// Median.
    pub median: f64,
    /// 95 % interval of the median, between two of the values; `None` for fewer than six.
    pub median_95: Option<[f64; 2]>,
    /// Lower and upper quartile.
    pub quartiles: [f64; 2],
    /// Ends of the whiskers (Tukey 1977).
    pub whiskers: [f64; 2],
    /// Values outside the whiskers.
    pub outliers: Vec<f64>,
}

/// Share of an answer among all answers of a cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Share {
    /// Level of each factor of the part.
    pub levels: Vec<String>,
    /// Kind of trial.
    pub kind: String,
    /// The stimulus that was chosen, or `different`.
    pub of: String,
    /// Number of these answers.
    pub count: usize,
    /// Number of all answers.
    pub n: usize,
    /// The share, and the ends of its 95 % interval (Wilson 1927). `None` without answers.
    pub share: Option<[f64; 3]>,
    /// Share by chance, one over the number of stimuli; `None` for *same or different*.
    pub chance: Option<f64>,
}

/// A free text.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Told {
    /// Code of the participant.
    pub participant: String,
    /// Levels and kind of the trial; empty in the survey.
    pub about: Vec<String>,
    /// The text.
    pub text: String,
}

impl Analysis {
    /// Figures of the answers of a table. Sessions give remarks and versions; none are needed for the rest.
    pub fn new(experiment: &Experiment, table: &Table, sessions: &[Session]) -> Self {
        let mut it = Self {
            title: experiment.title.clone(),
            seed: experiment.seed,
            planned: experiment.participants,
            participants: participants(table),
            excluded: excluded(experiment, table),
            notes: Vec::new(),
            warnings: warnings(experiment, sessions),
            parts: experiment.parts.iter().map(|part| part_figures(experiment, table, part)).collect(),
            survey: experiment.survey.iter().map(|question| survey_figures(table, question)).collect(),
        };
        for session in sessions {
            it.notes.extend(session.events.iter().filter_map(|event| match event {
                Event::Note { text, trial } => {
                    let (participant, text) = (session.participant.clone(), text.clone());
                    Some(Note { participant, trial: *trial, text })
                }
                _ => None,
            }));
        }
        it
    }

    /// The p-value of each declared test in each cell.
    ///
    /// Post-hoc pairs are listed also where they were not made. Names are distinct. They are the same for all
    /// tables of an experiment.
    pub fn p_values(&self) -> Vec<PValue> {
        let of = |part: &PartFigures| {
            let name = part.name.clone();
            part.tests.iter().flat_map(|test| test.p_values(&name)).collect::<Vec<_>>()
        };
        let mut found: Vec<PValue> = self.parts.iter().flat_map(of).collect();
        let mut seen: BTreeMap<String, u32> = BTreeMap::new();
        for value in &mut found {
            let count = seen.entry(value.name.clone()).or_default();
            *count += 1;
            if *count > 1 {
                value.name += &format!(" ({count})");
            }
        }
        found
    }
}

/// Codes of a table's participants.
fn people(table: &Table) -> BTreeSet<&str> {
    table.participants.iter().map(|(code, _)| code.as_str()).collect()
}

fn participants(table: &Table) -> Vec<Participant> {
    let one = |(code, unanswered): &(String, usize)| {
        let own = table.rows.iter().filter(|row| row.participant == *code && !row.part.is_empty());
        let answered = own.map(|row| row.trial).collect::<BTreeSet<_>>().len();
        let excluded = table.excluded.iter().filter(|(who, ..)| who == code).count();
        Participant { code: code.clone(), answered, unanswered: *unanswered, excluded }
    };
    table.participants.iter().map(one).collect()
}

fn excluded(experiment: &Experiment, table: &Table) -> Vec<Excluded> {
    // All participants have the same number of trials in a part.
    let trials = if table.excluded.is_empty() { Vec::new() } else { experiment.trials(1) };
    let one = |(participant, trial, why): &(String, usize, String)| {
        let part = trials.get(*trial).map(|trial| experiment.parts[trial.part].name.clone());
        Excluded {
            participant: participant.clone(),
            part: part.unwrap_or_default(),
            trial: *trial,
            why: why.clone(),
        }
    };
    table.excluded.iter().map(one).collect()
}

fn warnings(experiment: &Experiment, sessions: &[Session]) -> Vec<String> {
    let mut versions = BTreeSet::new();
    let mut files: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for event in sessions.iter().flat_map(|session| &session.events) {
        if let Event::Begin { version, files: used, .. } = event {
            versions.insert(version.as_str());
            used.iter().for_each(|(path, hash)| _ = files.entry(path).or_default().insert(hash));
        }
    }
    let mut told = Vec::new();
    if versions.len() > 1 {
        let all = versions.into_iter().collect::<Vec<_>>().join(", ");
        told.push(format!("The sessions ran on several versions of the program: {all}."));
    }
    for (path, _) in files.iter().filter(|(_, hashes)| hashes.len() > 1) {
        told.push(format!("The file {path} changed between sessions."));
    }
    let [unfelt, answered] = sessions
        .iter()
        .map(|session| unfelt(experiment, session))
        .fold([0; 2], |[a, b], [c, d]| [a + c, b + d]);
    if unfelt > 0 {
        told.push(format!("In {unfelt} of {answered} answered trials, not every stimulus was played."));
    }
    told
}

/// Answered trials of which a stimulus was never under the stylus, and all. Simulated people feel nothing.
fn unfelt(experiment: &Experiment, session: &Session) -> [usize; 2] {
    let trials = experiment.trials(session.number);
    let (mut places, mut counts) = (BTreeSet::new(), [0; 2]);
    if !session.events.iter().any(|event| matches!(event, Event::Inputs { .. })) {
        return counts;
    }
    for event in &session.events {
        match event {
            Event::Shown { .. } => places.clear(),
            Event::Stimulus { place: Some(place), .. } => _ = places.insert(*place),
            Event::Answered { trial, .. } => {
                let all = trials.get(*trial).map_or(0, |trial| trial.places.len());
                counts[0] += usize::from((0..all).any(|place| !places.contains(&place)));
                counts[1] += 1;
            }
            _ => (),
        }
    }
    counts
}

fn part_figures(experiment: &Experiment, table: &Table, part: &Part) -> PartFigures {
    let levels = |(factor, levels): &(usize, Vec<usize>)| {
        let factor = &experiment.factors[*factor];
        (factor.name.clone(), levels.iter().map(|level| factor.levels[*level].clone()).collect())
    };
    PartFigures {
        name: part.name.clone(),
        trials: part.conditions().len() * part.count_of_each() as usize,
        factors: part.over.iter().map(levels).collect(),
        kinds: (0..part.show.len()).map(|kind| part.label(kind, &experiment.stimuli)).collect(),
        asked: part.ask.iter().map(|question| asked(experiment, table, part, question)).collect(),
        tests: part.tests.iter().map(|test| inference::tested(experiment, table, part, test)).collect(),
    }
}

fn asked(experiment: &Experiment, table: &Table, part: &Part, question: &Question) -> Asked {
    let all: Vec<usize> = part.over.iter().map(|(factor, _)| *factor).collect();
    let key = |row: &Row| levels_of(experiment, &all, row);
    let with = |names: Vec<String>| -> Vec<(Vec<String>, String)> {
        let cells = cells(experiment, part, &all);
        cells.iter().flat_map(|cell| names.iter().map(|name| (cell.clone(), name.clone()))).collect()
    };
    let figures = match &question.kind {
        QuestionKind::Which | QuestionKind::Same if part.vary.is_some() => {
            Figures::Thresholds(thresholds::thresholds(experiment, table, part, question))
        }
        QuestionKind::Scale { from, to, low, high } => {
            let kinds = (0..part.show.len()).map(|kind| part.label(kind, &experiment.stimuli)).collect();
            let means = table.means(&part.name, &question.name, |row| Some((key(row)?, row.kind.clone())));
            Figures::Numbers {
                range: [*from as f64, *to as f64],
                labels: [low.clone(), high.clone()],
                of_stimuli: false,
                cells: samples(people(table).len(), &means, with(kinds)),
                counts: counts(table, &part.name, question, *from..=*to),
                screening: None,
            }
        }
        QuestionKind::Sliders { low, high } => {
            let shown = stimuli(experiment, part);
            let screening = screening(experiment, table, part, question);
            let left_out: Vec<&str> =
                screening.iter().flat_map(|s| &s.left_out).map(|(who, ..)| who.as_str()).collect();
            let means = table.means(&part.name, &question.name, |row| {
                let counts = !left_out.contains(&row.participant.as_str());
                counts.then_some((key(row)?, row.about.clone()?))
            });
            Figures::Numbers {
                range: [0.0, 100.0],
                labels: [low.clone(), high.clone()],
                of_stimuli: true,
                cells: samples(people(table).len() - left_out.len(), &means, with(shown)),
                counts: Vec::new(),
                screening,
            }
        }
        QuestionKind::Which | QuestionKind::Same => {
            let mut shares = Vec::new();
            for cell in cells(experiment, part, &all) {
                for (kind, shown) in part.show.iter().enumerate() {
                    let label = part.label(kind, &experiment.stimuli);
                    let answers = rows(table, &part.name, &question.name)
                        .filter(|row| row.kind == label && key(row).as_ref() == Some(&cell));
                    let answers: Vec<&Answer> = answers.map(|row| &row.answer).collect();
                    let share = |of: &str, wanted: Answer, chance| {
                        let count = answers.iter().filter(|answer| ***answer == wanted).count();
                        let wilson = wilson_interval(count, answers.len(), CONFIDENCE).ok();
                        Share {
                            levels: cell.clone(),
                            kind: label.clone(),
                            of: of.to_owned(),
                            count,
                            n: answers.len(),
                            share: wilson.map(|w| [w.estimate, w.low, w.high]),
                            chance,
                        }
                    };
                    if question.kind == QuestionKind::Same {
                        shares.push(share("different", Answer::Same(false), None));
                        continue;
                    }
                    let names = || shown.iter().map(|s| experiment.stimuli[*s].name.as_str());
                    for of in pictures::distinct(names()) {
                        let chance = names().filter(|name| *name == of).count() as f64 / shown.len() as f64;
                        shares.push(share(of, Answer::Stimulus(of.into()), Some(chance)));
                    }
                }
            }
            Figures::Shares(shares)
        }
        QuestionKind::Text => texts(table, &part.name, question),
    };
    Asked { name: question.name.clone(), text: question.text.clone(), figures }
}

fn survey_figures(table: &Table, question: &Question) -> Asked {
    let figures = match &question.kind {
        QuestionKind::Scale { from, to, low, high } => {
            let means = table.means("", &question.name, |_| Some((Vec::new(), String::new())));
            Figures::Numbers {
                range: [*from as f64, *to as f64],
                labels: [low.clone(), high.clone()],
                of_stimuli: false,
                cells: samples(people(table).len(), &means, vec![(Vec::new(), String::new())]),
                counts: counts(table, "", question, *from..=*to),
                screening: None,
            }
        }
        // The other kinds of questions are about stimuli, and a survey shows none.
        _ => texts(table, "", question),
    };
    Asked { name: question.name.clone(), text: question.text.clone(), figures }
}

fn rows<'a>(table: &'a Table, part: &'a str, question: &'a str) -> impl Iterator<Item = &'a Row> {
    table.rows.iter().filter(move |row| row.part == part && row.question == question)
}

/// Names of a part's stimuli, each once, in the order of the file.
fn stimuli(experiment: &Experiment, part: &Part) -> Vec<String> {
    let shown: BTreeSet<usize> = part.show.iter().flatten().copied().collect();
    shown.into_iter().map(|s| experiment.stimuli[s].name.clone()).collect()
}

/// Every combination of levels of some of a part's factors; one empty combination without factors.
fn cells(experiment: &Experiment, part: &Part, factors: &[usize]) -> Vec<Vec<String>> {
    let mut cells = vec![Vec::new()];
    for factor in factors {
        let levels = part.over.iter().find(|(of, _)| of == factor).map_or(&[][..], |(_, levels)| levels);
        let names = || levels.iter().map(|level| experiment.factors[*factor].levels[*level].clone());
        let with = |cell: &Vec<String>| names().map(|n| [cell.clone(), vec![n]].concat()).collect::<Vec<_>>();
        cells = cells.iter().flat_map(with).collect();
    }
    cells
}

/// Levels of some factors in a row.
fn levels_of(experiment: &Experiment, factors: &[usize], row: &Row) -> Option<Vec<String>> {
    factors.iter().map(|f| row.level_of(&experiment.factors[*f].name).map(str::to_owned)).collect()
}

/// Means of each participant, by levels and kind.
type Means = BTreeMap<String, BTreeMap<(Vec<String>, String), f64>>;

fn samples(people: usize, means: &Means, cells: Vec<(Vec<String>, String)>) -> Vec<Cell> {
    let one = |key: (Vec<String>, String)| {
        let values: Vec<f64> = means.values().filter_map(|of| of.get(&key)).copied().collect();
        let tested = skewness_test(&values, Alternative::TwoSided);
        Cell {
            levels: key.0,
            kind: key.1,
            missing: people.saturating_sub(values.len()),
            summary: summary(&values),
            skewness: tested.as_ref().ok().map(|outcome| [outcome.statistic, outcome.p]),
            why: tested.err().map(|e| e.to_string()),
        }
    };
    cells.into_iter().map(one).collect()
}

/// People who did not know the hidden reference. `None` where the reference is not among the stimuli to rate.
fn screening(experiment: &Experiment, table: &Table, part: &Part, question: &Question) -> Option<Screening> {
    let reference = part.reference.filter(|it| part.show.iter().flatten().any(|shown| shown == it))?;
    let reference = experiment.stimuli[reference].name.clone();
    let mut ratings: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for row in rows(table, &part.name, &question.name).filter(|row| row.about.as_ref() == Some(&reference)) {
        let (low, all) = ratings.entry(&row.participant).or_default();
        *low += usize::from(row.answer.number().is_some_and(|x| x < KNOWN));
        *all += 1;
    }
    let fails = |(who, (low, all)): (&str, (usize, usize))| {
        (low as f64 > UNKNOWN_SHARE * all as f64).then(|| (who.to_owned(), low, all))
    };
    let left_out = ratings.into_iter().filter_map(fails).collect();
    Some(Screening { reference, left_out })
}

fn summary(values: &[f64]) -> Option<Summary> {
    let d = describe(values).ok()?;
    let ends = |interval: Result<Interval, Error>| interval.ok().map(|i| [i.low, i.high]);
    Some(Summary {
        n: d.n,
        mean: d.mean,
        mean_95: ends(mean_interval(values, CONFIDENCE)),
        sd: d.deviation,
        median: d.median,
        median_95: ends(median_interval(values, CONFIDENCE)),
        quartiles: d.quartiles,
        whiskers: d.whiskers,
        outliers: d.outliers,
    })
}

fn counts(
    table: &Table,
    part: &str,
    question: &Question,
    range: std::ops::RangeInclusive<i64>,
) -> Vec<(i64, usize)> {
    let mut counts: Vec<(i64, usize)> = range.map(|number| (number, 0)).collect();
    for row in rows(table, part, &question.name) {
        if let Answer::Number(n) = row.answer
            && let Some((_, count)) = counts.iter_mut().find(|(number, _)| *number == n)
        {
            *count += 1;
        }
    }
    counts
}

fn texts(table: &Table, part: &str, question: &Question) -> Figures {
    let one = |row: &Row| match &row.answer {
        Answer::Text(text) if !text.trim().is_empty() => Some(Told {
            participant: row.participant.clone(),
            about: row.levels.iter().map(|(_, level)| level.clone()).chain([row.kind.clone()]).collect(),
            text: text.clone(),
        }),
        _ => None,
    };
    Figures::Texts(rows(table, part, &question.name).filter_map(one).collect())
}
