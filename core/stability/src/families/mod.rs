//! All cases: one file a family.

mod autoregressive;
mod motion;
mod networks;
mod phase;

use crate::case::Case;

/// All cases, family by family.
pub fn cases() -> Vec<&'static Case> {
    [motion::CASES, networks::CASES, autoregressive::CASES, phase::CASES].into_iter().flatten().collect()
}
