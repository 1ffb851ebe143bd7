//! The program on a disk that fails: see `disk.c`.

use std::ffi::OsString;
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use super::writers::Writer;

/// Content of a file before the run.
pub(super) const BEFORE: &[u8] = b"what was there before\n";

/// Faults of the disk.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fails {
    /// Nothing.
    Never,
    /// The process is killed at this change of a file, counted from 1.
    KilledAt(u64),
    /// It takes so many bytes.
    FullAt(u64),
}

/// End of a command.
pub(super) struct Ended {
    /// Its exit code; none where a signal ended it.
    pub(super) code: Option<i32>,
    /// Whether it was killed, or as a shell a command of its own.
    pub(super) killed: bool,
    /// Its error output.
    pub(super) said: String,
    /// Changes of files and bytes written, where it came to its end.
    pub(super) wrote: Option<(u64, u64)>,
}

/// The library that is put before the C library's; none where it cannot be.
fn library() -> Option<&'static Path> {
    static LIBRARY: OnceLock<Option<(PathBuf, tempfile::TempDir)>> = OnceLock::new();
    let built = LIBRARY.get_or_init(|| {
        if !cfg!(all(target_os = "linux", target_env = "gnu")) {
            return None;
        }
        let dir = tempfile::tempdir().expect("a folder");
        let library = dir.path().join("disk.so");
        let source = harness::root().join("tests/stability/faults/disk.c");
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror", "-o"]);
        harness::plugins::must(cc.arg(&library).arg(source).arg("-ldl"));
        Some((library, dir))
    });
    built.as_ref().map(|(library, _)| library.as_path())
}

/// A folder with what a command reads, with what was there before or without, and what was in it then.
pub(super) struct Place {
    pub(super) dir: tempfile::TempDir,
    /// Names of what it reads.
    given: Vec<OsString>,
}

impl Place {
    pub(super) fn new(writer: &Writer, with_before: bool) -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(dir.path().join("tmp")).expect("a folder");
        (writer.prepare)(dir.path());
        let given = names(dir.path());
        for made in writer
            .makes
            .iter()
            .filter(|made| with_before && !made.folder && !given.contains(&made.name.into()))
        {
            std::fs::write(dir.path().join(made.name), BEFORE).expect("a file");
        }
        Self { dir, given }
    }

    /// Runs the writer's command here.
    pub(super) fn run(&self, writer: &Writer, fails: Fails) -> Ended {
        let mut command = writer.command(self.dir.path());
        command.current_dir(self.dir.path()).env("TMPDIR", self.dir.path().join("tmp"));
        let says = tempfile::NamedTempFile::new().expect("a file");
        if let Some(library) = library() {
            command.env("LD_PRELOAD", library).env("ASPERITY_DISK_SAYS", says.path());
        }
        match fails {
            Fails::Never => &mut command,
            Fails::KilledAt(n) => command.env("ASPERITY_DISK_KILL", n.to_string()),
            Fails::FullAt(n) => command.env("ASPERITY_DISK_BYTES", n.to_string()),
        };
        let Output { status, stdout, stderr } = command.output().expect("the program starts");
        let said = String::from_utf8_lossy(&[stdout, stderr].concat()).into_owned();
        let text = std::fs::read_to_string(says.path()).unwrap_or_default();
        let number = |column: usize| -> u64 {
            text.lines().filter_map(|line| line.split(' ').nth(column)?.parse::<u64>().ok()).sum()
        };
        let wrote = (!text.is_empty()).then(|| (number(0), number(1)));
        Ended {
            code: status.code(),
            killed: status.signal() == Some(9) || status.code() == Some(128 + 9),
            said,
            wrote,
        }
    }

    /// Where something of what a writer makes is neither as it was before nor whole.
    pub(super) fn half(&self, writer: &Writer, before: &Before) -> Option<String> {
        for (made, before) in writer.makes.iter().zip(&before.0) {
            let path = self.dir.path().join(made.name);
            let now = content(&path);
            let whole = now.as_ref().is_some_and(|_| (made.whole)(&path));
            if now != *before && !whole {
                let size = now.map_or("gone".into(), |now| format!("{} bytes", now.len()));
                return Some(format!("{} is half: {size}", made.name));
            }
        }
        None
    }

    /// Whether some of what a writer makes is new, and some is not.
    pub(super) fn is_mixed(&self, writer: &Writer, before: &Before) -> bool {
        let now = self.now(writer);
        let new = now.0.iter().zip(&before.0).filter(|(now, before)| now != before).count();
        new > 0 && new < now.0.len()
    }

    /// The files of a writer, as they are now.
    pub(super) fn now(&self, writer: &Writer) -> Before {
        Before(writer.makes.iter().map(|made| content(&self.dir.path().join(made.name))).collect())
    }

    /// Names of what is here and was neither given nor asked for; of the folder for what is temporary, with
    /// its path.
    pub(super) fn left(&self, writer: &Writer) -> Vec<String> {
        let asked = |name: &OsString| writer.makes.iter().any(|made| name == made.name);
        let here =
            names(self.dir.path()).into_iter().filter(|name| !self.given.contains(name) && !asked(name));
        let temporary =
            names(&self.dir.path().join("tmp")).into_iter().map(|name| Path::new("tmp").join(name).into());
        here.chain(temporary).map(|name: OsString| name.to_string_lossy().into_owned()).collect()
    }
}

/// Content of a writer's files; none where a file was missing.
#[derive(PartialEq)]
pub(super) struct Before(Vec<Option<Vec<u8>>>);

/// A file's bytes, or for a folder something that is there while it is.
fn content(path: &Path) -> Option<Vec<u8>> {
    if path.is_dir() { Some(Vec::new()) } else { std::fs::read(path).ok() }
}

fn names(dir: &Path) -> Vec<OsString> {
    let mut all: Vec<OsString> =
        std::fs::read_dir(dir).expect("a folder").map(|entry| entry.expect("an entry").file_name()).collect();
    all.sort();
    all
}

/// End of a journal's name: the files that it lists get their names together.
pub(super) const JOURNAL: &str = ".part.renames";

/// Whether a name says of which file or of which program it is what is left, and that it is no whole one.
pub(super) fn is_recognisable(name: &str, writer: &Writer) -> bool {
    let ends = [".part", JOURNAL].iter().any(|end| name.ends_with(end));
    let part =
        |made: &str| (name.starts_with(&format!(".{made}.")) && ends) || name == format!("{made}.recording");
    name.starts_with("tmp/asperity-") || writer.makes.iter().any(|made| part(made.name))
}

/// Whether the disk can be made to fail here; says so where it cannot.
pub(super) fn can_fail() -> bool {
    if library().is_none() {
        eprintln!("SKIPPED: no library can be put before the C library here");
    }
    library().is_some()
}
