//! The header: a magic string, a version, a length, and a Python dictionary of three entries.

use asperity_diagnostics::Diagnostic;

/// Longest header that is read, in bytes. NumPy itself refuses more than 10000 unless told otherwise.
pub(super) const MAX_LEN: usize = 1 << 16;

const MAGIC: &[u8] = b"\x93NUMPY";

#[derive(Debug)]
pub(super) struct Header {
    /// float64, else float32.
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
    /// The header and what follows it.
    pub(super) fn parse(bytes: &[u8]) -> Result<(Self, &[u8]), Diagnostic> {
        let Some(rest) = bytes.strip_prefix(MAGIC) else {
            let found = if bytes.starts_with(b"PK\x03\x04") {
                "this is a zip archive, perhaps an .npz file"
            } else if bytes.is_empty() {
                "this file is empty"
            } else {
                "this is not a .npy file: it does not start with \\x93NUMPY"
            };
            return Err(
                Diagnostic::new(found).help("save one array with np.save(file, x.astype(np.float32))")
            );
        };
        let cut =
            || Diagnostic::new("this .npy file ends within its header").help("save it again with np.save");
        let (&[major, minor], rest) = rest.split_first_chunk::<2>().ok_or_else(cut)?;
        let (len, rest) = match major {
            1 => {
                let (len, rest) = rest.split_first_chunk().ok_or_else(cut)?;
                (usize::from(u16::from_le_bytes(*len)), rest)
            }
            2 | 3 => {
                let (len, rest) = rest.split_first_chunk().ok_or_else(cut)?;
                (u32::from_le_bytes(*len) as usize, rest)
            }
            _ => {
                return Err(Diagnostic::new(format!("this .npy file is of version {major}.{minor}"))
                    .help("versions 1.0 to 3.0 are read"));
            }
        };
        if len > MAX_LEN {
            return Err(Diagnostic::new(format!(
                "the header of this .npy file says that it has {len} bytes"
            ))
            .help(format!("at most {MAX_LEN} are read")));
        }
        let (text, data) = rest.split_at_checked(len).ok_or_else(cut)?;
        let text = std::str::from_utf8(text)
            .map_err(|_| Diagnostic::new("the header of this .npy file is not text"))?;
        Ok((Self::entries(text)?, data))
    }

    fn entries(text: &str) -> Result<Self, Diagnostic> {
        let mut dict = Dict(text);
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
                    return Err(Diagnostic::new(format!(
                        "the header of this .npy file has an entry {other:?}"
                    ))
                    .help("there are \"descr\", \"fortran_order\" and \"shape\""));
                }
            }
            if !dict.take(',') {
                dict.expect('}')?;
                break;
            }
        }
        let missing = |what| Diagnostic::new(format!("the header of this .npy file has no entry {what:?}"));
        let (wide, big_endian) = descr.ok_or_else(|| missing("descr"))?;
        Ok(Self {
            wide,
            big_endian,
            fortran: fortran.ok_or_else(|| missing("fortran_order"))?,
            shape: shape.ok_or_else(|| missing("shape"))?,
        })
    }
}

/// What is left of the dictionary's text.
struct Dict<'a>(&'a str);

impl<'a> Dict<'a> {
    fn take(&mut self, c: char) -> bool {
        self.0 = self.0.trim_start();
        match self.0.strip_prefix(c) {
            Some(rest) => {
                self.0 = rest;
                true
            }
            None => false,
        }
    }

    fn wrong(&self, wanted: &str) -> Diagnostic {
        let found: String = self.0.chars().take(20).collect();
        Diagnostic::new(format!("the header of this .npy file has {found:?} where {wanted} belongs"))
            .help("save it again with np.save")
    }

    fn expect(&mut self, c: char) -> Result<(), Diagnostic> {
        if self.take(c) { Ok(()) } else { Err(self.wrong(&format!("{c:?}"))) }
    }

    fn string(&mut self) -> Result<&'a str, Diagnostic> {
        self.0 = self.0.trim_start();
        for quote in ['\'', '"'] {
            if let Some((text, rest)) = self.0.strip_prefix(quote).and_then(|t| t.split_once(quote)) {
                self.0 = rest;
                return Ok(text);
            }
        }
        Err(self.wrong("a string"))
    }

    fn descr(&mut self) -> Result<(bool, bool), Diagnostic> {
        let help = "float32 or float64 fit: np.save(file, x.astype(np.float32))";
        self.0 = self.0.trim_start();
        if self.0.starts_with('[') {
            return Err(Diagnostic::new("this array is one of records").help(help));
        }
        match self.string()? {
            "<f4" => Ok((false, false)),
            "<f8" => Ok((true, false)),
            ">f4" => Ok((false, true)),
            ">f8" => Ok((true, true)),
            other => Err(Diagnostic::new(format!("this array's numbers are of type {other:?}")).help(help)),
        }
    }

    fn boolean(&mut self) -> Result<bool, Diagnostic> {
        self.0 = self.0.trim_start();
        for (word, value) in [("False", false), ("True", true)] {
            if let Some(rest) = self.0.strip_prefix(word) {
                self.0 = rest;
                return Ok(value);
            }
        }
        Err(self.wrong("True or False"))
    }

    fn tuple(&mut self) -> Result<Vec<usize>, Diagnostic> {
        self.expect('(')?;
        let mut all = Vec::new();
        while !self.take(')') {
            self.0 = self.0.trim_start();
            let digits = self.0.find(|c: char| !c.is_ascii_digit()).unwrap_or(self.0.len());
            let (number, rest) = self.0.split_at(digits);
            let number = number.parse().map_err(|_| self.wrong("a length"))?;
            self.0 = rest.strip_prefix('L').unwrap_or(rest);
            all.push(number);
            if !self.take(',') {
                self.expect(')')?;
                break;
            }
        }
        Ok(all)
    }
}
