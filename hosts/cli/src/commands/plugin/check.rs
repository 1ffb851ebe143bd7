//! `asperity plugin check`: runs the node cases over a plugin, in a process of its own.
//!
//! A plugin that crashes ends the process of the cases. A new process goes on with the next case. A plugin
//! that does not answer is killed. It does not see locks, system calls and threads of a plugin, nor memory
//! that is not from the C library. It does not see writes to foreign memory that do not crash.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use asperity_checks::node_cases;
use asperity_diagnostics::{Diagnostic, one_of};
use serde_json::json;

use super::child::{Loaded, Message, Row, TIME};
use super::surroundings::SURROUNDINGS;
use super::{Cases, CheckPlugin};
use crate::failure::{Failure, print};

/// Name of the case that compares with another process.
const OTHER_PROCESS: &str = "other_process";
/// Name of the case whose figures it compares.
const DETERMINISM: &str = "determinism";
/// Time between the two, so that outputs that follow from the time of day differ.
const APART: Duration = Duration::from_millis(1100);
/// Cases that call all functions that a graph calls first.
const FIRST: [&str; 4] = ["descriptor", "prepare", "zero", SURROUNDINGS];
/// Time limit of an answer of a plugin that is rebuilt while a graph plays.
const TRIAL: Duration = Duration::from_secs(5);

pub fn run(args: &CheckPlugin) -> Result<(), Failure> {
    let asked = &args.cases.case;
    let names = || node_cases().iter().map(|c| c.name).chain([SURROUNDINGS, TIME, OTHER_PROCESS]);
    if let Some(unknown) = asked.iter().find(|asked| names().all(|name| name != *asked)) {
        let help = one_of(unknown, names());
        return Err(Diagnostic::new(format!("there is no case `{unknown}`")).help(help).into());
    }
    let list = std::env::var_os(asperity_loader::PATH_VARIABLE);
    let path = asperity_loader::find(&args.cases.plugin, "".as_ref(), list)?;
    let trial = Trial { path, patience: Duration::from_secs(args.patience.max(1)), in_all: None };
    let mut checker = Checker { cases: &args.cases, trial, json: args.json, plugin: None, rows: Vec::new() };
    let begun = Instant::now();
    if asked.is_empty() || asked.iter().any(|case| case != OTHER_PROCESS) {
        checker.run_all()?;
    }
    if asked.is_empty() || asked.iter().any(|case| case == OTHER_PROCESS) {
        checker.compare(begun)?;
    }
    checker.finish()
}

/// Tries a copy of a plugin in another process: its code must return and leave the process as it was.
pub fn survives(path: &Path, copy: &Path) -> Result<(), Diagnostic> {
    let case = FIRST.map(str::to_owned).to_vec();
    let cases = Cases { plugin: String::new(), kind: None, case, set: Vec::new(), ticks: 500 };
    let trial = Trial { path: copy.to_owned(), patience: TRIAL, in_all: Some(2 * TRIAL) };
    let mut disturbed = None;
    let ended = trial.process(&cases, 0, &mut |said| {
        if let Message::End(row) = said
            && row.case == SURROUNDINGS
            && row.verdict == "fail"
        {
            disturbed = Some(row.found);
        }
        Ok(())
    });
    let did = match (ended, disturbed) {
        (Ok(Ended::Done), None) => return Ok(()),
        (Ok(Ended::Done), Some(found)) => format!("does not leave the process as it was: {found}"),
        (Ok(Ended::Broke { row: Some((kind, case)), how, .. }), _) => {
            format!("{how} in case `{case}` of `{kind}`")
        }
        (Ok(Ended::Broke { how, .. }), _) => how,
        // The loader reports a plugin that does not load.
        (Err(Failure::Input(_)), _) => return Ok(()),
        (Err(other), _) => return Err(Diagnostic::new(other.reason()).in_file(path)),
    };
    let what = format!("tried in another process, this plugin {did}");
    Err(Diagnostic::new(what).in_file(path).help("`asperity plugin check` says more"))
}

/// Runs cases, and prints a table row by row, or JSON at the end.
struct Checker<'a> {
    cases: &'a Cases,
    trial: Trial,
    json: bool,
    plugin: Option<Loaded>,
    rows: Vec<Row>,
}

impl Checker<'_> {
    /// Runs all cases. After a crash it goes on with the next case.
    fn run_all(&mut self) -> Result<(), Failure> {
        let mut done = 0;
        loop {
            let mut rows = Vec::new();
            let ended = self.process(self.cases, done, &mut rows, true)?;
            done += rows.len();
            match ended {
                Ended::Done => return Ok(()),
                Ended::Broke { row: Some((kind, case)), doing, how } => {
                    let during = if doing.is_empty() { doing } else { format!(", at: {doing}") };
                    let found = format!("{how} in case `{case}`{during}");
                    self.row(Row::new(&kind, &case, "fail", found))?;
                    done += 1;
                }
                Ended::Broke { row: None, how, .. } => {
                    let when = if self.plugin.is_some() { "exit" } else { "load" };
                    return self.row(Row::new("", when, "fail", format!("{how} outside of any case")));
                }
            }
        }
    }

    /// Runs a process to its end and collects its rows; `shown` ones are results of the check.
    fn process(
        &mut self,
        cases: &Cases,
        skip: usize,
        rows: &mut Vec<Row>,
        shown: bool,
    ) -> Result<Ended, Failure> {
        let trial = self.trial.clone();
        trial.process(cases, skip, &mut |said| match said {
            Message::Loaded(plugin) => self.open(plugin),
            Message::End(row) => {
                rows.push(row.clone());
                if shown { self.row(row) } else { Ok(()) }
            }
            _ => Ok(()),
        })
    }

    /// Runs the case of determinism in another process, or in two if it has not run yet, and compares.
    fn compare(&mut self, begun: Instant) -> Result<(), Failure> {
        let cases = Cases { case: vec![DETERMINISM.to_owned()], ..self.cases.clone() };
        let mut before: Vec<Row> = self.rows.iter().filter(|r| r.case == DETERMINISM).cloned().collect();
        let since = if before.is_empty() {
            self.process(&cases, 0, &mut before, false)?;
            Instant::now()
        } else {
            begun
        };
        before.retain(|row| row.verdict == "pass");
        if before.is_empty() {
            return Ok(());
        }
        std::thread::sleep(APART.saturating_sub(since.elapsed()));
        let mut again = Vec::new();
        self.process(&cases, 0, &mut again, false)?;
        for row in before {
            let same = again.iter().any(|other| other.kind == row.kind && other.found == row.found);
            let (verdict, found) = match same {
                true => ("pass", "the same"),
                false => ("fail", "another process puts out something else for the same input"),
            };
            self.row(Row::new(&row.kind, OTHER_PROCESS, verdict, found.to_owned()))?;
        }
        Ok(())
    }

    /// Prints the heading when the plugin is first loaded.
    fn open(&mut self, plugin: Loaded) -> Result<(), Failure> {
        if self.plugin.is_some() {
            return Ok(());
        }
        let heading = format!("{} {}\n\n", plugin.name, plugin.version);
        self.plugin = Some(plugin);
        let line = self.line("kind", "case", "verdict", "found");
        if self.json { Ok(()) } else { print(&(heading + &line)) }
    }

    fn line(&self, kind: &str, case: &str, verdict: &str, found: &str) -> String {
        let kinds = self.plugin.iter().flat_map(|p| &p.kinds).map(String::len).max().unwrap_or(0).max(4);
        let cases = node_cases().iter().map(|c| c.name.len()).max().unwrap_or(0);
        let text = format!("{kind:kinds$}  {case:cases$}  {verdict:14}  {found}");
        format!("{}\n", text.trim_end())
    }

    fn row(&mut self, row: Row) -> Result<(), Failure> {
        let line = self.line(&row.kind, &row.case, &row.verdict, &row.found);
        self.rows.push(row);
        if self.json { Ok(()) } else { print(&line) }
    }

    fn finish(&self) -> Result<(), Failure> {
        let count = |verdict: &str| self.rows.iter().filter(|r| r.verdict == verdict).count();
        let (passed, failed, other) = (count("pass"), count("fail"), count("not applicable"));
        if self.json {
            let plugin = self.plugin.as_ref();
            let all = json!({
                "file": self.trial.path.display().to_string(), "name": plugin.map(|p| &p.name),
                "version": plugin.map(|p| &p.version), "heap_counted": plugin.map(|p| p.heap),
                "random_ticks": self.cases.ticks, "verdict": if failed == 0 { "pass" } else { "fail" },
                "cases": self.rows,
            });
            print(&format!("{all:#}\n"))?;
        } else {
            print(&format!("\n{passed} passed, {failed} failed, {other} not applicable\n"))?;
        }
        Failure::said(failed > 0)
    }
}

/// Runs a plugin's file in another process.
#[derive(Clone)]
struct Trial {
    path: PathBuf,
    patience: Duration,
    /// Time limit of all cases together.
    in_all: Option<Duration>,
}

/// End of a process that runs cases.
enum Ended {
    Done,
    /// It broke: in this case of this kind, during this step; or outside of any case.
    Broke {
        row: Option<(String, String)>,
        doing: String,
        how: String,
    },
}

impl Trial {
    /// Runs one process to its end. Hands on that the plugin is loaded, and the results of cases.
    fn process(
        &self,
        cases: &Cases,
        skip: usize,
        each: &mut dyn FnMut(Message) -> Result<(), Failure>,
    ) -> Result<Ended, Failure> {
        let (mut child, lines) = self.spawn(cases, skip)?;
        let until = self.in_all.map(|span| Instant::now() + span);
        let (mut row, mut doing) = (None, String::new());
        loop {
            let left = until.map_or(self.patience, |until| until.saturating_duration_since(Instant::now()));
            match lines.recv_timeout(self.patience.min(left)) {
                Ok(Message::Alive) => {}
                Ok(Message::Doing(what)) => doing = what,
                Ok(Message::Begin { kind, case }) => (row, doing) = (Some((kind, case)), String::new()),
                Ok(Message::Refused { message, help }) => {
                    let d = Diagnostic::new(message).in_file(&self.path);
                    return Err(help.into_iter().fold(d, Diagnostic::help).into());
                }
                Ok(Message::Done) => {
                    return Ok(match child.status(self.patience) {
                        Some(status) if status.success() => Ended::Done,
                        _ => Ended::Broke { row: None, doing, how: child.end(self.patience) },
                    });
                }
                Ok(said) => {
                    row = row.filter(|_| !matches!(said, Message::End(_)));
                    each(said)?;
                }
                Err(RecvTimeoutError::Disconnected) => {
                    return Ok(Ended::Broke { row, doing, how: child.end(self.patience) });
                }
                Err(RecvTimeoutError::Timeout) => {
                    let how = format!("did not answer within {} s", self.patience.as_secs());
                    return Ok(Ended::Broke { row, doing, how });
                }
            }
        }
    }

    fn spawn(&self, cases: &Cases, skip: usize) -> Result<(Running, Receiver<Message>), Failure> {
        let fail = |e: std::io::Error| Failure::Machine(format!("cannot start the process that checks: {e}"));
        let program = std::env::current_exe().map_err(fail)?;
        let (reader, writer) = std::io::pipe().map_err(fail)?;
        let mut command = Command::new(program);
        command.args(["plugin", "cases", "--ticks", &cases.ticks.to_string(), "--skip", &skip.to_string()]);
        let kind = Vec::from_iter(cases.kind.clone());
        for (option, values) in [("--case", &cases.case), ("--set", &cases.set), ("--kind", &kind)] {
            for value in values {
                command.arg(option).arg(value);
            }
        }
        command.arg("--").arg(&self.path);
        // The plugin may print: that is not part of the answer.
        command.stdin(Stdio::from(writer)).stdout(Stdio::from(std::io::stderr()));
        let child = command.spawn().map_err(fail)?;
        // Closes this end of the pipe, or it never ends.
        drop(command);
        let (send, receive) = channel();
        std::thread::spawn(move || {
            let lines = BufReader::new(reader).lines().map_while(Result::ok);
            let mut messages = lines.filter_map(|line| serde_json::from_str(&line).ok());
            messages.all(|message| send.send(message).is_ok())
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

    fn end(&mut self, patience: Duration) -> String {
        let Some(status) = self.status(patience) else {
            return format!("did not end within {} s", patience.as_secs());
        };
        #[cfg(unix)]
        if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
            return format!("crashed by {}", signal_name(signal));
        }
        match status.code() {
            Some(code) => format!("ended the process with code {code}"),
            None => "ended the process".to_owned(),
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

pub(super) fn signal_name(signal: i32) -> String {
    // Other numbers differ between systems.
    let bus = if cfg!(target_os = "linux") { 7 } else { 10 };
    let name = match signal {
        4 => "illegal instruction",
        5 => "trap",
        6 => "abort",
        8 => "arithmetic error",
        9 => "killed",
        11 => "segmentation fault",
        15 => "terminated",
        n if n == bus => "bus error",
        _ => return format!("signal {signal}"),
    };
    format!("signal {signal} ({name})")
}
