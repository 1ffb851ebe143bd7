//! `asperity study check`: counts of a study, and whether it can run.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_diagnostics::Diagnostic;
use asperity_graph::{NodeDecl, Schedule};
use asperity_study::{Experiment, Matching, Method, Stimulus, StimulusKind};
use serde_json::json;

use super::{experiment, stimulus};
use crate::commands::run::reloader::fits;
use crate::failure::{Failure, plural, print_report, warn};
use crate::kinds::Kinds;
use crate::load::{GraphArgs, PluginArgs};

/// Count the trials and minutes of a study, check its balance, and load everything it plays
///
/// Nothing is played.
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&["asperity study check graphs/studies/heravi2024.ron"]))]
pub struct Args {
    /// Experiment file
    #[arg(value_name = "EXPERIMENT.ron", value_parser = crate::shipped::path())]
    pub file: PathBuf,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let experiment = experiment(&args.file)?;
    let graphs = GraphArgs { plugins: args.plugins.clone(), ..GraphArgs::default() };
    let (push, _) = stimulus::push(&experiment, &graphs, &mut Kinds::new(&args.plugins.plugin).looking())?;
    // `study run` says which hand moves the stylus.
    let loaded = load_all(&experiment, &graphs, push.as_ref(), fits)?;
    print_report(args.json, || as_json(&experiment, loaded), || text(&experiment, loaded))?;
    experiment.imbalances().iter().chain(&not_yet(&experiment)).for_each(|told| warn(told));
    warn_of_masking(&experiment);
    Ok(())
}

/// Whether a graph can follow another one.
pub type Fits = fn(&Schedule, &Schedule) -> Result<(), Failure>;

/// Loads every stimulus of every trial, at the ends of varied parameters. All must fit one sound card and
/// engine by `fits`. Returns how many there are.
pub fn load_all(
    experiment: &Experiment,
    args: &GraphArgs,
    push: Option<&NodeDecl>,
    fits: Fits,
) -> Result<usize, Failure> {
    let mut done = BTreeSet::new();
    let mut first = None;
    for (number, part) in experiment.parts.iter().enumerate() {
        for trial in experiment.trials_of(number, 1) {
            for stimulus in trial.places.iter().chain(&part.reference) {
                let filled = experiment.shown(&trial, *stimulus);
                let levels = match part.vary.as_ref().filter(|vary| vary.stimulus == *stimulus) {
                    None => vec![None],
                    Some(vary) => {
                        ends(&vary.method).into_iter().map(|level| Some((vary.set.as_str(), level))).collect()
                    }
                };
                for level in levels {
                    if !done.insert(format!("{} {level:?}", described(&filled))) {
                        continue;
                    }
                    let about = |failure| named(failure, experiment, *stimulus);
                    let Some(schedule) = load_one(&filled, level, args, push).map_err(about)? else {
                        continue;
                    };
                    match &first {
                        None => first = Some(schedule),
                        Some(first) => alike(first, &schedule, &experiment.stimuli[*stimulus], fits)?,
                    }
                }
            }
        }
    }
    Ok(done.len())
}

/// Refuses a stimulus that cannot follow another one in the same engine and on the same sound card.
fn alike(first: &Schedule, next: &Schedule, stimulus: &Stimulus, fits: Fits) -> Result<(), Failure> {
    let rates = |s: &Schedule| format!("{} ticks a second and {} Hz", s.tick_hz, s.audio_hz);
    let what = match fits(first, next) {
        Ok(()) => return Ok(()),
        Err(_) if rates(first) != rates(next) => {
            format!("`{}` runs at {}, and another stimulus at {}", stimulus.name, rates(next), rates(first))
        }
        Err(failure) => format!("`{}` cannot follow another stimulus: {}", stimulus.name, failure.reason()),
    };
    let help = "all stimuli of a study share one engine, one sound card and one hand";
    Err(Diagnostic::new(what).at_place(&stimulus.place).help(help).into())
}

/// Levels of a varied parameter to load: the lowest and the highest, and any that the file lists.
fn ends(method: &Method) -> Vec<f64> {
    match method {
        Method::Staircase(s) => vec![s.floor, s.start, s.ceiling],
        Method::Constant { levels, .. } => levels.clone(),
        Method::Quest(settings) => {
            let levels = settings.levels().unwrap_or_default();
            levels.first().into_iter().chain(levels.last()).copied().collect()
        }
    }
}

/// A stimulus in words, without its place.
fn described(kind: &StimulusKind) -> String {
    match kind {
        StimulusKind::Graph { file, set } => {
            let set: Vec<String> =
                set.iter().map(|(key, v)| format!("{}={:?}", key.name, v.kind())).collect();
            format!("graph {:?} {}", file.kind(), set.join(" "))
        }
        StimulusKind::Clip { file } => format!("clip {:?}", file.kind()),
        StimulusKind::Real { mount } => format!("real {:?}", mount.kind()),
        StimulusKind::Silence => "silence".into(),
    }
}

/// The schedule of a stimulus that is a graph.
fn load_one(
    kind: &StimulusKind,
    level: Option<(&str, f64)>,
    args: &GraphArgs,
    push: Option<&NodeDecl>,
) -> Result<Option<Schedule>, Failure> {
    match kind {
        StimulusKind::Graph { file, set } => {
            let mut kinds = Kinds::new(&args.plugins.plugin).looking();
            let loaded = stimulus::load((file, set), level, 1.0, args, push, &mut kinds)?;
            Ok(Some(loaded.compiled.schedule))
        }
        StimulusKind::Clip { file } => {
            let clip = hound::WavReader::open(stimulus::found(file)?);
            clip.map(|_| None).map_err(|e| file.error(format!("this clip cannot be read: {e}")).into())
        }
        StimulusKind::Real { .. } | StimulusKind::Silence => Ok(None),
    }
}

/// Warns that `study run` plays no masking noise yet.
pub fn warn_of_masking(experiment: &Experiment) {
    if experiment.masking.is_some() {
        warn("masking noise is not played yet: play it by other means");
    }
}

/// Parts of the file that `study run` does not support yet, in sentences: it refuses such a study.
pub fn not_yet(experiment: &Experiment) -> Vec<String> {
    let mut found = Vec::new();
    for part in &experiment.parts {
        let name = &part.name;
        if part.level != Matching::Off {
            found.push(format!("part `{name}`: levels cannot be matched yet"));
        }
    }
    if experiment.stimuli.iter().any(|s| matches!(s.kind, StimulusKind::Clip { .. })) {
        found.push("a clip cannot be played yet".into());
    }
    found
}

/// Adds which stimulus it is about.
fn named(failure: Failure, experiment: &Experiment, stimulus: usize) -> Failure {
    let Failure::Input(all) = failure else { return failure };
    let stimulus = &experiment.stimuli[stimulus];
    let told = |d: Diagnostic| {
        let span = stimulus.place.span;
        d.related(&stimulus.place.source, span, format!("for the stimulus `{}`", stimulus.name))
    };
    Failure::Input(all.into_iter().map(told).collect())
}

fn text(experiment: &Experiment, loaded: usize) -> String {
    let counts: Vec<usize> = (0..experiment.parts.len()).map(|i| experiment.trials_of(i, 1).len()).collect();
    let mut out = format!(
        "{}: {}, up to {} and about {:.0} minutes each\n\n",
        experiment.title,
        plural(experiment.participants as usize, "participant"),
        plural(counts.iter().sum(), "trial"),
        experiment.minutes()
    );
    let names = experiment.parts.iter().map(|part| part.name.chars().count());
    let width = names.chain([4]).max().unwrap_or(4);
    let _ = writeln!(out, "{:width$}  trials  minutes  conditions  questions", "part");
    for (part, count) in experiment.parts.iter().zip(&counts) {
        let asked: Vec<&str> = part.ask.iter().map(|q| q.name.as_str()).collect();
        let asked = if asked.is_empty() { "none".into() } else { asked.join(", ") };
        let (minutes, conditions) = (*count as f64 * part.trial_s / 60.0, part.conditions().len());
        let _ = writeln!(out, "{:width$}  {count:6}  {minutes:7.1}  {conditions:10}  {asked}", part.name);
    }
    let _ = writeln!(out, "\nstimuli  all {loaded} load");
    if experiment.imbalances().is_empty() {
        out += "balance  every condition is shown equally often in each order of sides\n";
    }
    out
}

fn as_json(experiment: &Experiment, loaded: usize) -> serde_json::Value {
    let parts = experiment.parts.iter().enumerate().map(|(i, part)| {
        let trials = experiment.trials_of(i, 1).len();
        json!({
            "name": part.name, "trials": trials, "minutes": trials as f64 * part.trial_s / 60.0,
            "conditions": part.conditions().len(),
            "questions": part.ask.iter().map(|q| &q.name).collect::<Vec<_>>(),
        })
    });
    json!({
        "title": experiment.title, "participants": experiment.participants, "minutes": experiment.minutes(),
        "parts": parts.collect::<Vec<_>>(), "stimuli": loaded, "imbalances": experiment.imbalances(),
    })
}
