//! The process in which a plugin's cases run. It reports each step as a line of JSON, so that the last step
//! before a crash is known. The lines go through its standard input, since a plugin may print.

use std::cell::{Cell, RefCell};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use asperity_checks::{Subject, Verdict, Witness, node_cases, tick_time};
use asperity_diagnostics::{Diagnostic, one_of};
use asperity_loader::Plugin;
use asperity_node::NodeKind;
use serde_json::{Value, json};

use super::CasesOfPlugin;
use super::heap::Counter;
use super::surroundings::{SURROUNDINGS, Surroundings};

/// Name of the row with the time of a tick.
pub const TIME: &str = "time";

/// Interval of the signs of life.
const SIGN_OF_LIFE: Duration = Duration::from_millis(200);

/// The way to the process that started this one.
struct Line {
    out: RefCell<File>,
    last: Cell<Instant>,
}

impl Line {
    fn open() -> std::io::Result<Self> {
        #[cfg(unix)]
        let handle = std::os::fd::AsFd::as_fd(&std::io::stdin()).try_clone_to_owned()?;
        #[cfg(windows)]
        let handle = std::os::windows::io::AsHandle::as_handle(&std::io::stdin()).try_clone_to_owned()?;
        Ok(Self { out: RefCell::new(File::from(handle)), last: Cell::new(Instant::now()) })
    }

    fn say(&self, what: &Value) {
        // Without a reader there is nothing left to do.
        if writeln!(self.out.borrow_mut(), "{what}").is_err() {
            crate::leave::now(1);
        }
        self.last.set(Instant::now());
    }
}

impl Witness for Line {
    fn alive(&self) {
        if self.last.get().elapsed() > SIGN_OF_LIFE {
            self.say(&json!({ "alive": true }));
        }
    }

    fn doing(&self, what: &str) {
        self.say(&json!({ "doing": what }));
    }
}

/// Ends this process with its parent: a plugin in an endless loop would run for ever.
fn end_with_parent() {
    #[cfg(unix)]
    {
        let parent = std::os::unix::process::parent_id();
        let watch = move || {
            while std::os::unix::process::parent_id() == parent {
                std::thread::sleep(SIGN_OF_LIFE);
            }
            crate::leave::now(1);
        };
        let _ = std::thread::Builder::new().name("asperity-parent".into()).spawn(watch);
    }
}

/// Runs the cases.
pub fn run(args: &CasesOfPlugin) -> ExitCode {
    crate::leave::as_it_likes();
    end_with_parent();
    let Ok(line) = Line::open() else { return ExitCode::FAILURE };
    match checked(args, &line) {
        Ok(()) => ExitCode::SUCCESS,
        Err(d) => {
            line.say(&json!({ "refused": { "message": d.message, "help": d.help } }));
            ExitCode::from(2)
        }
    }
}

/// The wanted kinds.
fn kinds(plugin: &Plugin, wanted: Option<&str>) -> Result<Vec<Arc<NodeKind>>, Diagnostic> {
    let name = |k: &Arc<NodeKind>| k.descriptor().kind.to_string();
    let kinds: Vec<_> =
        plugin.kinds().iter().filter(|k| wanted.is_none_or(|w| w == name(k))).cloned().collect();
    match (kinds.is_empty(), wanted) {
        (true, Some(wanted)) => {
            let names: Vec<String> = plugin.kinds().iter().map(name).collect();
            let help = one_of(wanted, names.iter().map(String::as_str));
            Err(Diagnostic::new(format!("this plugin has no kind `{wanted}`")).help(help))
        }
        _ => Ok(kinds),
    }
}

/// The settings. Each must be a parameter of some kind.
fn settings(args: &CasesOfPlugin, kinds: &[Arc<NodeKind>]) -> Result<Vec<(String, String)>, Diagnostic> {
    let mut out = Vec::new();
    for text in &args.cases.set {
        let Some((name, value)) = text.split_once('=') else {
            return Err(Diagnostic::new(format!("there is no `=` in `{text}`")).help("PARAM=VALUE"));
        };
        let params = || kinds.iter().flat_map(|k| k.descriptor().params.iter());
        if !params().any(|p| p.name == name.trim()) {
            let names: Vec<&str> = params().map(|p| p.name.as_ref()).collect();
            let help = one_of(name.trim(), names.iter().copied());
            return Err(Diagnostic::new(format!("no kind here has a parameter `{}`", name.trim())).help(help));
        }
        out.push((name.trim().to_owned(), value.trim().to_owned()));
    }
    Ok(out)
}

fn checked(args: &CasesOfPlugin, line: &Line) -> Result<(), Diagnostic> {
    let mut surroundings = Surroundings::now();
    let plugin = Plugin::load(Path::new(&args.cases.plugin))?;
    let kinds = kinds(&plugin, args.cases.kind.as_deref())?;
    let settings = settings(args, &kinds)?;
    let heap = Counter::find();
    let names: Vec<_> = kinds.iter().map(|k| k.descriptor().kind.to_string()).collect();
    line.say(&json!({ "plugin": {
        "name": plugin.name(), "version": plugin.version(), "kinds": names, "heap": heap.is_some(),
    } }));
    let mut skip = args.skip;
    for kind in &kinds {
        let d = kind.descriptor();
        let mut subject = Subject::one(kind.clone()).ticks(args.cases.ticks).witness(line);
        for (name, value) in settings.iter().filter(|(n, _)| d.params.iter().any(|p| p.name == *n)) {
            subject = subject.set(name, value);
        }
        if let Some(heap) = &heap {
            subject = subject.heap(heap);
        }
        for name in node_cases().iter().map(|c| c.name).chain([SURROUNDINGS, TIME]) {
            if !args.cases.case.is_empty() && !args.cases.case.iter().any(|c| c == name) {
                continue;
            }
            if skip > 0 {
                skip -= 1;
                continue;
            }
            line.say(&json!({ "begin": { "kind": d.kind, "case": name } }));
            let end = if name == SURROUNDINGS {
                let found = surroundings.disturbed_by(&subject);
                surroundings = Surroundings::now();
                match found.is_empty() {
                    true => json!({ "verdict": "pass", "found": "as they were" }),
                    false => json!({ "verdict": "fail", "found": found.join("; ") }),
                }
            } else {
                outcome(&subject, name)
            };
            line.say(&json!({ "end": end }));
        }
    }
    line.say(&json!({ "done": true }));
    Ok(())
}

fn outcome(subject: &Subject<'_>, name: &str) -> Value {
    if let Some(case) = node_cases().iter().find(|c| c.name == name) {
        let outcome = case.run(subject);
        let verdict = match outcome.verdict {
            Verdict::Holds => "pass",
            Verdict::Fails => "fail",
            Verdict::NotApplicable => "not applicable",
        };
        return json!({ "verdict": verdict, "found": outcome.found });
    }
    match tick_time(subject) {
        Ok(t) => json!({
            "verdict": "measured",
            "found": format!(
                "median {:.2} us, 99 % {:.2} us, longest {:.1} us in {} calls",
                t.median_us, t.p99_us, t.max_us, t.calls
            ),
            "median_us": t.median_us, "p99_us": t.p99_us, "max_us": t.max_us, "calls": t.calls,
        }),
        Err(why) => json!({ "verdict": "not applicable", "found": why }),
    }
}
