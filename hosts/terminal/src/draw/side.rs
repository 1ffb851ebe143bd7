//! Latency, item by item, and the sources of motion.

use std::time::Duration;

use asperity_live::view::SourceView;

use super::pane::{ALARM, BOLD, CURVE, FAINT, PLAIN, Pane, bar};
use crate::board::Board;
use crate::text::{columns, count, micros, millis};

pub(crate) fn latency(board: &Board, pane: &mut Pane) {
    let items = &board.view.latency_ms;
    let sum: f64 = items.iter().map(|(_, ms)| ms).sum();
    let rows = pane.height().saturating_sub(1);
    if items.is_empty() {
        pane.head("latency", "");
        pane.put(1, 1, usize::MAX, "not known yet", FAINT);
        return;
    }
    let to = if pane.width() >= 40 { ", hand to actuator" } else { "" };
    pane.head("latency", &format!("{} ms{to}", millis(sum)));
    if items.len() < rows {
        latency_list(items, sum, pane);
    } else {
        latency_text(items, sum, pane);
    }
}

/// One line for each item, with a bar of its share of the sum.
fn latency_list(items: &[(String, f64)], sum: f64, pane: &mut Pane) {
    let width = pane.width();
    let names = items.iter().map(|(name, _)| columns(name)).max().unwrap_or(0).clamp(4, (width / 2).max(4));
    let bars = width.saturating_sub(names + 12);
    for (row, (name, ms)) in items.iter().enumerate() {
        pane.put(1, row + 1, names, name, PLAIN);
        pane.put_right(names + 9, row + 1, 7, &millis(*ms), PLAIN);
        if sum > 0.0 && bars > 3 {
            pane.put(names + 11, row + 1, bars, &bar(ms / sum, bars), CURVE);
        }
    }
    let row = items.len() + 1;
    pane.put(1, row, names, "sum", BOLD);
    pane.put_right(names + 9, row, 7, &millis(sum), BOLD);
    pane.put(names + 10, row, 3, "ms", FAINT);
}

/// All items as one sum that runs over the lines there are.
fn latency_text(items: &[(String, f64)], sum: f64, pane: &mut Pane) {
    let (width, rows) = (pane.width(), pane.height());
    let (mut column, mut row) = (1, 1);
    let total = ("=".into(), sum);
    for (index, (name, ms)) in items.iter().chain([&total]).enumerate() {
        let last = index == items.len();
        let text = match (last, index + 1 < items.len()) {
            (true, _) => format!("= {} ms", millis(*ms)),
            (_, true) => format!("{name} {} +", millis(*ms)),
            _ => format!("{name} {}", millis(*ms)),
        };
        let room = width.saturating_sub(2);
        if column > 1 && column + columns(&text).min(room) > width {
            (column, row) = (1, row + 1);
        }
        if row >= rows {
            pane.put(width.saturating_sub(1), rows - 1, 1, "…", FAINT);
            return;
        }
        column += 1 + pane.put(column, row, room, &text, if last { BOLD } else { PLAIN });
    }
}

pub(crate) fn sources(board: &Board, pane: &mut Pane, time: Duration) {
    let sources = &board.view.sources;
    let (rows, width) = (pane.height().saturating_sub(2), pane.width());
    let hidden = sources.len().saturating_sub(rows);
    pane.head("sources", &if hidden > 0 { format!("{rows} of {}", sources.len()) } else { String::new() });
    if sources.is_empty() {
        pane.put(1, 1, usize::MAX, "none: no hand", FAINT);
        return;
    }
    let id = width.saturating_sub(30).min(24);
    pane.put(1, 1, id, "id", FAINT);
    for (end, title) in [(9, "Hz"), (16, "age ms"), (22, "delay"), (29, "stalls")] {
        pane.put_right(id + end, 1, 7, title, FAINT);
    }
    // Stalled sources come first, so that they are visible. A source that has not begun is not stalled.
    let stalls = |s: &SourceView| s.stalled && s.samples > 0;
    let stalled = |k: &usize| stalls(&sources[*k]) || board.stalls.get(*k).is_some_and(|s| s.risen(time) > 0);
    let order = (0..sources.len()).filter(stalled).chain((0..sources.len()).filter(|k| !stalled(k)));
    for (row, k) in order.take(rows).enumerate() {
        let (source, row) = (&sources[k], row + 2);
        pane.put(1, row, id, &source.id, PLAIN);
        if stalled(&k) {
            pane.put_right(id + 9, row, 7, "STALLED", ALARM);
        } else if source.samples == 0 {
            pane.put_right(id + 9, row, 7, "waits", FAINT);
        } else {
            pane.put_right(id + 9, row, 7, &micros(source.rate_hz.round()).replace(".0", ""), PLAIN);
        }
        pane.put_right(id + 16, row, 6, &millis(source.age_ms), PLAIN);
        pane.put_right(id + 22, row, 6, &millis(source.delay_ms), PLAIN);
        pane.put_right(id + 29, row, 6, &count(source.stalls), if source.stalls > 0 { BOLD } else { FAINT });
    }
}
