//! Reads a texture from a file of the Penn Haptic Texture Toolkit (Culbertson, Lopez Delgado,
//! Kuchenbecker 2014, "One hundred data-driven haptic texture models and open-source methods for
//! rendering on 3D objects").
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

mod xml;

use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, Span};
use roxmltree::Node;

use super::{MAX_MODELS, Model, Texture, Triangles, line_spectrum};
use xml::Numbers;

/// Largest difference between coefficients and those of their frequencies, in parts of the largest.
/// Files are rounded.
const ROUNDED: f64 = 0.1;

/// Reads a model set in the form that the [module](super) describes.
///
/// # Errors
/// Each with the place of its element: text that is not XML; no `modelSet`; a value that is missing,
/// not a number or out of range; coefficients and frequencies of different filters; a model that is not
/// stable; models of different orders; a number of models other than `numMod`; more than
/// [`MAX_MODELS`]; a triangle's corner that is no model.
pub fn parse(source: &Arc<Source>) -> Result<Texture, Diagnostic> {
    let document = xml::document(source)?;
    let mut elements = document.descendants().filter(Node::is_element);
    let Some(set) = elements.find(|n| n.tag_name().name().eq_ignore_ascii_case("modelSet")) else {
        return Err(Diagnostic::new("no `modelSet` in this file").at(source, Span::at(0)));
    };
    let rate_hz = one(source, set, "SampleRate")?.ok_or_else(|| missing(source, set, "SampleRate"))?;
    let is_model =
        |n: &Node<'_, '_>| n.is_element() && (xml::holds(*n, "ARcoeff") || xml::holds(*n, "ARlsf"));
    let nodes: Vec<Node<'_, '_>> = set.descendants().filter(is_model).collect();
    if let Some(count) = one(source, set, "numMod")?
        && count != nodes.len() as f64
    {
        return Err(Diagnostic::new(format!("`numMod` is {count}, and there are {} models", nodes.len()))
            .at(source, xml::tag(set)));
    }
    if nodes.len() > MAX_MODELS {
        return Err(Diagnostic::new(format!("a texture of {} models", nodes.len()))
            .at(source, xml::tag(set))
            .help(format!("at most {MAX_MODELS} are taken: a tick looks at every triangle between them")));
    }
    let [speeds, forces] = ["speedList", "forceList"].map(|name| xml::numbers(source, set, name));
    let (speeds, forces) = (speeds?, forces?);
    let of = |list: &Option<Numbers>, i: usize| {
        list.as_ref().filter(|l| l.values.len() == nodes.len()).and_then(|l| l.values.get(i)).copied()
    };
    let models = nodes.iter().enumerate();
    let models = models.map(|(i, &node)| model(source, node, [of(&speeds, i), of(&forces, i)]));
    let models = models.collect::<Result<Vec<Model>, Diagnostic>>()?;
    let triangles = triangles(source, set, &models)?;
    Texture::new(rate_hz, models, triangles.as_deref()).map_err(|e| e.at(source, xml::tag(set)))
}

/// Largest deviation of a model's noise in m/s^2. No tool is shaken more.
const LOUDEST_M_S2: f64 = 1e4;

fn model(
    source: &Arc<Source>,
    node: Node<'_, '_>,
    [speed, force]: [Option<f64>; 2],
) -> Result<Model, Diagnostic> {
    let required = |name: &str, otherwise: Option<f64>| {
        one(source, node, name)?.or(otherwise).ok_or_else(|| missing(source, node, name))
    };
    let model = Model {
        ar: polynomial(source, node, ["ARcoeff", "ARlsf"])?,
        ma: polynomial(source, node, ["MAcoeff", "MAlsf"])?,
        variance: required("var", None)?,
        gain: required("gain", Some(1.0))?,
        speed_mm_s: required("speedMod", speed)?,
        force_n: required("forceMod", force)?,
    };
    model.check().map_err(|e| e.at(source, xml::tag(node)))?;
    let deviation = model.variance.sqrt() * model.gain;
    if deviation > LOUDEST_M_S2 {
        return Err(Diagnostic::new(format!("the noise of this model comes to {deviation:.0e} m/s^2"))
            .at(source, xml::tag(node))
            .help(format!("the root of `var` times `gain` is at most {LOUDEST_M_S2} m/s^2")));
    }
    Ok(model)
}

/// The single number under a name, if there is one.
fn one(source: &Arc<Source>, node: Node<'_, '_>, name: &str) -> Result<Option<f64>, Diagnostic> {
    let Some(numbers) = xml::numbers(source, node, name)? else { return Ok(None) };
    match numbers.values.as_slice() {
        [x] => Ok(Some(*x)),
        values => Err(Diagnostic::new(format!("`{name}` holds {} numbers, not one", values.len()))
            .at(source, numbers.span)),
    }
}

fn missing(source: &Arc<Source>, node: Node<'_, '_>, name: &str) -> Diagnostic {
    Diagnostic::new(format!("`{name}` is missing"))
        .at(source, xml::tag(node))
        .label(format!("no `{name}` in here"))
}

/// `c_1 ..` of `1 + c_1 z^-1 + ..`, from coefficients, line spectral frequencies, or both.
fn polynomial(
    source: &Arc<Source>,
    node: Node<'_, '_>,
    [of_coefficients, of_lines]: [&str; 2],
) -> Result<Vec<f64>, Diagnostic> {
    let filled = |name| Ok(xml::numbers(source, node, name)?.filter(|n| !n.values.is_empty()));
    let (coefficients, lines) = (filled(of_coefficients)?, filled(of_lines)?);
    let Some(lines) = lines else {
        let Some(Numbers { mut values, .. }) = coefficients else { return Ok(Vec::new()) };
        if values.first() == Some(&1.0) {
            values.remove(0);
        }
        return Ok(values);
    };
    if !line_spectrum::are_valid(&lines.values) {
        return Err(Diagnostic::new(format!("`{of_lines}` are not line spectral frequencies"))
            .at(source, lines.span)
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
                .at(source, coefficients.span)
                .help("as many, or one more where the first is 1")
                .related(source, lines.span, "the frequencies"));
        }
    };
    let distance = |sign: f64| meant.iter().zip(given).map(|(m, c)| (m - sign * c).abs()).fold(0.0, f64::max);
    let sign = if distance(1.0) <= distance(-1.0) { 1.0 } else { -1.0 };
    let largest = meant.iter().fold(1.0, |m: f64, c| m.max(c.abs()));
    if distance(sign) > ROUNDED * largest {
        return Err(Diagnostic::new(format!("`{of_coefficients}` and `{of_lines}` are not of one filter"))
            .at(source, coefficients.span)
            .related(source, lines.span, "the frequencies"));
    }
    Ok(given.iter().map(|c| sign * c).collect())
}

/// The file's triangles with corners from 0. None where there are none or they do not tile the hull.
fn triangles(
    source: &Arc<Source>,
    set: Node<'_, '_>,
    models: &[Model],
) -> Result<Option<Vec<[usize; 3]>>, Diagnostic> {
    let Some(numbers) = xml::numbers(source, set, "tri")? else { return Ok(None) };
    let fail = |what: String| Err(Diagnostic::new(what).at(source, numbers.span));
    let mut corners = Vec::with_capacity(numbers.values.len());
    for &x in &numbers.values {
        if x.fract() != 0.0 || !(1.0..=models.len() as f64).contains(&x) {
            return fail(format!("the corner {x} in `tri` is none of {} models", models.len()));
        }
        corners.push(x as usize - 1);
    }
    if corners.len() % 3 != 0 {
        return fail(format!("`tri` holds {} corners, which is not a multiple of 3", corners.len()));
    }
    let points: Vec<[f64; 2]> = models.iter().map(Model::place).collect();
    let count = corners.len() / 3;
    let by_rows: Vec<[usize; 3]> = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    let by_columns: Vec<[usize; 3]> =
        (0..count).map(|i| [corners[i], corners[count + i], corners[2 * count + i]]).collect();
    Ok([by_rows, by_columns].into_iter().find(|t| Triangles::given(&points, t).is_some()))
}
