//! Access to values.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{Key, Kind, Value};
use crate::{Diagnostic, Place, Source, Span, nearest, one_of};

impl Value {
    /// A value made by a program because of a position in a file. Errors point there, and paths are
    /// relative to that file.
    pub fn made(kind: Kind, place: &Place) -> Self {
        Self { source: place.source.clone(), span: place.span, kind }
    }

    /// The same value, each part of it where `place` says that its span stands now.
    #[must_use]
    pub fn moved(self, place: &impl Fn(Span) -> Place) -> Self {
        let all = |fields: Vec<(Key, Self)>| {
            let one =
                |(key, value): (Key, Self)| (Key { span: place(key.span).span, ..key }, value.moved(place));
            fields.into_iter().map(one).collect()
        };
        let Place { source, span } = place(self.span);
        let kind = match self.kind {
            Kind::List(items) => Kind::List(items.into_iter().map(|item| item.moved(place)).collect()),
            Kind::Record { name, fields } => Kind::Record { name, fields: all(fields) },
            Kind::Map(entries) => Kind::Map(all(entries)),
            plain => plain,
        };
        Self { source, span, kind }
    }

    /// Position of this value, with its text.
    pub fn place(&self) -> Place {
        Place { source: self.source.clone(), span: self.span }
    }

    /// The text that contains this value.
    pub fn source(&self) -> &Arc<Source> {
        &self.source
    }

    /// Position of this value.
    pub fn span(&self) -> Span {
        self.span
    }

    /// The value itself.
    pub fn kind(&self) -> &Kind {
        &self.kind
    }

    /// An error that points at this value.
    pub fn error(&self, message: impl Into<String>) -> Diagnostic {
        Diagnostic::new(message).at(&self.source, self.span)
    }

    /// Describes this value for an error message.
    pub fn describe(&self) -> String {
        match &self.kind {
            Kind::Unit => "nothing `()`".into(),
            Kind::Bool(b) => format!("`{b}`"),
            Kind::Int(i) => format!("the number {i}"),
            Kind::Float(x) => format!("the number {x}"),
            Kind::Text(t) => format!("the text \"{t}\""),
            Kind::Word(w) => format!("the word `{w}`"),
            Kind::List(l) => format!("a list of {}", l.len()),
            Kind::Record { name: Some(n), .. } => format!("`{n}(...)`"),
            Kind::Record { name: None, .. } => "named fields `(...)`".into(),
            Kind::Map(_) => "a map `{...}`".into(),
        }
    }

    fn mismatch(&self, wanted: &str) -> Diagnostic {
        self.error(format!("expected {wanted}, found {}", self.describe()))
            .label(format!("expected {wanted}"))
    }

    /// A number, whole or not. Error: anything but a number.
    pub fn f64(&self) -> Result<f64, Diagnostic> {
        match self.kind {
            // Whole numbers in a file are far below 2^53.
            Kind::Int(i) => Ok(i as f64),
            Kind::Float(x) => Ok(x),
            _ => Err(self.mismatch("a number")),
        }
    }

    /// A number within a range, in a unit that is named in the error. Error: anything but a number in the
    /// range.
    pub fn f64_in(&self, range: RangeInclusive<f64>, unit: &str) -> Result<f64, Diagnostic> {
        self.within(self.f64()?, range, unit)
    }

    /// A whole number. Error: anything but a whole number.
    pub fn i64(&self) -> Result<i64, Diagnostic> {
        match self.kind {
            Kind::Int(i) => Ok(i),
            Kind::Float(x) if x.fract() == 0.0 && x.abs() < 9e15 => Ok(x as i64),
            _ => Err(self.mismatch("a whole number")),
        }
    }

    /// A whole number within a range. Error: anything but a whole number in the range.
    pub fn i64_in(&self, range: RangeInclusive<i64>, unit: &str) -> Result<i64, Diagnostic> {
        self.within(self.i64()?, range, unit)
    }

    fn within<T: PartialOrd + Display>(
        &self,
        x: T,
        range: RangeInclusive<T>,
        unit: &str,
    ) -> Result<T, Diagnostic> {
        if range.contains(&x) {
            return Ok(x);
        }
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let help = format!("from {} to {}{unit}", range.start(), range.end());
        Err(self.error(format!("{x}{unit} is out of range")).label("out of range").help(help))
    }

    /// `true` or `false`. Error: anything else.
    pub fn bool(&self) -> Result<bool, Diagnostic> {
        match self.kind {
            Kind::Bool(b) => Ok(b),
            _ => Err(self.mismatch("true or false")),
        }
    }

    /// A text in quotes. Error: anything else.
    pub fn text(&self) -> Result<&str, Diagnostic> {
        match &self.kind {
            Kind::Text(t) => Ok(t),
            Kind::Word(w) => Err(self.mismatch("a text in quotes").help(format!("\"{w}\""))),
            _ => Err(self.mismatch("a text in quotes")),
        }
    }

    /// One of a few words, in quotes or bare. Error: anything else, with the nearest of the words.
    pub fn choice(&self, words: &[&str]) -> Result<&str, Diagnostic> {
        let (Kind::Text(found) | Kind::Word(found)) = &self.kind else {
            return Err(self.mismatch("a word").help(one_of("", words.iter().copied())));
        };
        if words.contains(&found.as_str()) {
            return Ok(found);
        }
        Err(self.error(format!("unknown choice `{found}`")).help(one_of(found, words.iter().copied())))
    }

    /// The items of a list or tuple. Error: anything but a list.
    pub fn list(&self) -> Result<&[Value], Diagnostic> {
        match &self.kind {
            Kind::List(items) => Ok(items),
            Kind::Unit => Ok(&[]),
            _ => Err(self.mismatch("a list `[...]`")),
        }
    }

    /// The entries of a map with texts as keys, in the order of the file. Error: anything but a map.
    pub fn map(&self) -> Result<&[(Key, Value)], Diagnostic> {
        match &self.kind {
            Kind::Map(entries) => Ok(entries),
            _ => Err(self.mismatch("a map `{\"name\": ...}`")),
        }
    }

    /// The path in a text, from the folder of the file that names it. Error: anything but a text, an empty
    /// text.
    pub fn path(&self) -> Result<PathBuf, Diagnostic> {
        let text = self.text()?;
        if text.trim().is_empty() {
            return Err(self.error("an empty path"));
        }
        Ok(self.source.path().parent().unwrap_or(Path::new("")).join(text))
    }

    /// A struct with named fields, called `name` or without a name. Error: anything else, or a struct of
    /// another name.
    pub fn record(&self, name: &str) -> Result<Record<'_>, Diagnostic> {
        match &self.kind {
            Kind::Record { name: found, fields } => match found {
                Some(found) if found != name => {
                    Err(self.error(format!("expected `{name}(...)`, found `{found}(...)`")))
                }
                _ => Ok(Record { value: self, fields, taken: vec![false; fields.len()], known: Vec::new() }),
            },
            Kind::Unit => Ok(Record { value: self, fields: &[], taken: Vec::new(), known: Vec::new() }),
            _ => Err(self.mismatch(&format!("`{name}(...)`"))),
        }
    }
}

/// A struct whose fields are being read; [`finish`](Self::finish) refuses unread ones.
#[derive(Debug)]
pub struct Record<'v> {
    value: &'v Value,
    fields: &'v [(Key, Value)],
    taken: Vec<bool>,
    /// Names of all fields that were asked for.
    known: Vec<String>,
}

impl<'v> Record<'v> {
    /// A field that may be missing.
    pub fn optional(&mut self, name: &str) -> Option<&'v Value> {
        self.known.push(name.to_owned());
        let i = self.fields.iter().position(|(k, _)| k.name == name)?;
        self.taken[i] = true;
        Some(&self.fields[i].1)
    }

    /// A field that must be there. Error: the field is missing, at a field of a similar name if there is one.
    pub fn required(&mut self, name: &str) -> Result<&'v Value, Diagnostic> {
        self.optional(name).ok_or_else(|| {
            let missing = Diagnostic::new(format!("the field `{name}` is missing"));
            let unread = || self.fields.iter().zip(&self.taken).filter(|(_, taken)| !**taken);
            let similar = nearest(name, unread().map(|((key, _), _)| key.name.as_str()));
            if let Some(((key, _), _)) = unread().find(|((key, _), _)| Some(key.name.as_str()) == similar) {
                return missing
                    .at(&self.value.source, key.span)
                    .label(format!("did you mean `{name}`?"))
                    .help(format!("write `{name}` here, or add `{name}: ...`"));
            }
            let start = self.value.span.start;
            missing
                .at(&self.value.source, Span { start, end: (start + 1).min(self.value.span.end) })
                .label(format!("no `{name}` in here"))
                .help(format!("add `{name}: ...`"))
        })
    }

    /// All fields, in the order of the file; they count as read.
    pub fn all(&mut self) -> &'v [(Key, Value)] {
        self.taken.fill(true);
        self.fields
    }

    /// The value this record was made from.
    pub fn value(&self) -> &'v Value {
        self.value
    }

    /// Refuses fields that were not asked for. Error: an unknown field, with the nearest known one.
    pub fn finish(self) -> Result<(), Diagnostic> {
        match self.fields.iter().zip(&self.taken).find(|(_, taken)| !**taken) {
            None => Ok(()),
            Some(((key, _), _)) => Err(Diagnostic::new(format!("unknown field `{}`", key.name))
                .at(&self.value.source, key.span)
                .label("not known here")
                .help(one_of(&key.name, self.known.iter().map(String::as_str)))),
        }
    }
}
