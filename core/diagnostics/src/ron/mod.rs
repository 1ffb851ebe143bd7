//! A strict reader for RON that keeps the position of every value.
//!
//! The grammar is the `ron` crate's. This reader also refuses duplicate keys and fields, numbers that
//! are not finite, and extensions. A value is read with [`Value::record`] (a struct with named fields),
//! [`Value::map`], [`Value::list`] and the scalar accessors. Each returns an error with its position if
//! the kind differs.

#[cfg(feature = "ron")]
mod read;
#[cfg(all(test, feature = "ron"))]
mod tests;
mod value;
mod write;

use std::sync::Arc;

use crate::{Source, Span};

#[cfg(feature = "ron")]
pub use read::{first_word, parse, parse_or_text};
pub use value::Record;
pub use write::quoted;

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
