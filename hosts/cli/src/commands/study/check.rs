//! `asperity study check`: counts of a study, and whether it can run.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_diagnostics::Diagnostic;
use asperity_graph::Schedule;
use asperity_study::{Experiment, Method, Stimulus, log};
use serde_json::json;

use super::experiment;
use super::levels::{self, Levels};
use super::stimulus::{self, Loader};
use crate::commands::run::reloader::fits;
use crate::failure::{Failure, plural, print_report, warn};
use crate::load::PluginArgs;

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
    let options = log::Options { plugins: args.plugins.plugin.clone(), ..log::Options::default() };
    let (mut loader, _) = Loader::session(&experiment, &options, true)?;
    // `study run` says which hand moves the stylus.
    let loaded = load_all(&experiment, &mut loader, fits)?.count;
    let levels = Levels::measure(&experiment, 1, &args.plugins)?;
    print_report(args.json, || as_json(&experiment, loaded, &levels), || text(&experiment, loaded, &levels))?;
    experiment
        .imbalances()
        .iter()
        .chain(&experiment.doubts())
        .chain(&levels.undone())
        .for_each(|told| warn(told));
    Ok(())
}

/// Stimuli of a study.
pub struct All {
    pub count: usize,
    /// Every file that they are made of.
    pub files: BTreeSet<PathBuf>,
}

/// Whether a graph can follow another one.
pub type Fits = fn(&Schedule, &Schedule) -> Result<(), Failure>;

/// Loads every stimulus of every trial, at the ends of varied parameters. All must fit one sound card and
/// engine by `fits`, and masking noise must have its level.
pub fn load_all(experiment: &Experiment, loader: &mut Loader, fits: Fits) -> Result<All, Failure> {
    let mut done = BTreeSet::new();
    let mut files = BTreeSet::new();
    let mut first = None;
    for (number, part) in experiment.parts.iter().enumerate() {
        for trial in experiment.trials_of(number, 1) {
            for stimulus in trial.places.iter().chain(&part.reference) {
                let filled = experiment.shown(&trial, *stimulus);
                let levels = match part.vary.as_ref().filter(|vary| vary.stimulus == *stimulus) {
                    None => vec![None],
                    Some(vary) => ends(&vary.method).into_iter().map(|level| Some(vary.at(level))).collect(),
                };
                for varied in levels {
                    let level = varied.as_ref().map(|varied| varied.level);
                    if !done.insert(format!("{} {level:?}", stimulus::described(&filled))) {
                        continue;
                    }
                    let about = |failure| stimulus::named(failure, experiment, *stimulus);
                    if stimulus::file_of(&filled).is_none() {
                        continue;
                    }
                    let schedule =
                        loader.load(&filled, varied.as_ref(), 1.0, None).map_err(about)?.compiled.schedule;
                    files.extend(loader.files(&filled, &schedule)?);
                    match &first {
                        None => first = Some(schedule),
                        Some(first) => alike(first, &schedule, &experiment.stimuli[*stimulus], fits)?,
                    }
                }
            }
        }
    }
    levels::check_masking(experiment, loader)?;
    Ok(All { count: done.len(), files })
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

fn text(experiment: &Experiment, loaded: usize, levels: &Levels) -> String {
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
    out + &levels.text()
}

fn as_json(experiment: &Experiment, loaded: usize, levels: &Levels) -> serde_json::Value {
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
        "gains": levels.json(),
    })
}
