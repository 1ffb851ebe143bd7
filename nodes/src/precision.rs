//! The parameter `precision` of nodes whose kernel runs in single or in double precision. Inputs and outputs
//! are in single precision either way.

use crate::prelude::*;

/// The parameter `precision`.
pub(crate) fn precision() -> Param {
    choice("precision", &["f32", "f64"]).doc(
        "Floating-point type of the computation. Inputs and outputs are f32 either way. f64 shows the \
             accuracy lost with f32.",
    )
}

/// Prepares a node in the precision that its parameter says. One precision continues from the state of the
/// other where both write it alike; other states are refused.
pub(crate) fn in_precision(
    setup: &Setup<'_>,
    single: impl FnOnce(&Setup<'_>) -> Result<Prepared, Diagnostic>,
    double: impl FnOnce(&Setup<'_>) -> Result<Prepared, Diagnostic>,
) -> Result<Prepared, Diagnostic> {
    if setup.params.text("precision") == "f64" { double(setup) } else { single(setup) }
}

#[cfg(test)]
#[path = "precision_tests.rs"]
mod tests;
