//! Plugins for the tests, built when first asked for.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::root;

/// Where the tests' plugins lie.
pub fn sources() -> PathBuf {
    root().join("tests/plugins")
}

/// Runs a command that must succeed.
pub fn must(command: &mut Command) {
    let out = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    assert!(out.status.success(), "{command:?}:\n{}", String::from_utf8_lossy(&out.stderr));
}

/// Compiles a C or C++ file with plain cc into `to`.
pub fn compile(source: &Path, to: &Path, flags: &[&str]) {
    let cpp = source.extension().is_some_and(|e| e == "cpp");
    let (compiler, standard) = if cpp { ("c++", "-std=c++11") } else { ("cc", "-std=c99") };
    let include = root().join("core/abi/include");
    must(
        Command::new(compiler)
            .args([standard, "-O1", "-Wall", "-Wextra", "-Werror", "-fPIC", "-fvisibility=hidden", "-I"])
            .arg(include)
            .args(flags)
            .args(["-shared", "-o"])
            .arg(to)
            .arg(source)
            .arg("-lm"),
    );
}

/// A plugin of the tests in C, by its name, compiled once a test program.
pub fn c(name: &str) -> PathBuf {
    static DIR: OnceLock<tempfile::TempDir> = OnceLock::new();
    let dir = DIR.get_or_init(|| tempfile::tempdir().expect("a folder")).path();
    let to = dir.join(format!("lib{name}.so"));
    static ONE: std::sync::Mutex<()> = std::sync::Mutex::new(());
    let _one = ONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if !to.exists() {
        compile(&sources().join(format!("{name}.c")), &to, &[]);
    }
    to
}

/// The tests' plugin `node.c`, broken in one way or, by `NOTHING`, not at all.
pub fn broken(dir: &Path, how: &str) -> PathBuf {
    let to = dir.join(format!("{}{}", how.to_lowercase(), std::env::consts::DLL_SUFFIX));
    compile(&sources().join("node.c"), &to, &[&format!("-DBREAK={how}"), "-std=c11"]);
    to
}

/// The template `like`/`name` in C and C++.
pub fn templates(dir: &Path, like: &str, name: &str) -> [PathBuf; 2] {
    ["c", "cpp"].map(|language| {
        let to = dir.join(format!("{name}_{language}.so"));
        compile(&root().join(format!("plugins/template/{like}/{language}/{name}.{language}")), &to, &[]);
        to
    })
}

/// Packages of this workspace that are plugins in Rust, and what their libraries are called.
const RUST: [(&str, &str); 6] = [
    ("my_phase", "my_phase"),
    ("my_filter", "my_filter"),
    ("my_effect", "my_effect"),
    ("asperity-rtpghi", "rtpghi"),
    ("asperity-gsrtisi-la", "gsrtisi_la"),
    ("asperity-test-panics", "asperity_test_panics"),
];

/// A plugin of this workspace in Rust, by its package, built by cargo into the folder of the program itself.
pub fn rust(package: &str) -> PathBuf {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    let folder = BUILT.get_or_init(|| {
        let program = crate::program();
        let folder = program.parent().expect("a folder").to_owned();
        let mut cargo = Command::new(env!("CARGO"));
        cargo.current_dir(root()).arg("build").env("CARGO_TARGET_DIR", folder.parent().expect("a folder"));
        for (package, _) in RUST {
            cargo.args(["-p", package]);
        }
        if folder.ends_with("release") {
            cargo.arg("--release");
        }
        must(&mut cargo);
        folder
    });
    let library = RUST.iter().find(|(p, _)| *p == package).expect("a package that is a plugin").1;
    folder.join(asperity_loader::file_name(library))
}
