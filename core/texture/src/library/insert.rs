//! Inserts a material into the text of a library file.

use std::sync::Arc;

use asperity_diagnostics::ron;
use asperity_diagnostics::{Diagnostic, Source, Span};

use super::{LARGEST, Library, LibraryMaterial};

impl Library {
    /// The text of a library file with one more material at the end. Everything else stays byte for byte,
    /// comments included. Only a comma after the last material may be added, and the version may rise.
    ///
    /// # Errors
    /// Those of [`parse`](Self::parse); an empty or existing name; a number that is not finite or beyond
    /// 1e6.
    pub fn insert(source: &Arc<Source>, material: &LibraryMaterial) -> Result<String, Diagnostic> {
        let mut wanted = Self::parse(source)?;
        let refuse = |what: String| Diagnostic::new(what).in_file(source.path());
        if material.name.trim().is_empty() {
            return Err(refuse("a new material without a name".into()));
        }
        if let Some(at) = material.vector.iter().position(|x| x.is_nan() || f64::from(x.abs()) > LARGEST) {
            let x = material.vector[at];
            return Err(refuse(format!("number {at} of `{}` is {x}; at most {LARGEST} fits", material.name)));
        }
        let whole = ron::parse(source)?;
        let mut record = whole.record("Library")?;
        let version = record.required("version")?;
        let list = record.required("materials")?;
        let entries = list.map()?;
        if let Some((key, _)) = entries.iter().find(|(key, _)| key.name == material.name) {
            return Err(Diagnostic::new(format!("the library has a material `{}`", material.name))
                .at(source, key.span)
                .label("this one")
                .help("choose another name"));
        }
        let (at, entry) = entry(source.text(), list.span().end - 1, material);
        let mut changes = vec![(Span::at(at), entry)];
        if version.i64()? < material.needs_version() {
            changes.push((version.span(), material.needs_version().to_string()));
        }
        wanted.materials.push(material.clone());
        // The result must be as intended, whatever the file looks like. A comma may be missing so far.
        let with_comma = entries.last().map(|(_, last)| (Span::at(last.span().end), ",".to_owned()));
        let mut found = Self::parse(&Source::new(source.path(), changed(source.text(), &changes)));
        if found.is_err() {
            changes.extend(with_comma);
            found = Self::parse(&Source::new(source.path(), changed(source.text(), &changes)));
        }
        match found {
            Ok(found) if found == wanted => Ok(changed(source.text(), &changes)),
            Ok(_) => Err(refuse("cannot add to this file without changing its other entries".into())),
            Err(e) => Err(refuse(format!("cannot add to this file: {}", e.message))),
        }
    }
}

/// A text with new content in some places.
fn changed(text: &str, changes: &[(Span, String)]) -> String {
    let mut changes: Vec<_> = changes.iter().collect();
    changes.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
    let mut text = text.to_owned();
    for (span, new) in changes {
        text.replace_range(span.start..span.end, new);
    }
    text
}

/// The entry, on lines of its own before the closing brace of the list, and its place.
fn entry(text: &str, brace: usize, material: &LibraryMaterial) -> (usize, String) {
    let line = text[..brace].rfind('\n').map_or(0, |at| at + 1);
    let before = &text[line..brace];
    let indent: String = before.chars().take_while(|c| *c == ' ' || *c == '\t').collect();
    let mut new = String::new();
    material.write(&mut new, &format!("{indent}    "));
    let own_line = before.trim().is_empty();
    if !own_line {
        new = format!("\n{new}{indent}");
    }
    if text.contains("\r\n") {
        new = new.replace('\n', "\r\n");
    }
    (if own_line { line } else { brace }, new)
}

#[cfg(test)]
mod tests {
    use super::super::tests::three;
    use super::*;
    use crate::VECTOR_LEN;

    fn new(name: &str) -> LibraryMaterial {
        LibraryMaterial {
            description: "a \"new\" one".into(),
            vector: Box::new(std::array::from_fn(|i| i as f32 / 3.0 - 20.0)),
            ..super::super::tests::material(name)
        }
    }

    fn inserted(text: &str, material: &LibraryMaterial) -> String {
        Library::insert(&Source::new("l.ron", text), material).unwrap_or_else(|e| panic!("{e}\n{text}"))
    }

    fn old(end: &str) -> String {
        let vector = format!("[{}]", "0.25, ".repeat(VECTOR_LEN));
        format!(
            "// head\nLibrary(version: 1, /* x */ materials: {{ \"a, b\": (description: \"d\", vector: \
             {vector}){end}) // foot\n"
        )
    }

    #[test]
    fn library_after_insert_equals_one_written_with_the_material() {
        let mut library = three();
        let text = library.to_ron();
        let material = new("felt");
        library.materials.push(material.clone());
        assert_eq!(inserted(&text, &material), library.to_ron());
    }

    #[test]
    fn insert_at_any_list_end_adds_only_the_new_entry() {
        let felt = new("felt");
        // Whether a comma is missing.
        for (end, comma) in [
            ("}", true),
            (",}", false),
            (" , }", false),
            ("\n}", true),
            (",\n    }", false),
            (" // , no comma\n  }", true),
            ("/* , /* , */ , */ }", true),
            (", // comma\n // last line }\n\t}", false),
            (",\r\n    }", false),
            ("/* é */ ,}", false),
        ] {
            let before = old(end);
            let after = inserted(&before, &felt);
            assert_eq!(after.contains("\r\n"), before.contains("\r\n"));
            // The old text keeps its order. Only the entry and a comma are new.
            let mut entry = String::new();
            felt.write(&mut entry, "");
            let squeezed = |t: &str| t.chars().filter(|c| !c.is_whitespace()).collect::<String>();
            let added = squeezed(&after).replacen(&squeezed(&entry), "", 1);
            let want = if comma { squeezed(&before).replacen("])", "]),", 1) } else { squeezed(&before) };
            assert_eq!(added, want, "{end:?}");
            let again = inserted(&after, &new("silk"));
            let library = Library::parse(&Source::new("l.ron", again)).unwrap();
            let names: Vec<&str> = library.materials.iter().map(|m| m.name.as_str()).collect();
            assert_eq!(names, ["a, b", "felt", "silk"]);
        }
    }

    #[test]
    fn pictures_and_family_turn_version_1_into_version_2() {
        let mut felt = new("felt");
        assert!(inserted(&old("}"), &felt).starts_with("// head\nLibrary(version: 1, /* x */"));
        felt.images = vec!["felt.png".into()];
        felt.family = Some("wool".into());
        let text = inserted(&old("}"), &felt);
        assert!(text.starts_with("// head\nLibrary(version: 2, /* x */"), "{text}");
        let library = Library::parse(&Source::new("l.ron", text)).unwrap();
        assert_eq!(library.material("felt").unwrap(), &felt);
    }

    #[test]
    fn existing_name_and_non_finite_numbers_are_refused() {
        let refused = |material: &LibraryMaterial| {
            Library::insert(&Source::new("l.ron", old("}")), material).unwrap_err().to_string()
        };
        let twice = refused(&new("a, b"));
        assert!(twice.starts_with("l.ron:2:42: the library has a material `a, b`"), "{twice}");
        assert!(refused(&new(" ")).contains("without a name"));
        for bad in [f32::NAN, f32::INFINITY, -1.1e6] {
            let mut material = new("felt");
            material.vector[3] = bad;
            assert!(refused(&material).contains("number 3 of `felt`"), "{}", refused(&material));
        }
    }
}
