//! Reading a trajectory from a CSV file.

use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source};

use super::trajectory::slopes;
use super::{AxisMap, Column, ColumnMap, Interpolation, Table, Trajectory};

/// Stiffness of the floor on which a recorded force becomes a depth, in N/mm: that of the shipped graphs.
pub const STIFFNESS_N_PER_MM: f64 = 0.5;
/// Gap between rows that is accepted at any rate, in seconds.
pub const DEFAULT_MAX_GAP_S: f64 = 0.1;
/// Gap between rows that is accepted in a slow recording, in median steps.
const MAX_GAP_STEPS: f64 = 5.0;

/// Options of reading a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrajectoryOptions {
    /// Columns of the file that do not go by their own names.
    pub columns: ColumnMap,
    /// Axes of the file.
    pub axes: AxisMap,
    /// Longest time between two rows, in seconds. The default is [`DEFAULT_MAX_GAP_S`] or five median steps,
    /// whichever is longer. A device that reports only while it moves needs a larger value.
    pub max_gap_s: Option<f64>,
    /// Interpolation of positions between rows.
    pub interpolation: Interpolation,
}

const TIME: usize = 0;
const X: usize = 1;
const Y: usize = 2;
const Z: usize = 3;
const FORCE: usize = 4;
const SPEED: usize = 5;
const STROKE: usize = 6;
const COLUMNS: [Column; 7] =
    [Column::TIME, Column::X, Column::Y, Column::Z, Column::FORCE, Column::SPEED, Column::STROKE];
const HEADER_HELP: &str = "the first line names the columns: `t_s,x_mm,y_mm,z_mm`, and where recorded \
    `force_n`, `speed_mm_s`, `stroke`";

impl Trajectory {
    /// Reads a file; see [`parse`](Self::parse). Error: as [`Source::read`] and [`parse`](Self::parse).
    pub fn read(path: impl AsRef<Path>, options: &TrajectoryOptions) -> Result<Self, Diagnostic> {
        Self::parse(&Source::read(path)?, options)
    }

    /// Reads a text as a [`Table`]. Its columns are `t_s` \[s\], `x_mm`, `y_mm`, `z_mm` \[mm\] and, where
    /// recorded, `force_n` \[N\], `speed_mm_s` \[mm/s\] and `stroke`. There is a row for each moment, at any
    /// rate, also irregular. Where the number of the `stroke` changes, the stylus was put down elsewhere: it
    /// stays until then, however long that is.
    ///
    /// Two assumptions replace places that were not recorded:
    ///
    /// - Without `z_mm`, the force presses into a floor of [`STIFFNESS_N_PER_MM`] at z = 0. A force below 0
    ///   counts as 0.
    /// - Without `x_mm` and `y_mm`, the stylus moves along x at `speed_mm_s` and never turns. The speed
    ///   changes linearly between rows.
    ///
    /// # Errors
    /// Each points at the cell: those of [`Table`]; a missing column; a value beyond the limits of its
    /// [`Column`]; a clock that stands still or goes back; a gap longer than `options.max_gap_s`; fewer than
    /// two rows.
    pub fn parse(source: &Arc<Source>, options: &TrajectoryOptions) -> Result<Self, Diagnostic> {
        let mut table = Table::open(source, &COLUMNS, &options.columns, HEADER_HELP)?;
        check(&table)?;
        let (has_place, has_z) = (table.has(X), table.has(Z));
        let [mut force, mut speed, mut stroke] =
            [FORCE, SPEED, STROKE].map(|column| table.has(column).then(Vec::<f64>::new));
        let (mut time, mut position, mut clock) = (Vec::<f64>::new(), Vec::new(), Vec::new());
        let (mut way_mm, mut speed_before) = (0.0, 0.0);
        let mut row = [0.0; COLUMNS.len()];
        while let Some(span) = table.next_row(&mut row)? {
            let [t, mut x, y, mut z, f, v, number] = row;
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
            if !has_place {
                let step = time.last().map_or(0.0, |before| t - before);
                way_mm += 0.5 * step * (speed_before + v);
                (x, speed_before) = (way_mm, v);
            }
            if !has_z {
                z = -f.max(0.0) / STIFFNESS_N_PER_MM;
            }
            time.push(t);
            clock.push(span);
            position.push(options.axes.apply([x, y, z]));
            force.iter_mut().for_each(|column| column.push(f));
            speed.iter_mut().for_each(|column| column.push(v));
            stroke.iter_mut().for_each(|column| column.push(number));
        }
        let presses = |column: &Vec<f64>| column.iter().any(|f| *f > 0.0) || column.iter().all(|f| *f == 0.0);
        if !force.as_ref().is_none_or(presses) {
            return Err(Diagnostic::new("`force_n` is nowhere positive")
                .at(source, table.end())
                .help("a force that presses is positive; turn the sign round: `--map force_n=-force_n`"));
        }
        if time.len() < 2 {
            let found = if time.is_empty() { "no rows" } else { "only one row" };
            return Err(Diagnostic::new(format!("a trajectory with {found}"))
                .at(source, table.end())
                .help("a stroke has two rows at least"));
        }
        let median_step_s = median_step(&time);
        let max_gap_s = options.max_gap_s.unwrap_or(DEFAULT_MAX_GAP_S.max(MAX_GAP_STEPS * median_step_s));
        let lifts = |i: usize| stroke.as_ref().is_some_and(|number| number[i] != number[i + 1]);
        let is_gap = |&i: &usize| time[i + 1] - time[i] > max_gap_s && !lifts(i);
        if let Some(i) = (0..time.len() - 1).find(is_gap) {
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
        Ok(Self { time, position, slope, force, speed, stroke, repeats: false, ignored: table.ignored() })
    }
}

/// Checks that the columns make a trajectory.
fn check(table: &Table<'_>) -> Result<(), Diagnostic> {
    let (place, is_placed) = ([X, Y], table.has(X) || table.has(Y));
    let mut missing: Vec<usize> = [TIME].into_iter().filter(|column| !table.has(*column)).collect();
    let mut help = Vec::new();
    if is_placed || !table.has(SPEED) {
        missing.extend(place.into_iter().filter(|column| !table.has(*column)));
    }
    if !is_placed && !table.has(SPEED) {
        help.push("`speed_mm_s` alone is a straight line");
    }
    if !table.has(Z) && !table.has(FORCE) {
        missing.push(Z);
        help.push("`force_n` may stand for `z_mm`");
    }
    let names: Vec<String> = missing.iter().map(|column| format!("`{}`", COLUMNS[*column].name)).collect();
    let what = match &names[..] {
        [] => return Ok(()),
        [one] => format!("the column {one} is missing"),
        [several @ .., last] => format!("the columns {} and {last} are missing", several.join(", ")),
    };
    Err(table.lacks(what, &missing, &help.join("; ")))
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
