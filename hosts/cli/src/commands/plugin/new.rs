//! `asperity plugin new`: a folder with a plugin that builds, to be changed.

use std::path::Path;
use std::{fs, io};

use asperity_diagnostics::Diagnostic;
use asperity_loader::file_name;
use clap::ValueEnum;
use include_dir::{Dir, include_dir};

use crate::failure::{Failure, print, wrong};
use crate::kinds;
use crate::phase::OFFLINE;
use crate::shipped::files;

/// Languages of a plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Lang {
    /// Rust, with the SDK
    Rust,
    /// C, with the header
    C,
    /// C++, with the header
    Cpp,
}

/// Templates of a plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Like {
    /// A phase-retrieval node: magnitudes in, spectra out
    Phase,
    /// A filter: audio in, audio out
    Audio,
    /// An effect of surfaces, for scenes
    Effect,
}

/// Make a folder with a plugin that builds, ready to edit
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity plugin new mine",
    "asperity plugin new mine --lang c --like audio",
]))]
pub struct Args {
    /// Folder to make. Its last part names the plugin and its kind of node
    pub name: String,
    /// Language
    #[arg(long, value_enum, default_value = "rust")]
    pub lang: Lang,
    /// Template
    #[arg(long, value_enum, default_value = "phase")]
    pub like: Like,
}

static TEMPLATES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../plugins/template");
static HEADER: &str = include_str!("../../../../../core/abi/include/asperity_plugin.h");

static SDK: [(&str, Dir<'_>); 6] = [
    ("core/abi", include_dir!("$CARGO_MANIFEST_DIR/../../core/abi")),
    ("core/node", include_dir!("$CARGO_MANIFEST_DIR/../../core/node")),
    ("core/diagnostics", include_dir!("$CARGO_MANIFEST_DIR/../../core/diagnostics")),
    ("core/numbers", include_dir!("$CARGO_MANIFEST_DIR/../../core/numbers")),
    ("core/state", include_dir!("$CARGO_MANIFEST_DIR/../../core/state")),
    ("plugins/sdk", include_dir!("$CARGO_MANIFEST_DIR/../../plugins/sdk")),
];

/// Names that a crate, a variable or a library cannot have.
const RESERVED: &str = r"
    abstract alloc as asperity asperity_abi asperity_node asperity_sdk asperity_diagnostics
    asperity_numbers asperity_state async await become box break build c const continue core crate
    default deps do dyn else enum examples extern false final fn for gen if impl in incremental let
    loop m macro match mod move mut override priv proc_macro pthread pub ref return self static std
    stdc struct super test trait true try type typeof union unsafe unsized use virtual where while
    yield";

pub fn run(args: &Args) -> Result<(), Failure> {
    let name = checked(&args.name)?;
    let folder = Path::new(&args.name);
    if folder.exists() {
        return Err(wrong(folder, "this is there already", "name another folder"));
    }
    // Made beside its place and moved there at the end, so that the folder is complete or missing.
    let parent = folder.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let cannot = |e: io::Error| {
        Failure::from(Diagnostic::new(format!("cannot make this folder: {e}")).in_file(folder))
    };
    let part = tempfile::Builder::new().prefix(&format!(".{name}.")).suffix(".part").tempdir_in(parent);
    let made = part.map_err(cannot)?;
    let failed = |e: io::Error| Failure::writing(folder, e);
    let library = write(name, args, made.path()).map_err(failed)?;
    open_to_others(made.path()).map_err(failed)?;
    fs::rename(made.path(), folder).map_err(failed)?;
    let _ = made.keep();
    let build = if args.lang == Lang::Rust { "cargo build --release" } else { "make" };
    let compare = match args.like {
        Like::Phase => format!("    asperity compare --plugin {library}\n"),
        Like::Audio | Like::Effect => String::new(),
    };
    let folder = folder.display();
    print(&format!(
        "made {folder}: a plugin with the kind `{name}`. Next:\n\n    cd {folder}\n    {build}\n    \
         asperity plugin check {library}\n{compare}"
    ))
}

/// The last part of the path, as the name of a crate and a kind.
fn checked(path: &str) -> Result<&str, Diagnostic> {
    let name = Path::new(path).file_name().and_then(|n| n.to_str()).unwrap_or("");
    let good = name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && name.len() <= 64;
    if !good {
        return Err(Diagnostic::new(format!("`{name}` cannot be the name of a plugin")).help(
            "lower-case letters, digits and `_`, beginning with a letter: \
                 it is the kind's name in graph files",
        ));
    }
    if RESERVED.split_whitespace().any(|word| word == name) {
        return Err(Diagnostic::new(format!("`{name}` means something in Rust, C or C++ already"))
            .help("choose another name"));
    }
    if OFFLINE.contains(&name) || kinds::built_in().get(name).is_some() {
        return Err(Diagnostic::new(format!("there is a built-in kind `{name}`")).help("choose another name"));
    }
    Ok(name)
}

fn template(path: &str) -> io::Result<&'static str> {
    let file = TEMPLATES.get_file(path).and_then(|f| f.contents_utf8());
    file.ok_or_else(|| io::Error::other(format!("the template {path} is missing")))
}

/// Writes the folder and answers where the library will be in it.
fn write(name: &str, args: &Args, to: &Path) -> io::Result<String> {
    let (like, snake, camel) = match args.like {
        Like::Phase => ("phase", "my_phase", "MyPhase"),
        Like::Audio => ("audio", "my_filter", "MyFilter"),
        Like::Effect => ("effect", "my_effect", "MyEffect"),
    };
    let (lang, readme, language) = match args.lang {
        Lang::Rust => ("rust", "README.rust.md", "Rust"),
        Lang::C => ("c", "README.make.md", "C"),
        Lang::Cpp => ("cpp", "README.make.md", "C++"),
    };
    let capital = |word: &str| word[..1].to_ascii_uppercase() + &word[1..];
    let ours: String = name.split('_').filter(|word| !word.is_empty()).map(capital).collect();
    let named = |text: &str| text.replace(snake, name).replace(camel, &ours);
    let folder = format!("{like}/{lang}");
    for file in TEMPLATES.get_dir(&folder).map(files).unwrap_or_default() {
        let path = file.path().to_string_lossy();
        let mut text = named(template(&path)?);
        let path = named(path.trim_start_matches(&folder).trim_start_matches('/'));
        if path == "Cargo.toml" {
            // A workspace of its own, wherever it lies; the SDK's crates have another one.
            text = text.replace("../../../sdk", "sdk/plugins/sdk") + "\n[workspace]\nexclude = [\"sdk\"]\n";
        }
        put(&to.join(path), &text)?;
    }
    let (library, source, ignored) = match args.lang {
        Lang::Rust => {
            sdk(&to.join("sdk"))?;
            put(&to.join("Cargo.lock"), &locked(template("rust.lock")?, name))?;
            (format!("target/release/{}", file_name(name)), "src/lib.rs".to_owned(), "/target/\n")
        }
        Lang::C | Lang::Cpp => {
            put(&to.join("asperity_plugin.h"), HEADER)?;
            (format!("./lib{name}.so"), format!("{name}.{lang}"), "*.so\n")
        }
    };
    put(&to.join(".gitignore"), ignored)?;
    let mut text = template(readme)?.replace("my_phase", name);
    match args.like {
        Like::Phase => text += template("README.phase.md")?,
        Like::Audio => {}
        Like::Effect => text += &named(template("README.effect.md")?),
    }
    let text = text
        .replace("target/release/LIBRARY", &library)
        .replace("LIBRARY_PATH", &library)
        .replace("LANGUAGE", language)
        .replace("SOURCE", &source);
    put(&to.join("README.md"), &text)?;
    Ok(library)
}

/// The lock file of the template for a package of another name: cargo sorts packages by name.
fn locked(lock: &str, name: &str) -> String {
    const PACKAGE: &str = "[[package]]\n";
    let mut parts = lock.split(PACKAGE);
    let head = parts.next().unwrap_or_default();
    let mut packages: Vec<String> =
        parts.map(|p| p.trim_end().replace("name = \"my_phase\"", &format!("name = {name:?}"))).collect();
    packages.sort_by_key(|p| p.lines().next().unwrap_or_default().to_owned());
    let packages: Vec<String> = packages.into_iter().map(|p| format!("{PACKAGE}{p}\n")).collect();
    format!("{head}{}", packages.join("\n"))
}

/// Writes the crates of the SDK, without their tests.
fn sdk(to: &Path) -> io::Result<()> {
    put(&to.join("Cargo.toml"), template("sdk.toml")?)?;
    for (folder, dir) in &SDK {
        for file in files(dir) {
            let path = file.path();
            if path.starts_with("src") || path.starts_with("include") || path == Path::new("Cargo.toml") {
                let text = file.contents_utf8().ok_or_else(|| io::Error::other("a source is not text"))?;
                put(&to.join(folder).join(path), text)?;
            }
        }
    }
    Ok(())
}

fn put(path: &Path, text: &str) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    fs::write(path, text)
}

/// Gives a temporary folder, which only its owner may read, the permissions of any other folder.
#[cfg(unix)]
fn open_to_others(path: &Path) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;
    fs::set_permissions(path, fs::Permissions::from_mode(0o755))
}

#[cfg(not(unix))]
fn open_to_others(_: &Path) -> io::Result<()> {
    Ok(())
}
