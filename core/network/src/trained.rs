//! The range that a network was trained on, as its file tells it.

use asperity_source::Diagnostic;
use std::path::Path;
use tract_onnx::pb::StringStringEntryProto;

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
                    let found: String = entry.value.chars().take(40).flat_map(char::escape_default).collect();
                    Err(Diagnostic::new(format!("this model's `{key}` is \"{found}\""))
                        .in_file(path)
                        .help("a number above 0, such as 3.5"))
                }
            }
        };
        Ok(Self { force_max_n: most("force_max_n")?, speed_max_mm_s: most("speed_max_mm_s")? })
    }
}
