//! `asperity materials`: lists the materials of a library.

use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_texture::{Library, LibraryMaterial};
use serde_json::{Value, json};

use crate::failure::{Failure, clean, plural, print_report};

/// List the materials of a library: names, families, descriptions, pictures
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity materials",
    "asperity materials --library mine/materials.ron --json",
]))]
pub struct Args {
    /// Library file
    #[arg(long, value_name = "L.ron", value_parser = crate::shipped::path(),
        default_value = "graphs/models/surfaces/materials.ron")]
    pub library: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let library = Library::read(&args.library).map_err(|e| Failure::from(e).named_by("--library"))?;
    print_report(args.json, || as_json(&library), || text_of(&library))
}

fn text_of(library: &Library) -> String {
    let materials = library.materials();
    let length = |t: &str| clean(t).chars().count();
    let names = materials.iter().map(|m| length(&m.name)).max().unwrap_or(0);
    let families = materials.iter().filter_map(|m| m.family.as_deref()).map(length).max().unwrap_or(0);
    let mut out = String::new();
    for m in materials {
        let _ = write!(out, "{:names$}  ", clean(&m.name));
        if families > 0 {
            let _ = write!(out, "{:families$}  ", clean(m.family.as_deref().unwrap_or_default()));
        }
        let _ = writeln!(out, "{}", clean(&m.description));
        for image in &m.images {
            let missing = if library.beside(image).is_file() { "" } else { " (missing)" };
            let path = library.beside(image).display().to_string();
            let _ = writeln!(out, "{:names$}  {}{missing}", "", clean(&path));
        }
    }
    let _ = writeln!(out, "\n{}", plural(materials.len(), "material"));
    if let Some(encoder) = library.encoder() {
        let missing = if encoder.is_file() { "" } else { " (missing)" };
        let _ = writeln!(out, "encoder {}{missing}", clean(&encoder.display().to_string()));
    }
    out
}

fn as_json(library: &Library) -> Value {
    let file = |path: PathBuf| json!({ "path": path.display().to_string(), "missing": !path.is_file() });
    let material = |m: &LibraryMaterial| {
        let images: Vec<Value> = m.images.iter().map(|i| file(library.beside(i))).collect();
        json!({ "name": m.name, "family": m.family, "description": m.description, "images": images })
    };
    json!({
        "library": library.path().display().to_string(),
        "encoder": library.encoder().map(file),
        "materials": library.materials().iter().map(material).collect::<Vec<_>>(),
    })
}
