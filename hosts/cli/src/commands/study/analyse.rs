//! `asperity study analyse`: tables, pictures and a report of a study's answers.

use std::path::PathBuf;

use asperity_diagnostics::Diagnostic;
use asperity_study::log::{self, Event};
use asperity_study::{Analysis, Session, Table, sidecar};

use super::{COPY, FOLDER, experiment, logs};
use crate::failure::{Failure, clean, json, plural, print, warn, wrong};
use crate::output::{Pending, keep_all};

/// Analyse the answers of a study: report, tables and pictures
///
/// It writes REPORT.md, answers.csv, answers_beh.tsv with a JSON sidecar, analysis.json and pictures into the
/// study's folder. It may run while people still take part.
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&["asperity study analyse out/heravi2024"]))]
pub struct Args {
    /// Folder of the study
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Output folder; by default the study's
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let experiment = experiment(&args.folder.join(COPY))?;
    let mut sessions = Vec::new();
    for path in logs(&args.folder)? {
        let events = log::read(&path)?;
        // A session that never began.
        if events.is_empty() {
            continue;
        }
        let Some(Event::Begin { participant, number, .. }) = events.first() else {
            return Err(Diagnostic::new("this log does not begin with a session").in_file(path).into());
        };
        let same = |other: &&Session| other.participant == *participant;
        if sessions.iter().any(|other| same(&other)) {
            let what = format!("two logs are of participant {participant}");
            return Err(Diagnostic::new(what).in_file(path).help("take the copy out of this folder").into());
        }
        if let Some(other) = sessions.iter().find(|other: &&Session| other.number == *number) {
            let other = &other.participant;
            warn(&format!(
                "participants {other} and {participant} have the number {number}: the same orders"
            ));
        }
        sessions.push(Session { participant: participant.clone(), number: *number, events });
    }
    if sessions.is_empty() {
        return Err(wrong(&args.folder, "no participant has a log here", FOLDER));
    }
    let table = Table::new(&experiment, &sessions)?;
    let analysis = Analysis::new(&experiment, &table, &sessions);
    let out = args.out.as_ref().unwrap_or(&args.folder);
    let pictures = analysis.pictures();
    let folder = out.join("pictures");
    std::fs::create_dir_all(if pictures.is_empty() { out } else { &folder })
        .map_err(|e| Failure::writing(out, e))?;
    let mut files = Vec::new();
    let mut put = |name: PathBuf, text: &str| -> Result<(), Failure> {
        files.push(Pending::create(&name)?.fill(text)?);
        Ok(())
    };
    for (name, svg) in &pictures {
        put(folder.join(name), svg)?;
    }
    put(out.join("answers.csv"), &table.csv())?;
    put(out.join("answers_beh.tsv"), &table.tsv())?;
    put(out.join("answers_beh.json"), &json(&sidecar(&experiment))?)?;
    put(out.join("analysis.json"), &json(&analysis)?)?;
    put(out.join("REPORT.md"), &analysis.report("pictures/"))?;
    let written = keep_all(files)?;
    for (participant, left) in table.participants.iter().filter(|(_, left)| *left > 0) {
        let left = plural(*left, "trial");
        warn(&format!("participant {participant} has not answered {left}"));
    }
    let report = clean(&out.join("REPORT.md").display().to_string());
    print(&format!(
        "{} of {}, {} excluded\nwrote {} files; read {report}\n",
        plural(table.rows.len(), "answer"),
        plural(sessions.len(), "participant"),
        plural(table.excluded.len(), "trial"),
        written.len()
    ))
}
