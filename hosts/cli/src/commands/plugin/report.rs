//! The results of a check: a table row by row, or JSON at the end.

use std::path::Path;
use std::process::ExitCode;

use asperity_checks::node_cases;
use serde_json::{Value, json};

use crate::failure::{Failure, print};

/// The result of a case for a kind.
#[derive(Clone, Debug)]
pub struct Row {
    pub kind: String,
    pub case: String,
    pub verdict: String,
    pub found: String,
    /// The whole answer, with its figures.
    pub figures: Value,
}

impl Row {
    pub fn new(kind: String, case: String, verdict: &str, found: String) -> Self {
        Self { kind, case, verdict: verdict.to_owned(), found, figures: Value::Null }
    }
}

/// All rows so far.
pub struct Report {
    json: bool,
    plugin: Option<Value>,
    kind_width: usize,
    rows: Vec<Row>,
}

impl Report {
    pub fn new(json: bool) -> Self {
        Self { json, plugin: None, kind_width: 4, rows: Vec::new() }
    }

    /// Whether the plugin has been loaded.
    pub fn is_open(&self) -> bool {
        self.plugin.is_some()
    }

    /// Prints the heading when the plugin is first loaded.
    pub fn open(&mut self, plugin: &Value) -> Result<(), Failure> {
        if self.plugin.is_some() {
            return Ok(());
        }
        let text = |name: &str| plugin[name].as_str().unwrap_or_default();
        let kinds = plugin["kinds"].as_array().map(Vec::as_slice).unwrap_or_default();
        self.kind_width = kinds.iter().filter_map(Value::as_str).map(str::len).max().unwrap_or(0).max(4);
        self.plugin = Some(plugin.clone());
        if self.json {
            return Ok(());
        }
        print(&format!(
            "{} {}\n\n{}",
            text("name"),
            text("version"),
            self.line("kind", "case", "verdict", "found")
        ))
    }

    fn line(&self, kind: &str, case: &str, verdict: &str, found: &str) -> String {
        let cases = node_cases().iter().map(|c| c.name.len()).max().unwrap_or(0);
        let text = format!("{kind:width$}  {case:cases$}  {verdict:14}  {found}", width = self.kind_width);
        format!("{}\n", text.trim_end())
    }

    /// Adds a row.
    pub fn row(&mut self, row: &Row) -> Result<(), Failure> {
        self.rows.push(row.clone());
        if self.json {
            return Ok(());
        }
        print(&self.line(&row.kind, &row.case, &row.verdict, &row.found))
    }

    /// The rows of a case.
    pub fn rows_of(&self, case: &str) -> Vec<Row> {
        self.rows.iter().filter(|r| r.case == case).cloned().collect()
    }

    fn count(&self, verdict: &str) -> usize {
        self.rows.iter().filter(|r| r.verdict == verdict).count()
    }

    /// Prints the summary. Answers the exit code.
    pub fn finish(&self, path: &Path, ticks: u64) -> Result<ExitCode, Failure> {
        let (passed, failed) = (self.count("pass"), self.count("fail"));
        if self.json {
            let rows: Vec<Value> = self.rows.iter().map(as_json).collect();
            let plugin = self.plugin.clone().unwrap_or_default();
            let all = json!({
                "file": path.display().to_string(), "name": plugin["name"], "version": plugin["version"],
                "heap_counted": plugin["heap"], "random_ticks": ticks,
                "verdict": if failed == 0 { "pass" } else { "fail" }, "cases": rows,
            });
            print(&format!("{all:#}\n"))?;
        } else {
            let other = self.count("not applicable");
            print(&format!("\n{passed} passed, {failed} failed, {other} not applicable\n"))?;
        }
        Ok(if failed == 0 { ExitCode::SUCCESS } else { ExitCode::from(1) })
    }
}

fn as_json(row: &Row) -> Value {
    let about = node_cases().iter().find(|c| c.name == row.case).map(|c| format!("{}: {}", c.hard, c.must));
    let mut out = json!({
        "kind": row.kind, "case": row.case, "about": about, "verdict": row.verdict, "found": row.found,
    });
    if let (Some(out), Some(figures)) = (out.as_object_mut(), row.figures.as_object()) {
        figures.iter().for_each(|(name, value)| drop(out.insert(name.clone(), value.clone())));
    }
    out
}
