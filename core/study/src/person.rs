//! A simulated participant: answers by chance, from a stated model.

use std::collections::BTreeMap;

use asperity_diagnostics::Diagnostic;
use asperity_diagnostics::ron::Value;
use asperity_numbers::random::seed_of;
use asperity_numbers::{Elementary as _, Random};
use asperity_psychometrics::Function;

use crate::file::Experiment;
use crate::log::Event;
use crate::method;
use crate::plan::Trial;
use crate::progress::Progress;
use crate::question::{Question, QuestionKind};
use crate::{Answer, Session};

/// Model of a person's answers. Without one, every answer is drawn as if all stimuli felt alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Person {
    /// Strength of a stimulus in *which*: `a` is chosen over `b` with odds exp(a - b) (Luce 1959).
    pub preference: BTreeMap<String, f64>,
    /// Mean answer to a scale or slider, by question, then by kind of trial or stimulus.
    pub ratings: BTreeMap<String, BTreeMap<String, f64>>,
    /// Standard deviation of a rating about the person's own mean, before rounding.
    pub spread: f64,
    /// Standard deviation of people's own means about the model's.
    pub between: f64,
    /// Probability of naming the varied stimulus, or a difference, by level.
    pub function: Option<Function>,
}

impl Default for Person {
    fn default() -> Self {
        let (preference, ratings) = (BTreeMap::new(), BTreeMap::new());
        Self { preference, ratings, spread: 1.2, between: 0.5, function: None }
    }
}

impl Person {
    pub(crate) fn read(value: &Value) -> Result<Self, Diagnostic> {
        let mut record = value.record("Person")?;
        let default = Self::default();
        let numbers = |v: &Value| {
            let one = |(key, v): &(asperity_diagnostics::ron::Key, Value)| Ok((key.name.clone(), v.f64()?));
            v.map()?.iter().map(one).collect::<Result<BTreeMap<_, _>, Diagnostic>>()
        };
        let ratings = |v: &Value| {
            let one =
                |(key, v): &(asperity_diagnostics::ron::Key, Value)| Ok((key.name.clone(), numbers(v)?));
            v.map()?.iter().map(one).collect::<Result<BTreeMap<_, _>, Diagnostic>>()
        };
        let it = Self {
            preference: record.optional("preference").map_or(Ok(BTreeMap::new()), numbers)?,
            ratings: record.optional("ratings").map_or(Ok(BTreeMap::new()), ratings)?,
            spread: record.optional("spread").map_or(Ok(default.spread), |v| v.f64_in(0.0..=100.0, ""))?,
            between: record.optional("between").map_or(Ok(default.between), |v| v.f64_in(0.0..=100.0, ""))?,
            function: record.optional("function").map(method::function).transpose()?,
        };
        record.finish()?;
        Ok(it)
    }

    /// A whole session of a simulated participant. The same seed gives the same answers.
    pub fn session(&self, experiment: &Experiment, number: u32, seed: u64) -> Session {
        let mut random = Random::new(seed_of(seed, &number.to_string()));
        let participant = format!("P{number:02}");
        let mut own = BTreeMap::new();
        let mut events = Vec::new();
        let mut progress = Progress::new(experiment, number);
        while let Some(step) = progress.step() {
            let trial = progress.trials()[step.number].clone();
            let part = &experiment.parts[trial.part];
            let mut answers = Vec::new();
            for question in &part.ask {
                let judges = part.judging().is_some_and(|q| q.name == question.name);
                let answer = match (judges, step.level, &self.function) {
                    (true, Some(level), Some(function)) => {
                        let hit = random.chance(function.probability(level));
                        judged(experiment, &trial, question, hit, &mut random)
                    }
                    _ => self.answer(experiment, &trial, question, &mut own, &mut random),
                };
                answers.push((question.name.clone(), answer));
            }
            progress.answer(&answers);
            let seconds = part.trial_s * (0.3 * random.normal()).exp_e();
            events.push(Event::Answered { trial: step.number, answers, seconds });
        }
        if !experiment.survey.is_empty() {
            let nothing = Trial {
                part: 0,
                cell: Vec::new(),
                kind: 0,
                places: Vec::new(),
                level: None,
                track: None,
                after_break: false,
            };
            let answers = experiment.survey.iter().map(|question| {
                let answer = self.answer(experiment, &nothing, question, &mut own, &mut random);
                (question.name.clone(), answer)
            });
            events.push(Event::Survey { answers: answers.collect() });
        }
        events.push(Event::End);
        Session { participant, number, events }
    }

    fn answer(
        &self,
        experiment: &Experiment,
        trial: &Trial,
        question: &Question,
        own: &mut BTreeMap<String, f64>,
        random: &mut Random,
    ) -> Answer {
        let names: Vec<&str> = trial.places.iter().map(|s| experiment.stimuli[*s].name.as_str()).collect();
        let mut rating = |about: &str, middle: f64, random: &mut Random| {
            let mean = self.ratings.get(&question.name).and_then(|of| of.get(about)).copied();
            let bias = *own.entry(question.name.clone()).or_insert_with(|| self.between * random.normal());
            mean.unwrap_or(middle) + bias + self.spread * random.normal()
        };
        match &question.kind {
            QuestionKind::Scale { from, to, .. } => {
                let part = experiment.parts.get(trial.part).filter(|_| !names.is_empty());
                let about = part.map_or(String::new(), |part| part.label(trial.kind, &experiment.stimuli));
                let x = rating(&about, (from + to) as f64 / 2.0, random);
                Answer::Number((x.round() as i64).clamp(*from, *to))
            }
            QuestionKind::Sliders { .. } => {
                let one = |name: &&str| ((*name).to_owned(), rating(name, 50.0, random).clamp(0.0, 100.0));
                Answer::Numbers(names.iter().map(one).collect())
            }
            QuestionKind::Which => {
                let weight = |name: &str| self.preference.get(name).copied().unwrap_or(0.0).exp_e();
                let mut left = random.unit() * names.iter().map(|name| weight(name)).sum::<f64>();
                let chosen = names.iter().find(|name| {
                    left -= weight(name);
                    left < 0.0
                });
                Answer::Stimulus((*chosen.or(names.last()).unwrap_or(&"")).to_owned())
            }
            QuestionKind::Same => Answer::Same(random.chance(0.5)),
            QuestionKind::Text => Answer::Text(String::new()),
        }
    }
}

/// The answer that names the varied stimulus or a difference, or another.
fn judged(
    experiment: &Experiment,
    trial: &Trial,
    question: &Question,
    hit: bool,
    random: &mut Random,
) -> Answer {
    if question.kind == QuestionKind::Same {
        return Answer::Same(!hit);
    }
    let varied = experiment.parts[trial.part].vary.as_ref().map(|vary| vary.stimulus);
    let others: Vec<usize> = trial.places.iter().copied().filter(|s| Some(*s) != varied).collect();
    let chosen = if hit { varied } else { others.get(random.below(others.len())).copied() };
    let name = |s: usize| experiment.stimuli[s].name.clone();
    Answer::Stimulus(chosen.or(varied).map_or(String::new(), name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Table;
    use crate::testing::experiment;

    #[test]
    fn ratings_have_the_means_of_the_model() {
        let study = experiment(
            "participants: 400,
            person: (ratings: {\"r\": {\"x\": 3.0, \"y\": 5.0}}, spread: 1.0, between: 0.5),",
            "show: [\"x\", \"y\"],
            ask: [scale(name: \"r\", text: \"?\", from: 1, to: 7, low: \"a\", high: \"b\")],",
        );
        let sessions: Vec<Session> = (1..=400).map(|n| study.person.session(&study, n, 3)).collect();
        let table = Table::new(&study, &sessions).unwrap();
        assert_eq!(table.rows.len(), 800);
        for (kind, mean) in [("x", 3.0), ("y", 5.0)] {
            let of: Vec<f64> =
                table.rows.iter().filter(|r| r.kind == kind).filter_map(|r| r.answer.number()).collect();
            let found = of.iter().sum::<f64>() / of.len() as f64;
            // Rounding and the ends of the scale pull it towards the middle a little.
            assert!((found - mean).abs() < 0.15, "{kind}: {found}");
        }
    }

    #[test]
    fn stimulus_is_chosen_with_the_odds_of_the_model() {
        let study = experiment(
            "person: (preference: {\"x\": 1.0986}),",
            "show: [(\"x\", \"y\")], repeats: 100, ask: [which(name: \"w\", text: \"?\")],",
        );
        let session = study.person.session(&study, 1, 9);
        let table = Table::new(&study, std::slice::from_ref(&session)).unwrap();
        let chosen = table.rows.iter().filter(|r| r.answer == Answer::Stimulus("x".into())).count();
        // Odds of 3 to 1, give or take three standard deviations.
        assert!((62..=88).contains(&chosen), "{chosen} of 100");
        assert_eq!(session, study.person.session(&study, 1, 9));
    }
}
