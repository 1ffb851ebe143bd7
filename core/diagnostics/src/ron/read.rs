//! From a text to values. `ron`'s raw values borrow from the text, so their address gives their
//! position.

use std::fmt::Formatter;
use std::marker::PhantomData;
use std::sync::Arc;

use ron::value::RawValue;
use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

use super::{Key, Kind, Value};
use crate::{Diagnostic, Source, Span, budget};

/// Reads a whole text. Error: a text that `ron` cannot parse, a duplicate key, a number that is not finite.
pub fn parse(source: &Arc<Source>) -> Result<Value, Diagnostic> {
    Reader { source }.whole()
}

/// Reads a value from a command line; a text that is not RON becomes a text value. Error: a value that
/// parses but is refused: duplicate keys, numbers that are not finite.
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

/// First word of a text after comments, such as `Graph` or `Scene`, even if the rest cannot be read.
pub fn first_word(source: &Source) -> Option<&str> {
    let text = after_comments(source.text().trim_start_matches('\u{feff}'));
    text.split(|c: char| !(c.is_alphanumeric() || c == '_')).next().filter(|word| !word.is_empty())
}

/// The text after white space and comments.
fn after_comments(text: &str) -> &str {
    let mut rest = text.trim_start();
    loop {
        rest = match (rest.strip_prefix("//"), rest.strip_prefix("/*")) {
            (Some(comment), _) => comment.split_once('\n').map_or("", |(_, after)| after),
            (_, Some(comment)) => after_comment(comment),
            _ => return rest,
        }
        .trim_start();
    }
}

/// The text after a comment whose `/*` has been read. Such comments nest.
fn after_comment(text: &str) -> &str {
    let (mut depth, mut rest) = (1, text);
    while depth > 0 {
        let close = rest.find("*/");
        match rest.find("/*").filter(|open| close.is_none_or(|close| *open < close)) {
            Some(open) => (depth, rest) = (depth + 1, &rest[open + 2..]),
            None => match close {
                Some(close) => (depth, rest) = (depth - 1, &rest[close + 2..]),
                None => return "",
            },
        }
    }
    rest
}

/// Longest name or text in bytes: the length of the longest path.
const MAX_TEXT: usize = 4096;

/// Reads one text.
pub(super) struct Reader<'s> {
    pub(super) source: &'s Arc<Source>,
}

impl<'s> Reader<'s> {
    pub(super) fn whole(&self) -> Result<Value, Diagnostic> {
        let text = self.source.text();
        // A value follows one of these. Lists grow by doubling, while their raw parts are still held.
        let values = text.bytes().filter(|b| matches!(b, b',' | b':' | b'(' | b'[' | b'{')).count() as u64;
        let needs = values * 2 * size_of::<Value>() as u64;
        budget::needs(needs).map_err(|e| e.in_file(self.source.path()))?;
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
        if first == '"' || (first == 'r' && text[1..].starts_with(['"', '#'])) {
            self.short(text)?;
        }
        let word_len = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
        self.short(&text[..word_len])?;
        let kind = match first {
            '[' => Kind::List(self.values(&ron::from_str::<Vec<&RawValue>>(text).map_err(reparse)?)?),
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
                match ron::from_str(text).map_err(reparse)? {
                    Parts::Items(items) if !items.is_empty() => {
                        return Err(refuse(&format!("the fields of `{name}(...)` need names"))
                            .help(format!("{name}(field: value, ...)")));
                    }
                    Parts::Items(_) => Kind::Record { name: Some(name), fields: Vec::new() },
                    parts => self.parenthesis(Some(name), parts)?,
                }
            }
            _ => return Err(refuse("this kind of value is not used here")),
        };
        Ok(Value { source: self.source.clone(), span, kind })
    }

    /// Refuses a name or text of more than [`MAX_TEXT`] bytes, before it is copied.
    fn short(&self, text: &str) -> Result<(), Diagnostic> {
        if text.len() <= MAX_TEXT {
            return Ok(());
        }
        Err(Diagnostic::new("this name or text is too long")
            .at(self.source, Span::at(self.span(text).start))
            .help(format!("at most {MAX_TEXT} bytes are read")))
    }

    fn number(&self, text: &str) -> Option<Kind> {
        if let Ok(i) = ron::from_str::<i64>(text) {
            return Some(Kind::Int(i));
        }
        ron::from_str::<f64>(text).ok().filter(|x| x.is_finite()).map(Kind::Float)
    }

    fn values(&self, items: &[&'s RawValue]) -> Result<Vec<Value>, Diagnostic> {
        items.iter().map(|r| self.value(r)).collect()
    }

    fn parenthesis(&self, name: Option<String>, parts: Parts<'s>) -> Result<Kind, Diagnostic> {
        match parts {
            Parts::Unit if name.is_none() => Ok(Kind::Unit),
            Parts::Unit => Ok(Kind::Record { name, fields: Vec::new() }),
            Parts::Items(items) => Ok(Kind::List(self.values(&items)?)),
            Parts::Fields(fields) => {
                fields.iter().try_for_each(|(k, _)| self.short(k.0))?;
                let key = |k: &'s str| Key { name: k.to_owned(), span: self.span(k) };
                let keyed = fields.into_iter().map(|(k, v)| (key(k.0), v));
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
            keyed.push((Key { name, span: key.span }, v));
        }
        self.entries(keyed)
    }

    fn entries(
        &self,
        keyed: impl IntoIterator<Item = (Key, &'s RawValue)>,
    ) -> Result<Vec<(Key, Value)>, Diagnostic> {
        let mut seen = std::collections::HashMap::<String, Span>::new();
        let mut entries = Vec::new();
        for (key, raw) in keyed {
            if let Some(first) = seen.insert(key.name.clone(), key.span) {
                return Err(Diagnostic::new(format!("`{}` is given twice", key.name))
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
    Fields(Vec<(Identifier<'s>, &'s RawValue)>),
}

impl<'de> Deserialize<'de> for Parts<'de> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct PartsVisitor;
        impl<'de> Visitor<'de> for PartsVisitor {
            type Value = Parts<'de>;
            fn expecting(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
                f.write_str("a list or named fields")
            }
            fn visit_unit<E>(self) -> Result<Self::Value, E> {
                Ok(Parts::Unit)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(Parts::Items)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                Entries(PhantomData).visit_map(map).map(Parts::Fields)
            }
        }
        d.deserialize_any(PartsVisitor)
    }
}

/// A field's name, borrowed from the text so that its position is known.
struct Identifier<'s>(&'s str);

impl<'de> Deserialize<'de> for Identifier<'de> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct IdentifierVisitor;
        impl<'de> Visitor<'de> for IdentifierVisitor {
            type Value = Identifier<'de>;
            fn expecting(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
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
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        d.deserialize_map(Entries(PhantomData)).map(RawMap)
    }
}

/// Collects the entries of a map or struct.
struct Entries<K>(PhantomData<K>);

impl<'de, K: Deserialize<'de>> Visitor<'de> for Entries<K> {
    type Value = Vec<(K, &'de RawValue)>;
    fn expecting(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str("a map")
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        std::iter::from_fn(|| map.next_entry().transpose()).collect()
    }
}
