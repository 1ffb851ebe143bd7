//! Plugins whose file is damaged.

use std::fs;

use harness::{Room, asperity, plugins};

use super::judge::{Seed, Tally, times, two_at_a_time};
use super::mutants::mutated;

#[test]
fn damaged_plugin_ends_no_check() {
    let tally = Tally::new("damaged plugins");
    let right = fs::read(plugins::c("told")).expect("a plugin");
    two_at_a_time(20 * times(), |number| {
        let dir = Room::new();
        let mut seed = Seed(number + 7);
        let mut bytes = right.clone();
        if number % 2 == 0 {
            bytes = mutated(&right, &mut seed);
        } else {
            // Of the same length: it gets further.
            (0..1 + seed.below(40)).for_each(|_| {
                let at = seed.below(bytes.len());
                bytes[at] = seed.next() as u8;
            });
        }
        dir.write("libtold.so", bytes);
        let mut program = asperity(&dir);
        program.args(["plugin", "check", "./libtold.so", "--ticks", "200", "--patience", "3"]);
        program.args(["--case", "prepare", "--case", "zero", "--case", "reset"]);
        tally.case(&format!("{number}"), dir, program, &[]);
    });
    tally.done();
}
