//! All cases: one file a family.

mod autoregressive;
mod friction;
mod motion;
mod networks;
mod phase;
mod stiff_walls;

use crate::case::Case;

/// All cases, family by family.
pub fn cases() -> Vec<&'static Case> {
    let all = [
        stiff_walls::CASES,
        motion::CASES,
        networks::CASES,
        autoregressive::CASES,
        phase::CASES,
        friction::CASES,
    ];
    all.into_iter().flatten().collect()
}
