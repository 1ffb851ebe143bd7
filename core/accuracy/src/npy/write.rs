//! Writing float32 arrays.

use std::io::{self, Seek, SeekFrom, Write};

/// Length of the header: room for any shape, and a multiple of 64, as NumPy aligns it.
const HEADER_LEN: usize = 128;

/// The header of an array of `rows`, with columns or without.
fn header(shape: &[usize]) -> io::Result<[u8; HEADER_LEN]> {
    let shape = super::header::print_shape(shape);
    let text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
    let mut bytes = [b' '; HEADER_LEN];
    bytes[..10].copy_from_slice(b"\x93NUMPY\x01\x00\x76\x00");
    bytes[HEADER_LEN - 1] = b'\n';
    let place = bytes[10..HEADER_LEN - 1].get_mut(..text.len());
    place.ok_or_else(|| invalid("too many dimensions for a .npy header"))?.copy_from_slice(text.as_bytes());
    Ok(bytes)
}

fn invalid(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, what)
}

/// Writes a float32 array, row by row.
///
/// # Errors
/// Errors of the writer; a shape that does not fit the number of values, or has too many dimensions.
pub fn write_f32(mut to: impl Write, shape: &[usize], values: &[f32]) -> io::Result<()> {
    if shape.iter().try_fold(1usize, |a, &n| a.checked_mul(n)) != Some(values.len()) {
        return Err(invalid("the shape does not fit the number of values"));
    }
    to.write_all(&header(shape)?)?;
    write_values(&mut to, values)?;
    to.flush()
}

fn write_values(to: &mut impl Write, values: &[f32]) -> io::Result<()> {
    let mut bytes = [0u8; 4096];
    for block in values.chunks(bytes.len() / 4) {
        for (b, v) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(block) {
            *b = v.to_le_bytes();
        }
        to.write_all(&bytes[..block.len() * 4])?;
    }
    Ok(())
}

/// Sets the number of rows in the header of a file that a [`Writer`] did not finish.
pub fn set_rows(to: &mut (impl Write + Seek), rows: usize, columns: Option<usize>) -> io::Result<()> {
    to.seek(SeekFrom::Start(0))?;
    to.write_all(&header(&shape(rows, columns))?)
}

fn shape(rows: usize, columns: Option<usize>) -> Vec<usize> {
    std::iter::once(rows).chain(columns).collect()
}

/// Offset of the rows and the columns of a file by a [`Writer`], from its first bytes; none of another file.
pub fn begun(head: &[u8]) -> Option<(u64, Option<usize>)> {
    let (header, _) = super::header::Header::parse(head.get(..HEADER_LEN)?).ok()?;
    let ours = !header.wide && !header.big_endian && !header.fortran && header.shape.len() <= 2;
    ours.then(|| (HEADER_LEN as u64, header.shape.get(1).copied()))
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
        to.write_all(&header(&shape(0, columns))?)?;
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
