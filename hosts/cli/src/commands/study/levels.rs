//! Level matching: how strong each stimulus is over a stroke, and the gain that makes those of a trial alike.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_accuracy::accuracy::{HOP_S, SILENCE_M_S2, Spectrogram, WINDOW_S, felt_db};
use asperity_diagnostics::Diagnostic;
use asperity_engine::{Engine, Options};
use asperity_graph::Compiled;
use asperity_node::{Buffer, Role, Unit};
use asperity_psychometrics::Steps;
use asperity_study::{Experiment, Felt, Matching, Method, StimulusKind, Trial, Varied};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::stimulus::{self, GAIN, HAND, Loader, MASK};
use crate::failure::{Failure, wrong};
use crate::load::PluginArgs;

/// The stroke over which levels are matched, unless the study names one.
const STROKE: &str = "graphs/trajectories/zigzag.csv";
/// Time after the beginning of each contact that does not count, in s.
const SETTLE_S: f64 = 0.2;
/// Levels of a staircase at which its stimulus is measured. Between them, decibels are interpolated.
const STAIRS: u32 = 17;
/// Time over which masking noise is measured, in s.
const MASKED_S: u32 = 3;
/// A larger change of the gain over a varied parameter causes a warning, in dB.
const TAKEN_DB: f64 = 3.0;
/// Largest error of its level in dB.
const MASK_DB: f64 = 0.5;

/// Strength of a stimulus in dB, at each level of its varied parameter.
type Points = Vec<(Option<f64>, f64)>;

/// How strong the stimuli of a study are, for parts that match levels.
pub struct Levels {
    experiment: Experiment,
    trials: Vec<Trial>,
    points: BTreeMap<String, Points>,
    stroke: PathBuf,
}

/// Something to measure.
struct Job {
    key: String,
    stimulus: usize,
    kind: StimulusKind,
    matching: Matching,
    vary: Option<Varied>,
}

/// A gain of the table.
struct Row {
    part: String,
    condition: String,
    /// Whether the trial has no right answer: people judge a change of level.
    compares: bool,
    stimulus: String,
    /// Gains in dB at levels of the varied parameter.
    gains: Points,
}

impl Levels {
    /// Renders every stimulus of a participant's trials whose level is matched, once each.
    pub fn measure(experiment: &Experiment, participant: u32, plugins: &PluginArgs) -> Result<Self, Failure> {
        let mut it = Self {
            experiment: experiment.clone(),
            trials: experiment.trials(participant),
            points: BTreeMap::new(),
            stroke: PathBuf::new(),
        };
        let jobs = it.jobs();
        if jobs.is_empty() {
            return Ok(it);
        }
        it.stroke = match &experiment.stroke {
            Some(stroke) => {
                let path = stimulus::found(stroke)?;
                if !path.is_file() {
                    return Err(stroke.error(format!("there is no file {}", path.display())).into());
                }
                path
            }
            None => crate::shipped::file(STROKE.as_ref())
                .ok_or_else(|| Failure::Machine(format!("{STROKE} is missing")))?,
        };
        let strengths =
            jobs.par_iter().map(|job| it.strength(job, plugins)).collect::<Result<Vec<_>, _>>()?;
        let mut units = BTreeMap::new();
        for (job, (db, unit)) in jobs.iter().zip(strengths) {
            units.insert(job.key.clone(), unit);
            let level = job.vary.as_ref().map(|varied| varied.level);
            it.points.entry(job.key.clone()).or_default().push((level, db));
        }
        for trial in &it.trials {
            let all = it.matched(trial);
            let mut units = all.iter().filter_map(|s| Some((s, units.get(&it.key(trial, *s)?)?)));
            let Some((_, first)) = units.next() else { continue };
            if let Some((other, unit)) = units.find(|(_, unit)| *unit != first) {
                let other = &experiment.stimuli[*other];
                let what = format!("`{}` is a signal in {unit}, and another one in {first}", other.name);
                let help = "levels are compared before the actuator's inverse, in one unit";
                return Err(Diagnostic::new(what).at_place(&other.place).help(help).into());
            }
        }
        Ok(it)
    }

    /// All that is to be measured.
    fn jobs(&self) -> Vec<Job> {
        let mut jobs: BTreeMap<String, Vec<Job>> = BTreeMap::new();
        for trial in &self.trials {
            let part = &self.experiment.parts[trial.part];
            for stimulus in self.matched(trial) {
                let Some(key) = self.key(trial, stimulus) else { continue };
                let job = |vary| Job {
                    key: key.clone(),
                    stimulus,
                    kind: self.experiment.shown(trial, stimulus),
                    matching: part.level,
                    vary,
                };
                let varied = part.vary.as_ref().filter(|vary| vary.stimulus == stimulus);
                let all = || match varied {
                    None => vec![job(None)],
                    Some(vary) => {
                        let levels = levels(&vary.method).into_iter();
                        levels.map(|level| job(Some(vary.at(level)))).collect()
                    }
                };
                jobs.entry(key.clone()).or_insert_with(all);
            }
        }
        jobs.into_values().flatten().collect()
    }

    /// Stimuli of a trial that have the same level, as the file lists them.
    fn matched(&self, trial: &Trial) -> Vec<usize> {
        let part = &self.experiment.parts[trial.part];
        let all = part.show[trial.kind].iter().copied().chain(part.reference);
        all.filter(|_| part.level != Matching::Off).collect()
    }

    /// Names a stimulus of a trial; `None` where it is not played.
    fn key(&self, trial: &Trial, stimulus: usize) -> Option<String> {
        let part = &self.experiment.parts[trial.part];
        let kind = self.experiment.shown(trial, stimulus);
        stimulus::file_of(&kind)?;
        let vary = part.vary.as_ref().filter(|vary| vary.stimulus == stimulus);
        let vary = vary.map(|vary| format!("{} {:?}", vary.set, vary.method));
        Some(format!("{:?} {} {vary:?}", part.level, stimulus::described(&kind)))
    }

    fn points(&self, trial: &Trial, stimulus: usize) -> Option<&Points> {
        self.points.get(&self.key(trial, stimulus)?)
    }

    /// The level that a trial's stimuli share: that of the weakest, at any level of a varied parameter.
    fn target(&self, trial: &Trial) -> f64 {
        let all = self.matched(trial);
        let all = all.iter().filter_map(|stimulus| self.points(trial, *stimulus)).flatten();
        all.map(|(_, db)| *db).fold(f64::INFINITY, f64::min)
    }

    /// Gain of a stimulus in a trial, at most 1.
    pub fn gain(&self, trial: usize, felt: &Felt) -> f64 {
        let Some(trial) = self.trials.get(trial) else { return 1.0 };
        let Some(points) = self.points(trial, felt.stimulus) else { return 1.0 };
        let own = between(points, felt.vary.as_ref().map_or(0.0, |varied| varied.level));
        10f64.powf((self.target(trial) - own) / 20.0).min(1.0)
    }

    /// Renders a stimulus over a stroke. Answers its level in dB while the stylus is in contact, before the
    /// actuator's own nodes, and its unit.
    fn strength(&self, job: &Job, plugins: &PluginArgs) -> Result<(f64, Unit), Failure> {
        let place = &self.experiment.stimuli[job.stimulus].place;
        let input = Some(self.stroke.clone());
        let mut loader = Loader::alone(plugins, input);
        let loaded = loader.load(&job.kind, job.vary.as_ref(), 1.0, None);
        let compiled =
            loaded.map_err(|failure| stimulus::named(failure, &self.experiment, job.stimulus))?.compiled;
        let schedule = &compiled.schedule;
        let nodes = || schedule.nodes.iter().enumerate();
        let gains: Vec<usize> = nodes().filter(|(_, n)| n.id.starts_with(GAIN)).map(|(i, _)| i).collect();
        let unit = gains.first().and_then(|gain| schedule.nodes[*gain].inputs[0].port.clone());
        let unit = unit.map_or(Unit::NONE, |port| port.unit);
        let hand = schedule.index_of(HAND);
        let duration = hand.and_then(|hand| schedule.nodes[hand].duration).map_or(0.0, |d| d.ms() / 1e3);
        let (tick_hz, rate_hz) = (schedule.tick_hz, f64::from(schedule.audio_hz));
        let mut signals = vec![Vec::new(); gains.len()];
        // Whether a sample counts.
        let mut counts: Vec<bool> = Vec::new();
        let mut touched_s = 0.0;
        let ticks = (duration * f64::from(tick_hz)) as u64;
        play(compiled, ticks, |engine| {
            let place = hand.and_then(|hand| engine.output(hand, 0));
            let is_in_contact = matches!(place, Some(Buffer::Control { values, .. }) if values[2] < 0.0);
            touched_s = if is_in_contact { touched_s + 1.0 / f64::from(tick_hz) } else { 0.0 };
            for (gain, signal) in gains.iter().zip(&mut signals) {
                if let Some(Buffer::Audio { samples, len, .. }) = engine.input(*gain, 0) {
                    signal.extend(samples[..*len].iter().map(|x| f64::from(*x)));
                }
            }
            counts.resize(signals.first().map_or(0, Vec::len), touched_s > SETTLE_S);
        });
        let refused = |what: String, help: &str| Err(Diagnostic::new(what).at_place(place).help(help).into());
        if gains.is_empty() {
            return refused("a stimulus without vibration has no level to match".into(), "leave `level` out");
        }
        let count = counts.iter().filter(|counts| **counts).count();
        if count == 0 {
            let what = format!("the stylus touches for less than {SETTLE_S} s in this stroke");
            return Err(wrong(&self.stroke, what, "a stroke with longer contact below z = 0"));
        }
        let heard = |signal: &Vec<f64>| {
            let squares = signal.iter().zip(&counts).map(|(x, counts)| if *counts { x * x } else { 0.0 });
            squares.sum::<f64>() / count as f64
        };
        let rms = signals.iter().map(heard).sum::<f64>().sqrt();
        let at = job.vary.as_ref().map_or(String::new(), |at| format!(" at {} = {}", at.set, at.level));
        if rms.is_nan() || rms <= SILENCE_M_S2 {
            let what = format!("a silent stimulus{at} has no level to match");
            return refused(what, "name a `stroke` that it answers, or leave `level` out");
        }
        if job.matching == Matching::Rms {
            return Ok((20.0 * rms.log10(), unit));
        }
        if unit != Unit::METRE_PER_SECOND_SQUARED {
            let what = format!("the perceptual level needs an acceleration, and this stimulus is in {unit}");
            return refused(what, "level: rms");
        }
        let axes: Vec<&[f64]> = signals.iter().map(Vec::as_slice).collect();
        let seen =
            Spectrogram::new(&axes, rate_hz).map_err(|e| Diagnostic::new(e.to_string()).at_place(place))?;
        let whole = |frame: &usize| {
            let from = (*frame as f64 * HOP_S * rate_hz) as usize;
            let to = from + (WINDOW_S * rate_hz) as usize;
            counts.get(from..to).is_some_and(|part| part.iter().all(|counts| *counts))
        };
        let frames: Vec<_> =
            (0..seen.frames()).filter(whole).filter_map(|n| seen.frame(n).copied()).collect();
        if frames.is_empty() {
            return Err(wrong(
                &self.stroke,
                "contact is too short for a spectrum",
                "a stroke with longer contact",
            ));
        }
        Ok((felt_db(&Spectrogram::from_powers(seen.bins(), frames).mean(0..usize::MAX)), unit))
    }

    /// Gains of every condition.
    fn rows(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        let mut known = Vec::new();
        for trial in &self.trials {
            let condition = (trial.part, &trial.cell, trial.kind);
            let part = &self.experiment.parts[trial.part];
            if part.level == Matching::Off || known.contains(&condition) {
                continue;
            }
            known.push(condition);
            let levels =
                trial.cell.iter().map(|(f, level)| self.experiment.factors[*f].levels[*level].clone());
            let name = |stimulus: &usize| self.experiment.stimuli[*stimulus].name.clone();
            let entry = part.show[trial.kind].iter().map(name).collect::<Vec<_>>().join("-");
            let condition = levels.chain([entry]).collect::<Vec<_>>().join(", ");
            let target = self.target(trial);
            for stimulus in self.matched(trial) {
                let Some(points) = self.points(trial, stimulus) else { continue };
                // A reference may be among the stimuli shown, too.
                let listed = |row: &Row| row.part == part.name && row.condition == condition;
                if rows.iter().any(|row| listed(row) && row.stimulus == name(&stimulus)) {
                    continue;
                }
                rows.push(Row {
                    part: part.name.clone(),
                    condition: condition.clone(),
                    compares: part.reference.is_none(),
                    stimulus: name(&stimulus),
                    gains: points.iter().map(|(level, db)| (*level, target - db)).collect(),
                });
            }
        }
        rows
    }

    /// Warnings where matching takes a change of level away from a varied parameter.
    pub fn undone(&self) -> Vec<String> {
        let warning = |row: &Row| {
            let gains = || row.gains.iter().map(|(_, db)| *db);
            let taken = gains().fold(f64::NEG_INFINITY, f64::max) - gains().fold(f64::INFINITY, f64::min);
            (row.compares && taken > TAKEN_DB).then(|| {
                format!(
                    "part `{}`, {}: level matching takes {taken:.0} dB from the varied parameter of `{}`; \
                     leave `level` out to vary the strength",
                    row.part, row.condition, row.stimulus
                )
            })
        };
        self.rows().iter().filter_map(warning).collect()
    }

    /// The table of gains; empty where no part matches levels.
    pub fn text(&self) -> String {
        let rows = self.rows();
        let Some(name) = self.stroke.file_name() else { return String::new() };
        let mut out = format!("\ngains over {}\n", name.to_string_lossy());
        let width = |of: fn(&Row) -> &str| rows.iter().map(|row| of(row).chars().count()).max().unwrap_or(0);
        let [a, b, c] = [width(|r| &r.part), width(|r| &r.condition), width(|r| &r.stimulus)];
        for Row { part, condition, stimulus, gains, .. } in &rows {
            let _ = write!(out, "{part:a$}  {condition:b$}  {stimulus:c$}");
            let decibels = || gains.iter().map(|(_, db)| *db);
            let _ = match gains.as_slice() {
                [(Some(first), _), .., (Some(last), _)] => {
                    let least = decibels().fold(f64::INFINITY, f64::min);
                    let most = decibels().fold(f64::NEG_INFINITY, f64::max);
                    writeln!(out, "  {least:.1} to {most:.1} dB at {first} to {last}")
                }
                _ => writeln!(out, "  {:.1} dB", decibels().next().unwrap_or_default()),
            };
        }
        out
    }

    pub fn json(&self) -> Value {
        let row = |row: Row| {
            let gains = row.gains.iter().map(|(level, db)| json!({ "level": level, "gain_db": db }));
            json!({
                "part": row.part, "condition": row.condition, "stimulus": row.stimulus,
                "gains": gains.collect::<Vec<_>>(),
            })
        };
        self.rows().into_iter().map(row).collect()
    }
}

/// Levels of a varied parameter at which its stimulus is measured.
fn levels(method: &Method) -> Vec<f64> {
    match method {
        Method::Constant { levels, .. } => {
            let mut levels = levels.clone();
            levels.sort_by(f64::total_cmp);
            levels
        }
        Method::Quest(settings) => settings.levels().unwrap_or_default(),
        Method::Staircase(s) => {
            let step = |n: u32| match (f64::from(n) / f64::from(STAIRS - 1), &s.steps) {
                (part, Steps::Add { .. }) => s.floor + part * (s.ceiling - s.floor),
                (part, Steps::Multiply { .. }) => s.floor * (s.ceiling / s.floor).powf(part),
            };
            (0..STAIRS).map(step).collect()
        }
    }
}

/// Strength at a level, along straight lines between points in their order.
fn between(points: &Points, level: f64) -> f64 {
    let known: Vec<(f64, f64)> = points.iter().map(|(at, db)| (at.unwrap_or(level), *db)).collect();
    let next = known.partition_point(|(at, _)| *at < level);
    match (next.checked_sub(1).and_then(|last| known.get(last)), known.get(next)) {
        (Some((a, low)), Some((b, high))) => low + (level - a) / (b - a) * (high - low),
        (Some((_, db)), None) | (None, Some((_, db))) => *db,
        (None, None) => 0.0,
    }
}

/// Runs a graph offline.
fn play(compiled: Compiled, ticks: u64, mut heard: impl FnMut(&Engine)) {
    let mut engine = Engine::new(compiled, Options::default());
    for _ in 0..ticks {
        engine.tick();
        heard(&engine);
    }
}

/// Refuses masking noise that the limits of the actuator hold back.
pub fn check_masking(experiment: &Experiment, loader: &mut Loader) -> Result<(), Failure> {
    let Some(masking) = &experiment.masking else { return Ok(()) };
    let compiled = loader.quiet(experiment)?.compiled;
    let outs = compiled.schedule.with_role(Role::AudioOutput);
    let out = outs.into_iter().find(|(_, node)| node.id.starts_with(MASK)).map(|(i, _)| i);
    let (mut sum, mut count) = (0.0, 0);
    let ticks = u64::from(MASKED_S * compiled.schedule.tick_hz);
    play(compiled, ticks, |engine| {
        if let Some(Buffer::Audio { samples, len, .. }) = out.and_then(|out| engine.output(out, 0)) {
            sum += samples[..*len].iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
            count += len;
        }
    });
    let dbfs = 10.0 * (sum / count.max(1) as f64).log10();
    if (dbfs - masking.dbfs).abs() <= MASK_DB {
        return Ok(());
    }
    let what = format!("the actuator's limits hold this noise back: it plays at {dbfs:.1} dB");
    Err(Diagnostic::new(what).at_place(&masking.place).help("ask for less: `dbfs`").into())
}
