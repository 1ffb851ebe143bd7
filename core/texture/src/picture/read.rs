//! Reads a tactile image from a picture file of any size and kind.

use std::io::Cursor;
use std::path::Path;

use asperity_diagnostics::{Diagnostic, file};
use image::imageops::FilterType;
use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::{IMAGE, Image};

/// Least width and height of a picture in pixels.
pub const MIN_SIDE: u32 = 16;
/// Most pixels of a picture: more than any camera behind a gel has; at 64 bits a pixel still 400 MB.
pub const MAX_PIXELS: u64 = 50_000_000;
/// Most bytes of a picture file.
pub const MAX_BYTES: u64 = 256 << 20;
/// Most memory in bytes that a decoder may unpack into.
const MAX_UNPACKED: u64 = 512 << 20;

/// A tactile image, and how the file's picture was changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// [`IMAGE`] rows and columns.
    pub image: Image,
    /// Notes, a sentence each without a full stop: grey, alpha, 16 bits, turned, cropped, enlarged.
    /// Reduction is not noted.
    pub notes: Vec<String>,
}

/// Reads a PNG, JPEG or BMP file: grey or in colour, 1 to 16 bits, with a palette or alpha.
///
/// Alpha is dropped, not blended. The picture is turned by its EXIF data. The middle of 4 to 3 is
/// scaled to [`IMAGE`] with a triangle filter. When it reduces, the filter is as wide as an output
/// pixel, so that fine texture does not alias into coarse.
///
/// # Errors
/// A file that is missing, a folder, empty, too large, not PNG, JPEG or BMP, damaged or cut off; a
/// picture with a side below [`MIN_SIDE`] or more than [`MAX_PIXELS`].
pub fn read(path: &Path) -> Result<Picture, Diagnostic> {
    let mut notes = Vec::new();
    let part = middle(decoded(&file::read(path, MAX_BYTES)?, path, &mut notes)?, &mut notes);
    let sixteen = part.color().bytes_per_pixel() == 2 * part.color().channel_count();
    let plain = if sixteen {
        notes.push("16 bits a channel, brought to 8".into());
        DynamicImage::from(part.into_rgb16())
    } else {
        DynamicImage::from(part.into_rgb8())
    };
    let [rows, columns] = IMAGE.map(|n| n as u32);
    if plain.width() < columns || plain.height() < rows {
        notes.push(format!(
            "enlarged from {} x {} to {columns} x {rows}, which adds no detail",
            plain.width(),
            plain.height()
        ));
    }
    let scaled = if (plain.width(), plain.height()) == (columns, rows) {
        plain
    } else {
        plain.resize_exact(columns, rows, FilterType::Triangle)
    };
    let pixels = scaled.into_rgb8().into_raw();
    if pixels.chunks_exact(3).all(|p| p.iter().all(|c| *c == p[0])) {
        notes.push("grey: its colours say nothing of slopes".into());
    }
    Ok(Picture { image: Image { size: IMAGE, pixels }, notes })
}

fn decoded(bytes: &[u8], path: &Path, notes: &mut Vec<String>) -> Result<DynamicImage, Diagnostic> {
    let fail = |what: String| Diagnostic::new(what).in_file(path);
    if bytes.is_empty() {
        return Err(fail("this file is empty, not a picture".into()));
    }
    let format = match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Bmp)) => format,
        _ => return Err(fail("no PNG, JPEG or BMP picture".into()).help("those three are read")),
    };
    let name = match format {
        ImageFormat::Png => "PNG",
        ImageFormat::Jpeg => "JPEG",
        _ => "BMP",
    };
    let damaged = |e: ImageError| match e {
        ImageError::Limits(_) => fail(format!("this {name} unpacks to more than {MAX_UNPACKED} bytes")),
        e => fail(format!("this {name} picture is damaged or cut off: {e}")),
    };
    if format == ImageFormat::Jpeg && !ends(bytes) {
        return Err(fail("this JPEG picture is cut off: it has no end".into()));
    }
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_UNPACKED);
    reader.limits(limits);
    let mut decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let size = format!("a picture of {width} x {height} pixels");
    if width.min(height) < MIN_SIDE {
        return Err(fail(size).help(format!("a tactile image has at least {MIN_SIDE} x {MIN_SIDE}")));
    }
    if u64::from(width) * u64::from(height) > MAX_PIXELS || decoder.total_bytes() > MAX_UNPACKED {
        return Err(fail(size).help(format!("at most {MAX_PIXELS} pixels are read")));
    }
    let turn = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let mut picture = DynamicImage::from_decoder(decoder).map_err(damaged)?;
    if picture.color().has_alpha() {
        notes.push("its alpha is left out".into());
    }
    if turn != Orientation::NoTransforms {
        notes.push("turned as its EXIF data says".into());
        picture.apply_orientation(turn);
    }
    Ok(picture)
}

/// The largest part of 4 to 3 around the middle.
fn middle(whole: DynamicImage, notes: &mut Vec<String>) -> DynamicImage {
    let [rows, columns] = IMAGE.map(|n| n as u64);
    let (width, height) = (u64::from(whole.width()), u64::from(whole.height()));
    // To the nearest pixel.
    let scaled = |side: u64, by: u64, to: u64| (2 * side * to + by) / (2 * by);
    let (w, h) = if width * rows > height * columns {
        (scaled(height, rows, columns).min(width), height)
    } else {
        (width, scaled(width, columns, rows).min(height))
    };
    if (w, h) == (width, height) {
        return whole;
    }
    notes.push(format!("cropped from {width} x {height} to its middle {w} x {h}"));
    whole.crop_imm(((width - w) / 2) as u32, ((height - h) / 2) as u32, w as u32, h as u32)
}

/// Whether a JPEG has an end marker behind the start of its first scan (ITU T.81, B.1.1); coded data never
/// looks like one. A decoder may fill missing parts with grey.
fn ends(bytes: &[u8]) -> bool {
    let mut rest = bytes.get(2..).unwrap_or_default();
    // Segments until then have a length. They may hold a smaller picture with an end of its own.
    while let Some(at) = rest.iter().position(|b| *b == 0xff) {
        let Some((marker, after)) = rest[at + 1..].split_first() else { return false };
        rest = match (marker, after.first_chunk()) {
            (0xda, _) => return after.windows(2).any(|pair| pair == [0xff, 0xd9]),
            // Fill bytes, and markers without data.
            (0xff, _) => &rest[at + 1..],
            (0x00 | 0x01 | 0xd0..=0xd8, _) => after,
            (_, Some(len)) => after.get(usize::from(u16::from_be_bytes(*len))..).unwrap_or_default(),
            (_, None) => return false,
        };
    }
    false
}
