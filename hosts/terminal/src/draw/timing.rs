//! Computing time and lateness of ticks, against the deadline.

use std::time::Duration;

use asperity_live::view::TimingView;

use super::pane::{ALARM, BOLD, CURVE, CURVE_2, FAINT, PLAIN, Pane};
use crate::board::Board;
use crate::text::{count, micros, percent, short};

/// Columns of the names before the figures and the bars.
const NAMES: usize = 11;

pub(crate) fn draw(board: &Board, pane: &mut Pane, time: Duration) {
    let timing = &board.view.timing;
    pane.head("timing", &format!("deadline {} us, at ┊", short(timing.deadline_us)));
    let width = pane.width();
    let ends = [1, 2, 3, 4].map(|k| NAMES + k * ((width - NAMES - 1) / 4).min(9));
    for (end, name) in ends.into_iter().zip(["p50", "p99", "p99.9", "max us"]) {
        pane.put_right(end, 1, 8, name, FAINT);
    }
    for (row, name, figures, style) in
        [(2, "late", timing.late_us, CURVE), (3, "computing", timing.compute_us, CURVE_2)]
    {
        pane.put(1, row, NAMES, name, style);
        for (end, us) in ends.into_iter().zip(figures) {
            let late = timing.deadline_us > 0.0 && us > timing.deadline_us;
            let text = format!("{}{}", if late { "!" } else { "" }, micros(us));
            pane.put_right(end, row, 8, &text, if late { ALARM } else { PLAIN });
        }
    }
    draw_misses(board, &mut pane.part(1, 4, width, 1), time);
    let rows = pane.height().saturating_sub(5);
    draw_histogram(timing, &mut pane.part(0, 5, width, rows));
}

fn draw_misses(board: &Board, line: &mut Pane, time: Duration) {
    let timing = &board.view.timing;
    let risen = board.counts[5].risen(time);
    let style = if risen > 0 {
        ALARM
    } else if timing.misses > 0 {
        BOLD
    } else {
        PLAIN
    };
    let share = if board.view.ticks > 0 { timing.misses as f64 / board.view.ticks as f64 } else { 0.0 };
    let misses = format!("{}{}", if risen > 0 { "!" } else { "" }, count(timing.misses));
    let woke = count(timing.woke_late);
    let slow = count(timing.misses.saturating_sub(timing.woke_late));
    let of = format!(" = {} %: ", percent(share));
    let words = [
        ("misses ", FAINT),
        (misses.as_str(), style),
        (&of, PLAIN),
        (&woke, PLAIN),
        (" woke late, ", FAINT),
        (&slow, PLAIN),
        (" slow", FAINT),
    ];
    line.words(0, 0, &words);
}

/// Two histograms above one logarithmic time axis. Heights are logarithmic too: one late tick in a million
/// is visible.
fn draw_histogram(timing: &TimingView, pane: &mut Pane) {
    let Some(axis) = Axis::of(timing, pane.width().saturating_sub(NAMES + 1)) else { return };
    let rows = pane.height().saturating_sub(1);
    let upper = rows.div_ceil(2);
    let width = pane.width();
    let deadline = axis.column(timing.deadline_us);
    let parts =
        [(0, upper, &timing.late_counts, CURVE), (upper, rows - upper, &timing.compute_counts, CURVE_2)];
    for (top, height, counts, style) in parts {
        let mut part = pane.part(NAMES, top, width, height);
        let columns = axis.columns(timing, counts);
        let most = columns.iter().map(|(n, _)| *n).max().unwrap_or(0).max(1) as f64;
        for (column, &(n, late)) in columns.iter().enumerate() {
            let full = height as f64 * 8.0;
            let eighths = if n == 0 { 0.0 } else { ((n as f64).ln_1p() / most.ln_1p() * full).max(1.0) };
            for row in 0..height {
                let here = (eighths.round() as usize).saturating_sub(8 * (height - 1 - row)).min(8);
                let mark = deadline == Some(column);
                let glyph = if mark && here == 0 {
                    "┊"
                } else {
                    ["", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"][here]
                };
                part.put(column, row, 1, glyph, if late || mark { ALARM } else { style });
            }
        }
    }
    for (row, name, style) in [(0, "late", CURVE), (upper, "computing", CURVE_2)] {
        if rows > upper {
            pane.put(1, row, NAMES - 2, name, style);
        }
    }
    axis.label(&mut pane.part(NAMES, rows, width, 1));
}

/// Whole decades of microseconds over some columns.
struct Axis {
    low: i32,
    high: i32,
    width: usize,
}

impl Axis {
    /// From the decade of the fastest tick to that of the slowest, or of the deadline. `None` without bins.
    fn of(timing: &TimingView, width: usize) -> Option<Self> {
        let many = timing.late_counts.len().max(timing.compute_counts.len());
        let edges = &timing.edges_us;
        if width < 12 || many == 0 || edges.is_empty() {
            return None;
        }
        let full = |bin: &usize| {
            let n = |counts: &[u64]| counts.get(*bin).copied().unwrap_or(0);
            n(&timing.late_counts) > 0 || n(&timing.compute_counts) > 0
        };
        let decade = |us: f64| us.log10();
        let edge =
            |bin: usize| edges.get(bin).or(edges.last()).copied().filter(|us| *us > 0.0 && us.is_finite());
        let first = (0..many).find(full).and_then(|bin| edge(bin.saturating_sub(1)));
        let last = (0..many).rev().find(full).and_then(edge);
        let deadline = Some(timing.deadline_us).filter(|us| *us > 0.0 && us.is_finite());
        let ends = || [first, last, deadline].into_iter().flatten().map(decade);
        let low = ends().fold(f64::INFINITY, f64::min);
        let high = ends().fold(f64::NEG_INFINITY, f64::max);
        if low > high {
            return None;
        }
        // Leaves room for ticks later than the deadline.
        let low = (low + 1e-9).floor() as i32;
        let high = ((high + 0.05).ceil() as i32).clamp(low + 1, low + 12);
        Some(Self { low, high, width })
    }

    /// The column of a time; `None` for a time that is not positive and finite.
    fn column(&self, us: f64) -> Option<usize> {
        let place = (us.log10() - f64::from(self.low)) / f64::from(self.high - self.low);
        (us > 0.0 && place.is_finite())
            .then(|| ((place.max(0.0) * self.width as f64) as usize).min(self.width - 1))
    }

    /// Ticks of each column, and whether all of them missed the deadline. Of several bins in a column the
    /// fullest counts; a wide bin fills its columns.
    fn columns(&self, timing: &TimingView, counts: &[u64]) -> Vec<(u64, bool)> {
        let edges = &timing.edges_us;
        let mut columns = vec![(0, false); self.width];
        for (bin, &n) in counts.iter().enumerate().filter(|(_, n)| **n > 0) {
            let least = bin.checked_sub(1).and_then(|k| edges.get(k)).copied();
            let from = least.and_then(|us| self.column(us)).unwrap_or(0);
            let open = bin + 1 >= counts.len();
            let to = edges.get(bin).filter(|_| !open).and_then(|us| self.column(*us)).unwrap_or(self.width);
            let late = timing.deadline_us > 0.0 && least.is_some_and(|us| us >= timing.deadline_us);
            for column in columns.iter_mut().take(to.max(from + 1)).skip(from).filter(|(most, _)| n > *most) {
                *column = (n, late);
            }
        }
        columns
    }

    fn label(&self, line: &mut Pane) {
        line.put(0, 0, self.width, &"·".repeat(self.width), FAINT);
        let mut free = 0;
        for decade in self.low..=self.high {
            let column = (decade - self.low) as usize * self.width / (self.high - self.low) as usize;
            let label = match decade {
                ..0 => format!("{:.*}", decade.unsigned_abs() as usize, 10f64.powi(decade)),
                0..3 => format!("{}", 10f64.powi(decade)),
                3..6 => format!("{} ms", 10f64.powi(decade - 3)),
                _ => format!("{} s", 10f64.powi(decade - 6)),
            };
            let at = column.min(self.width.saturating_sub(label.len()));
            if at >= free {
                free = at + line.put(at, 0, usize::MAX, &label, FAINT) + 1;
            }
        }
    }
}
