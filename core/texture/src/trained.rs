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

/// The range that a texture network was trained on; what its file does not say is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Trained {
    /// Largest normal force in N: `force_max_n` of the file's `metadata_props`.
    pub force_max_n: Option<f64>,
    /// Largest speed in mm/s, in any direction: `speed_max_mm_s`.
    pub speed_max_mm_s: Option<f64>,
}

/// Reads the range and the target.
pub(crate) fn read(entries: &[StringStringEntryProto], path: &Path) -> Result<(Trained, Target), Diagnostic> {
    let most = |text: &str| text.trim().parse().ok().filter(|x| *x > 0.0 && *x <= f64::from(f32::MAX));
    let number = |key| fact(entries, path, key, "a number above 0, such as 3.5", most);
    let trained = Trained { force_max_n: number("force_max_n")?, speed_max_mm_s: number("speed_max_mm_s")? };
    let target = |text: &str| match text {
        "rms" => Some(Target::RootMeanSquare),
        "mean" => Some(Target::Mean),
        _ => None,
    };
    Ok((trained, fact(entries, path, "target", "rms or mean", target)?.unwrap_or_default()))
}

/// The value of a key, if there is one.
fn fact<T>(
    entries: &[StringStringEntryProto],
    path: &Path,
    key: &str,
    wanted: &str,
    parse: impl Fn(&str) -> Option<T>,
) -> Result<Option<T>, Diagnostic> {
    let Some(entry) = entries.iter().find(|e| e.key == key) else { return Ok(None) };
    let found = parse(&entry.value).ok_or_else(|| {
        let beginning: String = entry.value.chars().take(40).flat_map(char::escape_default).collect();
        Diagnostic::new(format!("this model's `{key}` is \"{beginning}\"")).in_file(path).help(wanted)
    })?;
    Ok(Some(found))
}
