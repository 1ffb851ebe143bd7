//! The folder of results.

use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, Source};
use asperity_tradeoff::{Figure, Results};

use crate::failure::{Failure, wrong};
use crate::output::{Pending, keep_all};

pub const JSON: &str = "results.json";

pub fn make(folder: &Path) -> Result<(), Failure> {
    let fail = |e| Diagnostic::new(format!("cannot make this folder: {e}")).in_file(folder);
    Ok(std::fs::create_dir_all(folder).map_err(fail)?)
}

/// Refuses a folder with the results of another shard, and one that cannot take the files.
pub fn check(folder: &Path, shard: (usize, usize)) -> Result<(), Failure> {
    let files = [JSON, "results.csv", "REPORT.md"].map(|name| folder.join(name));
    if let Some(path) = files.iter().find(|path| path.is_dir()) {
        return Err(Diagnostic::new("this must be a file, and is a folder").in_file(path).into());
    }
    let there = Source::read(folder.join(JSON)).ok().and_then(|text| Results::parse(text.text()).ok());
    let Some(&[(number, of)]) = there.as_ref().map(|results| results.shards.as_slice()) else {
        return Ok(());
    };
    if (number, of) == shard || of.max(shard.1) <= 1 {
        return Ok(());
    }
    let here = if of > 1 { format!("shard {number}/{of}") } else { "a run without shards".into() };
    Err(wrong(
        folder,
        format!("this folder has the results of {here}"),
        "each shard needs its own --out folder",
    ))
}

pub fn has_results(folder: &Path) -> bool {
    folder.join(JSON).is_file()
}

/// The file of results: in a folder, or the path itself.
pub fn file(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(JSON) } else { path.to_owned() }
}

/// Writes all files, or none. Returns their paths.
pub fn write(folder: &Path, results: &Results) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    let mut put = |name: &str, text: &str| -> Result<(), Failure> {
        files.push(Pending::create(&folder.join(name))?.fill(text)?);
        Ok(())
    };
    for figure in Figure::all() {
        for (over, svg) in [("time", results.over_time(figure)), ("lag", results.over_lag(figure))] {
            if let Some(svg) = svg {
                put(&Results::picture_name(figure, over), &svg)?;
            }
        }
    }
    put("results.csv", &results.csv())?;
    let json = serde_json::to_string_pretty(results).map_err(|e| Failure::writing(&folder.join(JSON), e))?;
    put(JSON, &format!("{json}\n"))?;
    put("REPORT.md", &results.report())?;
    keep_all(files)
}

/// Reads results from a folder, or from the file itself.
pub fn read(path: &Path) -> Result<Results, Failure> {
    let file = file(path);
    let text = Source::read(&file).map_err(|e| e.help("a folder that `asperity tradeoff --out` wrote"))?;
    Results::parse(text.text()).map_err(|e| Diagnostic::new(e).in_file(&file).into())
}
