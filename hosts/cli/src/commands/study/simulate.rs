//! `asperity study simulate`: answers of simulated people, and the power of each declared test.

use std::fs;
use std::path::{Path, PathBuf};

use asperity_diagnostics::Diagnostic;
use asperity_statistics::wilson_interval;
use asperity_study::analysis::Figures;
use asperity_study::log::{self, Event, Log};
use asperity_study::{Analysis, Experiment, Session, Table};
use rayon::prelude::*;
use serde_json::json;

use super::{COPY, experiment};
use crate::failure::{Failure, clean, plural, print_report, warn, wrong};
use crate::number::whole;
use crate::output::write_text;

/// Simulate the people of a study, and find the power of each declared test
///
/// People answer by the model that the experiment file states under `person`. Without one, all stimuli feel
/// alike, and the power is the rate of false positives. Where a parameter varies, thresholds are compared
/// with that of the model. --out writes the logs of the first run.
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity study simulate graphs/studies/heravi2024.ron --participants 25",
    "asperity study simulate graphs/studies/heravi2024.ron --runs 1 --out out/heravi2024",
]))]
pub struct Args {
    /// Experiment file
    #[arg(value_name = "EXPERIMENT.ron", value_parser = crate::shipped::path())]
    pub file: PathBuf,
    /// Number of participants; by default as the file plans
    #[arg(long, value_name = "N", value_parser = whole(1_u32, 10_000, ""))]
    pub participants: Option<u32>,
    /// Number of simulated studies
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = whole(1_u64, 100_000, ""))]
    pub runs: u64,
    /// Seed of the answers
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Output folder for the logs of the first run; it must be empty or missing
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// A declared test in a cell, over all runs.
struct Power {
    name: String,
    significant: usize,
    made: usize,
}

/// Thresholds of a condition, over all people of all runs.
struct Recovered {
    condition: String,
    found: Vec<f64>,
    missing: usize,
}

impl Recovered {
    fn of(analysis: &Analysis) -> Vec<Self> {
        let figures =
            analysis.parts.iter().flat_map(|part| part.asked.iter().map(move |asked| (part, asked)));
        let mut all = Vec::new();
        for (part, asked) in figures {
            let Figures::Thresholds(of) = &asked.figures else { continue };
            all.extend(of.conditions.iter().map(|condition| {
                let found: Vec<f64> = condition.people.iter().filter_map(|one| one.threshold).collect();
                let missing = condition.people.len() - found.len();
                let levels = condition.levels.iter().chain([&condition.kind]);
                let name = [&part.name].into_iter().chain(levels).cloned().collect::<Vec<_>>().join(", ");
                Self { condition: name, found, missing }
            }));
        }
        all
    }

    /// Adds the runs of each condition.
    fn all(runs: Vec<Vec<Self>>) -> Vec<Self> {
        let mut runs = runs.into_iter();
        let mut sum = runs.next().unwrap_or_default();
        for run in runs {
            for (sum, one) in sum.iter_mut().zip(run) {
                sum.found.extend(one.found);
                sum.missing += one.missing;
            }
        }
        sum
    }

    fn mean(&self) -> f64 {
        self.found.iter().sum::<f64>() / self.found.len() as f64
    }

    fn sd(&self) -> f64 {
        let mean = self.mean();
        let squares: f64 = self.found.iter().map(|x| (x - mean) * (x - mean)).sum();
        (squares / self.found.len().saturating_sub(1) as f64).sqrt()
    }

    /// Share of people without a threshold.
    fn without(&self) -> f64 {
        self.missing as f64 / (self.missing + self.found.len()).max(1) as f64
    }

    fn json(&self) -> serde_json::Value {
        let (mean, sd) = (self.mean(), self.sd());
        json!({ "condition": self.condition, "mean": mean, "sd": sd, "without": self.without() })
    }
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let experiment = experiment(&args.file)?;
    let people = args.participants.unwrap_or(experiment.participants);
    let study = |run: u64| -> Vec<Session> {
        let seed = args.seed.wrapping_add(run);
        (1..=people).map(|number| experiment.person.session(&experiment, number, seed)).collect()
    };
    let written = match &args.out {
        Some(folder) => write(folder, &experiment, &study(0))?,
        None => 0,
    };
    let tested = |run: u64| {
        let sessions = study(run);
        let table = Table::new(&experiment, &sessions)?;
        let analysis = Analysis::new(&experiment, &table, &sessions);
        Ok((analysis.p_values(), Recovered::of(&analysis)))
    };
    experiment.doubts().iter().for_each(|told| warn(told));
    let (runs, recovered): (Vec<_>, Vec<_>) = (0..args.runs)
        .into_par_iter()
        .map(tested)
        .collect::<Result<Vec<_>, Diagnostic>>()?
        .into_iter()
        .unzip();
    let recovered = Recovered::all(recovered);
    let mut powers: Vec<Power> = Vec::new();
    for found in runs.iter().flatten() {
        let at = powers.iter().position(|power| power.name == found.name).unwrap_or_else(|| {
            powers.push(Power { name: found.name.clone(), significant: 0, made: 0 });
            powers.len() - 1
        });
        powers[at].made += usize::from(found.p.is_some());
        powers[at].significant += usize::from(found.is_significant);
    }
    let count = runs.len();
    let of = |power: &Power| wilson_interval(power.significant, count, 0.95).ok();
    let value = || {
        let tests = powers.iter().map(|power| {
            let interval = of(power).map(|i| [i.low, i.high]);
            let share = power.significant as f64 / count as f64;
            json!({ "test": power.name, "power": share, "interval": interval, "made": power.made })
        });
        json!({ "participants": people, "runs": count, "tests": tests.collect::<Vec<_>>(),
            "thresholds": recovered.iter().map(Recovered::json).collect::<Vec<_>>(), "logs": written })
    };
    let text = || {
        let mut out = format!(
            "{}: {} in {}\n\n",
            experiment.title,
            plural(people as usize, "participant"),
            plural(count, "simulated run")
        );
        if powers.is_empty() {
            out += "no tests are declared\n";
        } else if powers.iter().any(|power| power.made > 0) {
            out += "power   95 % interval  made  test\n";
        }
        // A post-hoc test that no run made says nothing.
        for power in powers.iter().filter(|power| power.made > 0) {
            let [low, high] = of(power).map_or([f64::NAN; 2], |i| [i.low, i.high]);
            let share = power.significant as f64 / count as f64;
            let (name, made) = (clean(&power.name), power.made);
            out += &format!("{share:5.3}  {low:6.3} to {high:5.3} {made:5}  {name}\n");
        }
        if !recovered.is_empty() {
            out += "\nmean threshold of a person  deviation  without  condition\n";
        }
        for one in &recovered {
            let [mean, sd, without] = [one.mean(), one.sd(), 100.0 * one.without()];
            out += &format!("{mean:26.4}  {sd:9.4}  {without:5.1} %  {}\n", clean(&one.condition));
        }
        if let Some(function) = experiment.person.function.filter(|_| !recovered.is_empty()) {
            out += &format!("the model of a person has the threshold {}\n", function.threshold);
        }
        if let Some(folder) = &args.out {
            let folder = clean(&folder.display().to_string());
            out += &format!(
                "\nwrote {} of the first run; next: asperity study analyse {folder}\n",
                plural(written, "log")
            );
        }
        out
    };
    print_report(args.json, value, text)
}

/// Writes a copy of the experiment, and a log for each participant.
fn write(folder: &Path, experiment: &Experiment, sessions: &[Session]) -> Result<usize, Failure> {
    let cannot = |e: std::io::Error| Failure::writing(folder, e);
    fs::create_dir_all(folder).map_err(cannot)?;
    if fs::read_dir(folder).map_err(cannot)?.next().is_some() {
        let help = "simulated answers never join real ones: take a new folder";
        return Err(wrong(folder, "this folder is not empty", help));
    }
    write_text(&folder.join(COPY), experiment.source.text())?;
    for session in sessions {
        let path = folder.join(format!("{}.jsonl", session.participant));
        let (mut log, _) = Log::open(&path)?;
        let begin = Event::Begin {
            study: experiment.title.clone(),
            participant: session.participant.clone(),
            number: session.number,
            version: format!("{}{}", log::SIMULATED, env!("CARGO_PKG_VERSION")),
            files: Vec::new(),
            at: String::new(),
            options: Default::default(),
        };
        let events = std::iter::once(&begin).chain(&session.events);
        log.append_all(events).map_err(|e| Failure::writing(&path, e))?;
    }
    Ok(sessions.len())
}
