//! `asperity encode`: finds materials like pictures of a surface, and adds one to a library.

use std::fs::File;
use std::path::{Component, Path, PathBuf};

use asperity_diagnostics::{Diagnostic, MAX_TEXT_BYTES, Source, file};
use asperity_texture::picture::{self, Quality};
use asperity_texture::statistics::{Statistics, Strangeness};
use asperity_texture::{
    Assignment, BLENDED, Encoded, Encoder, Library, LibraryMaterial, Neighbour, VECTOR_LEN,
};
use clap::ValueEnum;
use serde_json::{Value, json};

use crate::failure::{Failure, clean, json as as_text, print, warn, wrong};
use crate::number::whole;
use crate::output::{folder_of, resolved, write_text};

/// Vector of a new material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum As {
    /// The nearest stored vector, on which a network was trained
    Nearest,
    /// Its own vector
    Raw,
    /// The mean of the nearest stored vectors, each weighted by 1 / distance
    Blend,
}

/// Find the materials nearest to pictures of a surface, and add one to a library
///
/// A picture is cropped to its middle of 4 to 3 and scaled to 192 x 256 pixels. Both are reported. A picture
/// that is blank, saturated or out of focus is refused. One that is unlike what the encoder was trained on is
/// compared, but not added.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args = crate::number::may_be_negative)]
#[command(after_help = crate::commands::examples(&[
    "asperity encode rug.png --library mine/materials.ron --dry-run",
    "asperity encode rug_1.png rug_2.png --library mine/materials.ron --name rug --family carpet",
]))]
pub struct Args {
    /// Tactile images of one material: PNG, JPEG or BMP. Several images give their mean vector
    #[arg(required = true, value_name = "IMAGE", value_parser = crate::shipped::path())]
    pub images: Vec<PathBuf>,
    /// Library to search, which gets the material
    #[arg(long, value_name = "L.ron", value_parser = crate::shipped::path())]
    pub library: PathBuf,
    /// Encoder; by default the one that the library names
    #[arg(long, value_name = "FILE.onnx", value_parser = crate::shipped::path())]
    pub encoder: Option<PathBuf>,
    /// Name of the material; by default that of the first image's file
    #[arg(long)]
    pub name: Option<String>,
    /// Sentence that describes how it feels
    #[arg(long, value_name = "TEXT")]
    pub description: Option<String>,
    /// Family that it belongs to, such as a weave
    #[arg(long, value_name = "TEXT", value_parser = family)]
    pub family: Option<String>,
    /// Vector that it gets
    #[arg(long = "as", value_enum, default_value = "nearest")]
    pub how: As,
    /// Number of nearest materials to list (by default 5), and to blend with `--as blend` (by default 3)
    #[arg(long, value_name = "N", value_parser = whole(1_usize, 4096, ""))]
    pub neighbours: Option<usize>,
    /// Add the material even if a picture is unlike what the encoder was trained on
    #[arg(long)]
    pub accept_unlike: bool,
    /// Dry run: add nothing to the library
    #[arg(long)]
    pub dry_run: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

fn family(text: &str) -> Result<String, String> {
    if text.trim().is_empty() { Err("an empty text".into()) } else { Ok(text.to_owned()) }
}

type Vector = [f32; VECTOR_LEN];

/// A picture, and the encoder's answer.
struct Seen<'a> {
    path: &'a Path,
    notes: Vec<String>,
    quality: Quality,
    encoded: Encoded,
}

const LISTED: usize = 5;

pub fn run(args: &Args) -> Result<(), Failure> {
    let library = Library::read(&args.library).map_err(|e| Failure::from(e).named_by("--library"))?;
    let name = name(args)?;
    if library.materials().iter().any(|m| m.name == name) {
        let what = format!("the library has a material `{}` already", clean(&name));
        if !args.dry_run {
            return Err(wrong(&args.library, what, "choose another --name"));
        }
        warn(&what);
    }
    let encoder = encoder(args, &library)?;
    let seen = args.images.iter().map(|path| look(path, &encoder)).collect::<Result<Vec<Seen<'_>>, _>>()?;
    let sum = |i: usize| seen.iter().map(|s| f64::from(s.encoded.vector[i])).sum::<f64>();
    let mean: Vector = std::array::from_fn(|i| (sum(i) / seen.len().max(1) as f64) as f32);
    let near = library.nearest(&mean, args.neighbours.unwrap_or(LISTED));
    let nearest = library.nearest(&mean, 1);
    let nearest = nearest.first().map(|n| n.material);
    let (how, gets) = match args.how {
        As::Nearest => {
            let gets = nearest.map_or_else(String::new, |m| format!("the vector of `{}`", m.name));
            (Assignment::Nearest, gets)
        }
        As::Raw => (Assignment::Raw, "its own vector".to_owned()),
        As::Blend => {
            let count = args.neighbours.unwrap_or(BLENDED);
            let found = count.min(library.materials().len());
            (Assignment::Blend(count), format!("a blend of the nearest {found}"))
        }
    };
    let unlike: Vec<Diagnostic> = seen.iter().filter_map(Seen::unlike).collect();
    let adds = !args.dry_run && (args.accept_unlike || unlike.is_empty());
    let say = |last: String| match args.json {
        true => print(&as_text(&report(&library, &seen, &mean, &near, (&name, &gets, adds)))?),
        false => print(&(text(&library, &seen, &mean, &near) + &last)),
    };
    if encoder.statistics().is_none() {
        let beside = Statistics::beside(encoder.path());
        let missing = format!("the encoder has no statistics, {}", beside.display());
        warn(&format!("{missing}: whether a picture is unlike the training pictures cannot be told"));
    }
    if !adds && !args.dry_run {
        say(String::new())?;
        return Err(unlike.into());
    }
    for d in &unlike {
        let path = d.path().map(|path| path.display().to_string()).unwrap_or_default();
        warn(&clean(&format!("{path}: {}", d.message)));
    }
    let (shown, will) = (clean(&name), clean(&gets));
    if args.dry_run {
        return say(format!("\n`{shown}` would get {will}; nothing was added\n"));
    }
    let from = match seen.len() {
        1 => "a picture".to_owned(),
        n => format!("{n} pictures"),
    };
    let material = LibraryMaterial {
        name: name.clone(),
        description: args.description.clone().unwrap_or_else(|| format!("From {from}: {gets}.")),
        family: args.family.clone(),
        images: args.images.iter().map(|image| beside(&args.library, image)).collect::<Result<_, _>>()?,
        image_mm: None,
        // A picture does not show where ridges and bumps are: the nearest material's are taken.
        pattern: nearest.map(|m| m.pattern.clone()).unwrap_or_default(),
        vector: library.assign(&mean, how),
    };
    add(&args.library, &material)?;
    say(format!("\nadded `{shown}` to {}: {will}\n", args.library.display()))
}

/// Reads, checks and encodes a picture.
fn look<'a>(path: &'a Path, encoder: &Encoder) -> Result<Seen<'a>, Failure> {
    let picture = picture::read(path)?;
    let quality = Quality::of(&picture.image);
    if let Some((what, help)) = quality.fault() {
        return Err(wrong(path, what, help));
    }
    Ok(Seen { path, notes: picture.notes, quality, encoded: encoder.look(&picture.image)? })
}

fn name(args: &Args) -> Result<String, Failure> {
    let stem = args.images.first().and_then(|i| i.file_stem()).unwrap_or_default().to_string_lossy();
    let name = args.name.clone().unwrap_or_else(|| stem.into_owned());
    if name.trim().is_empty() {
        return Err(Diagnostic::new("a material without a name").help("give it one by --name").into());
    }
    Ok(name)
}

fn encoder(args: &Args, library: &Library) -> Result<Encoder, Failure> {
    let own = library.encoder();
    let (path, by) = match (args.encoder.clone(), own) {
        (Some(given), own) => {
            if let Some(own) = own.filter(|own| resolved(own) != resolved(&given)) {
                let own = own.display();
                warn(&format!(
                    "the library names another encoder, {own}: distances mean little unless it is the same"
                ));
            }
            (given, "--encoder".to_owned())
        }
        (None, Some(own)) => (own, args.library.display().to_string()),
        (None, None) => {
            let help = "name one by --encoder FILE.onnx, or in the library by `encoder: \"FILE.onnx\"`";
            return Err(wrong(&args.library, "this library names no encoder", help));
        }
    };
    Encoder::load(&path).map_err(|e| Failure::from(e).named_by(&by))
}

impl Seen<'_> {
    /// The error for a picture that is unlike the training pictures.
    fn unlike(&self) -> Option<Diagnostic> {
        let found = self.encoded.strangeness.as_ref().filter(|s| s.is_unlike())?;
        let (far, limit, layer) = (found.distance, found.limit, clean(&found.layer));
        let what = format!(
            "this picture is unlike those that the encoder was trained on: distance {far:.1} in its layer \
             `{layer}`, limit {limit:.1}"
        );
        let help = "its nearest materials mean little; `--accept-unlike` adds it all the same";
        Some(Diagnostic::new(what).in_file(self.path).help(help))
    }
}

/// Notes and strangeness of each picture, the spread of several, and the list of materials.
fn text(library: &Library, seen: &[Seen<'_>], mean: &Vector, near: &[Neighbour<'_>]) -> String {
    let mut out = String::new();
    for Seen { path, notes, encoded, .. } in seen {
        let path = clean(&path.display().to_string());
        notes.iter().for_each(|note| out += &format!("{path}: {note}\n"));
        if let Some(s) = &encoded.strangeness {
            let (part, layer) = (100.0 * s.distance / s.limit, clean(&s.layer));
            out += &format!("{path}: strangeness {part:.0} % of the limit, in layer `{layer}`\n");
        }
        if let Some(first) = library.nearest(&encoded.vector, 1).first().filter(|_| seen.len() > 1) {
            let (name, far) = (clean(&first.material.name), first.distance);
            out += &format!("{path}: nearest `{name}`, at {far:.4}\n");
        }
    }
    if seen.len() > 1 {
        let [rms, most] = spread(seen, mean);
        let count = seen.len();
        out += &format!("spread of {count} pictures around their mean: {rms:.4} rms, {most:.4} at most\n");
    }
    out + &list(near)
}

/// Distances of the pictures' vectors from their mean: root mean square, and the largest.
fn spread(seen: &[Seen<'_>], mean: &Vector) -> [f64; 2] {
    let square = |s: &Seen<'_>| {
        let apart = s.encoded.vector.iter().zip(mean);
        apart.map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>()
    };
    let squares: Vec<f64> = seen.iter().map(square).collect();
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    [mean, squares.into_iter().fold(0.0, f64::max)].map(f64::sqrt)
}

fn report(
    library: &Library,
    seen: &[Seen<'_>],
    mean: &Vector,
    near: &[Neighbour<'_>],
    (name, gets, added): (&str, &str, bool),
) -> Value {
    let neighbour = |n: &Neighbour<'_>| {
        let (name, family) = (&n.material.name, &n.material.family);
        json!({ "name": name, "family": family, "distance": n.distance })
    };
    let strangeness = |s: &Strangeness| {
        let (layer, unlike) = (&s.layer, s.is_unlike());
        json!({ "layer": layer, "distance": s.distance, "limit": s.limit, "unlike": unlike })
    };
    let image = |s: &Seen<'_>| {
        json!({
            "path": s.path.display().to_string(),
            "notes": s.notes,
            "contrast": s.quality.contrast,
            "saturated": s.quality.saturated,
            "detail": s.quality.detail,
            "sharpness": s.quality.sharpness,
            "strangeness": s.encoded.strangeness.as_ref().map(strangeness),
            "nearest": library.nearest(&s.encoded.vector, 1).first().map(neighbour),
        })
    };
    let [rms, most] = spread(seen, mean);
    json!({
        "images": seen.iter().map(image).collect::<Vec<_>>(),
        "spread": { "rms": rms, "most": most },
        "nearest": near.iter().map(neighbour).collect::<Vec<_>>(),
        "material": { "name": name, "vector": gets, "added": added },
    })
}

fn list(near: &[Neighbour<'_>]) -> String {
    let names: Vec<String> = near.iter().map(|n| clean(&n.material.name)).collect();
    let width = names.iter().map(|n| n.chars().count()).max().unwrap_or(0).max(7);
    let mut out = format!("{:width$}  distance\n", "nearest");
    for (Neighbour { material, distance }, name) in near.iter().zip(names) {
        let family = material.family.as_deref().map(|f| format!("  {}", clean(f))).unwrap_or_default();
        out += &format!("{name:width$}  {distance:8.4}{family}\n");
    }
    out
}

/// Adds a material to the file as it is now, or nothing.
fn add(library: &Path, material: &LibraryMaterial) -> Result<(), Failure> {
    // Held until it is written, so that no other process adds to the text that was read.
    let _held = hold(&resolved(library))?;
    let text = Library::insert(&Source::read(library)?, material)?;
    // Reading removes a byte order mark. Writing restores it.
    let bytes = file::read(library, MAX_TEXT_BYTES)?;
    let mark = if bytes.starts_with("\u{feff}".as_bytes()) { "\u{feff}" } else { "" };
    write_text(library, &format!("{mark}{text}"))
}

/// Waits until no other process holds a library, and holds it until the answer is dropped.
fn hold(library: &Path) -> Result<File, Failure> {
    let fail = |e: std::io::Error| Failure::Machine(format!("cannot hold {}: {e}", library.display()));
    // Windows opens no folder, and a file that is locked cannot be read there: one beside it is locked.
    let open_beside = || {
        let path = library.with_extension("lock");
        File::options().write(true).create(true).truncate(false).open(path)
    };
    let held = File::open(folder_of(library)).or_else(|_| open_beside()).map_err(fail)?;
    held.lock().map_err(fail)?;
    Ok(held)
}

/// A picture's path for the library: from its folder, with `/`; from the root if they share no folder.
fn beside(library: &Path, image: &Path) -> Result<String, Failure> {
    let whole = |path: &Path| {
        path.canonicalize().map_err(|e| Diagnostic::new(format!("cannot find this file: {e}")).in_file(path))
    };
    // Paths start at the folder of the name that was given, also where that is a link.
    let (folder, image) = (whole(folder_of(library))?, whole(image)?);
    let shared = folder.components().zip(image.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    let path = match shared {
        0 => image.clone(),
        _ => up.chain(image.components().skip(shared)).collect::<PathBuf>(),
    };
    let text = path.to_str().ok_or_else(|| {
        Diagnostic::new("this picture's path is not UTF-8, and cannot stand in a library").in_file(&image)
    })?;
    Ok(if cfg!(windows) { text.replace('\\', "/") } else { text.to_owned() })
}
