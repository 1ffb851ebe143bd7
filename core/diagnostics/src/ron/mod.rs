//! A strict reader for RON that keeps the position of every value.
//!
//! The grammar is the `ron` crate's. This reader also refuses duplicate keys and fields, numbers that
//! are not finite, and extensions. A value is read with [`Value::record`] (a struct with named fields),
//! [`Value::map`], [`Value::list`] and the scalar accessors. Each returns an error with its position if
//! the kind differs.

mod read;
#[cfg(test)]
mod tests;
mod value;

use std::sync::Arc;

use ron::value::RawValue;

use crate::{Diagnostic, Source, Span};

use read::Reader;
pub use value::Record;

/// A value with its position.
#[derive(Clone, Debug)]
pub struct Value {
    source: Arc<Source>,
    span: Span,
    kind: Kind,
}

/// Kinds of values.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// `()`
    Unit,
    /// `true`, `false`
    Bool(bool),
    /// A whole number.
    Int(i64),
    /// A number with a point or an exponent; always finite.
    Float(f64),
    /// `"text"`
    Text(String),
    /// A bare word, such as a variant's name.
    Word(String),
    /// `[a, b]`, or a tuple `(a, b)`.
    List(Vec<Value>),
    /// `Name(field: value)` or `(field: value)`.
    Record {
        /// The name before the parenthesis, if any.
        name: Option<String>,
        /// Fields in the order of the file.
        fields: Vec<(Key, Value)>,
    },
    /// `{"key": value}`
    Map(Vec<(Key, Value)>),
}

impl PartialEq for Value {
    fn eq(&self, other: &Self) -> bool {
        self.kind == other.kind
    }
}

/// The name of a field or of a map's entry.
#[derive(Clone, Debug)]
pub struct Key {
    /// The name, without quotes.
    pub name: String,
    /// Its position.
    pub span: Span,
}

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// Reads a whole text.
///
/// # Errors
/// A text that `ron` cannot parse, a duplicate key, a number that is not finite.
pub fn parse(source: &Arc<Source>) -> Result<Value, Diagnostic> {
    Reader { source }.whole()
}

/// First word of a text after comments, such as `Graph` or `Scene`, even if the rest cannot be read.
pub fn first_word(source: &Source) -> Option<&str> {
    let text = read::after_comments(source.text().trim_start_matches('\u{feff}'));
    text.split(|c: char| !(c.is_alphanumeric() || c == '_')).next().filter(|word| !word.is_empty())
}

/// Reads a value from a command line; a text that is not RON becomes a text value.
///
/// # Errors
/// A value that parses but is refused: duplicate keys, numbers that are not finite.
pub fn parse_or_text(source: &Arc<Source>) -> Result<Value, Diagnostic> {
    let text = source.text();
    let whole = Span { start: 0, end: text.len() };
    let as_text = || Value { source: source.clone(), span: whole, kind: Kind::Text(text.to_owned()) };
    if ron::from_str::<&RawValue>(text).is_err() {
        return Ok(as_text());
    }
    let value = parse(source)?;
    Ok(if matches!(value.kind, Kind::Word(_)) { as_text() } else { value })
}
