//! The materials library file: names, a sentence each, and the vector a texture network knows them by.
//!
//! ```text
//! Library(
//!     version: 1,
//!     materials: {
//!         "coarse weave": (
//!             description: "What it feels like, in a sentence.",
//!             vector: [-1.25, 0.5, /* 256 numbers in all */],
//!         ),
//!     },
//! )
//! ```

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_source::ron::{self, Value};
use asperity_source::{Diagnostic, Source, one_of};

use super::{EMBEDDING_LEN, MadeMaterial, embed};

/// Numbers in a material's vector.
pub const VECTOR_LEN: usize = EMBEDDING_LEN;

/// Largest number a vector may hold, either sign: far beyond any embedding.
const LARGEST: f64 = 1e6;

/// A material of a library.
#[derive(Clone, Debug, PartialEq)]
pub struct LibraryMaterial {
    /// Its name; no other material of the library has it.
    pub name: String,
    /// What it feels like, in a sentence.
    pub description: String,
    /// What a texture network is given.
    pub vector: Box<[f32; VECTOR_LEN]>,
}

/// Materials by name, in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Library {
    path: PathBuf,
    materials: Vec<LibraryMaterial>,
}

impl Library {
    /// The library of the made materials, each with [`embed`] of its law.
    pub fn made(materials: &[MadeMaterial]) -> Self {
        let materials = materials
            .iter()
            .map(|m| LibraryMaterial {
                name: m.name.to_owned(),
                description: m.description.to_owned(),
                vector: Box::new(embed(&m.law)),
            })
            .collect();
        Self { path: PathBuf::from("made.ron"), materials }
    }

    /// Reads a library file.
    ///
    /// # Errors
    /// A file that cannot be read, and all of [`parse`](Self::parse).
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        Self::parse(&Source::read(path)?)
    }

    /// Reads a library from its text.
    ///
    /// # Errors
    /// Text that is not RON, an unknown or missing field, another version, no material at all, a name that is empty
    /// or stands twice, a vector that has not 256 finite numbers between -1e6 and 1e6.
    pub fn parse(source: &Arc<Source>) -> Result<Self, Diagnostic> {
        let whole = ron::parse(source)?;
        let mut record = whole.record("Library")?;
        record.required("version")?.i64_in(1..=1, "")?;
        let list = record.required("materials")?;
        record.finish(&["version", "materials"])?;
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
            let mut m = value.record("Material")?;
            let description = m.required("description")?.text()?.to_owned();
            let vector = vector(m.required("vector")?)?;
            m.finish(&["description", "vector"])?;
            materials.push(LibraryMaterial { name: key.name.clone(), description, vector });
        }
        Ok(Self { path: source.path().to_owned(), materials })
    }

    /// The text of a library file. Numbers are written so that they read back to the same bits.
    pub fn to_ron(&self) -> String {
        let mut text = String::from("Library(\n    version: 1,\n    materials: {\n");
        // writing to a String cannot fail
        for m in &self.materials {
            let _ = writeln!(text, "        {}: (", quoted(&m.name));
            let _ = writeln!(text, "            description: {},", quoted(&m.description));
            text.push_str("            vector: [\n");
            for row in m.vector.chunks(8) {
                let row: Vec<String> = row.iter().map(|x| format!("{x:?}")).collect();
                let _ = writeln!(text, "                {},", row.join(", "));
            }
            text.push_str("            ],\n        ),\n");
        }
        text.push_str("    },\n)\n");
        text
    }

    /// The materials, in the order of the file.
    pub fn materials(&self) -> &[LibraryMaterial] {
        &self.materials
    }

    /// A material by name.
    ///
    /// # Errors
    /// No such material, with the nearest name. The error names the library's file; a caller that has the name from a
    /// text of its own points there with [`Diagnostic::at`].
    pub fn material(&self, name: &str) -> Result<&LibraryMaterial, Diagnostic> {
        self.materials.iter().find(|m| m.name == name).ok_or_else(|| {
            Diagnostic::new(format!("no material `{name}` in {}", self.path.display()))
                .in_file(&self.path)
                .help(one_of(name, self.materials.iter().map(|m| m.name.as_str())))
        })
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

fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '\n' => quoted.push_str("\\n"),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::made_materials;

    fn error(text: &str) -> String {
        Library::parse(&Source::new("m.ron", text)).unwrap_err().to_string()
    }

    fn with_vector(vector: &str) -> String {
        format!("Library(version: 1, materials: {{\n\"a\": (description: \"d\",\n vector: {vector}),\n}})")
    }

    #[test]
    fn a_library_reads_back_to_the_same_bits() {
        let library = Library::made(&made_materials().unwrap());
        let back = Library::parse(&Source::new("made.ron", library.to_ron())).unwrap();
        assert_eq!(library, back);
    }

    #[test]
    fn names_and_sentences_with_quotes_read_back() {
        let mut library = Library::made(&made_materials().unwrap()[..1]);
        library.materials[0].name = "the \"odd\" \\ one".into();
        library.materials[0].description = "two\nlines, é".into();
        let back = Library::parse(&Source::new("made.ron", library.to_ron())).unwrap();
        assert_eq!(library, back);
    }

    #[test]
    fn an_unknown_material_names_the_nearest() {
        let library = Library::made(&made_materials().unwrap());
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
        assert!(error("Library(version: 2, materials: {})").starts_with("m.ron:1:18: 2 is out of range"));
        assert!(error("Library(version: 1, materials: {})").contains("without materials"));
        assert!(error("Library(version: 1)").contains("`materials` is missing"));
        assert!(
            error(&with_vector("[]").replace("description", "descripton"))
                .contains("`description` is missing")
        );
        let twice = "Library(version: 1, materials: {\"a\": (), \"a\": ()})";
        assert!(error(twice).contains("twice"));
    }

    #[test]
    fn a_missing_file_is_named() {
        let e = Library::read("no/such/library.ron").unwrap_err().to_string();
        assert!(e.starts_with("no/such/library.ron: cannot read"), "{e}");
    }
}
