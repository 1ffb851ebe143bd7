//! Reads shapes and their poses.

use asperity_diagnostics::ron::{Record, Value};
use asperity_diagnostics::{Diagnostic, nearest};

use super::Heights;
use super::read::{Known, body, number, numbers, variant, whole};
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
            _ => Err(value.error(format!("a {name} without a size")).help(usage(name))),
        };
    };
    let thickness =
        |record: &mut Record<'_>| number(record, "thickness_mm", 0.0..=WORLD_MM, "mm", Some(THICKNESS_MM));
    let shape = match name {
        "plane" => Ok(Shape::plane()),
        "sphere" => Shape::sphere(number(&mut record, "radius_mm", size, "mm", None)?),
        "box" => Shape::cuboid(numbers(record.required("size_mm")?, &size, "mm")?),
        "rectangle" => {
            let sides = numbers(record.required("size_mm")?, &size, "mm")?;
            Shape::rectangle(sides, thickness(&mut record)?)
        }
        _ => {
            let from = record.required("heights")?;
            let heights = Heights::parse(from)?;
            let made = || grid(&heights).map_err(|e| at(from, e));
            let grid = known_before.grid(&heights, made)?;
            let sides = record.optional("size_mm").map(|v| numbers::<2>(v, &size, "mm")).transpose()?;
            let scale = number(&mut record, "scale", -1000.0..=1000.0, "", Some(1.0))?;
            Shape::relief(grid, sides, scale, thickness(&mut record)?)
        }
    };
    let shape = shape.map_err(|e| at(value, e))?;
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
            let name = surface.text()?.to_owned();
            let all = made_surfaces();
            if all.iter().all(|made| made.name != name) {
                let near = nearest(&name, all.iter().map(|made| made.name.as_str()));
                let help = near.map(|near| format!("did you mean `{near}`?"));
                return Err(surface
                    .error(format!("no made surface is called `{name}`"))
                    .help(help.unwrap_or("`asperity materials` lists them".to_owned())));
            }
            Heights::Made {
                name,
                side: whole(&mut record, "side", 8..=2048, "", 512)? as usize,
                step_mm: number(&mut record, "step_mm", 0.005..=1.0, "mm", Some(0.04))?,
                piece: whole(&mut record, "piece", 0..=i64::MAX, "", 1)? as u64,
            }
        } else {
            Heights::Picture {
                file: record.required("file")?.path()?,
                step_mm: number(&mut record, "step_mm", 0.001..=100.0, "mm", None)?,
                height_mm: number(&mut record, "height_mm", 0.0..=1000.0, "mm", None)?,
            }
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
                let unknown = || Diagnostic::new(format!("no made surface is called `{name}`"));
                Ok(made.ok_or_else(unknown)?.patch((*side, *step_mm), *piece))
            }
            Self::Picture { file, step_mm, height_mm } => {
                let (columns, heights) = grey(file, *height_mm)?;
                let side = columns.min(heights.len() / columns.max(1));
                let mut field = HeightField::flat(side, *step_mm);
                let rows = field.heights_mut().chunks_exact_mut(side.max(1));
                for (to, from) in rows.zip(heights.chunks_exact(columns.max(1))) {
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
    let unread = |e: &dyn std::fmt::Display| fail(format!("cannot read this picture: {e}"));
    let reader = image::ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format();
    let mut reader = reader.map_err(|e| unread(&e))?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(512 << 20);
    reader.limits(limits);
    let picture = reader.decode().map_err(|e| unread(&e))?.into_luma16();
    let columns = picture.width() as usize;
    let scale = height_mm / f64::from(u16::MAX);
    let rows: Vec<Vec<f32>> =
        picture.rows().map(|row| row.map(|p| (f64::from(p.0[0]) * scale) as f32).collect()).collect();
    Ok((columns, rows.into_iter().rev().flatten().collect()))
}
