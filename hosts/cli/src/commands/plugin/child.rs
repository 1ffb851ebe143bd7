//! The process in which a plugin's cases run. It reports each step as a line of JSON, so that the last step
//! before a crash is known. The lines go through its standard input, since a plugin may print.

use std::cell::{Cell, RefCell};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use asperity_checks::{Heap, Stop, Subject, Witness, node_cases, tick_time};
use asperity_diagnostics::{Diagnostic, one_of};
use asperity_loader::Plugin;
use asperity_node::NodeKind;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::CasesOfPlugin;
use super::heap::Counter;
use super::surroundings::{SURROUNDINGS, Surroundings};
use crate::failure::Failure;

/// Name of the row with the time of a tick.
pub const TIME: &str = "time";

const SIGN_OF_LIFE: Duration = Duration::from_millis(200);

#[derive(Debug, Serialize, Deserialize)]
pub enum Message {
    Alive,
    Doing(String),
    Loaded(Loaded),
    Begin {
        kind: String,
        case: String,
    },
    End(Row),
    /// The plugin does not load, or the arguments are wrong.
    Refused {
        message: String,
        help: Option<String>,
    },
    Done,
}

#[derive(Debug, Serialize, Deserialize)]
pub struct Loaded {
    pub name: String,
    pub version: String,
    pub kinds: Vec<String>,
    pub heap: bool,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    pub kind: String,
    pub case: String,
    about: Option<String>,
    pub verdict: String,
    pub found: String,
    #[serde(flatten)]
    figures: Map<String, Value>,
}

impl Row {
    pub fn new(kind: &str, case: &str, verdict: &str, found: String) -> Self {
        let about = node_cases().iter().find(|c| c.name == case).map(|c| format!("{}: {}", c.hard, c.must));
        let (kind, case, verdict) = (kind.to_owned(), case.to_owned(), verdict.to_owned());
        Self { kind, case, about, verdict, found, figures: Map::new() }
    }
}

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

    fn say(&self, what: &Message) {
        let line = serde_json::to_string(what).unwrap_or_default();
        // Without a reader there is nothing left to do.
        if writeln!(self.out.borrow_mut(), "{line}").is_err() {
            crate::leave::now(1);
        }
        self.last.set(Instant::now());
    }
}

impl Witness for Line {
    fn alive(&self) {
        if self.last.get().elapsed() > SIGN_OF_LIFE {
            self.say(&Message::Alive);
        }
    }

    fn doing(&self, what: &str) {
        self.say(&Message::Doing(what.to_owned()));
    }
}

/// Ends this process with its parent: a plugin in an endless loop would never end.
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

pub fn run(args: &CasesOfPlugin) -> Result<(), Failure> {
    crate::leave::as_it_likes();
    end_with_parent();
    let line = Line::open().map_err(|_| Failure::Said(1))?;
    checked(args, &line).map_err(|d| {
        line.say(&Message::Refused { message: d.message, help: d.help });
        Failure::Said(2)
    })
}

fn kinds(plugin: &Plugin, wanted: Option<&str>) -> Result<Vec<Arc<NodeKind>>, Diagnostic> {
    let name = |k: &Arc<NodeKind>| k.descriptor().kind.to_string();
    let is_wanted = |k: &&Arc<NodeKind>| wanted.is_none_or(|wanted| wanted == name(k));
    let kinds: Vec<_> = plugin.kinds().iter().filter(is_wanted).cloned().collect();
    let Some(wanted) = wanted.filter(|_| kinds.is_empty()) else { return Ok(kinds) };
    let names: Vec<String> = plugin.kinds().iter().map(name).collect();
    let help = one_of(wanted, names.iter().map(String::as_str));
    Err(Diagnostic::new(format!("this plugin has no kind `{wanted}`")).help(help))
}

/// A setting of `--set`. It must be a parameter of some kind.
fn setting<'a>(text: &'a str, kinds: &[Arc<NodeKind>]) -> Result<(&'a str, &'a str), Diagnostic> {
    let Some((name, value)) = text.split_once('=') else {
        return Err(Diagnostic::new(format!("there is no `=` in `{text}`")).help("PARAM=VALUE"));
    };
    let (name, value) = (name.trim(), value.trim());
    let params = || kinds.iter().flat_map(|k| k.descriptor().params.iter().map(|p| p.name.as_ref()));
    if params().any(|param| param == name) {
        return Ok((name, value));
    }
    Err(Diagnostic::new(format!("no kind here has a parameter `{name}`")).help(one_of(name, params())))
}

fn checked(args: &CasesOfPlugin, line: &Line) -> Result<(), Diagnostic> {
    let mut surroundings = Surroundings::now();
    let plugin = Plugin::load(Path::new(&args.cases.plugin))?;
    let kinds = kinds(&plugin, args.cases.kind.as_deref())?;
    let settings = args.cases.set.iter().map(|text| setting(text, &kinds)).collect::<Result<Vec<_>, _>>()?;
    let heap = Counter::find();
    line.say(&Message::Loaded(Loaded {
        name: plugin.name().to_string(),
        version: plugin.version().to_string(),
        kinds: kinds.iter().map(|k| k.descriptor().kind.to_string()).collect(),
        heap: heap.is_some(),
    }));
    let mut skip = args.skip;
    for kind in &kinds {
        let d = kind.descriptor();
        let mut subject = Subject::one(kind.clone());
        subject.ticks = args.cases.ticks;
        subject.witness = Some(line);
        for (name, value) in settings.iter().filter(|(n, _)| d.params.iter().any(|p| p.name == *n)) {
            subject = subject.set(*name, *value);
        }
        subject.heap = heap.as_ref().map(|heap| heap as &dyn Heap);
        for case in node_cases().iter().map(|c| c.name).chain([SURROUNDINGS, TIME]) {
            if !args.cases.case.is_empty() && !args.cases.case.iter().any(|c| c == case) {
                continue;
            }
            if skip > 0 {
                skip -= 1;
                continue;
            }
            line.say(&Message::Begin { kind: d.kind.to_string(), case: case.to_owned() });
            let end = if case == SURROUNDINGS {
                let found = surroundings.disturbed_by(&subject);
                surroundings = Surroundings::now();
                match found.is_empty() {
                    true => Row::new(&d.kind, case, "pass", "as they were".into()),
                    false => Row::new(&d.kind, case, "fail", found.join("; ")),
                }
            } else {
                outcome(&subject, &d.kind, case)
            };
            line.say(&Message::End(end));
        }
    }
    line.say(&Message::Done);
    Ok(())
}

fn outcome(subject: &Subject<'_>, kind: &str, name: &str) -> Row {
    if let Some(case) = node_cases().iter().find(|c| c.name == name) {
        return match case.run(subject) {
            Ok(found) => Row::new(kind, name, "pass", found),
            Err(Stop::Failed(why)) => Row::new(kind, name, "fail", why),
            Err(Stop::NotApplicable(why)) => Row::new(kind, name, "not applicable", why),
        };
    }
    let t = match tick_time(subject) {
        Ok(t) => t,
        Err(why) => return Row::new(kind, name, "not applicable", why),
    };
    let (median, p99, max, calls) = (t.median_us, t.p99_us, t.max_us, t.calls);
    let found = format!("median {median:.2} us, 99 % {p99:.2} us, longest {max:.1} us in {calls} calls");
    let figures = [("median_us", median), ("p99_us", p99), ("max_us", max)];
    let figures = figures.map(|(name, us)| (name.to_owned(), us.into()));
    let figures = figures.into_iter().chain([("calls".to_owned(), calls.into())]).collect();
    Row { figures, ..Row::new(kind, name, "measured", found) }
}
