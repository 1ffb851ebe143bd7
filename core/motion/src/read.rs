//! Reading a trajectory from a CSV file, strictly.

use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, Span, one_of};

use super::trajectory::Columns;
use super::{AxisMap, Interpolation, Trajectory};

/// Largest time in a file, in seconds: room for a Unix time, none for one in milliseconds.
pub const MAX_ABS_TIME_S: f64 = 1e10;
/// Largest position on an axis, in mm: 100 m.
pub const MAX_ABS_POSITION_MM: f64 = 1e5;
/// Largest recorded force, in N. Either sign, since a sensor at rest reads a little below zero.
pub const MAX_ABS_FORCE_N: f64 = 1e3;
/// Largest recorded speed, in mm/s; the least is 0.
pub const MAX_SPEED_MM_S: f64 = 1e5;
/// The longest gap between rows that is accepted however fast a recording was, in seconds.
pub const DEFAULT_MAX_GAP_S: f64 = 0.1;
/// Rows of a slow recording may lie this many of its median steps apart.
const MAX_GAP_STEPS: f64 = 5.0;

/// How a file is read.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrajectoryOptions {
    /// What the file's axes are.
    pub axes: AxisMap,
    /// Longest time between two rows, in seconds. By default [`DEFAULT_MAX_GAP_S`], or five median steps
    /// where that is longer: a device that reports only while it moves needs a larger value.
    pub max_gap_s: Option<f64>,
    /// How positions between rows are found.
    pub interpolation: Interpolation,
}

/// A column's name, its least and greatest value, and the unit for errors.
struct Column {
    name: &'static str,
    least: f64,
    greatest: f64,
    unit: &'static str,
}

/// Most cells of a line; of each the place is kept.
const MOST_CELLS: usize = 10_000;

const TIME: usize = 0;
const FORCE: usize = 4;
const SPEED: usize = 5;
const REQUIRED: usize = 4;
const COLUMNS: [Column; 6] = [
    Column { name: "t_s", least: -MAX_ABS_TIME_S, greatest: MAX_ABS_TIME_S, unit: "s" },
    Column { name: "x_mm", least: -MAX_ABS_POSITION_MM, greatest: MAX_ABS_POSITION_MM, unit: "mm" },
    Column { name: "y_mm", least: -MAX_ABS_POSITION_MM, greatest: MAX_ABS_POSITION_MM, unit: "mm" },
    Column { name: "z_mm", least: -MAX_ABS_POSITION_MM, greatest: MAX_ABS_POSITION_MM, unit: "mm" },
    Column { name: "force_n", least: -MAX_ABS_FORCE_N, greatest: MAX_ABS_FORCE_N, unit: "N" },
    Column { name: "speed_mm_s", least: 0.0, greatest: MAX_SPEED_MM_S, unit: "mm/s" },
];
const HEADER_HELP: &str =
    "the first line names the columns: `t_s,x_mm,y_mm,z_mm`, and where recorded `force_n`, `speed_mm_s`";

impl Trajectory {
    /// Reads a CSV file; see [`parse`](Self::parse).
    ///
    /// # Errors
    /// As [`Source::read`] and [`parse`](Self::parse).
    pub fn read(path: impl AsRef<Path>, options: &TrajectoryOptions) -> Result<Self, Diagnostic> {
        Self::parse(&Source::read(path)?, options)
    }

    /// Reads a CSV text: a header that names `t_s` \[s\], `x_mm`, `y_mm`, `z_mm` \[mm\] and, where recorded,
    /// `force_n` \[N\] and `speed_mm_s` \[mm/s\], in any order, then one row for each moment, at any rate and
    /// also irregular. Lines that start with `#` and blank lines are skipped; names and numbers may stand
    /// in double quotes.
    ///
    /// # Errors
    /// Each points at the cell: a column that is missing, unknown or there twice; a row with more or fewer
    /// cells than the header; a cell that is not a number, not finite, or beyond the limits of this module
    /// ([`MAX_ABS_TIME_S`], [`MAX_ABS_POSITION_MM`], [`MAX_ABS_FORCE_N`], 0 to [`MAX_SPEED_MM_S`]); a clock
    /// that stands still or goes back; a gap longer than `options.max_gap_s`; fewer than two rows.
    pub fn parse(source: &Arc<Source>, options: &TrajectoryOptions) -> Result<Self, Diagnostic> {
        let columns = read_columns(source, options.max_gap_s)?;
        Ok(Self::from_columns(columns, options.axes, options.interpolation))
    }
}

fn read_columns(source: &Arc<Source>, max_gap_s: Option<f64>) -> Result<Columns, Diagnostic> {
    let mut lines = Lines::new(source.text());
    let end = Span::at(source.text().len());
    let Some(header) = lines.next(source)? else {
        return Err(Diagnostic::new("no header line").at(source, end).help(HEADER_HELP));
    };
    let cell_of = read_header(source, &header)?;

    let (mut time, mut clock_spans) = (Vec::new(), Vec::new());
    let mut position = Vec::new();
    let (mut force, mut speed) = (cell_of[FORCE].map(|_| Vec::new()), cell_of[SPEED].map(|_| Vec::new()));
    while let Some(cells) = lines.next(source)? {
        check_count(source, &header, &cells)?;
        let mut row = [0.0; COLUMNS.len()];
        for ((value, column), cell) in row.iter_mut().zip(&COLUMNS).zip(cell_of) {
            if let Some(cell) = cell.and_then(|i| cells.get(i)) {
                *value = number(source, cell, column)?;
                if column.name == COLUMNS[TIME].name {
                    clock_spans.push(cell.span);
                }
            }
        }
        let [t, x, y, z, f, v] = row;
        if let (Some(&before), [.., span_before, span]) = (time.last(), clock_spans.as_slice())
            && t <= before
        {
            let what = if t < before { "goes back" } else { "stands still" };
            return Err(Diagnostic::new(format!("the clock {what}: {t} s after {before} s"))
                .at(source, *span)
                .label("not later than the row before")
                .help("`t_s` rises from row to row")
                .related(source, *span_before, "the row before"));
        }
        time.push(t);
        position.push([x, y, z]);
        if let Some(column) = &mut force {
            column.push(f);
        }
        if let Some(column) = &mut speed {
            column.push(v);
        }
    }
    if time.len() < 2 {
        let found = if time.is_empty() { "no rows" } else { "only one row" };
        return Err(Diagnostic::new(format!("a trajectory with {found}"))
            .at(source, end)
            .help("a stroke has two rows at least"));
    }
    let median_step_s = median_step(&time);
    let max_gap_s = max_gap_s.unwrap_or(DEFAULT_MAX_GAP_S.max(MAX_GAP_STEPS * median_step_s));
    if let Some(i) = time.windows(2).position(|w| w[1] - w[0] > max_gap_s) {
        let (before, gap) = (time[i], time[i + 1] - time[i]);
        return Err(Diagnostic::new(format!("a gap of {gap:.4} s after {before} s"))
            .at(source, clock_spans[i + 1])
            .label(format!("later than {:.4} s", before + max_gap_s))
            .help(format!(
                "rows may lie {max_gap_s:.4} s apart here (the median step is {median_step_s:.4} s); where the recording is right so, allow a longer gap"
            ))
            .related(source, clock_spans[i], "the row before"));
    }
    Ok(Columns { time, position, force, speed, median_step_s })
}

/// The lower median of the steps of a rising clock with two entries at least.
fn median_step(time: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = (steps.len() - 1) / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// For each of [`COLUMNS`] the cell that holds it.
fn read_header(
    source: &Arc<Source>,
    header: &[Cell<'_>],
) -> Result<[Option<usize>; COLUMNS.len()], Diagnostic> {
    let mut cell_of = [None; COLUMNS.len()];
    for (i, cell) in header.iter().enumerate() {
        let Some(column) = COLUMNS.iter().position(|c| c.name == cell.text) else {
            let help = if header.len() == 1 {
                HEADER_HELP.to_owned()
            } else {
                one_of(cell.text, COLUMNS.iter().map(|c| c.name))
            };
            return Err(Diagnostic::new(format!("unknown column `{}`", cell.text))
                .at(source, cell.span)
                .help(help));
        };
        if let Some(first) = cell_of[column].replace(i) {
            return Err(Diagnostic::new(format!("the column `{}` is there twice", cell.text))
                .at(source, cell.span)
                .related(source, header[first].span, "first here"));
        }
    }
    for (column, cell) in COLUMNS.iter().zip(cell_of).take(REQUIRED) {
        if cell.is_none() {
            let end = header.last().map_or(0, |c| c.span.end);
            return Err(Diagnostic::new(format!("the column `{}` is missing", column.name))
                .at(source, Span::at(end))
                .help(HEADER_HELP));
        }
    }
    Ok(cell_of)
}

fn check_count(source: &Arc<Source>, header: &[Cell<'_>], cells: &[Cell<'_>]) -> Result<(), Diagnostic> {
    let (want, found) = (header.len(), cells.len());
    if found == want {
        return Ok(());
    }
    let span = match cells.get(want) {
        Some(extra) => extra.span,
        None => Span::at(cells.last().map_or(0, |c| c.span.end)),
    };
    let many = if found == 1 { "" } else { "s" };
    let mut error =
        Diagnostic::new(format!("a row of {found} cell{many} under a header of {want}")).at(source, span);
    error = match header.get(found) {
        Some(missing) => error.label(format!("no `{}`", missing.text)),
        None => error.label("belongs to no column"),
    };
    Err(error.help("numbers are written with a point and separated by commas"))
}

fn number(source: &Arc<Source>, cell: &Cell<'_>, column: &Column) -> Result<f64, Diagnostic> {
    let Column { name, least, greatest, unit } = column;
    let fail = |what: String| {
        Err(Diagnostic::new(what)
            .at(source, cell.span)
            .help(format!("`{name}` is a number from {least} to {greatest} {unit}")))
    };
    match cell.text.parse::<f64>() {
        Err(_) if cell.text.is_empty() => fail(format!("`{name}` is empty")),
        Err(_) => fail(format!("`{name}` is `{}`, which is not a number", cell.text)),
        Ok(v) if !v.is_finite() && !cell.text.bytes().any(|b| b.is_ascii_digit()) => {
            fail(format!("`{name}` is `{}`, which is not finite", cell.text))
        }
        Ok(v) if v < *least || v > *greatest => fail(format!("`{name}` is `{}`, out of range", cell.text)),
        Ok(v) => Ok(v),
    }
}

/// A cell: its text without spaces and quotes around it, and where that stands.
struct Cell<'a> {
    text: &'a str,
    span: Span,
}

/// The rows of a CSV text, without comments and blank lines.
struct Lines<'a> {
    text: &'a str,
    reader: csv::Reader<&'a [u8]>,
    record: csv::StringRecord,
}

impl<'a> Lines<'a> {
    fn new(text: &'a str) -> Self {
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            // With no quoting a record is its line, byte for byte, which is what gives every cell its place.
            .quoting(false)
            .from_reader(text.as_bytes());
        Self { text, reader, record: csv::StringRecord::new() }
    }

    fn next(&mut self, source: &Arc<Source>) -> Result<Option<Vec<Cell<'a>>>, Diagnostic> {
        loop {
            let fail = |e: csv::Error| Diagnostic::new(format!("not a CSV file: {e}")).in_file(source.path());
            if !self.reader.read_record(&mut self.record).map_err(fail)? {
                return Ok(None);
            }
            // A record's position is where the reader stood, before any comments and blank lines.
            let mut start = self.record.position().map_or(0, |p| p.byte() as usize);
            let bytes = self.text.as_bytes();
            while let Some(b) = bytes.get(start) {
                match b {
                    b'\r' | b'\n' => start += 1,
                    b'#' => start = self.text[start..].find('\n').map_or(self.text.len(), |i| start + i + 1),
                    _ => break,
                }
            }
            if self.record.len() > MOST_CELLS {
                let what = format!("a line of {} cells", self.record.len());
                let help = format!("at most {MOST_CELLS}; {HEADER_HELP}");
                return Err(Diagnostic::new(what).at(source, Span::at(start)).help(help));
            }
            let mut cells = Vec::with_capacity(self.record.len());
            for field in &self.record {
                let raw = self.text.get(start..start + field.len()).unwrap_or_default();
                let left = raw.len() - raw.trim_start().len();
                let mut span = Span { start: start + left, end: start + left + raw.trim().len() };
                let mut text = raw.trim();
                if let Some(inner) = text.strip_prefix('"').and_then(|t| t.strip_suffix('"')) {
                    text = inner.trim();
                    span = Span { start: span.start + 1, end: span.end - 1 };
                }
                cells.push(Cell { text, span });
                start += field.len() + 1;
            }
            let blank = cells.len() == 1 && cells[0].text.is_empty();
            let comment = cells.first().is_some_and(|c| c.text.starts_with('#'));
            if !blank && !comment {
                return Ok(Some(cells));
            }
        }
    }
}

#[cfg(test)]
#[path = "read_tests.rs"]
mod tests;
