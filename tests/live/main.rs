//! Everything that plays in real time, or needs an audio server or a browser.
//!
//! Each test holds `harness::alone::real_time()` where others would disturb it (`servers::inside` and
//! `alone::apart` take it), and `beside_others()` where it can bear them.
#![allow(unreachable_pub, reason = "a test program has no outside")]

mod audio;
mod calibrate;
mod coil;
mod control;
mod driver;
mod ear;
mod edit;
mod edits;
mod ends;
mod feel;
mod hand;
mod hands;
mod haply;
mod jack_server;
mod limits;
mod long;
mod options;
mod page;
mod page_server;
mod pen;
mod pictures;
mod played;
mod pulse_server;
mod recorded;
mod scene;
mod simulated;
mod socket;
mod study;
mod study_people;
mod study_screens;
mod watch;

/// Counts allocations: `long` and `driver` ask it.
#[global_allocator]
static ALLOCATOR: harness::counting::Counting = harness::counting::Counting;
