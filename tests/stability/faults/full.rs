//! A disk that is full: an exit code that says so, a message that names the file, and what was there before
//! is kept.

use std::path::Path;
use std::process::Command;

use harness::files;

use super::disk::{BEFORE, Fails, Place, can_fail};
use super::writers::{WRITERS, Writer, mutant};

/// Whether a command that cannot write says so and leaves all as it was.
pub(super) fn endures(writer: &Writer) -> Result<(), String> {
    let undisturbed = Place::new(writer, true).run(writer, Fails::Never);
    let (Some(0), Some((_, bytes @ 1..))) = (undisturbed.code, undisturbed.wrote) else {
        return Err(format!("{}: it fails by itself: {}", writer.name, undisturbed.said));
    };
    // The last part is missed too; but what plays in real time, or reports times, may write less than before.
    let nearly = bytes - (bytes / 50).max(1);
    for room in if writer.live { vec![0, bytes / 2] } else { vec![0, 1, bytes / 3, nearly] } {
        let place = Place::new(writer, true);
        let before = place.now(writer);
        let ended = place.run(writer, Fails::FullAt(room));
        let about = |what: &str| {
            Err(format!("{}, room for {room} of {bytes} bytes: {what}; it said: {}", writer.name, ended.said))
        };
        match ended.code {
            Some(0) => return about("nobody is told"),
            None => return about("a signal ended it"),
            Some(_) => {}
        }
        if !writer.makes.iter().any(|made| ended.said.contains(made.name)) {
            return about("no file is named");
        }
        if let Some(half) = place.half(writer, &before) {
            return about(&half);
        }
        let left = place.left(writer);
        if !left.is_empty() {
            return about(&format!("{left:?} are left"));
        }
    }
    Ok(())
}

/// Mutants: one that ignores a write error, one that does not name the file, one that writes in place, one
/// that does not clear up.
#[test]
fn writers_that_a_full_disk_harms_are_found_out() {
    if !can_fail() {
        return;
    }
    for (line, says) in [
        ("dd if=new of=.out.1.part bs=64 && mv .out.1.part out; rm -f .out.1.part; exit 0", "nobody is told"),
        ("dd if=new of=.t bs=64 2>/dev/null && mv .t out || { rm -f .t; exit 1; }", "no file is named"),
        ("dd if=new of=out bs=64", "out is half"),
        ("dd if=new of=.out.1.part bs=64 && mv .out.1.part out", "are left"),
    ] {
        let found = endures(&mutant(line)).unwrap_err();
        assert!(found.contains(says), "{found}");
    }
    let right =
        mutant("dd if=new of=.out.1.part bs=64 && mv .out.1.part out || { rm -f .out.1.part; exit 1; }");
    endures(&right).unwrap();
}

/// Messages of a render into a folder with room for `kib`, by limits that the system itself keeps.
fn on_a_small_disk(script: &str, dir: &Path) -> (Option<i32>, String) {
    let out = Command::new("sh")
        .args(["-c", script, "sh", env!("CARGO_BIN_EXE_asperity")])
        .current_dir(dir)
        .output()
        .expect("a shell");
    (out.status.code(), String::from_utf8_lossy(&[out.stdout, out.stderr].concat()).into_owned())
}

const RENDER: &str = r#""$1" render g.ron --seconds 0.3 --out o.wav --quiet"#;

const TONE: &str = r#"Graph(version: 1, nodes: {
    "tone": (kind: "sine"), "limiter": (kind: "limiter", params: (profile: "hapcoil_one")),
    "out": (kind: "audio_out"),
}, wires: [("tone", "limiter"), ("limiter", "out")])"#;

/// The system's own limits, so that the disk of the other tests is not all that was tried: the largest file
/// that a process may write.
#[cfg(unix)]
#[test]
fn file_beyond_system_limit_fails_and_keeps_old_file() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("g.ron"), TONE).unwrap();
    std::fs::write(dir.path().join("o.wav"), BEFORE).unwrap();
    let before = files(dir.path());
    let (code, said) = on_a_small_disk(&format!("trap '' XFSZ; ulimit -f 8; {RENDER}"), dir.path());
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("cannot write") && said.contains("o.wav"), "{said}");
    assert_eq!(std::fs::read(dir.path().join("o.wav")).unwrap(), BEFORE);
    assert_eq!(files(dir.path()), before);
}

/// A real disk of 16 KiB, where a user may mount one for himself.
#[cfg(target_os = "linux")]
#[test]
fn a_real_disk_that_is_full_fails_and_keeps_what_was_there() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("g.ron"), TONE).unwrap();
    std::fs::create_dir(dir.path().join("small")).unwrap();
    let inside = format!(
        "mount -t tmpfs -o size=16k none small || exit 77; cp g.ron small; cd small; printf before > \
         o.wav; {RENDER}; code=$?; ls -A > ../left; cp o.wav ../; exit $code"
    );
    let script = format!("unshare --user --map-root-user --mount sh -c '{inside}' sh \"$1\" || exit $?");
    let (code, said) = on_a_small_disk(&script, dir.path());
    if !dir.path().join("left").exists() {
        eprintln!("SKIPPED: no disk can be mounted here: {said}");
        return;
    }
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("cannot write") && said.contains("o.wav"), "{said}");
    assert_eq!(std::fs::read_to_string(dir.path().join("o.wav")).unwrap(), "before");
    assert_eq!(std::fs::read_to_string(dir.path().join("left")).unwrap(), "g.ron\no.wav\n");
}

/// Whether a command whose standard output is full says so.
#[cfg(target_os = "linux")]
fn says_that_nobody_can_read(command: &mut Command) -> Result<(), String> {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("a device that is full");
    let out = command.stdout(full).output().expect("the program starts");
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    match out.status.code() {
        Some(1) if said.contains("standard output") && !said.contains("panicked") => Ok(()),
        code => Err(format!("{command:?} ended with {code:?} and said: {said}")),
    }
}

/// Everything that prints, into a full disk: exit code 1, a line that says so, no panic.
#[cfg(target_os = "linux")]
#[test]
fn a_standard_output_that_is_full_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    (WRITERS[0].prepare)(dir.path());
    let graph = harness::graphs("scenes/side_by_side.ron").display().to_string();
    let library = harness::graphs("models/surfaces/materials.ron").display().to_string();
    for args in [
        &["nodes"][..],
        &["nodes", "--json"],
        &["nodes", "limiter"],
        &["check", "g.ron"],
        &["check", "g.ron", "--json"],
        &["devices"],
        &["materials", "--library", &library],
        &["plugin", "list"],
        &["scene", "expand", &graph],
        &["render", "g.ron", "--seconds", "0.1"],
        &["run", "g.ron", "--device", "simulated:frames=64", "--seconds", "0.1"],
    ] {
        says_that_nobody_can_read(harness::asperity(dir.path()).args(args)).unwrap_or_else(|e| panic!("{e}"));
    }
    // Mutant: one to which it is all one.
    says_that_nobody_can_read(Command::new("sh").args(["-c", "echo x; exit 0"])).unwrap_err();
}
