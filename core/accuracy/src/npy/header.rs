//! The header: a magic string, a version, a length, and a Python dictionary with three entries.

use asperity_diagnostics::Diagnostic;

/// Longest header that is read \[bytes\]. NumPy itself refuses more than 10000 unless told otherwise.
pub(super) const MAX_LEN: usize = 1 << 16;

const MAGIC: &[u8] = b"\x93NUMPY";

#[derive(Debug)]
pub(super) struct Header {
    /// float64, otherwise float32.
    pub(super) wide: bool,
    pub(super) big_endian: bool,
    pub(super) fortran: bool,
    pub(super) shape: Vec<usize>,
}

pub(super) fn print_shape(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        all => format!("({})", all.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

impl Header {
    /// Reads the header, and returns the bytes behind it.
    pub(super) fn parse(bytes: &[u8]) -> Result<(Self, &[u8]), Diagnostic> {
        let Some(rest) = bytes.strip_prefix(MAGIC) else {
            let found = if bytes.starts_with(b"PK\x03\x04") {
                "this is a zip archive, perhaps an .npz file"
            } else if bytes.is_empty() {
                "this file is empty"
            } else {
                "this is not a .npy file: it does not start with \\x93NUMPY"
            };
            let help = "save one array with np.save(file, x.astype(np.float32))";
            return Err(Diagnostic::new(found).help(help));
        };
        let cut =
            || Diagnostic::new("this .npy file ends within its header").help("save it again with np.save");
        let (&[major, minor], rest) = rest.split_first_chunk().ok_or_else(cut)?;
        let (len, rest) = match (major, rest) {
            (1, &[a, b, ref rest @ ..]) => (u32::from_le_bytes([a, b, 0, 0]), rest),
            (2 | 3, &[a, b, c, d, ref rest @ ..]) => (u32::from_le_bytes([a, b, c, d]), rest),
            (1..=3, _) => return Err(cut()),
            _ => {
                return Err(Diagnostic::new(format!("this .npy file has version {major}.{minor}"))
                    .help("versions 1.0 to 3.0 are read"));
            }
        };
        if len as usize > MAX_LEN {
            let found = format!("the header of this .npy file claims to have {len} bytes");
            return Err(Diagnostic::new(found).help(format!("at most {MAX_LEN} are read")));
        }
        let (text, data) = rest.split_at_checked(len as usize).ok_or_else(cut)?;
        let text = std::str::from_utf8(text)
            .map_err(|_| Diagnostic::new("the header of this .npy file is not text"))?;
        Ok((Self::entries(&mut Dict(text))?, data))
    }

    fn entries(dict: &mut Dict<'_>) -> Result<Self, Diagnostic> {
        let (mut descr, mut fortran, mut shape) = (None, None, None);
        dict.expect('{')?;
        while !dict.take('}') {
            let key = dict.string()?;
            dict.expect(':')?;
            match key {
                "descr" => descr = Some(dict.descr()?),
                "fortran_order" => fortran = Some(dict.boolean()?),
                "shape" => shape = Some(dict.tuple()?),
                other => {
                    let found = format!("the header of this .npy file has an unknown entry {other:?}");
                    return Err(
                        Diagnostic::new(found).help("known are \"descr\", \"fortran_order\" and \"shape\"")
                    );
                }
            }
            if !dict.take(',') {
                dict.expect('}')?;
                break;
            }
        }
        let missing = |what| Diagnostic::new(format!("the header of this .npy file has no entry {what:?}"));
        let (wide, big_endian) = descr.ok_or_else(|| missing("descr"))?;
        let fortran = fortran.ok_or_else(|| missing("fortran_order"))?;
        Ok(Self { wide, big_endian, fortran, shape: shape.ok_or_else(|| missing("shape"))? })
    }
}

/// The unread text of the dictionary.
struct Dict<'a>(&'a str);

impl<'a> Dict<'a> {
    /// Skips a word after white space; whether it is there.
    fn take_word(&mut self, word: &str) -> bool {
        self.0 = self.0.trim_start();
        let rest = self.0.strip_prefix(word);
        self.0 = rest.unwrap_or(self.0);
        rest.is_some()
    }

    fn take(&mut self, c: char) -> bool {
        self.take_word(c.encode_utf8(&mut [0; 4]))
    }

    fn wrong(&self, wanted: &str) -> Diagnostic {
        let found: String = self.0.chars().take(20).collect();
        Diagnostic::new(format!("the header of this .npy file has {found:?} instead of {wanted}"))
            .help("save it again with np.save")
    }

    fn expect(&mut self, c: char) -> Result<(), Diagnostic> {
        if self.take(c) { Ok(()) } else { Err(self.wrong(&format!("{c:?}"))) }
    }

    fn string(&mut self) -> Result<&'a str, Diagnostic> {
        let quoted = ['\'', '"'].into_iter().find(|quote| self.take(*quote));
        let (text, rest) =
            quoted.and_then(|quote| self.0.split_once(quote)).ok_or_else(|| self.wrong("a string"))?;
        self.0 = rest;
        Ok(text)
    }

    fn descr(&mut self) -> Result<(bool, bool), Diagnostic> {
        let help = "float32 or float64 fit: np.save(file, x.astype(np.float32))";
        if self.take('[') {
            return Err(Diagnostic::new("this is an array of records").help(help));
        }
        match self.string()? {
            "<f4" => Ok((false, false)),
            "<f8" => Ok((true, false)),
            ">f4" => Ok((false, true)),
            ">f8" => Ok((true, true)),
            other => Err(Diagnostic::new(format!("this array has numbers of type {other:?}")).help(help)),
        }
    }

    fn boolean(&mut self) -> Result<bool, Diagnostic> {
        if self.take_word("False") {
            Ok(false)
        } else if self.take_word("True") {
            Ok(true)
        } else {
            Err(self.wrong("True or False"))
        }
    }

    fn tuple(&mut self) -> Result<Vec<usize>, Diagnostic> {
        self.expect('(')?;
        let mut all = Vec::new();
        while !self.take(')') {
            self.0 = self.0.trim_start();
            let digits = self.0.find(|c: char| !c.is_ascii_digit()).unwrap_or(self.0.len());
            let (number, rest) = self.0.split_at(digits);
            all.push(number.parse().map_err(|_| self.wrong("a length"))?);
            // NumPy of Python 2 wrote `3L`.
            self.0 = rest.strip_prefix('L').unwrap_or(rest);
            if !self.take(',') {
                self.expect(')')?;
                break;
            }
        }
        Ok(all)
    }
}
