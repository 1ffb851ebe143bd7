//! Charts of signals, drawn with braille characters: two by four dots in a cell.

use super::pane::{CURVE, FAINT, PLAIN, Pane};
use crate::board::Board;
use crate::text::{number, short};
use crate::trace::{Scale, Trace};

/// Least rows and columns of a chart, with its heading and scale.
const LEAST: (usize, usize) = (4, 34);
/// Columns of the scale.
const SCALE: usize = 7;

pub(crate) fn draw(board: &Board, pane: &mut Pane) {
    let many = board.traces.len();
    let (width, height) = (pane.width(), pane.height().saturating_sub(1));
    let fit = ((width / LEAST.1).max(1), (height / LEAST.0).max(1));
    // Nine columns to a row look best: about four dots wide to one high. Empty places look worst.
    let odd = |across: usize| {
        let down = many.div_ceil(across).clamp(1, fit.1);
        let form = (width * down) as f64 / (across * height.max(1)) as f64 / 9.0;
        form.ln().abs() + (across * down).abs_diff(many) as f64
    };
    let across = (1..=fit.0).min_by(|a, b| odd(*a).total_cmp(&odd(*b))).unwrap_or(1);
    let down = many.div_ceil(across).clamp(1, fit.1);
    let shown = many.min(across * down);
    let head = match many {
        0 => "none".into(),
        _ if shown < many => format!("{shown} of {many}"),
        _ => String::new(),
    };
    pane.head("scopes", &head);
    for (k, (scope, trace)) in board.layout.scopes.iter().zip(&board.traces).take(shown).enumerate() {
        let (x, y) = (k % across, k / across);
        let (left, top) = (x * width / across, 1 + y * height / down);
        let (right, bottom) = ((x + 1) * width / across, 1 + (y + 1) * height / down);
        let mut part = pane.part(left, top, right - left - 1, bottom - top);
        chart(&scope.name, &scope.unit, trace, &mut part);
    }
}

fn chart(name: &str, unit: &str, trace: &Trace, pane: &mut Pane) {
    let (width, rows) = (pane.width().saturating_sub(SCALE + 1), pane.height().saturating_sub(1));
    let window = trace.window(2 * width);
    let column = 2 + pane.put(1, 0, width / 2, name, PLAIN);
    let peak = format!("peak {} {unit}", number(trace.peak().into()));
    let end = column + pane.put(column, 0, usize::MAX, &peak, FAINT);
    let seconds = format!("{:.1} s", window.seconds);
    if end + seconds.len() < pane.width() {
        pane.put_right(pane.width(), 0, seconds.len(), &seconds, FAINT);
    }
    let scale = trace.scale();
    scale_beside(scale, pane, rows);
    for (row, line) in dots(&window.columns, scale, rows).into_iter().enumerate() {
        pane.put(SCALE + 1, row + 1, width, &line, CURVE);
    }
}

fn scale_beside(scale: Scale, pane: &mut Pane, rows: usize) {
    let bottom = if scale.signed { -scale.top } else { 0.0 };
    for (row, x) in [(1, scale.top), (rows, bottom)] {
        pane.put_right(SCALE, row, SCALE, &short(x.into()), FAINT);
    }
    for row in 1..=rows {
        pane.put(SCALE, row, 1, "│", FAINT);
    }
    if scale.signed && rows > 2 && rows % 2 == 1 {
        pane.put_right(SCALE, rows / 2 + 1, SCALE, "0", FAINT);
    }
}

/// The lines of a chart. Each column is filled from its least to its greatest value and meets the one before.
fn dots(columns: &[Option<[f32; 2]>], scale: Scale, rows: usize) -> Vec<String> {
    const DOTS: [[u8; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];
    let height = 4 * rows;
    let mut cells = vec![vec![0u8; columns.len().div_ceil(2)]; rows];
    if height == 0 || scale.top <= 0.0 {
        return Vec::new();
    }
    let bottom = if scale.signed { -scale.top } else { 0.0 };
    let place = |x: f32| {
        let share = f64::from(scale.top - x) / f64::from(scale.top - bottom);
        (share * (height - 1) as f64).round().clamp(0.0, (height - 1) as f64) as usize
    };
    let mut before: Option<(usize, usize)> = None;
    for (k, column) in columns.iter().enumerate() {
        let Some([least, most]) = *column else {
            before = None;
            continue;
        };
        let (top, low) = (place(most), place(least));
        let (from, to) = match before {
            Some((last_top, _)) if last_top > low + 1 => (top, last_top - 1),
            Some((_, last_low)) if last_low + 1 < top => (last_low + 1, low),
            _ => (top, low),
        };
        for dot in from..=to {
            cells[dot / 4][k / 2] |= DOTS[k % 2][dot % 4];
        }
        before = Some((top, low));
    }
    let braille = |bits: u8| char::from_u32(0x2800 + u32::from(bits)).unwrap_or(' ');
    cells
        .into_iter()
        .map(|line| line.into_iter().map(|b| if b == 0 { ' ' } else { braille(b) }).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(top: f32, signed: bool) -> Scale {
        Scale { top, signed, ..Scale::default() }
    }

    #[test]
    fn rising_line_rises() {
        let ramp: Vec<_> = (0..8).map(|k| Some([k as f32; 2])).collect();
        assert_eq!(dots(&ramp, scale(7.0, false), 2), ["  ⡠⠊", "⡠⠊  "]);
    }

    #[test]
    fn jump_is_joined_and_gap_is_not() {
        let jump = [Some([0.0; 2]), Some([3.0; 2])];
        assert_eq!(dots(&jump, scale(3.0, false), 1), ["⡸"]);
        assert_eq!(dots(&[Some([0.0; 2]), None, Some([3.0; 2])], scale(3.0, false), 1), ["⡀⠁"]);
    }

    #[test]
    fn signed_scale_reaches_below_zero() {
        let swing = [Some([-1.0, 1.0]), Some([0.0, 9.0])];
        assert_eq!(dots(&swing, scale(1.0, true), 1), ["⡿"]);
    }
}
