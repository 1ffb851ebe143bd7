//! Errors with their place, and their text.

use std::fmt;
use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, Place};
use serde::Serialize;
use unicode_width::UnicodeWidthStr;

/// Why something was not done.
#[derive(Debug)]
pub enum Failure {
    /// The user's input is wrong: exit code 2; or too many files are open to read it: 1.
    Input(Vec<Diagnostic>),
    /// The machine failed, such as a full disk: exit code 1.
    Machine(String),
    /// All is said: the exit code.
    Said(u8),
}

impl From<Diagnostic> for Failure {
    fn from(d: Diagnostic) -> Self {
        Self::Input(vec![d])
    }
}

impl From<Vec<Diagnostic>> for Failure {
    fn from(d: Vec<Diagnostic>) -> Self {
        Self::Input(d)
    }
}

/// The error for a file or option at fault, with help.
pub fn wrong(at: impl Into<PathBuf>, what: impl Into<String>, help: impl Into<String>) -> Failure {
    Diagnostic::new(what).in_file(at).help(help).into()
}

impl Failure {
    /// The error for a file that cannot be written.
    pub fn writing(path: &Path, error: impl fmt::Display) -> Self {
        Self::Machine(format!("cannot write {}: {}", path.display(), without_path(error)))
    }

    /// Exit code 1 without more words, where something failed.
    ///
    /// # Errors
    /// Something failed.
    pub fn said(failed: bool) -> Result<(), Self> {
        if failed { Err(Self::Said(1)) } else { Ok(()) }
    }

    /// Adds the option that names the file.
    pub fn named_by(self, option: &str) -> Self {
        let Self::Input(all) = self else { return self };
        let named = |d: Diagnostic| {
            let by = format!("{option} names this file");
            let help = d.help.as_ref().map_or(by.clone(), |help| format!("{help}; {by}"));
            d.help(help)
        };
        Self::Input(all.into_iter().map(named).collect())
    }

    /// Removes places in a text that the program wrote for itself, and no user sees.
    pub fn not_shown(self, text: &Path) -> Self {
        let Self::Input(mut all) = self else { return self };
        for d in &mut all {
            if d.place.take_if(|place| place.source.path() == text).is_some() {
                d.file = Some(text.to_owned());
            }
            d.related.retain(|(place, _)| place.source.path() != text);
        }
        Self::Input(all)
    }

    /// The first error in a line, without its place.
    pub fn reason(&self) -> String {
        match self {
            Failure::Input(all) => all.first().map(|d| clean(&d.message)).unwrap_or_default(),
            Failure::Machine(message) => message.clone(),
            Failure::Said(code) => format!("exit code {code}"),
        }
    }

    /// The first error with its place, and its help, for another program.
    pub fn parts(&self) -> (String, String) {
        match self {
            Failure::Input(all) => all.first().map_or_else(Default::default, |d| {
                let bare = Diagnostic { help: None, ..d.clone() };
                (clean(&bare.to_string()), d.help.as_deref().map(clean).unwrap_or_default())
            }),
            failure => (failure.reason(), String::new()),
        }
    }

    /// The whole text: of each error `file:line:column: message`, then the source with a caret, then help.
    pub fn text(&self) -> String {
        match self {
            Failure::Input(all) => {
                let shown: String = all.iter().take(MOST_SHOWN).map(|d| format!("{}\n", Shown(d))).collect();
                match all.len().saturating_sub(MOST_SHOWN) {
                    0 => shown,
                    1 => shown + "... and 1 more error\n",
                    more => format!("{shown}... and {} more errors\n", grouped(more)),
                }
            }
            Failure::Machine(message) => {
                let help = open_files(message).map(|help| format!("  help: {help}\n"));
                format!("error: {message}\n{}", help.unwrap_or_default())
            }
            Failure::Said(_) => String::new(),
        }
    }
}

const MOST_SHOWN: usize = 50;

/// Most further places that are shown with an error.
const MOST_RELATED: usize = 10;

/// A number with commas between its thousands.
pub fn grouped(number: usize) -> String {
    match number {
        0..1000 => number.to_string(),
        _ => format!("{},{:03}", grouped(number / 1000), number % 1000),
    }
}

/// A number of things, in words.
pub fn plural(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// The text of an I/O error without the temporary name of an incomplete file.
pub fn without_path(error: impl fmt::Display) -> String {
    error.to_string().split(" at path ").next().unwrap_or_default().to_owned()
}

/// Help for an error of too many open files, found in its text: wrappers seldom keep the type of an error.
pub fn open_files(message: &str) -> Option<&'static str> {
    let found = message.split_once("Too many open files")?.1;
    Some(match found.starts_with(" in system") {
        true => "the whole system has too many open files: close other programs",
        false => "the shell's limit is too low: raise it with `ulimit -n 1024`",
    })
}

/// A value as JSON, with a line end.
///
/// # Errors
/// A value that JSON cannot have.
pub fn json(value: &impl Serialize) -> Result<String, Failure> {
    serde_json::to_string_pretty(value).map(|text| text + "\n").map_err(|e| Failure::Machine(e.to_string()))
}

/// A text from a file, harmless to a terminal, and at most 600 characters.
pub fn clean(text: &str) -> String {
    const MOST: usize = 600;
    let harmful = |c: char| {
        (c.is_control() && c != '\t') || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    let escaped = |c: char| if harmful(c) { c.escape_unicode().to_string() } else { c.to_string() };
    let mut out: String = text.chars().take(MOST).map(escaped).collect();
    if text.chars().count() > MOST {
        out.push('…');
    }
    out
}

/// A diagnostic as text: `file:line:column: message` on the first line, then the source with a caret.
struct Shown<'a>(&'a Diagnostic);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let d = self.0;
        match (&d.place, d.path()) {
            (Some(place), Some(path)) => {
                let at = place.position();
                let path = clean(&path.display().to_string());
                writeln!(f, "{path}:{}:{}: error: {}", at.line, at.column, clean(&d.message))?;
            }
            (None, Some(path)) => {
                writeln!(f, "{}: error: {}", clean(&path.display().to_string()), clean(&d.message))?
            }
            _ => writeln!(f, "error: {}", clean(&d.message))?,
        }
        // Places in other files have snippets of their own.
        let (here, elsewhere): (Vec<_>, Vec<_>) = d
            .related
            .iter()
            .take(MOST_RELATED)
            .partition(|(p, _)| d.place.as_ref().is_some_and(|at| at.source.path() == p.source.path()));
        let own = d.place.iter().map(|place| (place, d.label.as_str()));
        write_snippet(f, own.chain(here.into_iter().map(|(place, text)| (place, text.as_str()))))?;
        for (p, text) in elsewhere {
            let at = p.position();
            writeln!(f, "  {text} at {}:{}:{}", p.source.path().display(), at.line, at.column)?;
            write_snippet(f, std::iter::once((p, "")))?;
        }
        if let Some(more @ 1..) = d.related.len().checked_sub(MOST_RELATED) {
            writeln!(f, "  ... and {} more places", grouped(more))?;
        }
        for help in d.help.as_deref().into_iter().chain(open_files(&d.message)) {
            writeln!(f, "  help: {}", clean(help))?;
        }
        Ok(())
    }
}

/// Characters that are shown on each side of a place in a long line.
const AROUND: usize = 80;

/// Writes the lines of places in one text, with carets and a label under each place.
fn write_snippet<'a>(
    f: &mut fmt::Formatter<'_>,
    places: impl Iterator<Item = (&'a Place, &'a str)>,
) -> fmt::Result {
    let mut places: Vec<_> = places.filter(|(place, _)| !place.source.text().is_empty()).collect();
    places.sort_by_key(|(place, _)| place.span.start);
    let mut shown = None;
    for (place, label) in places {
        let (at, text) = (place.position(), place.source.text());
        let line = place.source.line_span(at.line);
        let line = &text[line.start..line.end];
        let first = (at.column - 1).saturating_sub(AROUND);
        let dots = if first > 0 { "…" } else { "" };
        if shown != Some((at.line, first)) {
            let part: String = line.chars().skip(first).take(2 * AROUND).collect();
            let more = if line.chars().count() > first + 2 * AROUND { "…" } else { "" };
            writeln!(f, "{:>5} │ {dots}{}{more}", at.line, clean(&part.replace('\t', " ")))?;
            shown = Some((at.line, first));
        }
        let before: String = line.chars().skip(first).take(at.column - 1 - first).collect();
        let before = dots.width() + clean(&before.replace('\t', " ")).width();
        let marked = text.get(place.span.start..place.span.end).unwrap_or_default();
        let marked = clean(marked.lines().next().unwrap_or_default()).width().clamp(1, AROUND);
        let marks = format!("{:>5} │ {:before$}{} {}", "", "", "^".repeat(marked), clean(label));
        writeln!(f, "{}", marks.trim_end())?;
    }
    Ok(())
}
