//! Whatever stands in a file: it is read or refused, without a panic, in bounded time and memory.
//!
//! The corpora are those of the fuzz targets (`fuzz/corpus`), and what fuzzing found stands in them. A file
//! whose name begins with `bad_` is one that is refused; all others are taken.

mod bent;
mod models;
pub(crate) use models::encoder;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

use bent::bent;
use harness::counting::{Held, held};
use harness::root;

use crate::readers::{READERS, Reader};

/// Longest time for one small file on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

fn folder(name: &str) -> PathBuf {
    root().join("fuzz/corpus").join(name)
}

/// Names and bytes of a corpus, in order.
fn corpus(name: &str) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(folder(name)).expect("a corpus");
    let mut all: Vec<_> = entries
        .map(|entry| entry.expect("an entry"))
        .map(|entry| {
            (entry.file_name().to_string_lossy().into_owned(), std::fs::read(entry.path()).expect("a file"))
        })
        .collect();
    all.sort();
    assert!(!all.is_empty(), "the corpus of {name} is empty");
    all
}

/// A corpus, then so many files that were made from it.
fn inputs(name: &str, count: u64) -> Vec<Vec<u8>> {
    let whole: Vec<Vec<u8>> = corpus(name).into_iter().map(|(_, bytes)| bytes).collect();
    let made: Vec<Vec<u8>> = (0..count).map(|seed| bent(&whole, seed)).collect();
    [whole, made].concat()
}

/// Whether a reader comes to an answer about each file within `patience`, without a panic and in the memory
/// that it may hold.
fn endures(reader: Reader, inputs: &[Vec<u8>], patience: Duration) -> Result<(), String> {
    let (answer, answers) = mpsc::channel();
    let files = inputs.to_vec();
    // On another thread, since what hangs cannot be stopped.
    let worker = std::thread::spawn(move || {
        for bytes in &files {
            let (_, Held { most, .. }) = held(|| std::hint::black_box((reader.read)(bytes)));
            if answer.send(most).is_err() {
                return;
            }
        }
    });
    for (i, bytes) in inputs.iter().enumerate() {
        let about = |what: String| Err(format!("{}: file {i} of {} bytes {what}", reader.name, bytes.len()));
        match answers.recv_timeout(patience) {
            Ok(held) if held > reader.most(bytes.len()) => {
                return about(format!("took {held} bytes of memory"));
            }
            Ok(_) => {}
            Err(mpsc::RecvTimeoutError::Timeout) => return about(format!("took longer than {patience:?}")),
            Err(mpsc::RecvTimeoutError::Disconnected) => return about("ended in a panic".into()),
        }
    }
    worker.join().map_err(|_| format!("{}: a panic at the end", reader.name))
}

fn reader(name: &str) -> Reader {
    READERS.into_iter().find(|reader| reader.name == name).expect("a reader of this name")
}

/// A test for each reader: over its corpus, and over so many files that were made from it.
macro_rules! readers {
    ($($test:ident $reader:literal $count:literal),*) => {$(
        #[test]
        fn $test() {
            endures(reader($reader), &inputs($reader, $count), PATIENCE).expect($reader);
        }
    )*};
}

readers! {
    graphs_are_read_or_refused "graph" 600,
    scenes_are_read_or_refused "scene" 400,
    materials_are_read_or_refused "material" 800,
    tables_are_read_or_refused "csv" 800,
    arrays_are_read_or_refused "npy" 2000,
    archives_are_read_or_refused "npz" 1000,
    markup_is_read_or_refused "xml" 1500,
    sounds_are_read_or_refused "wav" 2000,
    experiments_are_read_or_refused "experiment" 800,
    logs_are_read_or_refused "log" 1500,
    networks_are_read_or_refused "onnx" 300
}

/// A corpus is worth something only where it is understood.
#[test]
fn a_file_of_a_corpus_is_taken_unless_it_is_called_bad() {
    for reader in READERS {
        for (name, bytes) in corpus(reader.name) {
            assert_eq!(
                (reader.read)(&bytes),
                !name.starts_with("bad_"),
                "fuzz/corpus/{}/{name}",
                reader.name
            );
        }
    }
}

/// `ASPERITY_WRITE_CORPUS=1` writes them anew.
#[test]
fn the_models_of_the_corpus_are_as_they_are_made() {
    for (name, bytes) in models::all() {
        let path = folder("onnx").join(name);
        if std::env::var_os("ASPERITY_WRITE_CORPUS").is_some() {
            std::fs::write(&path, &bytes).expect("the corpus can be written to");
        }
        assert!(std::fs::read(&path).is_ok_and(|there| there == bytes), "{} is another", path.display());
    }
}

/// The fuzzer's dictionary knows every word of a graph. `ASPERITY_WRITE_CORPUS=1` writes it anew.
#[test]
fn the_fuzzers_dictionary_has_every_kind_and_parameter() {
    let mut words: Vec<String> = Vec::new();
    for kind in harness::registry().iter() {
        let d = kind.descriptor();
        words.push(d.kind.to_string());
        words.extend(d.params.iter().map(|p| p.name.to_string()));
        words.extend(d.inputs.iter().map(|p| p.name.to_string()));
        words.extend(d.outputs.iter().map(|p| p.name.to_string()));
    }
    words.sort();
    words.dedup();
    let text: String = words.iter().map(|word| format!("\"{word}\"\n")).collect();
    let path = root().join("fuzz/words.dict");
    if std::env::var_os("ASPERITY_WRITE_CORPUS").is_some() {
        std::fs::write(&path, &text).expect("the dictionary can be written to");
    }
    assert!(std::fs::read_to_string(&path).is_ok_and(|there| there == text), "{} is another", path.display());
}

/// Mutant: reserves room for as many numbers as the header claims, and only then looks whether they are
/// there.
fn reserves_what_is_claimed(bytes: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(128)]).into_owned();
    let shape = head.split_once("'shape': (").map_or("", |(_, shape)| shape);
    let claimed = shape.split(|c: char| !c.is_ascii_digit()).next().and_then(|n| n.parse::<usize>().ok());
    let room: Vec<f32> = Vec::with_capacity(claimed.unwrap_or(0).min(1 << 28));
    std::hint::black_box(&room).capacity() <= bytes.len()
}

/// Mutant: takes for granted that a row has a third cell.
fn panics_on_a_short_row(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .all(|line| !line.split(',').collect::<Vec<_>>()[2].is_empty())
}

/// Lets the mutant that hangs go.
static LET_GO: AtomicBool = AtomicBool::new(false);

/// Mutant: looks for the end of a tag, and goes on from there, which is nowhere where there is none.
fn hangs_on_an_open_tag(bytes: &[u8]) -> bool {
    let mut at = 0;
    while at < bytes.len() && !LET_GO.load(Ordering::SeqCst) {
        at += match bytes[at] {
            b'<' => bytes[at..].iter().position(|b| *b == b'>').unwrap_or(0),
            _ => 1,
        };
    }
    true
}

#[test]
fn broken_readers_are_found_out() {
    type Read = fn(&[u8]) -> bool;
    let mutants: [(&str, Read, u64, Duration, &str); 3] = [
        ("npy", reserves_what_is_claimed, 2000, PATIENCE, "bytes of memory"),
        ("csv", panics_on_a_short_row, 800, PATIENCE, "panic"),
        ("xml", hangs_on_an_open_tag, 1500, Duration::from_secs(2), "took longer"),
    ];
    for (name, read, count, patience, why) in mutants {
        let found = endures(Reader { read, ..reader(name) }, &inputs(name, count), patience).unwrap_err();
        assert!(found.contains(why), "{name}: {found}");
    }
    LET_GO.store(true, Ordering::SeqCst);
}
