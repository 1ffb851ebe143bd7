#![no_main]

#[path = "one.rs"]
mod one;

libfuzzer_sys::fuzz_target!(init: one::prepare(), |bytes: &[u8]| one::read("npz", bytes));
