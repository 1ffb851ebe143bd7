//! `asperity plugin check`: runs the node cases over a plugin, in a process of its own.
//!
//! A plugin that crashes ends the process of the cases. A new process goes on with the next case. A plugin
//! that does not answer is killed. Not seen are locks and system calls of a plugin, its threads, memory that
//! it does not take from the C library, and writes to foreign memory that do not crash.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use asperity_checks::node_cases;
use asperity_diagnostics::{Diagnostic, one_of};
use serde_json::Value;

use super::child::TIME;
use super::report::{Report, Row};
use super::surroundings::SURROUNDINGS;
use super::{Cases, CheckPlugin};
use crate::failure::Failure;

/// Name of the case that compares with another process.
const OTHER_PROCESS: &str = "other_process";
/// Name of the case whose figures it compares.
const DETERMINISM: &str = "determinism";
/// Time between the two, so that outputs that follow from the time of day differ.
const APART: Duration = Duration::from_millis(1100);

/// Runs the command.
pub fn run(args: &CheckPlugin) -> Result<ExitCode, Failure> {
    let names: Vec<&str> =
        node_cases().iter().map(|c| c.name).chain([SURROUNDINGS, TIME, OTHER_PROCESS]).collect();
    if let Some(unknown) = args.cases.case.iter().find(|c| !names.contains(&c.as_str())) {
        let help = one_of(unknown, names.iter().copied());
        return Err(Diagnostic::new(format!("there is no case `{unknown}`")).help(help).into());
    }
    let list = std::env::var_os(asperity_loader::PATH_VARIABLE);
    let path = asperity_loader::find(&args.cases.plugin, "".as_ref(), list)?;
    let mut checker = Checker {
        cases: Cases { plugin: path.display().to_string(), ..args.cases.clone() },
        trial: Trial { path, patience: Duration::from_secs(args.patience.max(1)), in_all: None },
        report: Report::new(args.json),
    };
    let begun = Instant::now();
    let asked = |case: &str| args.cases.case.is_empty() || args.cases.case.iter().any(|c| c == case);
    if args.cases.case.is_empty() || args.cases.case.iter().any(|c| c != OTHER_PROCESS) {
        checker.run_all()?;
    }
    if asked(OTHER_PROCESS) {
        checker.compare(begun)?;
    }
    checker.report.finish(&checker.trial.path, args.cases.ticks)
}

/// Runs a plugin's file in another process.
struct Trial {
    path: PathBuf,
    patience: Duration,
    /// Time limit of all cases together.
    in_all: Option<Duration>,
}

struct Checker {
    cases: Cases,
    trial: Trial,
    report: Report,
}

/// Cases that call all functions that a graph calls first.
const FIRST: [&str; 4] = ["descriptor", "prepare", "zero", SURROUNDINGS];
/// Time limit of an answer of a plugin that is rebuilt while a graph plays.
const TRIAL: Duration = Duration::from_secs(5);

/// Tries the copy of a plugin's file in another process: its code, which may be damaged, must return and
/// leave the process as it was. Other failures do not matter here.
///
/// # Errors
/// The way in which the process ended or changed.
pub fn survives(path: &Path, copy: &Path) -> Result<(), Diagnostic> {
    let cases = Cases {
        plugin: copy.display().to_string(),
        kind: None,
        case: FIRST.map(str::to_owned).to_vec(),
        set: Vec::new(),
        ticks: 500,
    };
    let refuse = |what: String| Diagnostic::new(what).in_file(path);
    let trial = Trial { path: copy.to_owned(), patience: TRIAL, in_all: Some(2 * TRIAL) };
    let mut disturbed = None;
    let mut each = |said| {
        if let Said::Row(row) = said
            && row.case == SURROUNDINGS
            && row.verdict == "fail"
        {
            disturbed = Some(row.found);
        }
        Ok(())
    };
    match (trial.process(&cases, 0, &mut each), disturbed) {
        (Ok(Ended::Done), Some(found)) => Err(refuse(format!(
            "tried in another process, this plugin does not leave the process as it was: {found}"
        ))
        .help("`asperity plugin check` says more")),
        (Ok(Ended::Done), None) => Ok(()),
        (Ok(Ended::Broke { row, how, .. }), _) => {
            let during = row.map_or(String::new(), |(kind, case)| format!(" in case `{case}` of `{kind}`"));
            Err(refuse(format!("tried in another process, this plugin {how}{during}"))
                .help("`asperity plugin check` says more"))
        }
        // The loader reports a plugin that does not load.
        (Err(Failure::Input(_)), _) => Ok(()),
        (Err(Failure::Machine(what)), _) => Err(refuse(what)),
    }
}

/// A message of the process that runs cases.
enum Said {
    /// The plugin is loaded.
    Plugin(Value),
    /// A case is over.
    Row(Row),
}

/// End of a process that runs cases.
enum Ended {
    /// It ran all cases.
    Done,
    /// It broke: in this case of this kind, during this step; or outside of any case.
    Broke { row: Option<(String, String)>, doing: String, how: String },
}

impl Checker {
    /// Runs all cases. After a crash it goes on with the next case.
    fn run_all(&mut self) -> Result<(), Failure> {
        let mut done = 0;
        loop {
            let mut rows = Vec::new();
            let cases = self.cases.clone();
            let ended = self.trial.process(&cases, done, &mut |said| match said {
                Said::Plugin(plugin) => self.report.open(&plugin),
                Said::Row(row) => {
                    self.report.row(&row)?;
                    rows.push(row);
                    Ok(())
                }
            })?;
            done += rows.len();
            match ended {
                Ended::Done => return Ok(()),
                Ended::Broke { row: Some((kind, case)), doing, how } => {
                    let during = if doing.is_empty() { String::new() } else { format!(", at: {doing}") };
                    let found = format!("{how} in case `{case}`{during}");
                    self.report.row(&Row::new(kind, case, "fail", found))?;
                    done += 1;
                }
                Ended::Broke { row: None, how, .. } => {
                    let when = if self.report.is_open() { "exit" } else { "load" };
                    let found = format!("{how} outside of any case");
                    return self.report.row(&Row::new("".into(), when.into(), "fail", found));
                }
            }
        }
    }

    /// Runs the case of determinism in another process, or in two if it has not run yet, and compares.
    fn compare(&mut self, begun: Instant) -> Result<(), Failure> {
        let mut before = self.report.rows_of(DETERMINISM);
        if before.is_empty() {
            before = self.determinism()?;
            std::thread::sleep(APART);
        } else {
            std::thread::sleep(APART.saturating_sub(begun.elapsed()));
        }
        if !before.iter().any(|row| row.verdict == "pass") {
            return Ok(());
        }
        let again = self.determinism()?;
        for row in before.iter().filter(|row| row.verdict == "pass") {
            let same = again.iter().any(|other| other.kind == row.kind && other.found == row.found);
            let (verdict, found) = if same {
                ("pass", "the same".to_owned())
            } else {
                ("fail", "another process puts out something else for the same input".to_owned())
            };
            self.report.row(&Row::new(row.kind.clone(), OTHER_PROCESS.into(), verdict, found))?;
        }
        Ok(())
    }

    fn determinism(&mut self) -> Result<Vec<Row>, Failure> {
        let cases = Cases { case: vec![DETERMINISM.to_owned()], ..self.cases.clone() };
        let mut rows = Vec::new();
        self.trial.process(&cases, 0, &mut |said| {
            match said {
                Said::Plugin(plugin) => self.report.open(&plugin)?,
                Said::Row(row) => rows.push(row),
            }
            Ok(())
        })?;
        Ok(rows)
    }
}

impl Trial {
    /// Runs one process to its end.
    fn process(
        &self,
        cases: &Cases,
        skip: usize,
        each: &mut dyn FnMut(Said) -> Result<(), Failure>,
    ) -> Result<Ended, Failure> {
        let (mut child, lines) = self.spawn(cases, skip)?;
        let until = self.in_all.map(|span| Instant::now() + span);
        let (mut row, mut doing) = (None, String::new());
        loop {
            let left = until.map_or(self.patience, |until| until.saturating_duration_since(Instant::now()));
            let line = match lines.recv_timeout(self.patience.min(left)) {
                Ok(line) => line,
                Err(RecvTimeoutError::Disconnected) => {
                    return Ok(Ended::Broke { row, doing, how: child.end(self.patience) });
                }
                Err(RecvTimeoutError::Timeout) => {
                    let how = format!("did not answer within {} s", self.patience.as_secs());
                    return Ok(Ended::Broke { row, doing, how });
                }
            };
            let text = |v: &Value| v.as_str().unwrap_or_default().to_owned();
            if let Some(begin) = line.get("begin") {
                doing.clear();
                row = Some((text(&begin["kind"]), text(&begin["case"])));
            } else if let Some(what) = line.get("doing") {
                doing = text(what);
            } else if let (Some(end), Some((kind, case))) = (line.get("end"), row.clone()) {
                row = None;
                let mut of = Row::new(kind, case, &text(&end["verdict"]), text(&end["found"]));
                of.figures = end.clone();
                each(Said::Row(of))?;
            } else if let Some(plugin) = line.get("plugin") {
                each(Said::Plugin(plugin.clone()))?;
            } else if let Some(refused) = line.get("refused") {
                let d = Diagnostic::new(text(&refused["message"])).in_file(&self.path);
                return Err(match refused["help"].as_str() {
                    Some(help) => d.help(help),
                    None => d,
                }
                .into());
            } else if line.get("done").is_some() {
                return Ok(match child.status(self.patience) {
                    Some(status) if status.success() => Ended::Done,
                    _ => Ended::Broke { row: None, doing, how: child.end(self.patience) },
                });
            }
        }
    }

    fn spawn(&self, cases: &Cases, skip: usize) -> Result<(Running, Receiver<Value>), Failure> {
        let fail = |e: &std::io::Error| machine("cannot start the process that checks", e);
        let program = std::env::current_exe().map_err(|e| fail(&e))?;
        let (reader, writer) = std::io::pipe().map_err(|e| fail(&e))?;
        let mut command = Command::new(program);
        command.args(["plugin", "cases", "--ticks", &cases.ticks.to_string(), "--skip", &skip.to_string()]);
        for (option, values) in [("--case", &cases.case), ("--set", &cases.set)] {
            for value in values {
                command.arg(option).arg(value);
            }
        }
        if let Some(kind) = &cases.kind {
            command.arg("--kind").arg(kind);
        }
        command.arg("--").arg(&self.path);
        // The plugin may print: that is not part of the answer.
        command.stdin(Stdio::from(writer)).stdout(Stdio::from(std::io::stderr()));
        let child = command.spawn().map_err(|e| fail(&e))?;
        // Closes this end of the pipe, or it never ends.
        drop(command);
        let (send, receive) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(reader).lines().map_while(Result::ok) {
                if let Ok(value) = serde_json::from_str(&line)
                    && send.send(value).is_err()
                {
                    return;
                }
            }
        });
        Ok((Running(child), receive))
    }
}

/// A process that runs cases. It is killed on drop.
struct Running(Child);

impl Running {
    /// Its exit status, if it ends within this time.
    fn status(&mut self, patience: Duration) -> Option<ExitStatus> {
        let until = Instant::now() + patience;
        loop {
            match self.0.try_wait() {
                Ok(Some(status)) => return Some(status),
                Ok(None) if Instant::now() < until => std::thread::sleep(Duration::from_millis(5)),
                _ => return None,
            }
        }
    }

    /// Its end in words.
    fn end(&mut self, patience: Duration) -> String {
        self.status(patience).map_or_else(|| format!("did not end within {} s", patience.as_secs()), how)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn machine(what: &str, e: &std::io::Error) -> Failure {
    Failure::Machine(format!("{what}: {e}"))
}

/// The end of a process in words.
fn how(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return match signal_name(signal) {
            Some(name) => format!("crashed by signal {signal} ({name})"),
            None => format!("crashed by signal {signal}"),
        };
    }
    match status.code() {
        Some(code) => format!("ended the process with code {code}"),
        None => "ended the process".to_owned(),
    }
}

pub(super) fn signal_name(signal: i32) -> Option<&'static str> {
    // Other numbers differ between systems.
    let bus = if cfg!(target_os = "linux") { 7 } else { 10 };
    match signal {
        4 => Some("illegal instruction"),
        5 => Some("trap"),
        6 => Some("abort"),
        8 => Some("arithmetic error"),
        9 => Some("killed"),
        11 => Some("segmentation fault"),
        15 => Some("terminated"),
        n if n == bus => Some("bus error"),
        _ => None,
    }
}
