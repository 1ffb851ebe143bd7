//! Reads shapes and their poses.

use asperity_diagnostics::Diagnostic;
use asperity_diagnostics::ron::{Record, Value};

use super::Heights;
use super::read::{Known, body, number, numbers, variant};
use crate::space::{HeightGrid, Pose, Shape, Surface, WORLD_MM};
use asperity_surfaces::topography::{HeightField, made_surfaces};

const SHAPES: &[&str] = &["plane", "rectangle", "sphere", "box", "relief"];
const HEIGHTS: &[&str] = &["made", "picture"];
/// Default thickness of a one-sided shape. A stylus that is pressed deeper is through.
const THICKNESS_MM: f64 = 20.0;

/// Reads the fields `shape`, `place_mm` and `turn_deg` of a surface.
pub(super) fn surface(record: &mut Record<'_>, known: &mut Known) -> Result<Surface, Diagnostic> {
    let value = record.required("shape")?;
    let shape = shape(value, known)?;
    let mut three = |name, most: f64, unit| {
        record.optional(name).map_or(Ok([0.0; 3]), |v| numbers::<3>(v, &(-most..=most), unit))
    };
    let (place_mm, turn_deg) = (three("place_mm", WORLD_MM, "mm")?, three("turn_deg", 3600.0, "degrees")?);
    let pose = Pose::new(place_mm, turn_deg).map_err(|e| at(value, e))?;
    Ok(Surface { shape, pose })
}

/// Moves an error about a value to the place of the value.
fn at(value: &Value, e: Diagnostic) -> Diagnostic {
    e.at(value.source(), value.span())
}

fn shape(value: &Value, known_before: &mut Known) -> Result<Shape, Diagnostic> {
    let name = variant(value, "shape", SHAPES)?;
    let size = 0.0..=WORLD_MM;
    let Some(mut record) = body(value, name)? else {
        return match name {
            "plane" => Ok(Shape::plane()),
            _ => Err(value.error(format!("a {name} of no size")).help(usage(name))),
        };
    };
    let shape = match name {
        "plane" => Shape::plane(),
        "sphere" => {
            let radius_mm = number(&mut record, "radius_mm", size, "mm", None)?;
            Shape::sphere(radius_mm).map_err(|e| at(value, e))?
        }
        "box" => {
            Shape::cuboid(numbers(record.required("size_mm")?, &size, "mm")?).map_err(|e| at(value, e))?
        }
        "rectangle" => {
            let sides = numbers(record.required("size_mm")?, &size, "mm")?;
            let thickness_mm = number(&mut record, "thickness_mm", size, "mm", Some(THICKNESS_MM))?;
            Shape::rectangle(sides, thickness_mm).map_err(|e| at(value, e))?
        }
        _ => {
            let from = record.required("heights")?;
            let mut picture = None;
            let grid = known_before.grid(from, |from| {
                let heights = Heights::parse(from)?;
                if let Heights::Picture { file, .. } = &heights {
                    picture = Some(file.clone());
                }
                grid(&heights).map_err(|e| at(from, e))
            })?;
            known_before.pictures.extend(picture);
            let sides = record.optional("size_mm").map(|v| numbers::<2>(v, &size, "mm")).transpose()?;
            let scale = number(&mut record, "scale", -1000.0..=1000.0, "", Some(1.0))?;
            let thickness_mm = number(&mut record, "thickness_mm", size, "mm", Some(THICKNESS_MM))?;
            Shape::relief(grid, sides, scale, thickness_mm).map_err(|e| at(value, e))?
        }
    };
    record.finish()?;
    Ok(shape)
}

fn usage(name: &str) -> &'static str {
    match name {
        "rectangle" => "rectangle(size_mm: (x, y))",
        "sphere" => "sphere(radius_mm: r)",
        "box" => "box(size_mm: (x, y, z))",
        _ => "relief(heights: made(surface: \"NAME\"))",
    }
}

impl Heights {
    /// Reads a source of heights: `made(...)` or `picture(...)`.
    ///
    /// # Errors
    /// A source, surface or field is unknown, or a number is out of its range. The file of a picture is
    /// not opened.
    pub fn parse(value: &Value) -> Result<Self, Diagnostic> {
        let name = variant(value, "source of heights", HEIGHTS)?;
        let mut record = value.record(name)?;
        let heights = if name == "made" {
            let surface = record.required("surface")?;
            let name = surface.text()?;
            let all = made_surfaces();
            if all.iter().all(|made| made.name != name) {
                let names: Vec<&str> = all.iter().map(|made| made.name.as_str()).collect();
                let e = surface.error(format!("no made surface is called `{name}`"));
                return Err(match asperity_diagnostics::nearest(name, names) {
                    Some(near) => e.help(format!("did you mean `{near}`?")),
                    None => e.help("`asperity materials` lists them"),
                });
            }
            let mut whole =
                |name, range, default| record.optional(name).map_or(Ok(default), |v| v.i64_in(range, ""));
            let side = whole("side", 8..=2048, 512)? as usize;
            let piece = whole("piece", 0..=i64::MAX, 1)? as u64;
            let step_mm = number(&mut record, "step_mm", 0.005..=1.0, "mm", Some(0.04))?;
            record.finish()?;
            return Ok(Heights::Made { name: name.to_owned(), side, step_mm, piece });
        } else {
            let file = record.required("file")?.path()?;
            let step_mm = number(&mut record, "step_mm", 0.001..=100.0, "mm", None)?;
            let height_mm = number(&mut record, "height_mm", 0.0..=1000.0, "mm", None)?;
            Heights::Picture { file, step_mm, height_mm }
        };
        record.finish()?;
        Ok(heights)
    }

    /// Heights on a grid that repeats.
    ///
    /// # Errors
    /// The picture cannot be read.
    pub fn field(&self) -> Result<HeightField, Diagnostic> {
        match self {
            Self::Made { name, side, step_mm, piece } => {
                let made = made_surfaces().into_iter().find(|made| made.name == *name);
                let made =
                    made.ok_or_else(|| Diagnostic::new(format!("no made surface is called `{name}`")))?;
                Ok(made.patch((*side, *step_mm), *piece))
            }
            Self::Picture { file, step_mm, height_mm } => {
                let (columns, heights) = grey(file, *height_mm)?;
                let side = columns.min(heights.len() / columns.max(1));
                let mut field = HeightField::flat(side, *step_mm);
                for (to, from) in field
                    .heights_mut()
                    .chunks_exact_mut(side.max(1))
                    .zip(heights.chunks_exact(columns.max(1)))
                {
                    to.copy_from_slice(&from[..side]);
                }
                Ok(field)
            }
        }
    }
}

/// Heights in the form that a shape takes. A patch of a made surface repeats, a picture ends.
fn grid(heights: &Heights) -> Result<HeightGrid, Diagnostic> {
    match heights {
        Heights::Made { .. } => HeightGrid::from_field(&heights.field()?),
        Heights::Picture { file, step_mm, height_mm } => {
            let (columns, heights) = grey(file, *height_mm)?;
            HeightGrid::new(columns, heights, [*step_mm; 2], false)
        }
    }
}

/// Columns and heights in mm of a grey picture, its lowest row first.
fn grey(file: &std::path::Path, height_mm: f64) -> Result<(usize, Vec<f32>), Diagnostic> {
    let fail = |what: String| Diagnostic::new(what).in_file(file);
    let bytes = asperity_diagnostics::file::read(file, asperity_texture::picture::MAX_BYTES)?;
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| fail(format!("cannot read this picture: {e}")))?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(512 << 20);
    reader.limits(limits);
    let picture = reader.decode().map_err(|e| fail(format!("cannot read this picture: {e}")))?.into_luma16();
    let columns = picture.width() as usize;
    let scale = height_mm / f64::from(u16::MAX);
    let rows: Vec<Vec<f32>> =
        picture.rows().map(|row| row.map(|p| (f64::from(p.0[0]) * scale) as f32).collect()).collect();
    Ok((columns, rows.into_iter().rev().flatten().collect()))
}
