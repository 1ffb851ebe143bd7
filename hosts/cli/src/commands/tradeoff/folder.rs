//! The folder of a study's results.

use std::path::{Path, PathBuf};

use asperity_source::Diagnostic;
use asperity_study::{Figure, Results};

use crate::failure::Failure;
use crate::output::Pending;

/// The file that other commands read.
const JSON: &str = "results.json";

/// Makes the folder where it is not there.
pub fn make(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|e| {
        Diagnostic::new(format!("cannot make this folder: {}", std::io::Error::from(e.kind())))
            .in_file(folder)
            .into()
    })
}

/// Writes all there is; each file whole or not at all. Answers their names.
pub fn write(folder: &Path, results: &Results) -> Result<Vec<PathBuf>, Failure> {
    let mut written = Vec::new();
    let mut put = |name: &str, text: &str| -> Result<(), Failure> {
        written.push(Pending::create(&folder.join(name))?.keep_text(text)?);
        Ok(())
    };
    for figure in Figure::ALL {
        for (against, svg) in [("time", results.against_time(figure)), ("lag", results.against_lag(figure))] {
            if let Some(svg) = svg {
                put(&Results::picture_name(figure, against), &svg)?;
            }
        }
    }
    put("results.csv", &results.csv())?;
    let json = serde_json::to_string_pretty(results).map_err(|e| Failure::writing(&folder.join(JSON), e))?;
    put(JSON, &format!("{json}\n"))?;
    put("REPORT.md", &results.report())?;
    Ok(written)
}

/// Reads results: a folder, or the file itself.
pub fn read(path: &Path) -> Result<Results, Failure> {
    let file = if path.is_dir() { path.join(JSON) } else { path.to_owned() };
    let refuse = |what: String| Diagnostic::new(what).in_file(&file);
    let text = std::fs::read_to_string(&file).map_err(|e| {
        refuse(format!("cannot read this file: {e}")).help("a folder that `asperity tradeoff --out` wrote")
    })?;
    parse(&text).map_err(|e| refuse(e).into())
}

/// Results from their text.
pub fn parse(text: &str) -> Result<Results, String> {
    serde_json::from_str(text).map_err(|e| format!("these are no results of `asperity tradeoff`: {e}"))
}
