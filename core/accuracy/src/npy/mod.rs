//! NumPy's `.npy` files of floating-point numbers, one or two dimensions.
//!
//! Format: NumPy Enhancement Proposal 1, versions 1.0 to 3.0 (`numpy.lib.format`).

mod header;
mod write;

pub use write::{Writer, begun, set_rows, write_f32};

use asperity_diagnostics::{Diagnostic, file};
use header::Header;
use std::path::Path;

/// Most numbers of a file: an hour of frames of 101 bins at 500 a second is 182 million.
pub const MAX_VALUES: usize = 1 << 28;

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
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::F64(v) => v.len(),
        }
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
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
    let most = MAX_VALUES as u64 * 8 + header::MAX_LEN as u64;
    parse(&file::read(path, most)?).map_err(|e| e.in_file(path))
}

/// Reads a file's bytes; see [`read`].
pub fn parse(bytes: &[u8]) -> Result<Array, Diagnostic> {
    let (header, data) = Header::parse(bytes)?;
    let Header { wide, big_endian, fortran, shape } = header;
    let printed = header::print_shape(&shape);
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
        return Err(Diagnostic::new(format!(
            "this array has the shape {printed}; at most {MAX_VALUES} numbers are read"
        )));
    };
    let want = count * if wide { 8 } else { 4 };
    if data.len() != want {
        return Err(Diagnostic::new(format!(
            "this file holds {} bytes of numbers, but its shape {printed} needs {want}",
            data.len()
        ))
        .help("the file was cut short or holds more than one array: save one array again with np.save"));
    }
    fn each<const N: usize, T>(data: &[u8], of: fn([u8; N]) -> T) -> Vec<T> {
        data.as_chunks().0.iter().map(|&b| of(b)).collect()
    }
    let values = match (wide, big_endian) {
        (false, false) => Values::F32(each(data, f32::from_le_bytes)),
        (false, true) => Values::F32(each(data, f32::from_be_bytes)),
        (true, false) => Values::F64(each(data, f64::from_le_bytes)),
        (true, true) => Values::F64(each(data, f64::from_be_bytes)),
    };
    Ok(Array { shape, values })
}

#[cfg(test)]
mod tests;
