//! Numbers in an XML file, however they are written, with their places.

use std::ops::Range;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, Span, budget};
use roxmltree::{Document, Node, ParsingOptions};

/// Most elements, attributes and texts of a file.
const MAX_NODES: u32 = 4_000_000;

/// Most attributes of one element. The parser compares each with all others. A toolkit file has a handful.
const MAX_ATTRIBUTES: usize = 1000;

/// Most bytes that the parser takes for each `<` or `=`: two nodes or an attribute, in lists that double.
const NODE_BYTES: u64 = 400;

/// Numbers with their place.
#[derive(Clone, Debug)]
pub(super) struct Numbers {
    pub(super) values: Vec<f64>,
    /// Place of the first element or attribute that holds them.
    pub(super) span: Span,
}

/// Parses a file.
pub(super) fn document(source: &Arc<Source>) -> Result<Document<'_>, Diagnostic> {
    few_attributes(source)?;
    no_entities(source)?;
    let nodes = source.text().bytes().filter(|b| matches!(b, b'<' | b'=')).count() as u64;
    budget::needs(nodes * NODE_BYTES).map_err(|e| e.in_file(source.path()))?;
    let options = ParsingOptions { allow_dtd: true, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(source.text(), options).map_err(|e| {
        let at = e.pos();
        let line = source.line_span(at.row as usize);
        let text = source.text().get(line.start..line.end).unwrap_or_default();
        let skip: usize = text.chars().take((at.col as usize).saturating_sub(1)).map(char::len_utf8).sum();
        Diagnostic::new(format!("not an XML file: {e}")).at(source, Span::at(line.start + skip))
    })
}

/// Refuses an element with more than [`MAX_ATTRIBUTES`] attributes.
fn few_attributes(source: &Arc<Source>) -> Result<(), Diagnostic> {
    let text = source.text();
    let mut start = 0;
    // No attribute holds a `<`, so an element's attributes stand before the next one.
    for part in text.split_inclusive('<') {
        let quoted = |(at, _): &(usize, &str)| part[at + 1..].trim_start().starts_with(['"', '\'']);
        if let Some((at, _)) = part.match_indices('=').filter(quoted).nth(MAX_ATTRIBUTES) {
            return Err(Diagnostic::new("an element of very many attributes")
                .at(source, Span::at(start + at))
                .help(format!("at most {MAX_ATTRIBUTES} are read")));
        }
        start += part.len();
    }
    Ok(())
}

/// Refuses a file's own entities: a short text could stand for gigabytes.
fn no_entities(source: &Arc<Source>) -> Result<(), Diagnostic> {
    match source.text().find("<!ENTITY") {
        None => Ok(()),
        Some(at) => Err(Diagnostic::new("an XML file that defines entities is not read")
            .at(source, Span::at(at))
            .help("write what they stand for in their place")),
    }
}

/// Place of an element's tag.
pub(super) fn tag(node: Node<'_, '_>) -> Span {
    let start = node.range().start;
    Span { start, end: start + 1 + node.tag_name().name().len() }
}

/// Whether an element holds this name, as an attribute or a child element.
pub(super) fn holds(node: Node<'_, '_>, name: &str) -> bool {
    node.attributes().any(|a| a.name().eq_ignore_ascii_case(name))
        || node.children().any(|c| c.is_element() && c.tag_name().name().eq_ignore_ascii_case(name))
}

/// Numbers under a name in an element: of its attribute, or of all child elements of that name. None if
/// there are none.
pub(super) fn numbers(
    source: &Arc<Source>,
    node: Node<'_, '_>,
    name: &str,
) -> Result<Option<Numbers>, Diagnostic> {
    let mut found: Option<Numbers> = None;
    let mut add = |span: Span, values: Vec<f64>| match &mut found {
        Some(numbers) => numbers.values.extend(values),
        None => found = Some(Numbers { values, span }),
    };
    if let Some(attribute) = node.attributes().find(|a| a.name().eq_ignore_ascii_case(name)) {
        let range = attribute.range_value();
        add(Span { start: range.start, end: range.end }, list(source, name, range)?);
    }
    for child in node.children().filter(|c| c.is_element() && c.tag_name().name().eq_ignore_ascii_case(name))
    {
        add(tag(child), within(source, name, child)?);
    }
    Ok(found)
}

/// Numbers of all texts in an element. Without texts, those of attributes called `value`.
fn within(source: &Arc<Source>, name: &str, node: Node<'_, '_>) -> Result<Vec<f64>, Diagnostic> {
    let mut values = Vec::new();
    for text in node.descendants().filter(Node::is_text) {
        values.extend(list(source, name, text.range())?);
    }
    if values.is_empty() {
        for element in node.descendants().filter(Node::is_element) {
            for attribute in element.attributes().filter(|a| a.name().eq_ignore_ascii_case("value")) {
                values.extend(list(source, name, attribute.range_value())?);
            }
        }
    }
    Ok(values)
}

/// The numbers in a part of the text.
fn list(source: &Arc<Source>, name: &str, range: Range<usize>) -> Result<Vec<f64>, Diagnostic> {
    let text = source.text().get(range.clone()).unwrap_or_default();
    let separates = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | '[' | ']');
    let mut values = Vec::new();
    for word in text.split(separates).filter(|w| !w.is_empty()) {
        match word.parse::<f64>() {
            Ok(x) if x.is_finite() => values.push(x),
            _ => {
                let start = range.start + (word.as_ptr() as usize - text.as_ptr() as usize);
                return Err(Diagnostic::new(format!("`{word}` in `{name}` is not a number"))
                    .at(source, Span { start, end: start + word.len() })
                    .help("finite numbers, separated by spaces or commas"));
            }
        }
    }
    Ok(values)
}
