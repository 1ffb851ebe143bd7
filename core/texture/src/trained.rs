//! Facts of a network's training, as its file tells them.

use crate::onnx::StringStringEntryProto;
use asperity_diagnostics::Diagnostic;
use std::path::Path;

/// Kind of magnitudes that a texture network answers, where a texture is random.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Target {
    /// Root mean square magnitudes: `target` of the file's `metadata_props` is `rms`, or not there.
    #[default]
    RootMeanSquare,
    /// Mean magnitudes: `target` is `mean`.
    Mean,
}

impl Target {
    pub(crate) fn read(entries: &[StringStringEntryProto], path: &Path) -> Result<Self, Diagnostic> {
        let Some(entry) = entries.iter().find(|e| e.key == "target") else { return Ok(Self::default()) };
        match entry.value.as_str() {
            "rms" => Ok(Self::RootMeanSquare),
            "mean" => Ok(Self::Mean),
            _ => Err(Diagnostic::new(format!("this model's `target` is \"{}\"", beginning(&entry.value)))
                .in_file(path)
                .help("rms or mean")),
        }
    }
}

/// The beginning of a value, for errors.
fn beginning(value: &str) -> String {
    value.chars().take(40).flat_map(char::escape_default).collect()
}

/// The range that a texture network was trained on; what its file does not say is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trained {
    /// Largest normal force in N: `force_max_n` of the file's `metadata_props`.
    pub force_max_n: Option<f64>,
    /// Largest speed in mm/s, in any direction: `speed_max_mm_s`.
    pub speed_max_mm_s: Option<f64>,
}

impl Trained {
    pub(crate) fn read(entries: &[StringStringEntryProto], path: &Path) -> Result<Self, Diagnostic> {
        let most = |key: &str| -> Result<Option<f64>, Diagnostic> {
            let Some(entry) = entries.iter().find(|e| e.key == key) else { return Ok(None) };
            let number = entry.value.trim().parse::<f64>().ok();
            match number.filter(|x| *x > 0.0 && *x <= f64::from(f32::MAX)) {
                Some(x) => Ok(Some(x)),
                None => {
                    let found = beginning(&entry.value);
                    Err(Diagnostic::new(format!("this model's `{key}` is \"{found}\""))
                        .in_file(path)
                        .help("a number above 0, such as 3.5"))
                }
            }
        };
        Ok(Self { force_max_n: most("force_max_n")?, speed_max_mm_s: most("speed_max_mm_s")? })
    }
}
