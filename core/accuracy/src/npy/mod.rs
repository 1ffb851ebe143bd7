//! NumPy's `.npy` files of floating-point numbers, one or two dimensions, and archives of them (`.npz`).
//!
//! Format: NumPy Enhancement Proposal 1, versions 1.0 to 3.0 (`numpy.lib.format`). The crates for it allocate
//! what a header claims and parse its dictionary by recursion, and cannot mend a file that was not finished.

use asperity_diagnostics::{Diagnostic, file};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

mod npz;

pub use npz::{Archive, Entry, MAX_ENTRIES, Packer};

/// Most numbers of a file: an hour of frames of 101 bins at 500 a second is 182 million.
pub const MAX_VALUES: usize = 1 << 28;
/// Longest header that is read \[bytes\]. NumPy itself refuses more than 10000 unless told otherwise.
const MAX_HEADER: usize = 1 << 16;
/// Length of a written header: room for any shape, and a multiple of 64, as NumPy aligns it.
const HEADER: usize = 128;

/// An array, row by row (C order).
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Length along each dimension: one or two.
    pub shape: Vec<usize>,
    /// All numbers.
    pub values: Values,
}

/// Numbers in the precision of the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// float32.
    F32(Vec<f32>),
    /// float64.
    F64(Vec<f64>),
}

impl Values {
    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        matches!(self, Self::F32(v) if v.is_empty()) || matches!(self, Self::F64(v) if v.is_empty())
    }

    /// As single precision, rounded where the file has double.
    pub fn into_f32(self) -> Vec<f32> {
        match self {
            Self::F32(v) => v,
            Self::F64(v) => v.into_iter().map(|x| x as f32).collect(),
        }
    }

    /// As double precision.
    pub fn into_f64(self) -> Vec<f64> {
        match self {
            Self::F32(v) => v.into_iter().map(f64::from).collect(),
            Self::F64(v) => v,
        }
    }
}

/// Reads a file.
///
/// # Errors
/// A file that cannot be read or is no `.npy` file; other numbers than float32 or float64; other than one or
/// two dimensions; more than [`MAX_VALUES`] numbers; fewer or more bytes than the header says. NaN and
/// infinities are read.
pub fn read(path: impl AsRef<Path>) -> Result<Array, Diagnostic> {
    let path = path.as_ref();
    let most = MAX_VALUES as u64 * 8 + MAX_HEADER as u64;
    parse(&file::read(path, most)?).map_err(|e| e.in_file(path))
}

/// Reads a file's bytes; see [`read`].
pub fn parse(bytes: &[u8]) -> Result<Array, Diagnostic> {
    let (text, data) = header(bytes)?;
    let (descr, fortran, shape) = entries(&text)?;
    if !["<f4", ">f4", "<f8", ">f8"].contains(&descr) {
        return Err(Diagnostic::new(format!("this array has numbers of type {descr:?}"))
            .help("float32 or float64 fit: np.save(file, x.astype(np.float32))"));
    }
    let printed = print_shape(&shape);
    if !(1..=2).contains(&shape.len()) {
        return Err(Diagnostic::new(format!("this array has the shape {printed}"))
            .help("one or two dimensions fit, as (samples,) or (frames, bins)"));
    }
    // Where at most one dimension is longer than 1, both orders are the same.
    if fortran && shape.iter().all(|&n| n > 1) && shape.len() > 1 {
        return Err(Diagnostic::new("this array is stored column by column (Fortran order)")
            .help("save it row by row: np.save(file, np.ascontiguousarray(x))"));
    }
    let count = shape.iter().try_fold(1usize, |a, &n| a.checked_mul(n)).filter(|&n| n <= MAX_VALUES);
    let Some(count) = count else {
        let what = format!("this array has the shape {printed}; at most {MAX_VALUES} numbers are read");
        return Err(Diagnostic::new(what));
    };
    let want = count * if descr.ends_with('8') { 8 } else { 4 };
    let have = data.len();
    if have != want {
        let what = format!("this file holds {have} bytes of numbers, but its shape {printed} needs {want}");
        return Err(Diagnostic::new(what)
            .help("the file was cut short or holds more than one array: save one array again with np.save"));
    }
    fn each<const N: usize, T>(data: &[u8], of: fn([u8; N]) -> T) -> Vec<T> {
        data.as_chunks().0.iter().map(|&b| of(b)).collect()
    }
    let values = match descr {
        "<f4" => Values::F32(each(data, f32::from_le_bytes)),
        ">f4" => Values::F32(each(data, f32::from_be_bytes)),
        "<f8" => Values::F64(each(data, f64::from_le_bytes)),
        _ => Values::F64(each(data, f64::from_be_bytes)),
    };
    Ok(Array { shape, values })
}

/// Text of the header with single quotes, and the bytes behind it.
fn header(bytes: &[u8]) -> Result<(String, &[u8]), Diagnostic> {
    let Some(rest) = bytes.strip_prefix(b"\x93NUMPY") else {
        let found = match bytes {
            [] => "this file is empty",
            [b'P', b'K', 3, 4, ..] => "this is a zip archive, perhaps an .npz file",
            _ => "this is not a .npy file: it does not start with \\x93NUMPY",
        };
        return Err(Diagnostic::new(found).help("save one array with np.save(file, x.astype(np.float32))"));
    };
    let cut = || Diagnostic::new("this .npy file ends within its header").help("save it again with np.save");
    let (len, rest) = match rest {
        [1, _, a, b, rest @ ..] => (u32::from_le_bytes([*a, *b, 0, 0]), rest),
        [2 | 3, _, a, b, c, d, rest @ ..] => (u32::from_le_bytes([*a, *b, *c, *d]), rest),
        [1..=3, ..] | [] | [_] => return Err(cut()),
        [major, minor, ..] => {
            return Err(Diagnostic::new(format!("this .npy file has version {major}.{minor}"))
                .help("versions 1.0 to 3.0 are read"));
        }
    };
    if len as usize > MAX_HEADER {
        return Err(Diagnostic::new(format!("the header of this .npy file claims to have {len} bytes"))
            .help(format!("at most {MAX_HEADER} are read")));
    }
    let (text, data) = rest.split_at_checked(len as usize).ok_or_else(cut)?;
    match std::str::from_utf8(text) {
        Ok(text) => Ok((text.replace('"', "'"), data)),
        Err(_) => Err(Diagnostic::new("the header of this .npy file is not text")),
    }
}

/// Type of the numbers, whether the order is Fortran's, and the shape, from a header's Python dictionary.
fn entries(text: &str) -> Result<(&str, bool, Vec<usize>), Diagnostic> {
    let wrong = |what: &str| {
        let found = format!("the header of this .npy file {what}");
        Diagnostic::new(found).help("save it again with np.save")
    };
    let entry = |key: &str| {
        let (_, value) = text.split_once(key).ok_or_else(|| wrong(&format!("has no entry {key}")))?;
        Ok(value.trim_start().strip_prefix(':').unwrap_or_default().trim_start())
    };
    let descr = entry("'descr'")?.split('\'').nth(1).ok_or_else(|| wrong("does not name a type"))?;
    let order = entry("'fortran_order'")?;
    let fortran = order.starts_with("True");
    if !fortran && !order.starts_with("False") {
        return Err(wrong("does not say True or False for \"fortran_order\""));
    }
    let no_length = || wrong("has a shape with something else than a length");
    let shape = entry("'shape'")?.strip_prefix('(').and_then(|shape| shape.split_once(')'));
    let lengths = shape.ok_or_else(no_length)?.0.split_terminator(',').map(str::trim);
    // Python 2 writes `3L`.
    let length = |text: &str| text.trim_end_matches('L').parse::<usize>().map_err(|_| no_length());
    Ok((descr, fortran, lengths.filter(|text| !text.is_empty()).map(length).collect::<Result<_, _>>()?))
}

fn print_shape(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        all => format!("({})", all.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

fn invalid(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, what)
}

fn write_header(to: &mut impl Write, descr: &str, shape: &[usize]) -> io::Result<()> {
    let text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {}, }}", print_shape(shape));
    let room = HEADER - 11;
    if text.len() > room {
        return Err(invalid("too many dimensions for a .npy header"));
    }
    to.write_all(b"\x93NUMPY\x01\x00\x76\x00")?;
    writeln!(to, "{text:<room$}")
}

/// Writes a float32 array, row by row.
///
/// # Errors
/// Errors of the writer; a shape that does not fit the number of values, or has too many dimensions.
pub fn write_f32(mut to: impl Write, shape: &[usize], values: &[f32]) -> io::Result<()> {
    if shape.iter().try_fold(1usize, |a, &n| a.checked_mul(n)) != Some(values.len()) {
        return Err(invalid("the shape does not fit the number of values"));
    }
    write_header(&mut to, "<f4", shape)?;
    write_values(&mut to, values)?;
    to.flush()
}

fn write_values(to: &mut impl Write, values: &[f32]) -> io::Result<()> {
    let blocks = values.chunks(1024);
    blocks
        .map(|block| block.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())
        .try_for_each(|bytes| to.write_all(&bytes))
}

/// Sets the number of rows in the header of a file that a [`Writer`] did not finish.
pub fn set_rows(to: &mut (impl Write + Seek), rows: usize, columns: Option<usize>) -> io::Result<()> {
    to.seek(SeekFrom::Start(0))?;
    write_header(to, "<f4", &[&[rows], columns.as_slice()].concat())
}

/// Offset of the rows and the columns of a file by a [`Writer`], from its first bytes; none of another file.
pub fn begun(head: &[u8]) -> Option<(u64, Option<usize>)> {
    let text = header(head.get(..HEADER)?).ok()?.0;
    let (descr, fortran, shape) = entries(&text).ok()?;
    let ours = descr == "<f4" && !fortran && shape.len() <= 2;
    ours.then(|| (HEADER as u64, shape.get(1).copied()))
}

/// Writes a float32 array whose number of rows is not known yet.
///
/// The file is a valid, empty array from the start, and has all rows after [`finish`](Self::finish).
#[derive(Debug)]
pub struct Writer<W> {
    to: W,
    columns: Option<usize>,
    rows: usize,
}

impl<W: Write + Seek> Writer<W> {
    /// Starts an array of shape `(rows,)`, or `(rows, columns)`, at the start of `to`.
    pub fn new(mut to: W, columns: Option<usize>) -> io::Result<Self> {
        set_rows(&mut to, 0, columns)?;
        Ok(Self { to, columns, rows: 0 })
    }

    /// Appends values: whole rows where the array has columns.
    ///
    /// # Errors
    /// Errors of the writer; values that are not whole rows.
    pub fn append(&mut self, values: &[f32]) -> io::Result<()> {
        let width = self.columns.unwrap_or(1);
        if width == 0 || !values.len().is_multiple_of(width) {
            return Err(invalid("not a whole number of rows"));
        }
        write_values(&mut self.to, values)?;
        self.rows += values.len() / width;
        Ok(())
    }

    /// Writes the number of rows into the header: the file is complete until the next append.
    pub fn flush(&mut self) -> io::Result<()> {
        set_rows(&mut self.to, self.rows, self.columns)?;
        self.to.seek(SeekFrom::End(0))?;
        self.to.flush()
    }

    /// Writes the number of rows into the header and returns the writer.
    pub fn finish(mut self) -> io::Result<W> {
        self.flush()?;
        Ok(self.to)
    }
}

#[cfg(test)]
mod tests;
