//! All cases: one file a family.

mod motion;

use crate::case::Case;

/// All cases, family by family.
pub fn cases() -> Vec<&'static Case> {
    [motion::CASES].into_iter().flatten().collect()
}
