//! Archives of arrays, numbers and texts, as `np.savez` and `np.savez_compressed` write them.
//!
//! An archive is a ZIP file. Each entry is a `.npy` file with the name of its argument.

use std::collections::BTreeMap;
use std::io::{self, Cursor, Read, Seek, SeekFrom, Write};
use std::path::Path;

use asperity_diagnostics::{Diagnostic, budget, file};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::{Array, HEADER, MAX_HEADER, MAX_VALUES, begun, entries, header, parse, write_header};

/// Most entries of an archive that is read.
pub const MAX_ENTRIES: usize = 64;
/// Most bytes of an entry, and of all of them.
const MOST: u64 = 8 * MAX_VALUES as u64 + MAX_HEADER as u64;

/// An entry of an archive.
#[derive(Clone, Debug)]
pub enum Entry {
    /// One or two dimensions of float32 or float64.
    Array(Array),
    /// A number without dimensions: an integer, float32 or float64.
    Number(f64),
    /// A text without dimensions.
    Text(String),
    /// Something else; says why it is not read.
    Other(Diagnostic),
}

/// The entries of an archive, by name.
#[derive(Clone, Debug, Default)]
pub struct Archive(pub BTreeMap<String, Entry>);

impl Archive {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read or is no ZIP archive of at most [`MAX_ENTRIES`] entries and 2 GiB. An entry
    /// of another kind is [`Entry::Other`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        let path = path.as_ref();
        Self::parse(&file::read(path, MOST)?).map_err(|e| e.in_file(path))
    }

    /// Reads a file's bytes; see [`read`](Self::read).
    ///
    /// # Errors
    /// See [`read`](Self::read).
    pub fn parse(bytes: &[u8]) -> Result<Self, Diagnostic> {
        let broken = |e: &dyn std::fmt::Display| {
            Diagnostic::new(format!("this is not a whole .npz archive: {e}"))
                .help("save it again with np.savez(file, magnitudes=x, ...)")
        };
        let mut zip = ZipArchive::new(Cursor::new(bytes)).map_err(|e| broken(&e))?;
        if zip.len() > MAX_ENTRIES {
            let what = format!("this archive has {} entries; at most {MAX_ENTRIES} are read", zip.len());
            return Err(Diagnostic::new(what));
        }
        let (mut found, mut left) = (BTreeMap::new(), MOST);
        for i in 0..zip.len() {
            let entry = zip.by_index(i).map_err(|e| broken(&e))?;
            let name = entry.name().map_err(|e| broken(&e))?;
            let name = name.strip_suffix(".npy").unwrap_or(&name).to_owned();
            let size = entry.size();
            left = left.checked_sub(size).ok_or_else(|| {
                Diagnostic::new(format!("the entries of this archive have more than {MOST} bytes in all"))
            })?;
            budget::needs(size)?;
            let mut bytes = Vec::new();
            entry.take(size + 1).read_to_end(&mut bytes).map_err(|e| broken(&e))?;
            if bytes.len() as u64 != size {
                return Err(broken(&format!("`{name}` has another length than the archive says")));
            }
            found.insert(name, Entry::parse(&bytes));
        }
        Ok(Self(found))
    }

    /// A number; `None` if there is no such entry.
    ///
    /// # Errors
    /// An entry of another kind.
    pub fn number(&self, name: &str) -> Result<Option<f64>, Diagnostic> {
        self.entry(name, "a number", |entry| match entry {
            Entry::Number(number) => Some(*number),
            _ => None,
        })
    }

    /// A text; `None` if there is no such entry.
    ///
    /// # Errors
    /// An entry of another kind.
    pub fn text(&self, name: &str) -> Result<Option<&str>, Diagnostic> {
        self.entry(name, "a text", |entry| match entry {
            Entry::Text(text) => Some(text.as_str()),
            _ => None,
        })
    }

    /// An array; `None` if there is no such entry.
    ///
    /// # Errors
    /// An entry of another kind.
    pub fn array(&self, name: &str) -> Result<Option<&Array>, Diagnostic> {
        self.entry(name, "an array of one or two dimensions", |entry| match entry {
            Entry::Array(array) => Some(array),
            _ => None,
        })
    }

    fn entry<'a, T>(
        &'a self,
        name: &str,
        wanted: &str,
        of: impl Fn(&'a Entry) -> Option<T>,
    ) -> Result<Option<T>, Diagnostic> {
        let Some(entry) = self.0.get(name) else { return Ok(None) };
        match (of(entry), entry) {
            (Some(value), _) => Ok(Some(value)),
            (None, Entry::Other(e)) => {
                Err(Diagnostic { message: format!("`{name}`: {}", e.message), ..e.clone() })
            }
            (None, _) => Err(Diagnostic::new(format!("`{name}` of this archive is not {wanted}"))),
        }
    }
}

impl Entry {
    fn parse(bytes: &[u8]) -> Self {
        let known = scalar(bytes).and_then(|scalar| match scalar {
            Some(scalar) => Ok(scalar),
            None => parse(bytes).map(Self::Array),
        });
        known.unwrap_or_else(Self::Other)
    }
}

/// The number or text of an array without dimensions; `None` for one with dimensions.
fn scalar(bytes: &[u8]) -> Result<Option<Entry>, Diagnostic> {
    let (text, data) = header(bytes)?;
    let (descr, _, shape) = entries(&text)?;
    if !shape.is_empty() {
        return Ok(None);
    }
    let number = match (descr, data) {
        ("<f8", &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        ("<f4", &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
        ("<i8", &[a, b, c, d, e, f, g, h]) => i64::from_le_bytes([a, b, c, d, e, f, g, h]) as f64,
        ("<u8", &[a, b, c, d, e, f, g, h]) => u64::from_le_bytes([a, b, c, d, e, f, g, h]) as f64,
        ("<i4", &[a, b, c, d]) => f64::from(i32::from_le_bytes([a, b, c, d])),
        ("<u4", &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
        _ if descr.starts_with("<U") && data.len().is_multiple_of(4) => {
            let points = data.as_chunks().0.iter().map(|&b| u32::from_le_bytes(b));
            let text: Option<String> = points.take_while(|&p| p != 0).map(char::from_u32).collect();
            let no_text = || Diagnostic::new("this is no text: a character is none of Unicode");
            return text.map(|text| Some(Entry::Text(text))).ok_or_else(no_text);
        }
        _ => {
            let what = format!("a single value of type {descr:?} and {} bytes is not read", data.len());
            return Err(Diagnostic::new(what).help("an int, a float or a str fits"));
        }
    };
    Ok(Some(Entry::Number(number)))
}

/// Writes an archive without compression, entry by entry.
pub struct Packer<W: Write + Seek>(ZipWriter<W>);

impl<W: Write + Seek> std::fmt::Debug for Packer<W> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Packer").finish_non_exhaustive()
    }
}

impl<W: Write + Seek> Packer<W> {
    /// Begins an archive at the start of `to`.
    pub fn new(to: W) -> Self {
        Self(ZipWriter::new(to))
    }

    /// Adds the whole rows of a file by a [`Writer`](super::Writer), finished or not. `complex` takes two
    /// columns as real and imaginary part.
    ///
    /// # Errors
    /// Errors of the file and the writer; another file.
    pub fn rows(&mut self, name: &str, complex: bool, file: &mut (impl Read + Seek)) -> io::Result<()> {
        let (mut head, len) = (Vec::new(), file.seek(SeekFrom::End(0))?);
        file.rewind()?;
        file.by_ref().take(HEADER as u64).read_to_end(&mut head)?;
        let (at, columns) = begun(&head).ok_or(io::ErrorKind::InvalidData)?;
        let row = 4 * columns.unwrap_or(1).max(1) as u64;
        let rows = len.saturating_sub(at) / row;
        let parts = if complex { 2 } else { 1 };
        let shape = [&[rows as usize], columns.map(|n| n / parts).as_slice()].concat();
        self.begin(name)?;
        write_header(&mut self.0, if complex { "<c8" } else { "<f4" }, &shape)?;
        io::copy(&mut file.take(rows * row), &mut self.0).map(drop)
    }

    /// Adds a number, as an integer if it is one.
    ///
    /// # Errors
    /// Errors of the writer.
    pub fn number(&mut self, name: &str, value: f64) -> io::Result<()> {
        self.begin(name)?;
        let whole = value.fract() == 0.0 && value.abs() < 2_f64.powi(53);
        write_header(&mut self.0, if whole { "<i8" } else { "<f8" }, &[])?;
        self.0.write_all(&if whole { (value as i64).to_le_bytes() } else { value.to_le_bytes() })
    }

    /// Adds a text.
    ///
    /// # Errors
    /// Errors of the writer.
    pub fn text(&mut self, name: &str, text: &str) -> io::Result<()> {
        self.begin(name)?;
        write_header(&mut self.0, &format!("<U{}", text.chars().count()), &[])?;
        text.chars().try_for_each(|c| self.0.write_all(&u32::from(c).to_le_bytes()))
    }

    /// Writes the archive's directory, and answers the writer.
    ///
    /// # Errors
    /// Errors of the writer.
    pub fn finish(self) -> io::Result<W> {
        self.0.finish().map_err(io::Error::from)
    }

    fn begin(&mut self, name: &str) -> io::Result<()> {
        // The same bytes for the same values: no date of today. Large: the size is not known yet.
        let stored = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(zip::DateTime::default())
            .large_file(true);
        self.0.start_file(format!("{name}.npy"), stored).map_err(io::Error::from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::npy::{Values, Writer};

    fn packed() -> Vec<u8> {
        let mut rows = Writer::new(Cursor::new(Vec::new()), Some(2)).expect("a header");
        rows.append(&[1.0, 2.0, 3.0, 4.0]).expect("two rows");
        // A third row was begun, and the header is not up to date.
        let mut file = Cursor::new(rows.finish().expect("a file").into_inner());
        file.seek(SeekFrom::End(0)).and_then(|_| file.write_all(&[0; 5])).expect("room");
        let mut to = Packer::new(Cursor::new(Vec::new()));
        to.rows("x", false, &mut file).expect("rows");
        to.number("whole", 2500.0).expect("room");
        to.number("part", 88.2).expect("room");
        to.text("word", "m/s\u{b2}").expect("room");
        to.finish().expect("a directory").into_inner()
    }

    #[test]
    fn archive_gives_back_its_whole_rows_numbers_and_texts() {
        let archive = Archive::parse(&packed()).expect("an archive");
        let array = archive.array("x").expect("an array").expect("one");
        assert_eq!((&array.shape[..], &array.values), (&[2, 2][..], &Values::F32(vec![1.0, 2.0, 3.0, 4.0])));
        assert_eq!(archive.number("whole").expect("a number"), Some(2500.0));
        assert_eq!(archive.number("part").expect("a number"), Some(88.2));
        assert_eq!(archive.text("word").expect("a text"), Some("m/s\u{b2}"));
        assert!(archive.number("other").expect("nothing").is_none());
        let told = archive.number("word").expect_err("a text").message;
        assert_eq!(told, "`word` of this archive is not a number");
    }

    /// A ZIP archive states the sizes of its entries, and could state less than it holds.
    #[test]
    fn damaged_archive_is_an_error() {
        let whole = packed();
        for cut in [0, 1, 30, 200, whole.len() / 2, whole.len() - 1] {
            assert!(Archive::parse(&whole[..cut]).is_err(), "cut after {cut} bytes");
        }
        let mut changed = whole.clone();
        let at = whole.windows(4).position(|w| w == 3.0_f32.to_le_bytes()).expect("the number 3");
        changed[at] ^= 1;
        let told = Archive::parse(&changed).expect_err("another checksum");
        assert!(told.message.contains("not a whole .npz archive") && told.help.is_some(), "{told}");
    }

    #[test]
    fn same_values_make_the_same_bytes() {
        assert!(packed() == packed());
    }
}
