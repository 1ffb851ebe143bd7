//! Folders, pipes and devices in the place of every file that is read or written.

use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use harness::{Room, asperity, root};

use super::judge::Tally;
use super::mutants::READERS;

/// Makes something in the place of a file.
type Make = fn(&Path);

const SPECIAL: [(&str, Make); 11] = [
    ("a pipe without a writer", |at| {
        assert!(Command::new("mkfifo").arg(at).status().expect("mkfifo").success())
    }),
    ("/dev/zero", |at| symlink("/dev/zero", at).expect("a link")),
    ("/dev/null", |at| symlink("/dev/null", at).expect("a link")),
    ("/dev/tty", |at| symlink("/dev/tty", at).expect("a link")),
    ("/proc/self/mem", |at| symlink("/proc/self/mem", at).expect("a link")),
    ("a folder", |at| fs::create_dir(at).expect("a folder")),
    ("a socket", |at| drop(std::os::unix::net::UnixListener::bind(at).expect("a socket"))),
    ("a link to nothing", |at| symlink("nothing", at).expect("a link")),
    ("a link to itself", |at| symlink(at, at).expect("a link")),
    ("an empty file", |at| drop(File::create(at).expect("a file"))),
    ("8 GiB of nothing", |at| File::create(at).and_then(|f| f.set_len(8 << 30)).expect("a file")),
];

#[test]
fn what_is_no_file_is_refused_by_every_reader() {
    let tally = Tally::new("special files, read");
    for reader in &READERS {
        for (what, make) in SPECIAL {
            let dir = Room::new();
            make(&dir.join(reader.name));
            let mut program = asperity(&dir);
            program.args(reader.args());
            tally.case(&format!("{what} as {}", reader.name), dir, program, &reader.outputs());
        }
    }
    tally.done();
}

#[test]
fn what_is_no_file_is_not_written_over() {
    let tally = Tally::new("special files, written");
    let data = root().join("tests/data");
    let data = data.display();
    let writers = [
        format!("render {data}/small.ron --seconds 0.05 --out x.wav"),
        format!("render {data}/small.ron --seconds 0.05 --report x.wav"),
        format!("render {data}/small.ron --seconds 0.05 --probe motion.speed=x.npy"),
        format!("graph {data}/small.ron --svg x.wav"),
        format!("invert --magnitudes {data}/phase/texture_2500.mag.npy --rate 2500 --out x.wav"),
    ];
    for writer in &writers {
        // Over a file that is empty or large, and through a link, these may write.
        for (what, make) in
            SPECIAL.iter().filter(|(what, _)| !["an empty file", "8 GiB of nothing"].contains(what))
        {
            let dir = Room::new();
            make(&dir.join(if writer.ends_with("x.npy") { "x.npy" } else { "x.wav" }));
            let mut program = asperity(&dir);
            program.args(writer.split(' '));
            tally.case(&format!("{what}, {writer}"), dir, program, &["nothing"]);
        }
    }
    tally.done();
}
