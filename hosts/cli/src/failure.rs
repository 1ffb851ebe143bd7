//! How the program fails: with what was wrong, where, and an exit code.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use asperity_source::{Diagnostic, Place};
use miette::{GraphicalReportHandler, GraphicalTheme, LabeledSpan, NamedSource};

/// Why a command did not do what it was asked.
#[derive(Debug)]
pub enum Failure {
    /// Something the user gave is wrong: exit code 2.
    Input(Vec<Diagnostic>),
    /// The machine did not play along, such as a full disk: exit code 1.
    Machine(String),
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

impl Failure {
    /// A file that could not be written.
    pub fn writing(path: &Path, error: impl fmt::Display) -> Self {
        Self::Machine(format!("cannot write {}: {error}", path.display()))
    }

    /// Prints what is wrong and answers the exit code.
    pub fn report(&self) -> ExitCode {
        match self {
            Failure::Input(all) => {
                for d in all {
                    eprintln!("{}", Shown(d));
                }
                if all.len() > 1 {
                    eprintln!("{} errors; nothing was started, nothing written", all.len());
                }
                ExitCode::from(2)
            }
            Failure::Machine(message) => {
                eprintln!("error: {message}");
                ExitCode::from(1)
            }
        }
    }
}

/// Prints a warning in the way of an error.
pub fn warn(message: &str) {
    eprintln!("warning: {message}");
}

/// A diagnostic as a person reads it: `file:line:column: message` on the first line, then the text with a caret.
struct Shown<'a>(&'a Diagnostic);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let d = self.0;
        match (&d.place, d.path()) {
            (Some(place), Some(path)) => {
                let at = place.position();
                writeln!(f, "{}:{}:{}: error: {}", path.display(), at.line, at.column, d.message)?;
            }
            (None, Some(path)) => writeln!(f, "{}: error: {}", path.display(), d.message)?,
            _ => writeln!(f, "error: {}", d.message)?,
        }
        let label = |p: &Place, text: &str| {
            let len = p.span.end.saturating_sub(p.span.start).max(1);
            LabeledSpan::new_with_span((!text.is_empty()).then(|| text.to_owned()), (p.span.start, len))
        };
        // What stands in another file than the error itself is named in a line of its own.
        let (here, elsewhere): (Vec<_>, Vec<_>) = d
            .related
            .iter()
            .partition(|(p, _)| d.place.as_ref().is_some_and(|at| at.source.path() == p.source.path()));
        if let Some(place) = &d.place
            && !place.source.text().is_empty()
        {
            let mut labels = vec![label(place, &d.label)];
            labels.extend(here.iter().map(|(p, text)| label(p, text)));
            let theme = GraphicalTheme::unicode_nocolor();
            let handler = GraphicalReportHandler::new_themed(theme).with_width(110).with_context_lines(1);
            let name = place.source.path().display().to_string();
            let snippet = Snippet { source: NamedSource::new(name, place.source.text().to_owned()), labels };
            let mut text = String::new();
            handler.render_report(&mut text, &snippet)?;
            // The first line is the report's own title, which stands above already.
            for line in text.lines().skip_while(|l| !l.contains('╭')).filter(|l| !l.trim().is_empty()) {
                writeln!(f, "{line}")?;
            }
        }
        for (p, text) in elsewhere {
            let at = p.position();
            writeln!(f, "  {text} at {}:{}:{}", p.source.path().display(), at.line, at.column)?;
        }
        if let Some(help) = &d.help {
            writeln!(f, "  help: {help}")?;
        }
        Ok(())
    }
}

/// A piece of a file with carets.
#[derive(Debug)]
struct Snippet {
    source: NamedSource<String>,
    labels: Vec<LabeledSpan>,
}

impl fmt::Display for Snippet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("error")
    }
}

impl std::error::Error for Snippet {}

impl miette::Diagnostic for Snippet {
    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        Some(&self.source)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        Some(Box::new(self.labels.iter().cloned()))
    }
}
