//! Phase-retrieval kinds.

use crate::{Descriptor, ShapeSpec};

/// Ports of a phase-retrieval kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Retrieval<'a> {
    /// Name of its input of magnitudes.
    pub input: &'a str,
    /// Name of its output.
    pub output: &'a str,
    /// Whether it outputs spectra, so that an `overlap_add` must follow; otherwise it outputs samples.
    pub spectrum: bool,
}

impl Descriptor {
    /// Ports of this kind if it retrieves phase: exactly one required input, of magnitudes, and one
    /// output, of spectra or samples.
    pub fn retrieval(&self) -> Option<Retrieval<'_>> {
        let mut required = self.inputs.iter().filter(|p| !p.optional);
        let (Some(input), None) = (required.next(), required.next()) else { return None };
        let [output] = self.outputs.as_slice() else { return None };
        let spectrum = match output.shape {
            ShapeSpec::Spectrum(_) => true,
            ShapeSpec::Audio(_) => false,
            _ => return None,
        };
        let magnitudes = matches!(input.shape, ShapeSpec::Magnitude(_));
        magnitudes.then_some(Retrieval { input: &input.name, output: &output.name, spectrum })
    }
}
