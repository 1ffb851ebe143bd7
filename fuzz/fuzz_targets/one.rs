//! Shared by all targets: reads one input, in bounded memory and without a panic.

#[path = "../../tests/harness/src/counting.rs"]
#[allow(dead_code, unreachable_pub, reason = "tests ask more of it")]
mod counting;
#[path = "../../tests/stability/readers.rs"]
#[allow(dead_code, reason = "tests ask more of it")]
mod readers;

use std::panic::{self, AssertUnwindSafe};
use std::sync::Mutex;

use asperity_nodes::registry;

/// Counts the bytes that a reader holds.
#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;

/// The folder of the shipped graphs.
const GRAPHS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs");

/// Message of the last panic.
static SAID: Mutex<String> = Mutex::new(String::new());

/// A panic that is caught where it belongs is none: tract's over a malformed model. Any other ends the run.
pub fn prepare() {
    panic::set_hook(Box::new(|info| {
        if let Ok(mut said) = SAID.lock() {
            *said = info.to_string();
        }
    }));
}

/// Reads an input by the reader of this name.
pub fn read(name: &str, bytes: &[u8]) {
    let reader = readers::READERS.iter().find(|reader| reader.name == name).expect("a reader of this name");
    let (done, held) = counting::held(|| panic::catch_unwind(AssertUnwindSafe(|| (reader.read)(bytes))));
    if done.is_err() {
        eprintln!("{name}: {}", SAID.lock().map(|said| said.clone()).unwrap_or_default());
        std::process::abort();
    }
    let most = reader.most(bytes.len());
    if held.most > most {
        eprintln!("{name} held {} bytes for a file of {}; at most {most}", held.most, bytes.len());
        std::process::abort();
    }
}
