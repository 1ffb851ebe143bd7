//! The materials library file: names, descriptions, and each material's vector for a texture network.
//!
//! ```text
//! Library(
//!     version: 4,
//!     encoder: "encoder.onnx",
//!     materials: {
//!         "denim": (
//!             description: "What it feels like, in a sentence.",
//!             family: "weave",
//!             images: ["pictures/denim.jpg"],
//!             image_mm: 10.24,
//!             events: (spacing_mm: 0.4, spacing_exponent: -0.5, anisotropy: [0.6, 0.0],
//!                      interval_cv: 0.25, height_cv: 0.5),
//!             // Each harmonic's weight, share and phase.
//!             waves: [(per_mm: [1.25, 0.0], harmonics: [[1.2, 0.8, 0.1]])],
//!             vector: [-1.25, 0.5, /* 256 numbers in all */],
//!         ),
//!     },
//! )
//! ```
//!
//! `encoder`, `family` and `images` are optional; version 1 has none of them. Paths are relative to the
//! library's folder. `events` and `waves` are a material's [`Pattern`]; they are optional and came with
//! version 3. `image_mm`, the width of each picture on the material, is optional and came with version 4.

mod assign;
mod insert;
mod pattern;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_diagnostics::ron::{self, Value, quoted};
use asperity_diagnostics::{Diagnostic, Recent, Source, fingerprint, one_of};

pub use asperity_dsp::shaped_noise::Events;
pub use assign::{Assignment, BLENDED, Neighbour};
pub use pattern::{Harmonic, MAX_HARMONICS, MAX_WAVES, Pattern, Wave};

/// Numbers in a material's vector.
pub const VECTOR_LEN: usize = 256;

/// Largest number in a vector, either sign: far beyond any embedding.
const LARGEST: f64 = 1e6;

/// Widths that a picture may show.
const IMAGE_MM: std::ops::RangeInclusive<f64> = 0.1..=1000.0;

/// A material of a library.
#[derive(Clone, Debug, PartialEq)]
pub struct LibraryMaterial {
    /// Name, unique in the library.
    pub name: String,
    /// A sentence on how it feels.
    pub description: String,
    /// Family, such as weave; never empty.
    pub family: Option<String>,
    /// Paths of pictures of it as in the file: relative to the library's folder.
    pub images: Vec<String>,
    /// Width of each picture on the material \[mm\], if known.
    pub image_mm: Option<f64>,
    /// Spread of its vibration over place.
    pub pattern: Pattern,
    /// Input of a texture network.
    pub vector: Box<[f32; VECTOR_LEN]>,
}

/// Materials by name, in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Library {
    path: PathBuf,
    encoder: Option<String>,
    materials: Vec<LibraryMaterial>,
}

/// Recent libraries, by path and content.
static LIBRARIES: Recent<(PathBuf, (usize, u64)), Arc<Library>> = Recent::new(4);

impl Library {
    /// A library for the file `path`. `encoder` is the path of the encoder that made the vectors,
    /// relative to that file.
    ///
    /// It is not checked as [`parse`](Self::parse) does.
    pub fn new(path: impl Into<PathBuf>, encoder: Option<String>, materials: Vec<LibraryMaterial>) -> Self {
        Self { path: path.into(), encoder, materials }
    }

    /// Reads a library file.
    ///
    /// # Errors
    /// A file that cannot be read, and all of [`parse`](Self::parse).
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        Self::parse(&Source::read(path)?)
    }

    /// Like [`read`](Self::read), but a recent library with the same content is not read again.
    pub fn shared(path: impl AsRef<Path>) -> Result<Arc<Self>, Diagnostic> {
        let source = Source::read(path)?;
        let key = (source.path().to_owned(), fingerprint(source.text().as_bytes()));
        LIBRARIES.of(key, |_| Self::parse(&source).map(Arc::new))
    }

    /// Reads a library from its text.
    ///
    /// # Errors
    /// Text that is not RON; an unknown or missing field; another version; no material; a name that is
    /// empty or there twice; a vector without exactly 256 finite numbers between -1e6 and 1e6.
    pub fn parse(source: &Arc<Source>) -> Result<Self, Diagnostic> {
        let whole = ron::parse(source)?;
        let mut record = whole.record("Library")?;
        let version = record.required("version")?.i64_in(1..=4, "")?;
        let later = version > 1;
        let encoder = if later { record.optional("encoder").map(named).transpose()? } else { None };
        let list = record.required("materials")?;
        record.finish()?;
        let entries = list.map()?;
        if entries.is_empty() {
            return Err(list
                .error("a library without materials")
                .help("add `\"name\": (description: ..., vector: [...])`"));
        }
        let mut materials = Vec::with_capacity(entries.len());
        for (key, value) in entries {
            if key.name.trim().is_empty() {
                return Err(Diagnostic::new("a material without a name").at(source, key.span));
            }
            materials.push(material(&key.name, value, version)?);
        }
        Ok(Self { path: source.path().to_owned(), encoder, materials })
    }

    /// The text of a library file, in the earliest version that has all its content. Numbers read back
    /// to the same bits.
    pub fn to_ron(&self) -> String {
        let needed = self.materials.iter().map(LibraryMaterial::needs_version).max().unwrap_or(1);
        let version = needed.max(if self.encoder.is_some() { 2 } else { 1 });
        let mut text = format!("Library(\n    version: {version},\n");
        // Writing to a String cannot fail.
        if let Some(encoder) = &self.encoder {
            let _ = writeln!(text, "    encoder: {},", quoted(encoder));
        }
        text.push_str("    materials: {\n");
        for m in &self.materials {
            m.write(&mut text, "        ");
        }
        text.push_str("    },\n)\n");
        text
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the encoder that makes this library's vectors from pictures, if named.
    pub fn encoder(&self) -> Option<PathBuf> {
        self.encoder.as_deref().map(|e| self.beside(e))
    }

    /// Path of a file that the library names relative to its folder.
    pub fn beside(&self, path: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }

    /// The materials, in the order of the file.
    pub fn materials(&self) -> &[LibraryMaterial] {
        &self.materials
    }

    /// A material by name.
    ///
    /// # Errors
    /// No such material; the error has the nearest name and the library's file. A caller that has the name
    /// from its own text points there with [`Diagnostic::at`].
    pub fn material(&self, name: &str) -> Result<&LibraryMaterial, Diagnostic> {
        self.materials.iter().find(|m| m.name == name).ok_or_else(|| {
            let (file, names) = (self.path.display(), self.materials.iter().map(|m| m.name.as_str()));
            let of_family = self.materials.iter().filter(|m| m.family.as_deref() == Some(name));
            let family: Vec<String> = of_family.map(|m| format!("`{}`", m.name)).collect();
            let help = match family.is_empty() {
                true => one_of(name, names),
                false => format!("`{name}` is a family: {}", family.join(", ")),
            };
            Diagnostic::new(format!("no material `{name}` in {file}"))
                .in_file(&self.path)
                .help(format!("{help} (all of them: asperity materials --library {file})"))
        })
    }
}

impl LibraryMaterial {
    /// The earliest version of the file with all of its fields.
    fn needs_version(&self) -> i64 {
        match () {
            () if self.image_mm.is_some() => 4,
            () if self.pattern != Pattern::default() => 3,
            () if self.family.is_some() || !self.images.is_empty() => 2,
            () => 1,
        }
    }

    /// Writes the entry, each line behind `indent`.
    fn write(&self, text: &mut String, indent: &str) {
        let _ = writeln!(text, "{indent}{}: (", quoted(&self.name));
        let _ = writeln!(text, "{indent}    description: {},", quoted(&self.description));
        if let Some(family) = &self.family {
            let _ = writeln!(text, "{indent}    family: {},", quoted(family));
        }
        if !self.images.is_empty() {
            let images: Vec<String> = self.images.iter().map(|i| quoted(i)).collect();
            let _ = writeln!(text, "{indent}    images: [{}],", images.join(", "));
        }
        if let Some(mm) = self.image_mm {
            let _ = writeln!(text, "{indent}    image_mm: {mm:?},");
        }
        self.pattern.write(text, &format!("{indent}    "));
        let _ = writeln!(text, "{indent}    vector: [");
        for row in self.vector.chunks(8) {
            let row: Vec<String> = row.iter().map(|x| format!("{x:?}")).collect();
            let _ = writeln!(text, "{indent}        {},", row.join(", "));
        }
        let _ = writeln!(text, "{indent}    ],\n{indent}),");
    }
}

fn material(name: &str, value: &Value, version: i64) -> Result<LibraryMaterial, Diagnostic> {
    let mut m = value.record("Material")?;
    let description = m.required("description")?.text()?.to_owned();
    let vector = vector(m.required("vector")?)?;
    let (mut family, mut images, mut pattern) = (None, Vec::new(), Pattern::default());
    if version > 1 {
        family = m.optional("family").map(named).transpose()?;
        if let Some(list) = m.optional("images") {
            images = list.list()?.iter().map(named).collect::<Result<_, _>>()?;
        }
    }
    if version > 2 {
        pattern = Pattern::read(m.optional("waves"), m.optional("events"))?;
    }
    let image_mm = if version > 3 { m.optional("image_mm") } else { None };
    let image_mm = image_mm.map(|mm| mm.f64_in(IMAGE_MM, "mm")).transpose()?;
    m.finish()?;
    Ok(LibraryMaterial { name: name.to_owned(), description, family, images, image_mm, pattern, vector })
}

/// A text that is not empty.
fn named(value: &Value) -> Result<String, Diagnostic> {
    match value.text()? {
        text if text.trim().is_empty() => Err(value.error("an empty text").help("leave the field out")),
        text => Ok(text.to_owned()),
    }
}

fn vector(value: &Value) -> Result<Box<[f32; VECTOR_LEN]>, Diagnostic> {
    let numbers = value.list()?;
    if numbers.len() != VECTOR_LEN {
        return Err(value
            .error(format!("a vector of {}", numbers.len()))
            .label("wrong length")
            .help(format!("a material's vector has {VECTOR_LEN} numbers")));
    }
    let mut vector = Box::new([0.0; VECTOR_LEN]);
    for (x, number) in vector.iter_mut().zip(numbers) {
        *x = number.f64_in(-LARGEST..=LARGEST, "")? as f32;
    }
    Ok(vector)
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_numbers::Random;

    /// A material without anything optional.
    pub(crate) fn material(name: &str) -> LibraryMaterial {
        LibraryMaterial {
            name: name.into(),
            description: format!("What {name} feels like."),
            family: None,
            images: Vec::new(),
            image_mm: None,
            pattern: Pattern::default(),
            vector: Box::new([0.0; VECTOR_LEN]),
        }
    }

    /// A library of three.
    pub(super) fn three() -> Library {
        let mut random = Random::new(5);
        let mut material = |name: &str| LibraryMaterial {
            vector: Box::new(std::array::from_fn(|_| random.range(-4.0, 4.0) as f32)),
            ..material(name)
        };
        Library::new("three.ron", None, ["coarse weave", "brick", "cork"].map(&mut material).into())
    }

    fn error(text: &str) -> String {
        Library::parse(&Source::new("m.ron", text)).unwrap_err().to_string()
    }

    fn with_vector(vector: &str) -> String {
        format!("Library(version: 1, materials: {{\n\"a\": (description: \"d\",\n vector: {vector}),\n}})")
    }

    /// Checks that a library reads back to the same bits, and returns its text.
    pub(super) fn reads_back(library: &Library) -> String {
        let text = library.to_ron();
        assert_eq!(Library::parse(&Source::new(&library.path, text.as_str())).unwrap(), *library);
        text
    }

    #[test]
    fn version_2_reads_back_with_paths_beside_the_file() {
        let mut library = three();
        library.path = "some/where/m.ron".into();
        library.encoder = Some("../models/e.onnx".into());
        library.materials[1].family = Some("weave".into());
        library.materials[2].images = vec!["a.png".into(), "b \"c\".jpg".into()];
        library.materials[2].image_mm = Some(10.24);
        assert!(reads_back(&library).starts_with("Library(\n    version: 4,\n"));
        library.materials[2].image_mm = None;
        let text = reads_back(&library);
        assert!(text.starts_with("Library(\n    version: 2,\n    encoder: \"../models/e.onnx\",\n"));
        assert_eq!(library.encoder().unwrap(), Path::new("some/where/../models/e.onnx"));
        assert_eq!(library.beside("a.png"), Path::new("some/where/a.png"));
        assert_eq!(Library::new("m.ron", None, Vec::new()).beside("a.png"), Path::new("a.png"));
    }

    #[test]
    fn version_2_fields_are_unknown_in_version_1_refused_if_empty() {
        let vector = format!("[{}]", "0.5, ".repeat(256));
        for (version, head, fields, what) in [
            (1, "encoder: \"e\",", "", "unknown field `encoder`"),
            (1, "", "family: \"f\",", "unknown field `family`"),
            (1, "", "images: [\"f\"],", "unknown field `images`"),
            (2, "encoder: \" \",", "", "1:30: an empty text"),
            (2, "", "family: \"\",", "an empty text"),
            (2, "", "images: [\"a\", \"\"],", "an empty text"),
            (2, "", "images: \"a\",", "expected a list"),
            (2, "", "famly: \"a\",", "did you mean `family`?"),
        ] {
            let e = error(&format!(
                "Library(version: {version}, {head} materials: {{\"a\": (description: \"d\", {fields} \
                 vector: {vector})}})"
            ));
            assert!(e.contains(what), "{e}");
        }
    }

    #[test]
    fn names_and_sentences_with_quotes_read_back() {
        let mut library = three();
        library.materials[0].name = "the \"odd\" \\ one".into();
        library.materials[0].description = "two\nlines, é".into();
        reads_back(&library);
    }

    #[test]
    fn an_unknown_material_names_the_nearest() {
        let library = three();
        let e = library.material("coarse weaves").unwrap_err().to_string();
        assert!(
            e.contains("no material `coarse weaves`") && e.contains("did you mean `coarse weave`?"),
            "{e}"
        );
        assert_eq!(library.material("coarse weave").unwrap().name, "coarse weave");
    }

    #[test]
    fn bad_libraries_are_refused_where_they_are_bad() {
        let numbers = |n: usize, last: &str| format!("[{}{last}]", "0.5, ".repeat(n - 1));
        assert!(Library::parse(&Source::new("m.ron", with_vector(&numbers(256, "1")))).is_ok());
        for (vector, what) in [
            (numbers(255, "1"), "m.ron:3:10: a vector of 255"),
            (numbers(256, "NaN"), "not a finite number"),
            (numbers(256, "1e50"), "out of range"),
            (numbers(256, "\"x\""), "expected a number"),
        ] {
            let e = error(&with_vector(&vector));
            assert!(e.starts_with("m.ron:3:") && e.contains(what), "{e}");
        }
        for (text, what) in [
            ("Library(version: 5, materials: {})", "m.ron:1:18: 5 is out of range"),
            ("Library(version: 1, materials: {})", "without materials"),
            ("Library(version: 1)", "`materials` is missing"),
            (&with_vector("[]").replace("description", "descripton"), "`description` is missing"),
            ("Library(version: 1, materials: {\"a\": (), \"a\": ()})", "twice"),
        ] {
            assert!(error(text).contains(what), "{}", error(text));
        }
    }

    #[test]
    fn a_missing_file_is_named() {
        let e = Library::read("no/such/library.ron").unwrap_err().to_string();
        assert!(e.starts_with("no/such/library.ron: cannot read"), "{e}");
    }
}
