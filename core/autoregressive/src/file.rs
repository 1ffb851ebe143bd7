//! The file of a texture of autoregressive models.
//!
//! ```text
//! Autoregressive(
//!     version: 1,
//!     description: "What it feels like, in a sentence.",
//!     origin: "Where it came from.",
//!     rate_hz: 1000.0,
//!     models: [
//!         (
//!             speed_mm_s: 50.0,
//!             force_n: 1.0,
//!             variance: 0.04,
//!             gain: 1.5,
//!             ar: [-1.2, 0.81],
//!             ma: [0.3],
//!         ),
//!         /* at other speeds and forces, of the same orders */
//!     ],
//!     triangles: [[0, 1, 2], /* models by number, from 0 */],
//! )
//! ```
//!
//! `ar` is `a_1 .. a_p` and `ma` is `b_1 .. b_q` of the [model](super). Without `gain` it is 1, without
//! `ma` it is empty. Without `triangles` Delaunay's triangulation is made.

use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::ron::{self, Value, quoted};
use asperity_diagnostics::{Diagnostic, Source};

use super::frames::RATES_HZ;
use super::{MAX_ORDER, Model, Texture, Triangles, toolkit};
use asperity_motion::{MAX_ABS_FORCE_N, MAX_SPEED_MM_S};

/// Most models of a file. The Penn toolkit's textures have some tens. A tick searches all triangles.
pub const MAX_MODELS: usize = 256;

/// Largest text in bytes: room for the most models with the most coefficients. Reading takes at most
/// 110 MB, whatever the content.
const MAX_BYTES: usize = 1 << 20;
/// Largest variance in (m/s^2)^2 and largest gain.
const LARGEST: f64 = 1e12;
/// Largest root mean square of a model's signal in m/s^2.
const LOUDEST_M_S2: f64 = 1e5;
/// Least distance between models, in speed [mm/s] or force [N].
const APART: f64 = 1e-6;

/// A texture as it stands in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureFile {
    /// A sentence on how it feels.
    pub description: String,
    /// Origin: made, or the recording it was fitted to.
    pub origin: String,
    /// The texture.
    pub texture: Texture,
}

impl TextureFile {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read, and all of [`parse`](Self::parse).
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        Self::parse(&Source::read(path)?)
    }

    /// Reads a texture from its text.
    ///
    /// # Errors
    /// Each with its place: text that is not RON or longer than 1 MiB; an unknown or missing field;
    /// another version; a rate outside 100 Hz to 100 kHz; no model or more than [`MAX_MODELS`]; a
    /// number that is not finite or out of range; more than [`MAX_ORDER`] coefficients; a polynomial
    /// that is not stable; a model louder than 1e5 m/s^2; models of different orders; two models at one
    /// speed and force; triangles with bad corners or that do not tile the hull of the models.
    pub fn parse(source: &Arc<Source>) -> Result<Self, Diagnostic> {
        if source.text().len() > MAX_BYTES {
            return Err(Diagnostic::new(format!("a texture of {} bytes", source.text().len()))
                .in_file(source.path())
                .help(format!(
                    "at most {MAX_BYTES}: {MAX_MODELS} models of {MAX_ORDER} and {MAX_ORDER} coefficients"
                )));
        }
        let whole = ron::parse(source)?;
        let mut record = whole.record("Autoregressive")?;
        record.required("version")?.i64_in(1..=1, "")?;
        let description = record.required("description")?.text()?.to_owned();
        let origin = record.required("origin")?.text()?.to_owned();
        let rate_hz = record.required("rate_hz")?.f64_in(RATES_HZ, "Hz")?;
        let list = record.required("models")?;
        let corners = record.optional("triangles");
        record.finish()?;

        let values = list.list()?;
        if values.is_empty() || values.len() > MAX_MODELS {
            return Err(list
                .error(format!("a texture of {} models", values.len()))
                .help(format!("1 to {MAX_MODELS}")));
        }
        let models = values.iter().map(model).collect::<Result<Vec<Model>, _>>()?;
        apart(values, &models)?;
        let triangles = corners.map(|value| triangles(value, &models)).transpose()?;
        let texture = Texture::checked(rate_hz, models, triangles.as_deref()).map_err(|(model, e)| {
            let value = model.map_or(list, |i| &values[i]);
            e.at(value.source(), value.span())
        })?;
        texture.models().iter().zip(values).try_for_each(|(model, value)| quiet(model, value))?;
        Ok(Self { description, origin, texture })
    }

    /// The text of a file. It reads back to the same bits, triangles too.
    ///
    /// # Errors
    /// A texture that [`parse`](Self::parse) would refuse.
    pub fn to_ron(&self) -> Result<String, Diagnostic> {
        let model = |m: &Model| {
            let numbers = [
                ("speed_mm_s", m.speed_mm_s),
                ("force_n", m.force_n),
                ("variance", m.variance),
                ("gain", m.gain),
            ]
            .map(|(name, value)| format!("            {name}: {value:?},\n"));
            let ma = if m.ma.is_empty() { String::new() } else { row("ma", &m.ma) };
            format!("        (\n{}{}{ma}        ),\n", numbers.concat(), row("ar", &m.ar))
        };
        let models: String = self.texture.models().iter().map(model).collect();
        let corners = self.texture.triangles().corners().iter().map(|t| format!("        {t:?},\n"));
        let mut triangles: String = corners.collect();
        if !triangles.is_empty() {
            triangles = format!("    triangles: [\n{triangles}    ],\n");
        }
        let text = format!(
            "Autoregressive(\n    version: 1,\n    description: {},\n    origin: {},\n    \
             rate_hz: {:?},\n    models: [\n{models}    ],\n{triangles})\n",
            quoted(&self.description),
            quoted(&self.origin),
            self.texture.rate_hz()
        );
        // The text must read back to this texture.
        match Self::parse(&Source::new("texture", text.as_str())) {
            Ok(read) if read == *self => Ok(text),
            Ok(_) => Err(Diagnostic::new("this texture would read back different after writing")),
            Err(e) => Err(Diagnostic { place: None, file: None, related: Vec::new(), ..e }),
        }
    }
}

impl Texture {
    /// Reads a texture from a file: of the Penn [toolkit] if its name ends in `.xml`, else a [`TextureFile`].
    ///
    /// # Errors
    /// A file that cannot be read, and all of [`toolkit::parse`] or [`TextureFile::parse`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        let path = path.as_ref();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("xml")) {
            return toolkit::parse(&Source::read(path)?);
        }
        TextureFile::read(path).map(|file| file.texture)
    }
}

/// Coefficients, five a line.
fn row(name: &str, coefficients: &[f64]) -> String {
    let line = |five: &[f64]| five.iter().map(|c| format!("{c:?}")).collect::<Vec<_>>().join(", ");
    let lines: Vec<String> = coefficients.chunks(5).map(line).collect();
    format!("            {name}: [{}],\n", lines.join(",\n                "))
}

fn model(value: &Value) -> Result<Model, Diagnostic> {
    let mut m = value.record("Model")?;
    let ar = m.required("ar")?;
    let ma = m.optional("ma");
    let model = Model {
        speed_mm_s: m.required("speed_mm_s")?.f64_in(0.0..=MAX_SPEED_MM_S, "mm/s")?,
        force_n: m.required("force_n")?.f64_in(0.0..=MAX_ABS_FORCE_N, "N")?,
        variance: m.required("variance")?.f64_in(0.0..=LARGEST, "(m/s^2)^2")?,
        gain: m.optional("gain").map_or(Ok(1.0), |g| g.f64_in(0.0..=LARGEST, ""))?,
        ar: numbers(ar)?,
        ma: ma.map_or(Ok(Vec::new()), numbers)?,
    };
    m.finish()?;
    Ok(model)
}

/// Refuses a model that is too loud.
fn quiet(model: &Model, value: &Value) -> Result<(), Diagnostic> {
    let level = model.filter().variance().sqrt();
    if level <= LOUDEST_M_S2 {
        return Ok(());
    }
    Err(value
        .error(format!("a model whose signal has a root mean square of {level:.3e} m/s^2"))
        .help(format!("at most {LOUDEST_M_S2:e} m/s^2")))
}

fn numbers(value: &Value) -> Result<Vec<f64>, Diagnostic> {
    let numbers = value.list()?;
    if numbers.len() > MAX_ORDER {
        return Err(value
            .error(format!("{} coefficients", numbers.len()))
            .help(format!("at most {MAX_ORDER} are taken")));
    }
    numbers.iter().map(Value::f64).collect()
}

/// Refuses two models at one speed and force.
fn apart(values: &[Value], models: &[Model]) -> Result<(), Diagnostic> {
    for (i, m) in models.iter().enumerate() {
        let same = |n: &Model| {
            (n.speed_mm_s - m.speed_mm_s).abs() <= APART && (n.force_n - m.force_n).abs() <= APART
        };
        if let Some(first) = models[..i].iter().position(same) {
            return Err(values[i]
                .error(format!("a second model at {} mm/s and {} N", m.speed_mm_s, m.force_n))
                .related(values[i].source(), values[first].span(), "the first")
                .help("keep one of the two"));
        }
    }
    Ok(())
}

fn triangles(value: &Value, models: &[Model]) -> Result<Vec<[usize; 3]>, Diagnostic> {
    let rows = value.list()?;
    // A triangulation of n points has fewer than 2 n triangles.
    if rows.len() > 2 * models.len() {
        return Err(value.error(format!("{} triangles between {} models", rows.len(), models.len())));
    }
    let corners = |row: &Value| {
        let [a, b, c] = row.list()? else {
            return Err(row.error(format!("{} corners of a triangle", row.list()?.len())).help("three"));
        };
        // Not negative, by the range.
        let corner = |value: &Value| Ok(value.i64_in(0..=models.len() as i64 - 1, "")? as usize);
        let [a, b, c] = [corner(a)?, corner(b)?, corner(c)?];
        if a == b || b == c || c == a {
            return Err(row.error("a triangle with one corner twice").help("three models by number"));
        }
        Ok([a, b, c])
    };
    let given = rows.iter().map(corners).collect::<Result<Vec<[usize; 3]>, _>>()?;
    let points: Vec<[f64; 2]> = models.iter().map(Model::place).collect();
    if Triangles::given(&points, &given).is_none() {
        return Err(value
            .error("triangles that do not tile the hull of the models")
            .help("leave `triangles` out and Delaunay's triangulation is made"));
    }
    Ok(given)
}

#[cfg(test)]
#[path = "file_tests.rs"]
mod tests;
