//! Sources, positions in them, and errors that point there.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::file;
use crate::quote::cut;

/// A text and its name in errors, usually a path.
#[derive(Debug, PartialEq, Eq)]
pub struct Source {
    path: PathBuf,
    text: String,
}

/// Largest text file in bytes: far beyond any graph, and too small to fill memory.
pub const MAX_TEXT_BYTES: u64 = 256 << 20;

impl Source {
    /// Makes a source from a text in memory.
    pub fn new(path: impl Into<PathBuf>, text: impl Into<String>) -> Arc<Self> {
        Arc::new(Self { path: path.into(), text: text.into() })
    }

    /// Reads a UTF-8 text file. Error: a missing, unreadable, too large or not UTF-8 file, named by its
    /// path.
    pub fn read(path: impl AsRef<Path>) -> Result<Arc<Self>, Diagnostic> {
        let path = path.as_ref();
        match String::from_utf8(file::read(path, MAX_TEXT_BYTES)?) {
            Ok(text) => Ok(Self::new(path, text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))),
            Err(e) => {
                let good = e.utf8_error().valid_up_to();
                let text = String::from_utf8_lossy(&e.as_bytes()[..good]).into_owned();
                let source = Self::new(path, text);
                Err(Diagnostic::new("not a text file: from here on it is not UTF-8")
                    .at(&source, Span::at(good)))
            }
        }
    }

    /// The path or name of this text.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Line and column of a byte offset; an offset past the end is the end.
    pub fn position(&self, offset: usize) -> Position {
        let mut end = offset.min(self.text.len());
        while !self.text.is_char_boundary(end) {
            end -= 1;
        }
        let before = &self.text[..end];
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        Position {
            line: before.bytes().filter(|&b| b == b'\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
        }
    }

    /// Span of a whole line, counted from 1, without its line end.
    pub fn line_span(&self, line: usize) -> Span {
        let mut start = 0;
        for _ in 1..line {
            match self.text[start..].find('\n') {
                Some(i) => start += i + 1,
                None => return Span::at(self.text.len()),
            }
        }
        let len = self.text[start..].find('\n').unwrap_or(self.text.len() - start);
        Span { start, end: start + self.text[start..start + len].trim_end_matches('\r').len() }
    }
}

/// Bytes `start..end` of a source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Span {
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

impl Span {
    /// An empty span: a point.
    pub fn at(offset: usize) -> Self {
        Self { start: offset, end: offset }
    }
}

/// A line and a column, both counted from 1; columns are counted in characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1.
    pub column: usize,
}

/// A span in a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The text.
    pub source: Arc<Source>,
    /// Where in it.
    pub span: Span,
}

impl Place {
    /// Line and column of the first character.
    pub fn position(&self) -> Position {
        self.source.position(self.span.start)
    }
}

/// An error with its position and a help text. Quoted texts longer than 80 characters are cut.
#[derive(Clone, Debug, Default)]
pub struct Diagnostic {
    /// The problem, in one sentence.
    pub message: String,
    /// Text under the caret; empty for none.
    pub label: String,
    /// Suggested fix.
    pub help: Option<String>,
    /// Position in a text.
    pub place: Option<Place>,
    /// The file, if its text cannot be shown.
    pub file: Option<PathBuf>,
    /// Further positions that belong to the error, each with a label.
    pub related: Vec<(Place, String)>,
}

impl Diagnostic {
    /// Makes an error without a position.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: cut(message.into()), ..Self::default() }
    }

    /// Points at a span of a text.
    #[must_use]
    pub fn at(mut self, source: &Arc<Source>, span: Span) -> Self {
        self.place = Some(Place { source: source.clone(), span });
        self
    }

    /// Points at a place.
    #[must_use]
    pub fn at_place(self, place: &Place) -> Self {
        self.at(&place.source, place.span)
    }

    /// Names a file whose text cannot be shown (missing, binary).
    #[must_use]
    pub fn in_file(mut self, path: impl Into<PathBuf>) -> Self {
        self.file = Some(path.into());
        self
    }

    /// Sets the text under the caret.
    #[must_use]
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = cut(label.into());
        self
    }

    /// Sets the suggested fix.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(cut(help.into()));
        self
    }

    /// Adds a further position that belongs to the error.
    #[must_use]
    pub fn related(mut self, source: &Arc<Source>, span: Span, label: impl Into<String>) -> Self {
        self.related.push((Place { source: source.clone(), span }, cut(label.into())));
        self
    }

    /// File of this error, if there is one.
    pub fn path(&self) -> Option<&Path> {
        self.place.as_ref().map(|p| p.source.path()).or(self.file.as_deref())
    }
}

/// `file:line:column: message (help)`, on one line.
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(path) = self.path() {
            // A file's name may hold what a terminal would obey.
            for c in path.display().to_string().chars() {
                if c.is_control() { write!(f, "{}", c.escape_unicode())? } else { write!(f, "{c}")? }
            }
            f.write_str(":")?;
            if let Some(place) = &self.place {
                let Position { line, column } = place.position();
                write!(f, "{line}:{column}:")?;
            }
            f.write_str(" ")?;
        }
        f.write_str(&self.message)?;
        if let Some(help) = &self.help {
            write!(f, " ({help})")?;
        }
        Ok(())
    }
}

impl std::error::Error for Diagnostic {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_count_characters_from_one() {
        let s = Source::new("a.ron", "ab\nçd e\n");
        assert_eq!(s.position(0), Position { line: 1, column: 1 });
        assert_eq!(s.position(s.text().find('e').unwrap()), Position { line: 2, column: 4 });
        assert_eq!(s.position(999), Position { line: 3, column: 1 });
        assert_eq!(s.line_span(2), Span { start: 3, end: 8 });
    }

    #[test]
    fn diagnostic_prints_file_line_and_column() {
        let s = Source::new("g.ron", "one\ntwo");
        let d = Diagnostic::new("wrong").at(&s, Span { start: 5, end: 6 }).help("try 2");
        assert_eq!(d.to_string(), "g.ron:2:2: wrong (try 2)");
    }

    #[test]
    fn missing_file_is_named() {
        let e = Source::read("no/such/file").unwrap_err();
        assert!(e.to_string().starts_with("no/such/file: cannot read"), "{e}");
    }
}
