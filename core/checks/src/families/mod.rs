//! All cases, family by family.

mod actuator;
pub mod autoregressive;
mod filters_and_rates;
mod friction;
mod graphs;
mod motion;
mod networks;
mod phase;
mod stiff_walls;

pub use actuator::{Piece, Place, Sound, limited};
pub use graphs::{Became, Drawn, drawn};
pub use phase::decibels;

use std::collections::BTreeMap;

use crate::case::Case;

/// Cases over graphs and over all kinds, family by family.
pub fn cases() -> Vec<&'static Case> {
    let all = [
        stiff_walls::CASES,
        motion::CASES,
        networks::CASES,
        autoregressive::CASES,
        phase::CASES,
        actuator::CASES,
        friction::CASES,
        filters_and_rates::CASES,
        graphs::CASES,
    ];
    all.into_iter().flatten().collect()
}

/// Cases over one kind of node, in the order in which they run.
pub fn node_cases() -> &'static [Case] {
    crate::node::CASES
}

/// The three most frequent of some texts, with their numbers.
fn often(all: &BTreeMap<String, u64>) -> String {
    let mut all: Vec<_> = all.iter().collect();
    all.sort_by(|a, b| b.1.cmp(a.1));
    let all: Vec<String> =
        all.into_iter().take(3).map(|(why, times)| format!("{times} times: {why}")).collect();
    all.join("; ")
}
