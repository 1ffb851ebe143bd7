//! The trials of a participant: they follow from file, seed and participant number alone.

use std::collections::BTreeMap;

use asperity_numbers::Random;
use asperity_numbers::random::seed_of;

use crate::file::{Experiment, Order, Part, Sides, Stimulus, StimulusKind};
use crate::method::Method;

/// Trials of a block in which sides are balanced, for each stimulus of a trial.
const BLOCK: usize = 4;

/// A planned trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Index of its part.
    pub part: usize,
    /// Levels of the part's factors: pairs of indices, in the order of `over`.
    pub cell: Vec<(usize, usize)>,
    /// Index of its kind in `show`.
    pub kind: usize,
    /// Stimuli from left to right, as indices.
    pub places: Vec<usize>,
    /// Level of the varied parameter, by the method of constant stimuli.
    pub level: Option<f64>,
    /// Number of its track, where an adaptive method chooses the level. A track ends early; its other
    /// trials are left out then.
    pub track: Option<usize>,
    /// Whether a break precedes it.
    pub after_break: bool,
}

impl Experiment {
    /// All trials of a participant, from 1.
    pub fn trials(&self, participant: u32) -> Vec<Trial> {
        (0..self.parts.len()).flat_map(|part| self.trials_of(part, participant)).collect()
    }

    /// Trials of a part.
    pub fn trials_of(&self, index: usize, participant: u32) -> Vec<Trial> {
        let part = &self.parts[index];
        let seed = seed_of(self.seed, &part.name);
        let mut own = Random::new(seed_of(seed, &participant.to_string()));
        let conditions = part.conditions();
        let orders = conditions_in_order(part, &conditions, participant, seed, &mut own);
        let mut turns = turns(part, &conditions, &orders, participant, seed, &mut own);
        let mut trials = Vec::new();
        for (at, level) in orders {
            let (cell, kind) = &conditions[at];
            let stimuli = &part.show[*kind];
            let mut places = stimuli.clone();
            // A real sample is where the experimenter mounts it.
            let is_real = |s: &usize| matches!(self.stimuli[*s].kind, StimulusKind::Real { .. });
            match part.sides {
                _ if stimuli.iter().any(is_real) => (),
                Sides::Fixed | Sides::Left | Sides::Right => (),
                Sides::Random => shuffle(&mut places, &mut own),
                Sides::Balanced => {
                    let key = (at, level.map(f64::to_bits));
                    let turn = turns.get_mut(&key).and_then(Vec::pop).unwrap_or(0);
                    places.rotate_left(turn % stimuli.len());
                }
            }
            let after_break =
                part.break_every.is_some_and(|n| !trials.is_empty() && trials.len() % n as usize == 0);
            let track = part.vary.as_ref().filter(|_| level.is_none()).map(|_| at);
            trials.push(Trial {
                part: index,
                cell: cell.clone(),
                kind: *kind,
                places,
                level,
                track,
                after_break,
            });
        }
        trials
    }

    /// Name of a level of a trial, by its factor.
    pub fn level(&self, trial: &Trial, factor: &str) -> Option<String> {
        let is_it = |(at, _): &&(usize, usize)| self.factors[*at].name == factor;
        let (at, level) = trial.cell.iter().find(is_it)?;
        Some(self.factors[*at].levels[*level].clone())
    }

    /// The stimulus at a place of a trial. The place of the reference follows the last.
    pub fn at_place(&self, trial: &Trial, place: usize) -> Option<usize> {
        let reference = self.parts[trial.part].reference.iter();
        trial.places.iter().chain(reference).nth(place).copied()
    }

    /// A stimulus of a trial, with the trial's levels filled in.
    pub fn shown(&self, trial: &Trial, stimulus: usize) -> StimulusKind {
        self.stimuli[stimulus].filled(&|factor| self.level(trial, factor))
    }

    /// Conditions that cannot be balanced with the planned number of participants, in sentences.
    pub fn imbalances(&self) -> Vec<String> {
        let mut found = Vec::new();
        for part in &self.parts {
            let (name, people) = (&part.name, self.participants);
            let conditions = part.conditions().len();
            if part.order == Order::LatinSquare {
                let rows = latin_rows(conditions);
                if !(people as usize).is_multiple_of(rows) {
                    found.push(format!(
                        "part `{name}`: {people} participants do not fill a Latin square of {rows} rows; \
                         take {} or {}",
                        (people as usize / rows * rows).max(rows),
                        people as usize / rows * rows + rows
                    ));
                }
            }
            let per_condition = people * part.count_of_each();
            let uneven =
                |kind: &&Vec<usize>| kind.len() > 1 && !per_condition.is_multiple_of(kind.len() as u32);
            if let (Sides::Balanced, Some(kind)) = (part.sides, part.show.iter().find(uneven)) {
                found.push(format!(
                    "part `{name}`: {per_condition} trials of each condition do not divide into {} orders of \
                     sides; one is shown once more",
                    kind.len()
                ));
            }
        }
        found
    }

    /// Likely mistakes in the model of a person, in sentences.
    pub fn doubts(&self) -> Vec<String> {
        let Some(function) = &self.person.function else { return Vec::new() };
        let mut found = Vec::new();
        for part in &self.parts {
            let Some(vary) = &part.vary else { continue };
            let (name, [low, high]) = (&part.name, vary.method.range());
            let threshold = function.threshold;
            if !(low..=high).contains(&threshold) {
                found.push(format!(
                    "part `{name}`: the threshold of `person` is {threshold}, and the levels are {low} to \
                     {high}"
                ));
            }
            let guess = vary.method.guess().filter(|guess| (guess - function.guess).abs() > 1e-6);
            if let Some(guess) = guess {
                let own = function.guess;
                found.push(format!(
                    "part `{name}`: `person` guesses with the probability {own}, and the part is analysed \
                     with {guess}"
                ));
            }
        }
        found
    }

    /// Estimated time of a participant in minutes.
    pub fn minutes(&self) -> f64 {
        let of = |(i, part): (usize, &Part)| self.trials_of(i, 1).len() as f64 * part.trial_s;
        self.parts.iter().enumerate().map(of).sum::<f64>() / 60.0
    }
}

impl Part {
    /// Every combination of levels with every kind of trial.
    pub fn conditions(&self) -> Vec<(Vec<(usize, usize)>, usize)> {
        let mut cells = vec![Vec::new()];
        for (factor, levels) in &self.over {
            let with = |cell: &Vec<(usize, usize)>| {
                let add = |level: &usize| [cell.as_slice(), &[(*factor, *level)]].concat();
                levels.iter().map(add).collect::<Vec<_>>()
            };
            cells = cells.iter().flat_map(with).collect();
        }
        let kinds = 0..self.show.len();
        cells.into_iter().flat_map(|cell| kinds.clone().map(move |kind| (cell.clone(), kind))).collect()
    }

    /// Trials of each condition, at most.
    pub fn count_of_each(&self) -> u32 {
        self.repeats
            * match self.vary.as_ref().map(|v| &v.method) {
                None => 1,
                Some(Method::Constant { levels, each, .. }) => levels.len() as u32 * each,
                Some(Method::Staircase(settings)) => settings.trials,
                Some(Method::Quest(settings)) => settings.trials,
            }
    }

    /// Whether the experimenter mounts a sample in it, and so a *wait* and *explore* sign is shown.
    pub fn has_real(&self, stimuli: &[Stimulus]) -> bool {
        let shown = self.show.iter().flatten().chain(&self.reference);
        shown.into_iter().any(|s| matches!(stimuli[*s].kind, StimulusKind::Real { .. }))
    }
}

/// Conditions of all trials, in their order, each with its level if levels are fixed.
fn conditions_in_order(
    part: &Part,
    conditions: &[(Vec<(usize, usize)>, usize)],
    participant: u32,
    seed: u64,
    own: &mut Random,
) -> Vec<(usize, Option<f64>)> {
    let all: Vec<usize> = (0..conditions.len()).collect();
    let levels: Vec<Option<f64>> = match part.vary.as_ref().map(|v| &v.method) {
        Some(Method::Constant { levels, each, .. }) => {
            levels.iter().flat_map(|level| std::iter::repeat_n(Some(*level), *each as usize)).collect()
        }
        _ => vec![None; (part.count_of_each() / part.repeats) as usize],
    };
    let mut out = Vec::new();
    for repeat in 0..part.repeats {
        let mut trials: Vec<(usize, Option<f64>)> =
            levels.iter().flat_map(|level| all.iter().map(|at| (*at, *level))).collect();
        match &part.order {
            Order::Fixed => (),
            Order::Random => shuffle(&mut trials, own),
            Order::LatinSquare => {
                // The square's letters are the conditions in an order drawn once for the study.
                let mut letters = all.clone();
                shuffle(&mut letters, &mut Random::new(seed));
                let row =
                    latin_row(conditions.len(), (participant as usize + repeat as usize).wrapping_sub(1));
                trials = levels.iter().flat_map(|level| row.iter().map(|i| (letters[*i], *level))).collect();
            }
            Order::Blocks(factor) => {
                shuffle(&mut trials, own);
                let level = |at: usize| conditions[at].0.iter().find(|(f, _)| f == factor).map(|(_, l)| *l);
                let mut blocks: Vec<Option<usize>> = Vec::new();
                for (at, _) in &trials {
                    if !blocks.contains(&level(*at)) {
                        blocks.push(level(*at));
                    }
                }
                trials.sort_by_key(|(at, _)| blocks.iter().position(|block| *block == level(*at)));
            }
        }
        out.append(&mut trials);
    }
    out
}

/// Condition of a trial, and its level if levels are fixed.
type Shown = (usize, Option<u64>);

/// How far the stimuli of each trial are turned, so that sides are balanced: within a level as well as
/// possible, and over levels and participants. The order is drawn in blocks, so that nobody can foresee a
/// side.
fn turns(
    part: &Part,
    conditions: &[(Vec<(usize, usize)>, usize)],
    orders: &[(usize, Option<f64>)],
    participant: u32,
    seed: u64,
    own: &mut Random,
) -> BTreeMap<Shown, Vec<usize>> {
    let starts = side_starts(conditions, seed);
    let mut counts: BTreeMap<Shown, usize> = BTreeMap::new();
    orders.iter().for_each(|(at, level)| *counts.entry((*at, level.map(f64::to_bits))).or_default() += 1);
    let mut next = starts;
    let mut turns = BTreeMap::new();
    for (key @ (at, _), count) in counts {
        let first = next[at] + participant as usize;
        next[at] += count;
        let mut list: Vec<usize> = (first..first + count).collect();
        let block = BLOCK * part.show[conditions[at].1].len();
        list.chunks_mut(block).for_each(|block| shuffle(block, own));
        list.reverse();
        turns.insert(key, list);
    }
    turns
}

/// Offset of each condition's sides: half of the conditions of a kind begin each way.
fn side_starts(conditions: &[(Vec<(usize, usize)>, usize)], seed: u64) -> Vec<usize> {
    let mut random = Random::new(seed_of(seed, "sides"));
    let mut starts = vec![0; conditions.len()];
    let kinds = conditions.iter().map(|(_, kind)| kind + 1).max().unwrap_or(0);
    for kind in 0..kinds {
        let mut of_kind: Vec<usize> = (0..conditions.len()).filter(|at| conditions[*at].1 == kind).collect();
        shuffle(&mut of_kind, &mut random);
        of_kind.iter().enumerate().for_each(|(rank, at)| starts[*at] = rank);
    }
    starts
}

/// Fisher and Yates' shuffle, as Durstenfeld 1964 gives it.
fn shuffle<T>(items: &mut [T], random: &mut Random) {
    for last in (1..items.len()).rev() {
        items.swap(last, random.below(last + 1));
    }
}

/// Rows of a Latin square that is balanced for the trial before: `n`, or twice as many if `n` is odd.
fn latin_rows(n: usize) -> usize {
    if n.is_multiple_of(2) { n } else { 2 * n }
}

/// A row of Williams' square (1949): 0, 1, n-1, 2, n-2, .. plus the row's number; reversed in the second
/// half of the rows if `n` is odd.
fn latin_row(n: usize, row: usize) -> Vec<usize> {
    let row = row % latin_rows(n);
    let zigzag = (0..n).map(|i| if i % 2 == 1 { i.div_ceil(2) } else { (n - i / 2) % n });
    let mut out: Vec<usize> = zigzag.map(|i| (i + row) % n).collect();
    if row >= n {
        out.reverse();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::experiment;

    #[test]
    fn latin_square_is_balanced_for_the_trial_before() {
        for n in 2..9 {
            let rows: Vec<Vec<usize>> = (0..latin_rows(n)).map(|row| latin_row(n, row)).collect();
            let times = rows.len() / n;
            let mut after = vec![vec![0; n]; n];
            for place in 0..n {
                let mut seen = vec![0; n];
                rows.iter().for_each(|row| seen[row[place]] += 1);
                assert!(seen.iter().all(|count| *count == times), "{n}: {rows:?}");
            }
            rows.iter().flat_map(|row| row.windows(2)).for_each(|pair| after[pair[0]][pair[1]] += 1);
            for a in 0..n {
                assert!((0..n).all(|b| after[a][b] == if a == b { 0 } else { times }), "{n}: {after:?}");
            }
        }
    }

    #[test]
    fn sides_are_balanced_within_and_over_participants() {
        let study = experiment(
            "factors: {\"texture\": [\"a\", \"b\", \"c\", \"d\", \"e\", \"f\"]},",
            "over: [\"texture\"], show: [(\"x\", \"w\"), (\"w\", \"z\")],",
        );
        let mut over_people = vec![0; 12];
        for participant in 1..=10 {
            let trials = study.trials(participant);
            assert_eq!(trials.len(), 12);
            for kind in 0..2 {
                let first = |t: &&Trial| t.kind == kind && t.places[0] == study.parts[0].show[kind][0];
                assert_eq!(trials.iter().filter(first).count(), 3, "participant {participant}");
            }
            for trial in trials {
                let at = 2 * trial.cell[0].1 + trial.kind;
                over_people[at] += usize::from(trial.places == study.parts[0].show[trial.kind]);
            }
        }
        assert!(over_people.iter().all(|count| *count == 5), "{over_people:?}");
    }

    #[test]
    fn real_sample_stays_where_the_file_lists_it() {
        let study = experiment("", "show: [(\"x\", \"y\")], repeats: 20, sides: random,");
        assert!((1..5).all(|n| study.trials(n).iter().all(|t| t.places == [0, 2])));
    }

    #[test]
    fn trials_follow_from_seed_and_number_alone() {
        let study = |seed| {
            experiment(&format!("seed: {seed},"), "show: [(\"x\", \"w\")], repeats: 20, sides: random,")
        };
        assert_eq!(study(1).trials(3), study(1).trials(3));
        assert_ne!(study(1).trials(3), study(1).trials(4));
        assert_ne!(study(1).trials(3), study(2).trials(3));
    }

    #[test]
    fn every_order_has_every_condition_equally_often() {
        for order in ["fixed", "random", "latin_square", "blocks(by: \"texture\")"] {
            let study = experiment(
                "factors: {\"texture\": [\"a\", \"b\", \"c\"], \"speed\": [\"slow\", \"fast\"]},",
                &format!("over: [\"texture\", \"speed\"], show: [\"x\", \"y\"], repeats: 2, order: {order},"),
            );
            let trials = study.trials(5);
            assert_eq!(trials.len(), 24);
            for (cell, kind) in study.parts[0].conditions() {
                let count = trials.iter().filter(|t| t.cell == cell && t.kind == kind).count();
                assert_eq!(count, 2, "{order}");
            }
            if order.starts_with("blocks") {
                let changes = trials.windows(2).filter(|t| t[0].cell[0] != t[1].cell[0]).count();
                assert!((4..=5).contains(&changes), "three blocks in each of two repeats, {changes} changes");
            }
        }
    }

    #[test]
    fn study_that_cannot_balance_says_so() {
        let study = experiment("", "show: [\"x\", \"y\", \"z\"], order: latin_square,");
        let told = study.imbalances();
        assert!(
            told[0].contains("10 participants do not fill a Latin square of 6 rows; take 6 or 12"),
            "{told:?}"
        );
        let study = experiment("", "show: [(\"x\", \"w\", \"z\")],");
        assert!(study.imbalances()[0].contains("10 trials of each condition"), "{:?}", study.imbalances());
        assert!(experiment("", "show: [(\"x\", \"w\")],").imbalances().is_empty());
    }

    #[test]
    fn balanced_sides_cannot_be_foreseen() {
        let part = "show: [(\"x\", \"z\")], ask: [which(name: \"w\", text: \"?\")],
            vary: (stimulus: \"z\", set: \"a.b\", by: constant(levels: [0.1, 0.2], each: 8))";
        let study = experiment("", part);
        let mut alternate = 0;
        for participant in 1..=20 {
            let trials = study.trials(participant);
            let first = |level: f64| trials.iter().filter(move |trial| trial.level == Some(level));
            for level in [0.1, 0.2] {
                assert_eq!(first(level).filter(|trial| trial.places[0] == 0).count(), 4, "of 8 at {level}");
            }
            let sides: Vec<usize> = first(0.1).map(|trial| trial.places[0]).collect();
            alternate += usize::from(sides.windows(2).all(|pair| pair[0] != pair[1]));
        }
        // 2 of 70 orders alternate.
        assert!(alternate <= 5, "{alternate} of 20 alternate");
    }
}
