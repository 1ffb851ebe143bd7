//! The header: a magic string, a version, a length, and a Python dictionary with three entries.

use asperity_diagnostics::ron::{self, Kind};
use asperity_diagnostics::{Diagnostic, Source};

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
        Ok((Self::entries(text)?, data))
    }

    fn entries(text: &str) -> Result<Self, Diagnostic> {
        let wrong = |what: &str| {
            let found = format!("the header of this .npy file {what}");
            Diagnostic::new(found).help("save it again with np.save")
        };
        // A Python dictionary is a map in RON, but for its quotes and the `3L` of Python 2.
        let text = text.replace('\'', "\"").replace("L,", ",").replace("L)", ")");
        let dict = ron::parse(&Source::new("header", text));
        let dict = dict.map_err(|e| wrong(&format!("cannot be read: {}", e.message)))?;
        let entries = dict.map().map_err(|_| wrong("is no dictionary"))?;
        let known = ["descr", "fortran_order", "shape"];
        if let Some((key, _)) = entries.iter().find(|(key, _)| !known.contains(&key.name.as_str())) {
            return Err(wrong(&format!("has an unknown entry {:?}", key.name))
                .help("known are \"descr\", \"fortran_order\" and \"shape\""));
        }
        let [descr, fortran, shape] = known.map(|what| {
            let entry = entries.iter().find(|(key, _)| key.name == what);
            entry.map(|(_, value)| value).ok_or_else(|| wrong(&format!("has no entry {what:?}")))
        });
        let help = "float32 or float64 fit: np.save(file, x.astype(np.float32))";
        let (wide, big_endian) = match descr?.kind() {
            Kind::List(_) => return Err(Diagnostic::new("this is an array of records").help(help)),
            Kind::Text(text) => match text.as_str() {
                "<f4" => (false, false),
                "<f8" => (true, false),
                ">f4" => (false, true),
                ">f8" => (true, true),
                other => {
                    let found = format!("this array has numbers of type {other:?}");
                    return Err(Diagnostic::new(found).help(help));
                }
            },
            _ => return Err(wrong("does not name a type")),
        };
        let fortran = match fortran?.kind() {
            Kind::Word(word) if word == "True" => true,
            Kind::Word(word) if word == "False" => false,
            _ => return Err(wrong("does not say True or False for \"fortran_order\"")),
        };
        let length = |value: &ron::Value| {
            let length = value.i64().ok().and_then(|length| usize::try_from(length).ok());
            length.ok_or_else(|| wrong("has a shape with something else than a length"))
        };
        let shape = match shape?.kind() {
            Kind::Unit => Vec::new(),
            Kind::List(all) => all.iter().map(length).collect::<Result<_, _>>()?,
            _ => return Err(wrong("has a shape with something else than a length")),
        };
        Ok(Self { wide, big_endian, fortran, shape })
    }
}
