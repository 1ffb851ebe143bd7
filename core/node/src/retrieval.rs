//! Which kinds retrieve phase.

use crate::{Descriptor, ShapeSpec};

/// How a kind retrieves phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Retrieval<'a> {
    /// Its input of magnitudes.
    pub input: &'a str,
    /// Its output.
    pub output: &'a str,
    /// Whether it answers spectra, so that an `overlap_add` has to follow; else it answers samples.
    pub spectrum: bool,
}

impl Descriptor {
    /// How this kind retrieves phase, if it does: it has exactly one required input, which takes
    /// magnitudes, and one output, which is spectra or samples.
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
