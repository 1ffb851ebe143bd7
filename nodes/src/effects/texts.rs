//! Lists of effects, as texts.

use std::collections::HashMap;
use std::fmt::Debug;
use std::sync::Arc;

use asperity_diagnostics::ron::{self, Kind, Value};
use asperity_node::{Diagnostic, Params, Place, Setup, Source, Span};

/// What each text of a list comes to. Files that a text names are relative to the file in which the list stands.
///
/// # Errors
/// What is wrong with a text points into the list, and says which slot it is; what is wrong with a file that it names points there.
pub(super) fn read<T>(
    setup: &Setup<'_>,
    param: &str,
    mut read: impl FnMut(&Value) -> Result<T, Diagnostic>,
) -> Result<Vec<T>, Diagnostic> {
    let params = setup.params;
    let place = params.place(param).or(params.node_place());
    let path = place.map(|p| p.source.path().to_owned()).unwrap_or_default();
    let one = |(slot, text): (usize, &String)| {
        let source = Source::new(path.clone(), text.as_str());
        ron::parse(&source).and_then(|value| read(&value)).map_err(|e| told(params, param, slot, &source, e))
    };
    params.texts(param).iter().enumerate().map(one).collect()
}

/// The same of texts that hold one effect or a list of them.
///
/// # Errors
/// As [`read`].
pub(super) fn read_each<T>(
    setup: &Setup<'_>,
    param: &str,
    mut each: impl FnMut(&Value) -> Result<T, Diagnostic>,
) -> Result<Vec<Vec<T>>, Diagnostic> {
    read(setup, param, |value| match value.kind() {
        Kind::List(all) => all.iter().map(&mut each).collect(),
        _ => each(value).map(|one| vec![one]),
    })
}

/// What takes time or memory to make, made once for all that want the same.
pub(super) struct Shared<K, T> {
    made: Vec<(K, Arc<T>)>,
    /// Where each stands, by all that it says; none holds a NaN.
    known: HashMap<String, usize>,
}

impl<K, T> Default for Shared<K, T> {
    fn default() -> Self {
        Self { made: Vec::new(), known: HashMap::new() }
    }
}

impl<K: Debug, T> Shared<K, T> {
    /// The one that is wanted, made where there is none yet.
    ///
    /// # Errors
    /// Those of making it.
    pub(super) fn get(
        &mut self,
        wanted: K,
        make: impl FnOnce() -> Result<T, Diagnostic>,
    ) -> Result<Arc<T>, Diagnostic> {
        let text = format!("{wanted:?}");
        if let Some((_, made)) = self.known.get(&text).and_then(|place| self.made.get(*place)) {
            return Ok(made.clone());
        }
        let made = Arc::new(make()?);
        self.known.insert(text, self.made.len());
        self.made.push((wanted, made.clone()));
        Ok(made)
    }

    /// How many there are.
    pub(super) fn count(&self) -> u64 {
        self.made.len() as u64
    }

    /// What was wanted.
    pub(super) fn wanted(&self) -> impl Iterator<Item = &K> {
        self.made.iter().map(|(wanted, _)| wanted)
    }
}

/// An error in a text, at the list.
fn told(params: &Params, param: &str, slot: usize, source: &Arc<Source>, e: Diagnostic) -> Diagnostic {
    let inner = e.place.as_ref().filter(|p| Arc::ptr_eq(&p.source, source));
    if inner.is_none() && e.path().is_some() {
        return e;
    }
    let mut told = params.error(param, format!("slot {slot}: {}", e.message)).label(e.label);
    if let Some(list) = params.place(param)
        && let Some(span) = within(list, slot, inner.map(|p| p.span))
    {
        told = told.at(&list.source, span);
    }
    Diagnostic { help: e.help, ..told }
}

/// Where a part of a text stands in the list, or the text where that cannot be told.
fn within(list: &Place, slot: usize, part: Option<Span>) -> Option<Span> {
    let base = list.span.start;
    let text = list.source.text().get(base..list.span.end)?;
    let value = ron::parse(&Source::new("", text)).ok()?;
    let item = value.list().ok()?.get(slot)?.span();
    let written = text.get(item.start..item.end)?;
    let exact = part.and_then(|p| Some((written_at(written, p.start)?, written_at(written, p.end)?)));
    let (start, end) = exact.map_or((item.start, item.end), |(s, e)| (item.start + s, item.start + e));
    Some(Span { start: base + start, end: base + end })
}

/// The place in a text as it is written, quotes and all, of a byte of what it means; `None` behind an escape that is not one character.
fn written_at(written: &str, meant: usize) -> Option<usize> {
    let open = written.find('"')? + 1;
    if written.starts_with('r') {
        return Some(open + meant);
    }
    let mut chars = written.get(open..)?.chars();
    let mut left = meant;
    while left > 0 {
        let mut c = chars.next()?;
        if c == '\\' {
            c = chars.next().filter(|c| matches!(c, '"' | '\\' | '\'' | 'n' | 'r' | 't' | '0'))?;
        }
        left = left.checked_sub(c.len_utf8())?;
    }
    Some(written.len() - chars.as_str().len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_node::{Config, ParamValue};

    /// The error for a graph whose list of texts stands behind `list: `.
    fn error(graph: &str, texts: &[&str], wrong: impl Fn(&Value) -> Diagnostic) -> String {
        let source = Source::new("folder/g.ron", graph);
        let start = graph.find('[').unwrap();
        let place = Place { source, span: Span { start, end: graph.rfind(']').unwrap() + 1 } };
        let mut params = Params::new(None);
        let texts = texts.iter().map(|t| (*t).to_owned()).collect();
        params.insert("list", Some(ParamValue::Texts(texts)), Some(place));
        let config = Config { id: "it", params: &params, tick_hz: 500, every: 1, audio_hz: 8000, seed: 1 };
        let setup = Setup { config, inputs: &[], outputs: &[], closes_cycle: false };
        let read = read(&setup, "list", |value| if value.f64().is_ok() { Ok(()) } else { Err(wrong(value)) });
        read.unwrap_err().to_string()
    }

    #[test]
    fn an_error_points_at_the_place_in_the_text() {
        let of_b = |value: &Value| value.record("x").unwrap().required("b").unwrap().error("bad");
        let e = error("list: [\"1\",\n \"(a: 1, b: 2)\"]", &["1", "(a: 1, b: 2)"], of_b);
        assert_eq!(e, "folder/g.ron:2:13: slot 1: bad");
        let e = error("list: [\"(a: \\\"t\\\", b: 2)\"]", &["(a: \"t\", b: 2)"], of_b);
        assert_eq!(e, "folder/g.ron:1:23: slot 0: bad");
        let e = error("list: [r#\"(a: \"t\", b: 2)\"#]", &["(a: \"t\", b: 2)"], of_b);
        assert_eq!(e, "folder/g.ron:1:23: slot 0: bad");
        // An escape that is not followed: the text.
        let e = error("list: [\"(a: 1,\\u{20}b: 2)\"]", &["(a: 1, b: 2)"], of_b);
        assert_eq!(e, "folder/g.ron:1:8: slot 0: bad");
        // A list that was not written as one.
        let e = error("list: [1]", &["(a: 1, b: 2)"], of_b);
        assert_eq!(e, "folder/g.ron:1:8: slot 0: bad");
    }

    #[test]
    fn what_is_no_ron_is_said_and_what_another_file_says_stays() {
        let e = error("list: [\"(a:\"]", &["(a:"], |v| v.error("not this"));
        assert!(e.starts_with("folder/g.ron:1:") && e.contains("slot 0: not valid RON"), "{e}");
        let e = error("list: [\"x\"]", &["x"], |_| Diagnostic::new("missing").in_file("a.ron"));
        assert_eq!(e, "a.ron: missing");
        let e = error("list: [\"x\"]", &["x"], |_| Diagnostic::new("no place"));
        assert_eq!(e, "folder/g.ron:1:8: slot 0: no place");
    }
}
