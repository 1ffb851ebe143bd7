//! Values as text.

use std::fmt::{self, Write as _};

use super::{Key, Kind, Value};

/// The value as a file has it, on one line. Reading it back gives the same value.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind() {
            Kind::Unit => f.write_str("()"),
            Kind::Bool(b) => write!(f, "{b}"),
            Kind::Int(i) => write!(f, "{i}"),
            Kind::Float(x) => write!(f, "{x:?}"),
            Kind::Text(t) => f.write_str(&quoted(t)),
            Kind::Word(w) => f.write_str(w),
            Kind::List(items) => {
                let items: Vec<String> = items.iter().map(Self::to_string).collect();
                write!(f, "[{}]", items.join(", "))
            }
            Kind::Map(entries) => write!(f, "{{{}}}", fields(entries, |key| quoted(&key.name))),
            Kind::Record { name, fields: all } => {
                write!(f, "{}({})", name.as_deref().unwrap_or(""), fields(all, |key| key.name.clone()))
            }
        }
    }
}

fn fields(all: &[(Key, Value)], name: impl Fn(&Key) -> String) -> String {
    let all: Vec<String> = all.iter().map(|(key, value)| format!("{}: {value}", name(key))).collect();
    all.join(", ")
}

/// A RON string. Its escapes are not Rust's: only these few are needed.
pub fn quoted(text: &str) -> String {
    let mut out = String::from('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if c.is_control() => {
                let _ = write!(out, "\\u{{{:x}}}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
