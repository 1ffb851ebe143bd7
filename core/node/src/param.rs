//! Parameters: declared in a descriptor, and set in a graph file.

use std::borrow::Cow;
use std::fmt;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, Place};

use crate::Settings;

/// Kinds of parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum ParamKind {
    /// A finite number within a range.
    Number(RangeInclusive<f64>),
    /// A whole number within a range.
    Integer(RangeInclusive<i64>),
    /// True or false.
    Flag,
    /// Any text.
    Text,
    /// One of a few words.
    Choice(Cow<'static, [Cow<'static, str>]>),
    /// A file that must exist; a relative path is relative to the graph file.
    File,
    /// A list of finite numbers, each within a range.
    Numbers(RangeInclusive<f64>),
    /// A list of texts.
    Texts,
}

impl fmt::Display for ParamKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(r) => write!(f, "number from {} to {}", r.start(), r.end()),
            Self::Integer(r) if *r.end() == i64::MAX => write!(f, "whole number from {}", r.start()),
            Self::Integer(r) => write!(f, "whole number from {} to {}", r.start(), r.end()),
            Self::Flag => f.write_str("true or false"),
            Self::Text => f.write_str("text"),
            Self::Choice(words) => f.write_str(&words.join(" | ")),
            Self::File => f.write_str("file"),
            Self::Numbers(r) => write!(f, "list of numbers from {} to {}", r.start(), r.end()),
            Self::Texts => f.write_str("list of texts"),
        }
    }
}

/// A declared parameter: name, kind, range, unit, default and meaning in one place.
#[must_use]
#[derive(Clone, Debug)]
pub struct Param {
    /// Name in a graph file.
    pub name: Cow<'static, str>,
    /// Meaning and effect, in a sentence.
    pub doc: Cow<'static, str>,
    /// Unit of a number; empty for none.
    pub unit: Cow<'static, str>,
    /// Kind and range.
    pub kind: ParamKind,
    /// Default; `None` if a graph must set it.
    pub default: Option<ParamValue>,
    /// Whether it may be missing although it has no default.
    pub optional: bool,
    /// Whether [`Node::set_parameter`](crate::Node::set_parameter) takes new values while the node
    /// runs; otherwise a change makes a new node. Only for numbers, whole numbers, flags and choices.
    pub live: bool,
}

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum ParamValue {
    Number(f64),
    Integer(i64),
    Flag(bool),
    /// A text, or one of a few words.
    Text(String),
    /// A file with its resolved path.
    File(PathBuf),
    Numbers(Vec<f64>),
    Texts(Vec<String>),
}

impl fmt::Display for ParamValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ParamValue::Number(x) => write!(f, "{x:?}"),
            ParamValue::Integer(i) => write!(f, "{i}"),
            ParamValue::Flag(b) => write!(f, "{b}"),
            ParamValue::Text(t) => write!(f, "{t:?}"),
            ParamValue::File(p) => write!(f, "{:?}", p.display().to_string()),
            ParamValue::Numbers(xs) => write!(f, "{xs:?}"),
            ParamValue::Texts(ts) => write!(f, "{ts:?}"),
        }
    }
}

impl Param {
    fn new(name: &'static str, kind: ParamKind, default: Option<ParamValue>, doc: &'static str) -> Self {
        let (name, doc) = (Cow::Borrowed(name), Cow::Borrowed(doc));
        Self { name, doc, unit: Cow::Borrowed(""), kind, default, optional: false, live: false }
    }

    /// A number with a default.
    pub fn number(name: &'static str, default: f64, range: RangeInclusive<f64>, doc: &'static str) -> Self {
        Self::new(name, ParamKind::Number(range), Some(ParamValue::Number(default)), doc)
    }

    /// A whole number with a default.
    pub fn integer(name: &'static str, default: i64, range: RangeInclusive<i64>, doc: &'static str) -> Self {
        Self::new(name, ParamKind::Integer(range), Some(ParamValue::Integer(default)), doc)
    }

    /// True or false, with a default.
    pub fn flag(name: &'static str, default: bool, doc: &'static str) -> Self {
        Self::new(name, ParamKind::Flag, Some(ParamValue::Flag(default)), doc)
    }

    /// A text with a default.
    pub fn text(name: &'static str, default: &str, doc: &'static str) -> Self {
        Self::new(name, ParamKind::Text, Some(ParamValue::Text(default.to_owned())), doc)
    }

    /// One of a few words; the first is the default.
    pub fn choice(name: &'static str, words: &[&'static str], doc: &'static str) -> Self {
        let default = words.first().map(|w| ParamValue::Text((*w).to_owned()));
        let words = words.iter().map(|w| Cow::Borrowed(*w)).collect();
        Self::new(name, ParamKind::Choice(words), default, doc)
    }

    /// A file that a graph must name.
    pub fn file(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, ParamKind::File, None, doc)
    }

    /// A list of numbers with a default.
    pub fn numbers(
        name: &'static str,
        default: &[f64],
        range: RangeInclusive<f64>,
        doc: &'static str,
    ) -> Self {
        Self::new(name, ParamKind::Numbers(range), Some(ParamValue::Numbers(default.to_vec())), doc)
    }

    /// A list of texts, empty by default.
    pub fn texts(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, ParamKind::Texts, Some(ParamValue::Texts(Vec::new())), doc)
    }

    /// Sets the unit of a number.
    pub fn unit(mut self, unit: &'static str) -> Self {
        self.unit = Cow::Borrowed(unit);
        self
    }

    /// Requires a graph to set it.
    pub fn required(mut self) -> Self {
        self.default = None;
        self
    }

    /// Allows changes while the node runs.
    pub fn live(mut self) -> Self {
        self.live = true;
        self
    }

    /// Allows a graph to leave it out; then it has no value.
    pub fn optional(mut self) -> Self {
        self.default = None;
        self.optional = true;
        self
    }
}

/// The parameters of one node, checked against its descriptor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Params {
    entries: Vec<Entry>,
    node: Option<Place>,
    slots: Vec<Vec<Settings>>,
}

#[derive(Clone, Debug, PartialEq)]
struct Entry {
    name: String,
    value: Option<ParamValue>,
    place: Option<Place>,
}

impl Params {
    /// Makes an empty set for a node at position `node` of its file.
    pub fn new(node: Option<Place>) -> Self {
        Self { entries: Vec::new(), node, slots: Vec::new() }
    }

    /// Adds a parameter. `value` is `None` for an optional one that is missing.
    pub fn insert(&mut self, name: impl Into<String>, value: Option<ParamValue>, place: Option<Place>) {
        self.entries.push(Entry { name: name.into(), value, place });
    }

    /// Sets a number that has a value to another one.
    pub(crate) fn set_number(&mut self, name: &str, value: f64) {
        let entry = self.entries.iter_mut().find(|entry| entry.name == name);
        if let Some(Entry { value: Some(ParamValue::Number(number)), .. }) = entry {
            *number = value;
        }
    }

    /// Sets what the list of an [`Effect`](crate::Effect) holds.
    pub fn set_slots(&mut self, slots: Vec<Vec<Settings>>) {
        self.slots = slots;
    }

    /// The slots of an [`Effect`](crate::Effect): of each its settings, one, or for textures one and more.
    pub fn slots(&self) -> &[Vec<Settings>] {
        &self.slots
    }

    /// All parameters that have a value, in the descriptor's order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &ParamValue)> {
        self.entries.iter().filter_map(|e| Some((e.name.as_str(), e.value.as_ref()?)))
    }

    /// Whether the graph sets this parameter itself.
    pub fn is_set(&self, name: &str) -> bool {
        self.entry(name).is_some_and(|e| e.place.is_some())
    }

    fn entry(&self, name: &str) -> Option<&Entry> {
        self.entries.iter().find(|e| e.name == name)
    }

    /// The value of a parameter, if it has one.
    pub fn get(&self, name: &str) -> Option<&ParamValue> {
        self.entry(name)?.value.as_ref()
    }

    /// A number. 0 for a name that the descriptor does not declare as one.
    pub fn number(&self, name: &str) -> f64 {
        self.get_number(name).unwrap_or(0.0)
    }

    /// A number that may be missing.
    pub fn get_number(&self, name: &str) -> Option<f64> {
        match self.get(name)? {
            ParamValue::Number(x) => Some(*x),
            ParamValue::Integer(i) => Some(*i as f64),
            _ => None,
        }
    }

    /// A whole number. 0 for a name that the descriptor does not declare as one.
    pub fn integer(&self, name: &str) -> i64 {
        self.get_integer(name).unwrap_or(0)
    }

    /// A whole number that may be missing.
    pub fn get_integer(&self, name: &str) -> Option<i64> {
        match self.get(name)? {
            ParamValue::Integer(i) => Some(*i),
            _ => None,
        }
    }

    /// True or false; false for a name that the descriptor does not declare as one.
    pub fn flag(&self, name: &str) -> bool {
        matches!(self.get(name), Some(ParamValue::Flag(true)))
    }

    /// A text or a choice; empty if missing.
    pub fn text(&self, name: &str) -> &str {
        match self.get(name) {
            Some(ParamValue::Text(t)) => t,
            _ => "",
        }
    }

    /// Path of a file; empty if missing.
    pub fn file(&self, name: &str) -> &Path {
        match self.get(name) {
            Some(ParamValue::File(p)) => p,
            _ => Path::new(""),
        }
    }

    /// A list of numbers.
    pub fn numbers(&self, name: &str) -> &[f64] {
        match self.get(name) {
            Some(ParamValue::Numbers(xs)) => xs,
            _ => &[],
        }
    }

    /// A list of texts.
    pub fn texts(&self, name: &str) -> &[String] {
        match self.get(name) {
            Some(ParamValue::Texts(ts)) => ts,
            _ => &[],
        }
    }

    /// An error about a parameter. It points at the parameter in the file, or at the node if the file
    /// does not set it.
    pub fn error(&self, name: &str, message: impl Into<String>) -> Diagnostic {
        let place = self.entry(name).and_then(|e| e.place.as_ref()).or(self.node.as_ref());
        let d = Diagnostic::new(message);
        match place {
            Some(p) => d.at(&p.source, p.span),
            None => d,
        }
    }

    /// An error about the node as a whole.
    pub fn node_error(&self, message: impl Into<String>) -> Diagnostic {
        self.error("", message)
    }

    /// Position of a parameter in the graph file, if it is there.
    pub fn place(&self, name: &str) -> Option<&Place> {
        self.entry(name)?.place.as_ref()
    }

    /// Position of the node in the graph file.
    pub fn node_place(&self) -> Option<&Place> {
        self.node.as_ref()
    }
}
