//! A strict reader for RON that keeps the place of every value.
//!
//! The grammar is the `ron` crate's. On top of it this reader refuses what `ron` lets pass and a person would
//! not have meant: duplicate keys and fields, numbers that are not finite, extensions. A value is taken apart
//! with [`Value::record`] (a struct with named fields), [`Value::map`], [`Value::list`] and the scalar
//! accessors, each of which answers an error with its place when something else stands there.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::sync::Arc;

use ron::value::RawValue;
use serde::de::{Deserialize, MapAccess, SeqAccess, Visitor};

use crate::{Diagnostic, Source, Span, one_of};

/// A value and where it stands.
#[derive(Clone, Debug)]
pub struct Value {
    source: Arc<Source>,
    span: Span,
    kind: Kind,
}

/// What kinds of value there are.
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
        /// What stands before the parenthesis, if anything.
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
    /// Where it stands.
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
/// What `ron` cannot parse, a duplicate key, a number that is not finite.
pub fn parse(source: &Arc<Source>) -> Result<Value, Diagnostic> {
    Reader { source }.whole()
}

/// Reads a text that came from a command line as a value; a text that is no RON is taken as text.
///
/// # Errors
/// A value that parses, and is refused: duplicate keys, numbers that are not finite.
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

/// What comes after white space and comments.
fn after_comments(text: &str) -> &str {
    let mut rest = text.trim_start();
    loop {
        let after = if rest.starts_with("//") {
            rest.split_once('\n').map(|(_, after)| after)
        } else if rest.starts_with("/*") {
            // Comments of this kind nest.
            let (mut depth, mut at) = (0, 0);
            loop {
                let open = rest[at..].starts_with("/*");
                depth += i32::from(open) - i32::from(rest[at..].starts_with("*/"));
                at += if open || rest[at..].starts_with("*/") {
                    2
                } else {
                    rest[at..].chars().next().map_or(1, char::len_utf8)
                };
                if depth == 0 || at >= rest.len() {
                    break rest.get(at..);
                }
            }
        } else {
            return rest;
        };
        rest = after.unwrap_or("").trim_start();
    }
}

struct Reader<'s> {
    source: &'s Arc<Source>,
}

impl<'s> Reader<'s> {
    fn whole(&self) -> Result<Value, Diagnostic> {
        let text = self.source.text();
        let raw: &RawValue = ron::from_str(text).map_err(|e| self.syntax(&e, 0))?;
        let start = text.len() - after_comments(text).len();
        if text[start..].starts_with("#!") {
            return Err(Diagnostic::new("RON extensions are not used here")
                .at(self.source, Span { start, end: start + 2 })
                .help("delete this line"));
        }
        self.value(raw)
    }

    fn span(&self, part: &str) -> Span {
        let start = (part.as_ptr() as usize).wrapping_sub(self.source.text().as_ptr() as usize);
        Span { start, end: start + part.len() }
    }

    fn syntax(&self, e: &ron::error::SpannedError, base: usize) -> Diagnostic {
        let text = &self.source.text()[base..];
        let offset = |p: ron::error::Position| -> usize {
            let line_start =
                text.split_inclusive('\n').take(p.line.saturating_sub(1)).map(str::len).sum::<usize>();
            let line = text[line_start..].split('\n').next().unwrap_or("");
            let within = line.char_indices().nth(p.col.saturating_sub(1)).map_or(line.len(), |(i, _)| i);
            base + line_start + within
        };
        let span = Span { start: offset(e.span.start), end: offset(e.span.end).max(offset(e.span.start)) };
        let what = match e.code {
            ron::Error::ExceededRecursionLimit => "nested too deeply".to_owned(),
            ref code => format!("not valid RON: {code}"),
        };
        Diagnostic::new(what).at(self.source, span).label("here")
    }

    fn value(&self, raw: &'s RawValue) -> Result<Value, Diagnostic> {
        let text = raw.trim().get_ron();
        let span = self.span(text);
        let reparse = |e: ron::error::SpannedError| self.syntax(&e, span.start);
        let refuse = |what: &str| Diagnostic::new(what).at(self.source, span);
        let first = text.chars().next().unwrap_or(' ');
        let word_len = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
        let kind = match first {
            '[' => Kind::List(self.values(&ron::from_str::<Parts>(text).map_err(reparse)?)?),
            '{' => Kind::Map(self.map_entries(ron::from_str(text).map_err(reparse)?)?),
            '(' => self.parenthesis(None, ron::from_str(text).map_err(reparse)?)?,
            '"' => Kind::Text(ron::from_str(text).map_err(reparse)?),
            'r' if text[1..].starts_with(['"', '#']) => Kind::Text(ron::from_str(text).map_err(reparse)?),
            '0'..='9' | '+' | '-' | '.' => self.number(text).ok_or_else(|| {
                refuse("not a finite number").help("numbers here are finite, such as 20 or 20.0 or 1e3")
            })?,
            _ if word_len == text.len() => match text {
                "true" => Kind::Bool(true),
                "false" => Kind::Bool(false),
                "NaN" | "inf" | "NaNf32" | "NaNf64" | "inff32" | "inff64" => {
                    return Err(refuse("not a finite number").help("numbers here are finite, such as 20.0"));
                }
                word => Kind::Word(word.to_owned()),
            },
            c if (c.is_alphabetic() || c == '_') && text[word_len..].trim_start().starts_with('(') => {
                let name = text[..word_len].to_owned();
                self.parenthesis(Some(name), ron::from_str(text).map_err(reparse)?)?
            }
            _ => return Err(refuse("this kind of value is not used here")),
        };
        Ok(Value { source: self.source.clone(), span, kind })
    }

    fn number(&self, text: &str) -> Option<Kind> {
        if let Ok(i) = ron::from_str::<i64>(text) {
            return Some(Kind::Int(i));
        }
        ron::from_str::<f64>(text).ok().filter(|x| x.is_finite()).map(Kind::Float)
    }

    fn values(&self, parts: &Parts<'s>) -> Result<Vec<Value>, Diagnostic> {
        match parts {
            Parts::Unit => Ok(Vec::new()),
            Parts::Items(items) => items.iter().map(|r| self.value(r)).collect(),
            Parts::Fields(_) => Ok(Vec::new()),
        }
    }

    fn parenthesis(&self, name: Option<String>, parts: Parts<'s>) -> Result<Kind, Diagnostic> {
        match parts {
            Parts::Unit if name.is_none() => Ok(Kind::Unit),
            Parts::Unit => Ok(Kind::Record { name, fields: Vec::new() }),
            Parts::Items(items) => {
                Ok(Kind::List(items.iter().map(|r| self.value(r)).collect::<Result<_, _>>()?))
            }
            Parts::Fields(fields) => {
                let keyed = fields.into_iter().map(|(k, v)| (self.key(k.to_owned(), self.span(k)), v));
                Ok(Kind::Record { name, fields: self.entries(keyed)? })
            }
        }
    }

    fn map_entries(&self, raw: RawMap<'s>) -> Result<Vec<(Key, Value)>, Diagnostic> {
        let mut keyed = Vec::with_capacity(raw.0.len());
        for (k, v) in raw.0 {
            let key = self.value(k)?;
            let Kind::Text(name) = key.kind else {
                return Err(Diagnostic::new("a key here is a text in quotes").at(self.source, key.span));
            };
            keyed.push((self.key(name, key.span), v));
        }
        self.entries(keyed)
    }

    fn key(&self, name: String, span: Span) -> Key {
        Key { name, span }
    }

    fn entries(
        &self,
        keyed: impl IntoIterator<Item = (Key, &'s RawValue)>,
    ) -> Result<Vec<(Key, Value)>, Diagnostic> {
        let mut seen = std::collections::HashMap::<String, Span>::new();
        let mut entries = Vec::new();
        for (key, raw) in keyed {
            if let Some(first) = seen.insert(key.name.clone(), key.span) {
                return Err(Diagnostic::new(format!("`{}` stands here twice", key.name))
                    .at(self.source, key.span)
                    .label("the second")
                    .related(self.source, first, "the first")
                    .help("delete or rename one of the two"));
            }
            entries.push((key, self.value(raw)?));
        }
        Ok(entries)
    }
}

/// The parts of a list, tuple, struct or unit, still raw.
enum Parts<'s> {
    Unit,
    Items(Vec<&'s RawValue>),
    Fields(Vec<(&'s str, &'s RawValue)>),
}

impl<'de> Deserialize<'de> for Parts<'de> {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct PartsVisitor;
        impl<'de> Visitor<'de> for PartsVisitor {
            type Value = Parts<'de>;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a list or named fields")
            }
            fn visit_unit<E>(self) -> Result<Self::Value, E> {
                Ok(Parts::Unit)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
                let mut items = Vec::new();
                while let Some(item) = seq.next_element()? {
                    items.push(item);
                }
                Ok(Parts::Items(items))
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut fields = Vec::new();
                while let Some(Identifier(key)) = map.next_key()? {
                    fields.push((key, map.next_value()?));
                }
                Ok(Parts::Fields(fields))
            }
        }
        d.deserialize_any(PartsVisitor)
    }
}

/// A field's name, borrowed from the text so that its place is known.
struct Identifier<'s>(&'s str);

impl<'de> Deserialize<'de> for Identifier<'de> {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct IdentifierVisitor;
        impl<'de> Visitor<'de> for IdentifierVisitor {
            type Value = Identifier<'de>;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a field's name")
            }
            fn visit_borrowed_str<E>(self, v: &'de str) -> Result<Self::Value, E> {
                Ok(Identifier(v))
            }
        }
        d.deserialize_identifier(IdentifierVisitor)
    }
}

/// The entries of a map, still raw, duplicates included.
struct RawMap<'s>(Vec<(&'s RawValue, &'s RawValue)>);

impl<'de> Deserialize<'de> for RawMap<'de> {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct RawMapVisitor;
        impl<'de> Visitor<'de> for RawMapVisitor {
            type Value = RawMap<'de>;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a map")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(RawMap(entries))
            }
        }
        d.deserialize_map(RawMapVisitor)
    }
}

impl Value {
    /// The text this value stands in.
    pub fn source(&self) -> &Arc<Source> {
        &self.source
    }

    /// Where this value stands.
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

    /// What kind of thing this is, for an error's sentence.
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

    /// A number, whole or not.
    ///
    /// # Errors
    /// Anything but a number.
    pub fn f64(&self) -> Result<f64, Diagnostic> {
        match self.kind {
            // Whole numbers in a file are far below 2^53.
            Kind::Int(i) => Ok(i as f64),
            Kind::Float(x) => Ok(x),
            _ => Err(self.mismatch("a number")),
        }
    }

    /// A number within a range, in a unit that is named in the error.
    ///
    /// # Errors
    /// Anything but a number in the range.
    pub fn f64_in(&self, range: RangeInclusive<f64>, unit: &str) -> Result<f64, Diagnostic> {
        let x = self.f64()?;
        self.check_range(x, &range, unit)?;
        Ok(x)
    }

    /// A whole number.
    ///
    /// # Errors
    /// Anything but a whole number.
    pub fn i64(&self) -> Result<i64, Diagnostic> {
        match self.kind {
            Kind::Int(i) => Ok(i),
            Kind::Float(x) if x.fract() == 0.0 && x.abs() < 9e15 => Ok(x as i64),
            _ => Err(self.mismatch("a whole number")),
        }
    }

    /// A whole number within a range.
    ///
    /// # Errors
    /// Anything but a whole number in the range.
    pub fn i64_in(&self, range: RangeInclusive<i64>, unit: &str) -> Result<i64, Diagnostic> {
        let i = self.i64()?;
        self.check_range(i, &range, unit)?;
        Ok(i)
    }

    fn check_range<T: PartialOrd + Display>(
        &self,
        x: T,
        range: &RangeInclusive<T>,
        unit: &str,
    ) -> Result<(), Diagnostic> {
        if range.contains(&x) {
            return Ok(());
        }
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        Err(self.error(format!("{x}{unit} is out of range")).label("out of range").help(format!(
            "from {} to {}{unit}",
            range.start(),
            range.end()
        )))
    }

    /// `true` or `false`.
    ///
    /// # Errors
    /// Anything else.
    pub fn bool(&self) -> Result<bool, Diagnostic> {
        match self.kind {
            Kind::Bool(b) => Ok(b),
            _ => Err(self.mismatch("true or false")),
        }
    }

    /// A text in quotes.
    ///
    /// # Errors
    /// Anything else.
    pub fn text(&self) -> Result<&str, Diagnostic> {
        match &self.kind {
            Kind::Text(t) => Ok(t),
            Kind::Word(w) => Err(self.mismatch("a text in quotes").help(format!("\"{w}\""))),
            _ => Err(self.mismatch("a text in quotes")),
        }
    }

    /// One of a few words, in quotes or bare.
    ///
    /// # Errors
    /// Anything else, with the nearest of the words.
    pub fn choice(&self, words: &[&str]) -> Result<&str, Diagnostic> {
        let (Kind::Text(found) | Kind::Word(found)) = &self.kind else {
            return Err(self.mismatch("a word").help(one_of("", words.iter().copied())));
        };
        if words.contains(&found.as_str()) {
            return Ok(found);
        }
        Err(self.error(format!("unknown choice `{found}`")).help(one_of(found, words.iter().copied())))
    }

    /// The items of a list or tuple.
    ///
    /// # Errors
    /// Anything but a list.
    pub fn list(&self) -> Result<&[Value], Diagnostic> {
        match &self.kind {
            Kind::List(items) => Ok(items),
            Kind::Unit => Ok(&[]),
            _ => Err(self.mismatch("a list `[...]`")),
        }
    }

    /// The entries of a map with texts as keys, in the order of the file.
    ///
    /// # Errors
    /// Anything but a map.
    pub fn map(&self) -> Result<&[(Key, Value)], Diagnostic> {
        match &self.kind {
            Kind::Map(entries) => Ok(entries),
            _ => Err(self.mismatch("a map `{\"name\": ...}`")),
        }
    }

    /// A struct with named fields, called `name` or nothing at all.
    ///
    /// # Errors
    /// Anything else, or a struct of another name.
    pub fn record(&self, name: &str) -> Result<Record<'_>, Diagnostic> {
        match &self.kind {
            Kind::Record { name: found, fields } => match found {
                Some(found) if found != name => {
                    Err(self.error(format!("expected `{name}(...)`, found `{found}(...)`")))
                }
                _ => Ok(Record { value: self, fields, taken: vec![false; fields.len()] }),
            },
            Kind::Unit => Ok(Record { value: self, fields: &[], taken: Vec::new() }),
            _ => Err(self.mismatch(&format!("`{name}(...)`"))),
        }
    }
}

/// A struct that is being taken apart; [`finish`](Self::finish) refuses what nobody asked for.
#[derive(Debug)]
pub struct Record<'v> {
    value: &'v Value,
    fields: &'v [(Key, Value)],
    taken: Vec<bool>,
}

impl<'v> Record<'v> {
    /// A field that may be left out.
    pub fn optional(&mut self, name: &str) -> Option<&'v Value> {
        let i = self.fields.iter().position(|(k, _)| k.name == name)?;
        self.taken[i] = true;
        Some(&self.fields[i].1)
    }

    /// A field that must be there.
    ///
    /// # Errors
    /// The field is missing.
    pub fn required(&mut self, name: &str) -> Result<&'v Value, Diagnostic> {
        self.optional(name).ok_or_else(|| {
            let start = self.value.span.start;
            Diagnostic::new(format!("the field `{name}` is missing"))
                .at(&self.value.source, Span { start, end: (start + 1).min(self.value.span.end) })
                .label(format!("no `{name}` in here"))
                .help(format!("add `{name}: ...`"))
        })
    }

    /// All fields, in the order of the file; they count as asked for.
    pub fn all(&mut self) -> &'v [(Key, Value)] {
        self.taken.fill(true);
        self.fields
    }

    /// The value this record was made from.
    pub fn value(&self) -> &'v Value {
        self.value
    }

    /// Refuses fields that nobody asked for; `known` are the names there are.
    ///
    /// # Errors
    /// An unknown field, with the nearest known one.
    pub fn finish(self, known: &[&str]) -> Result<(), Diagnostic> {
        match self.fields.iter().zip(&self.taken).find(|(_, taken)| !**taken) {
            None => Ok(()),
            Some(((key, _), _)) => Err(Diagnostic::new(format!("unknown field `{}`", key.name))
                .at(&self.value.source, key.span)
                .label("not known here")
                .help(one_of(&key.name, known.iter().copied()))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Value, Diagnostic> {
        parse(&Source::new("t.ron", text))
    }

    fn error(text: &str) -> String {
        read(text).unwrap_err().to_string()
    }

    #[test]
    fn every_kind_of_value_is_read_with_its_place() {
        let v = read(
            "// c\nGraph(\n  a: 1, /* x */ b: -2.5e1,\n  c: [true, \"t\\n\"], d: {\"k\": (1, 2)}, e: zig,)",
        )
        .unwrap();
        let mut r = v.record("Graph").unwrap();
        assert_eq!(r.required("a").unwrap().i64().unwrap(), 1);
        let b = r.required("b").unwrap();
        assert_eq!(b.f64().unwrap(), -25.0);
        assert_eq!(b.source().position(b.span().start).column, 20);
        let c = r.required("c").unwrap().list().unwrap();
        assert!(c[0].bool().unwrap());
        assert_eq!(c[1].text().unwrap(), "t\n");
        let d = r.required("d").unwrap().map().unwrap();
        assert_eq!((d[0].0.name.as_str(), d[0].1.list().unwrap().len()), ("k", 2));
        assert_eq!(r.required("e").unwrap().choice(&["zig", "zag"]).unwrap(), "zig");
        r.finish(&[]).unwrap();
    }

    #[test]
    fn a_duplicate_key_is_refused_at_the_second() {
        assert!(error("{\"a\": 1,\n \"a\": 2}").starts_with("t.ron:2:2: `a` stands here twice"));
        assert!(error("(x: 1,\n x: 2)").starts_with("t.ron:2:2: `x` stands here twice"));
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused() {
        for bad in ["NaN", "inf", "-inf", "1e400", "+NaN"] {
            let e = error(&format!("(x: {bad})"));
            assert!(e.starts_with("t.ron:1:5: not a finite number"), "{bad}: {e}");
        }
    }

    #[test]
    fn syntax_errors_say_where() {
        assert!(error("(a: 1,\n b 2)").starts_with("t.ron:2:3:"));
        assert!(error("").starts_with("t.ron:1:1:"));
        assert!(error("(a: \"open").contains("t.ron:1:"));
        assert!(error("#![enable(implicit_some)]\n(a: 1)").contains("extensions"));
        assert!(
            error("// c\n/* a /* b */ */ #![enable(implicit_some)]\n(a: 1)")
                .starts_with("t.ron:2:17: RON extensions")
        );
        assert!(error(&"[".repeat(10_000)).contains("nested too deeply"));
    }

    #[test]
    fn an_unknown_field_names_its_neighbour() {
        let v = read("(cutof_hz: 20)").unwrap();
        let mut r = v.record("P").unwrap();
        assert!(r.optional("cutoff_hz").is_none());
        let e = r.finish(&["cutoff_hz", "order"]).unwrap_err().to_string();
        assert_eq!(e, "t.ron:1:2: unknown field `cutof_hz` (did you mean `cutoff_hz`?)");
    }

    #[test]
    fn out_of_range_says_the_range_and_the_unit() {
        let e = read("(x: 900)").unwrap();
        let e = e.record("P").unwrap().required("x").unwrap().f64_in(0.0..=250.0, "Hz").unwrap_err();
        assert_eq!(e.to_string(), "t.ron:1:5: 900 Hz is out of range (from 0 to 250 Hz)");
    }

    #[test]
    fn a_command_line_value_may_be_bare_text() {
        let get = |t: &str| parse_or_text(&Source::new("--set", t)).unwrap().kind().clone();
        assert_eq!(get("20.5"), Kind::Float(20.5));
        assert_eq!(get("coarse weave"), Kind::Text("coarse weave".into()));
        assert_eq!(get("zigzag"), Kind::Text("zigzag".into()));
        assert_eq!(get("true"), Kind::Bool(true));
    }

    #[test]
    fn no_prefix_of_a_good_text_panics() {
        let good =
            "G(a: [1, -2.0, \"x\"], m: {\"k\": (1, b: 2)}, r: r#\"raw\"#, c: 'c', s: Some(3), é: 1) // end";
        for i in (0..=good.len()).filter(|&i| good.is_char_boundary(i)) {
            let _ = read(&good[..i]);
            let _ = read(&good[i..]);
        }
    }
}
