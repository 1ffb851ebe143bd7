//! The slots of an effect: the texts of its list, read by the forms that its kind declares.

use asperity_diagnostics::ron::{self, Kind, Value};
use asperity_diagnostics::{Diagnostic, Place, Source, Span};
use asperity_node::{Descriptor, Effect, Settings};

use crate::Setting;

/// Reads the slots of a node. Every value keeps its place in the file, so that errors point there.
pub(crate) fn read(settings: &[Setting], descriptor: &Descriptor) -> Result<Vec<Vec<Settings>>, Diagnostic> {
    let Some(effect) = &descriptor.effect else { return Ok(Vec::new()) };
    let Some(list) = settings.iter().find(|setting| setting.name == effect.list) else {
        return Ok(Vec::new());
    };
    list.value.list()?.iter().map(|item| slot(item, &descriptor.kind, effect)).collect()
}

fn slot(item: &Value, kind: &str, effect: &Effect) -> Result<Vec<Settings>, Diagnostic> {
    let text = item.text()?;
    if effect.path_field().is_some() && is_path(text.trim(), kind) {
        return effect.read(kind, item).map(|settings| vec![settings]);
    }
    let source = Source::new(item.source().path().to_owned(), text);
    let placed = |span: Span| within(item, text, span);
    let value = ron::parse(&source).map_err(|e| match &e.place {
        Some(place) => {
            let Place { source, span } = placed(place.span);
            e.at(&source, span)
        }
        None => e,
    })?;
    let value = value.moved(&placed);
    match value.kind() {
        Kind::List(all) => all.iter().map(|value| effect.read(kind, value)).collect(),
        _ => effect.read(kind, &value).map(|settings| vec![settings]),
    }
}

/// Whether a text is a path and not a value in RON.
fn is_path(text: &str, kind: &str) -> bool {
    let value = text.strip_prefix(kind).unwrap_or(text).trim_start();
    !value.is_empty() && !value.starts_with(['(', '[', '"']) && !text.ends_with([')', ']', '"'])
}

/// Place of a part of an item's text in the file. It is the place of the whole item if the file does not
/// have its text letter by letter.
fn within(item: &Value, text: &str, part: Span) -> Place {
    let Place { source, span } = item.place();
    let written = source.text().get(span.start..span.end).unwrap_or_default();
    let at = |byte| if written == text { Some(byte) } else { written_at(written, byte) };
    let exact = at(part.start).zip(at(part.end));
    let span = exact.map_or(span, |(start, end)| Span { start: span.start + start, end: span.start + end });
    Place { source, span }
}

/// Place in a quoted text at which a byte of its meaning is written. `None` behind an escape that is not
/// one character, and if the text is not quoted.
fn written_at(written: &str, meant: usize) -> Option<usize> {
    let open = written.find('"')? + 1;
    if written.starts_with('r') {
        return Some(open + meant);
    }
    if !written.starts_with('"') {
        return None;
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
    use asperity_node::{Acts, Form, Param};

    /// The error for a graph whose list of texts stands behind `list: `.
    fn error(graph: &str) -> String {
        let source = Source::new("folder/g.ron", graph);
        let value = ron::parse(&source).unwrap();
        let value = value.record("").unwrap().required("list").unwrap().clone();
        let form = Form::new("", "(a: \"t\", b: 2)").field(Param::text("a", "", "")).field(Param::number(
            "b",
            1.0,
            0.0..=1.0,
            "",
        ));
        let descriptor = Descriptor::new("it", "").effect(Effect::new("list", Acts::Touching).form(form));
        let setting = Setting { name: "list".into(), place: value.place(), value, typed: None };
        read(&[setting], &descriptor).unwrap_err().to_string()
    }

    #[test]
    fn error_in_a_slot_points_at_its_place_in_the_file() {
        let e = error("(list: [\"(a: \\\"\\\")\",\n \"(a: \\\"t\\\", b: 2)\"])");
        assert_eq!(e, "folder/g.ron:2:17: 2 is out of range (from 0 to 1)");
        let e = error("(list: [r#\"(a: \"t\", b: 2)\"#])");
        assert_eq!(e, "folder/g.ron:1:24: 2 is out of range (from 0 to 1)");
        // An escape that is not followed: the whole text.
        let e = error("(list: [\"(a: \\\"\\\",\\u{20}b: 2)\"])");
        assert_eq!(e, "folder/g.ron:1:9: 2 is out of range (from 0 to 1)");
        let e = error("(list: [\"(a:\"])");
        assert!(e.starts_with("folder/g.ron:1:") && e.contains("not valid RON"), "{e}");
        // A path alone is for effects that need one.
        let e = error("(list: [\"m.ron\"])");
        assert!(e.starts_with("folder/g.ron:1:") && !e.contains("m.ron:"), "{e}");
        let e = error("(list: [\"(c: 1)\"])");
        assert!(e.starts_with("folder/g.ron:1:11: unknown field `c`"), "{e}");
    }
}
