//! Reads a texture file of the Penn Haptic Texture Toolkit (Culbertson, Lopez Delgado, Kuchenbecker 2014,
//! "One hundred data-driven haptic texture models and open-source methods for rendering on 3D objects").
//!
//! XML with a `modelSet`:
//!
//! | of the set | |
//! |---|---|
//! | `SampleRate` | rate of the models in Hz |
//! | `numMod` | how many models there are; may be missing |
//! | `speedList`, `forceList` | speeds in mm/s and forces in N of models without their own |
//! | `tri` | corners of triangles, from 1, by rows or by columns; else Delaunay's triangulation |
//!
//! | of a model | |
//! |---|---|
//! | `ARcoeff`, `ARlsf` | `A = 1 + a_1 z^-1 + ..`, with or without the 1; its line spectral frequencies |
//! | `MAcoeff`, `MAlsf` | the same of `B`; without both `B` is 1 |
//! | `var`, `gain` | variance of the noise in (m/s^2)^2, and a factor on the noise, by default 1 |
//! | `speedMod`, `forceMod` | speed in mm/s and force in N |
//!
//! Frequencies are in radians. One of coefficients and frequencies is enough.
//! `tri` counts where its triangles tile the hull of the models.
//!
//! Line spectral frequencies tell which sign a file gives its coefficients: `1 + ..` or `1 - ..`.
//! Without frequencies it is `1 + ..`. A model is any element that holds `ARcoeff` or `ARlsf`. Case
//! does not matter. A value may be an attribute, an element with numbers separated by spaces or commas,
//! or an element with one child for each number or row.

use std::ops::Range;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, Span, budget};
use roxmltree::{Document, Node, ParsingOptions};

use super::{MAX_MODELS, Model, Texture, Triangles, line_spectrum};

/// Largest difference between coefficients and those of their frequencies, in parts of the largest.
/// Files are rounded.
const ROUNDED: f64 = 0.1;
/// Largest deviation of a model's noise in m/s^2. No tool is shaken more.
const LOUDEST_M_S2: f64 = 1e4;
/// Most elements, attributes and texts of a file.
const MAX_NODES: u32 = 4_000_000;
/// Most attributes of one element. The parser compares each with all others. A toolkit file has a handful.
const MAX_ATTRIBUTES: usize = 1000;
/// Most bytes that the parser takes for each `<` or `=`: two nodes or an attribute, in lists that double.
const NODE_BYTES: u64 = 400;

/// Reads a model set in the form that the [module](super) describes.
///
/// # Errors
/// Each with the place of its element: text that is not XML; no `modelSet`; a value that is missing,
/// not a number or out of range; coefficients and frequencies of different filters; a model that is not
/// stable; models of different orders; a number of models other than `numMod`; more than
/// [`MAX_MODELS`]; a triangle's corner that is no model.
pub fn parse(source: &Arc<Source>) -> Result<Texture, Diagnostic> {
    let document = document(source)?;
    let elements = || document.descendants().filter(Node::is_element);
    let Some(node) = elements().find(|n| n.tag_name().name().eq_ignore_ascii_case("modelSet")) else {
        return Err(Diagnostic::new("no `modelSet` in this file").at(source, Span::at(0)));
    };
    let set = Element { source, node };
    let rate_hz = set.required("SampleRate", None)?;
    let within = node.descendants().filter(Node::is_element).map(|node| Element { source, node });
    let elements: Vec<Element<'_, '_>> = within.filter(|e| e.holds("ARcoeff") || e.holds("ARlsf")).collect();
    let models = elements.len();
    if let Some(count) = set.one("numMod")?
        && count != models as f64
    {
        return Err(set.error(format!("`numMod` is {count}, and there are {models} models")));
    }
    if models > MAX_MODELS {
        let help = format!("at most {MAX_MODELS} are taken: a tick looks at every triangle between them");
        return Err(set.error(format!("a texture of {models} models")).help(help));
    }
    let list = |name| Ok(set.numbers(name)?.filter(|list| list.values.len() == models));
    let (speeds, forces) = (list("speedList")?, list("forceList")?);
    let of = |list: &Option<Numbers>, i: usize| list.as_ref().map(|list| list.values[i]);
    let models = elements.into_iter().enumerate();
    let models = models.map(|(i, element)| model(element, [of(&speeds, i), of(&forces, i)]));
    let models = models.collect::<Result<Vec<Model>, Diagnostic>>()?;
    let triangles = triangles(set, &models)?;
    Texture::new(rate_hz, models, triangles.as_deref()).map_err(|e| e.at(source, set.tag()))
}

fn model(of: Element<'_, '_>, [speed, force]: [Option<f64>; 2]) -> Result<Model, Diagnostic> {
    let model = Model {
        ar: polynomial(of, ["ARcoeff", "ARlsf"])?,
        ma: polynomial(of, ["MAcoeff", "MAlsf"])?,
        variance: of.required("var", None)?,
        gain: of.required("gain", Some(1.0))?,
        speed_mm_s: of.required("speedMod", speed)?,
        force_n: of.required("forceMod", force)?,
    };
    model.check().map_err(|e| e.at(of.source, of.tag()))?;
    let deviation = model.variance.sqrt() * model.gain;
    if deviation > LOUDEST_M_S2 {
        let help = format!("the root of `var` times `gain` is at most {LOUDEST_M_S2} m/s^2");
        return Err(of.error(format!("the noise of this model comes to {deviation:.0e} m/s^2")).help(help));
    }
    Ok(model)
}

/// `c_1 ..` of `1 + c_1 z^-1 + ..`, from coefficients, line spectral frequencies, or both.
fn polynomial(of: Element<'_, '_>, [of_coefficients, of_lines]: [&str; 2]) -> Result<Vec<f64>, Diagnostic> {
    let filled = |name| Ok(of.numbers(name)?.filter(|n| !n.values.is_empty()));
    let (coefficients, lines) = (filled(of_coefficients)?, filled(of_lines)?);
    let Some(lines) = lines else {
        let mut values = coefficients.map_or(Vec::new(), |numbers| numbers.values);
        if values.first() == Some(&1.0) {
            values.remove(0);
        }
        return Ok(values);
    };
    if !line_spectrum::are_valid(&lines.values) {
        return Err(Diagnostic::new(format!("`{of_lines}` are not line spectral frequencies"))
            .at(of.source, lines.span)
            .help("numbers that rise and lie between 0 and pi"));
    }
    let order = lines.values.len();
    let mut meant = vec![0.0; order];
    line_spectrum::to_polynomial(&lines.values, &mut meant);
    let Some(coefficients) = coefficients else { return Ok(meant) };
    let given = match coefficients.values.as_slice() {
        values if values.len() == order => values,
        [1.0, values @ ..] if values.len() == order => values,
        values => {
            let (count, what) = (values.len(), of_coefficients);
            return Err(Diagnostic::new(format!("`{what}` holds {count} numbers, and `{of_lines}` {order}"))
                .at(of.source, coefficients.span)
                .help("as many, or one more where the first is 1")
                .related(of.source, lines.span, "the frequencies"));
        }
    };
    let distance = |sign: f64| meant.iter().zip(given).map(|(m, c)| (m - sign * c).abs()).fold(0.0, f64::max);
    let sign = if distance(1.0) <= distance(-1.0) { 1.0 } else { -1.0 };
    let largest = meant.iter().fold(1.0, |m: f64, c| m.max(c.abs()));
    if distance(sign) > ROUNDED * largest {
        return Err(Diagnostic::new(format!("`{of_coefficients}` and `{of_lines}` are not of one filter"))
            .at(of.source, coefficients.span)
            .related(of.source, lines.span, "the frequencies"));
    }
    Ok(given.iter().map(|c| sign * c).collect())
}

/// The file's triangles with corners from 0. None where there are none or they do not tile the hull.
fn triangles(set: Element<'_, '_>, models: &[Model]) -> Result<Option<Vec<[usize; 3]>>, Diagnostic> {
    let Some(numbers) = set.numbers("tri")? else { return Ok(None) };
    let fail = |what: String| Err(Diagnostic::new(what).at(set.source, numbers.span));
    let mut corners = Vec::with_capacity(numbers.values.len());
    for &x in &numbers.values {
        if x.fract() != 0.0 || !(1.0..=models.len() as f64).contains(&x) {
            return fail(format!(
                "the corner {x} in `tri` is not the number of a model (1 to {})",
                models.len()
            ));
        }
        corners.push(x as usize - 1);
    }
    if corners.len() % 3 != 0 {
        return fail(format!("`tri` holds {} corners, which is not a multiple of 3", corners.len()));
    }
    let points: Vec<[f64; 2]> = models.iter().map(Model::place).collect();
    let count = corners.len() / 3;
    let by_rows: Vec<[usize; 3]> = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    let by_columns = (0..count).map(|i| [0, 1, 2].map(|k| corners[k * count + i])).collect();
    Ok([by_rows, by_columns].into_iter().find(|t| Triangles::given(&points, t).is_some()))
}

/// Numbers with the place of the first element or attribute that holds them.
struct Numbers {
    values: Vec<f64>,
    span: Span,
}

/// An element of a file.
#[derive(Clone, Copy)]
struct Element<'a, 's> {
    source: &'a Arc<Source>,
    node: Node<'a, 's>,
}

impl<'a, 's> Element<'a, 's> {
    /// Place of its tag.
    fn tag(self) -> Span {
        let start = self.node.range().start;
        Span { start, end: start + 1 + self.node.tag_name().name().len() }
    }

    fn error(self, what: String) -> Diagnostic {
        Diagnostic::new(what).at(self.source, self.tag())
    }

    /// Child elements of a name.
    fn children(self, name: &str) -> impl Iterator<Item = Node<'a, 's>> {
        let named = move |n: &Node<'_, '_>| n.is_element() && n.tag_name().name().eq_ignore_ascii_case(name);
        self.node.children().filter(named)
    }

    /// Whether it has an attribute or a child element of a name.
    fn holds(self, name: &str) -> bool {
        self.node.attributes().any(|a| a.name().eq_ignore_ascii_case(name))
            || self.children(name).next().is_some()
    }

    /// Numbers of its attribute or of all its child elements of a name. None if there are none.
    fn numbers(self, name: &str) -> Result<Option<Numbers>, Diagnostic> {
        let mut found: Option<Numbers> = None;
        let mut add = |span: Span, values: Vec<f64>| {
            found.get_or_insert(Numbers { values: Vec::new(), span }).values.extend(values);
        };
        if let Some(attribute) = self.node.attributes().find(|a| a.name().eq_ignore_ascii_case(name)) {
            let range = attribute.range_value();
            add(Span { start: range.start, end: range.end }, list(self.source, name, range)?);
        }
        for node in self.children(name) {
            let child = Element { node, ..self };
            add(child.tag(), child.all_numbers(name)?);
        }
        Ok(found)
    }

    /// Numbers of all texts in it. Without texts, those of attributes called `value`.
    fn all_numbers(self, name: &str) -> Result<Vec<f64>, Diagnostic> {
        let mut texts = self.node.descendants().filter(Node::is_text).map(|text| text.range());
        let attributes = self.node.descendants().flat_map(|node| node.attributes());
        let mut values =
            attributes.filter(|a| a.name().eq_ignore_ascii_case("value")).map(|a| a.range_value());
        let all = |ranges: &mut dyn Iterator<Item = Range<usize>>| {
            let lists = ranges.map(|range| list(self.source, name, range));
            Ok(lists.collect::<Result<Vec<_>, Diagnostic>>()?.concat())
        };
        let found: Vec<f64> = all(&mut texts)?;
        if found.is_empty() { all(&mut values) } else { Ok(found) }
    }

    /// The single number under a name, if there is one.
    fn one(self, name: &str) -> Result<Option<f64>, Diagnostic> {
        let Some(Numbers { values, span }) = self.numbers(name)? else { return Ok(None) };
        match values[..] {
            [x] => Ok(Some(x)),
            _ => Err(Diagnostic::new(format!("`{name}` holds {} numbers, not one", values.len()))
                .at(self.source, span)),
        }
    }

    fn required(self, name: &str, otherwise: Option<f64>) -> Result<f64, Diagnostic> {
        self.one(name)?
            .or(otherwise)
            .ok_or_else(|| self.error(format!("`{name}` is missing")).label(format!("no `{name}` in here")))
    }
}

/// Parses a file.
fn document(source: &Arc<Source>) -> Result<Document<'_>, Diagnostic> {
    few_attributes(source)?;
    if let Some(at) = source.text().find("<!ENTITY") {
        // A short text could stand for gigabytes.
        return Err(Diagnostic::new("an XML file that defines entities is not read")
            .at(source, Span::at(at))
            .help("replace each entity by its text"));
    }
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
