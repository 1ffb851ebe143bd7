//! Reading a trajectory from a CSV file.

use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source};

use super::trajectory::slopes;
use super::{AxisMap, Column, Interpolation, Table, Trajectory};

/// Largest time in a file, in seconds: room for a Unix time, none for one in milliseconds.
pub const MAX_ABS_TIME_S: f64 = 1e10;
/// Largest position on an axis, in mm: 100 m.
pub const MAX_ABS_POSITION_MM: f64 = 1e5;
/// Largest recorded force, in N. Either sign, since a sensor at rest reads a little below zero.
pub const MAX_ABS_FORCE_N: f64 = 1e3;
/// Largest recorded speed, in mm/s; the least is 0.
pub const MAX_SPEED_MM_S: f64 = 1e5;
/// Gap between rows that is accepted at any rate, in seconds.
pub const DEFAULT_MAX_GAP_S: f64 = 0.1;
/// Gap between rows that is accepted in a slow recording, in median steps.
const MAX_GAP_STEPS: f64 = 5.0;

/// Options of reading a file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrajectoryOptions {
    /// Axes of the file.
    pub axes: AxisMap,
    /// Longest time between two rows, in seconds. The default is [`DEFAULT_MAX_GAP_S`] or five median steps,
    /// whichever is longer. A device that reports only while it moves needs a larger value.
    pub max_gap_s: Option<f64>,
    /// Interpolation of positions between rows.
    pub interpolation: Interpolation,
}

const FORCE: usize = 4;
const SPEED: usize = 5;
/// Columns; all before the force are required.
const COLUMNS: [Column; 6] = [
    Column::within("t_s", MAX_ABS_TIME_S, "s"),
    Column::within("x_mm", MAX_ABS_POSITION_MM, "mm"),
    Column::within("y_mm", MAX_ABS_POSITION_MM, "mm"),
    Column::within("z_mm", MAX_ABS_POSITION_MM, "mm"),
    Column::within("force_n", MAX_ABS_FORCE_N, "N"),
    Column { least: 0.0, ..Column::within("speed_mm_s", MAX_SPEED_MM_S, "mm/s") },
];
const HEADER_HELP: &str =
    "the first line names the columns: `t_s,x_mm,y_mm,z_mm`, and where recorded `force_n`, `speed_mm_s`";

impl Trajectory {
    /// Reads a CSV file; see [`parse`](Self::parse). Error: as [`Source::read`] and [`parse`](Self::parse).
    pub fn read(path: impl AsRef<Path>, options: &TrajectoryOptions) -> Result<Self, Diagnostic> {
        Self::parse(&Source::read(path)?, options)
    }

    /// Reads a CSV text as a [`Table`]. Its columns are `t_s` \[s\], `x_mm`, `y_mm`, `z_mm` \[mm\] and, where
    /// recorded, `force_n` \[N\] and `speed_mm_s` \[mm/s\]. There is a row for each moment, at any rate, also
    /// irregular.
    ///
    /// # Errors
    /// Each points at the cell: those of [`Table`]; a missing column; a value beyond the limits of this
    /// module ([`MAX_ABS_TIME_S`], [`MAX_ABS_POSITION_MM`], [`MAX_ABS_FORCE_N`], 0 to [`MAX_SPEED_MM_S`]); a
    /// clock that stands still or goes back; a gap longer than `options.max_gap_s`; fewer than two rows.
    pub fn parse(source: &Arc<Source>, options: &TrajectoryOptions) -> Result<Self, Diagnostic> {
        let mut table = Table::open(source, &COLUMNS, HEADER_HELP)?;
        if let Some(missing) = (0..FORCE).find(|column| !table.has(*column)) {
            let what = format!("the column `{}` is missing", COLUMNS[missing].name);
            return Err(Diagnostic::new(what).at(source, table.header_end()).help(HEADER_HELP));
        }
        let [mut force, mut speed] = [FORCE, SPEED].map(|column| table.has(column).then(Vec::new));
        let (mut time, mut position, mut clock) = (Vec::<f64>::new(), Vec::new(), Vec::new());
        let mut row = [0.0; COLUMNS.len()];
        while let Some(span) = table.next_row(&mut row)? {
            let [t, x, y, z, f, v] = row;
            if let (Some(&before), Some(&span_before)) = (time.last(), clock.last())
                && t <= before
            {
                let what = if t < before { "goes back" } else { "stands still" };
                return Err(Diagnostic::new(format!("the clock {what}: {t} s after {before} s"))
                    .at(source, span)
                    .label("not later than the row before")
                    .help("`t_s` rises from row to row")
                    .related(source, span_before, "the row before"));
            }
            time.push(t);
            clock.push(span);
            position.push(options.axes.apply([x, y, z]));
            force.iter_mut().for_each(|column| column.push(f));
            speed.iter_mut().for_each(|column| column.push(v));
        }
        if time.len() < 2 {
            let found = if time.is_empty() { "no rows" } else { "only one row" };
            return Err(Diagnostic::new(format!("a trajectory with {found}"))
                .at(source, table.end())
                .help("a stroke has two rows at least"));
        }
        let median_step_s = median_step(&time);
        let max_gap_s = options.max_gap_s.unwrap_or(DEFAULT_MAX_GAP_S.max(MAX_GAP_STEPS * median_step_s));
        if let Some(i) = time.windows(2).position(|w| w[1] - w[0] > max_gap_s) {
            let (before, gap) = (time[i], time[i + 1] - time[i]);
            return Err(Diagnostic::new(format!("a gap of {gap:.4} s after {before} s"))
                .at(source, clock[i + 1])
                .label(format!("later than {:.4} s", before + max_gap_s))
                .help(format!(
                    "rows may lie {max_gap_s:.4} s apart here (the median step is {median_step_s:.4} s); \
                     if the recording is right, allow a longer gap"
                ))
                .related(source, clock[i], "the row before"));
        }
        let start_s = time[0];
        time.iter_mut().for_each(|t| *t -= start_s);
        let slope = match options.interpolation {
            Interpolation::Linear => Vec::new(),
            Interpolation::Cubic => slopes(&time, &position),
        };
        Ok(Self { time, position, slope, force, speed, repeats: false })
    }
}

/// The lower median of the steps of a rising clock with at least two entries.
fn median_step(time: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = (steps.len() - 1) / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
#[path = "read_tests.rs"]
mod tests;
