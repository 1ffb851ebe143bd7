//! The nodes, in the order of their calls.

use std::time::Duration;

use super::pane::{ALARM, FAINT, PLAIN, Pane};
use crate::board::{Board, Row};
use crate::text::{clean, count, micros, number, percent};

/// Figures of a node: title and width in columns, from left to right.
const FIGURES: [(&str, usize); 6] =
    [("us", 6), ("max us", 7), ("% tick", 7), ("calls", 7), ("asleep", 7), ("faults", 7)];
const VALUE: usize = 19;
/// Width of a pane beside the names of nodes, with room for a fault.
pub(super) const REST: usize = 41 + VALUE + 24;

pub(crate) fn draw(board: &mut Board, pane: &mut Pane, time: Duration) {
    let (many, rows) = (board.layout.nodes.len(), pane.height().saturating_sub(2));
    board.page = rows.max(1);
    board.scroll = board.scroll.min(many.saturating_sub(rows));
    let (from, to) = (board.scroll, (board.scroll + rows).min(many));
    let out = board.rows.iter().filter(|row| row.last.quarantined).count();
    let mut more = match many {
        0 => "none".into(),
        _ if to - from < many => format!("{} to {to} of {many}, PgUp PgDn", from + 1),
        _ => format!("{many}"),
    };
    if out > 0 {
        more = format!("{more}, {out} out of use");
    }
    pane.head("nodes", &more);
    let figures: usize = FIGURES.iter().map(|(_, width)| width).sum();
    let names = pane.width().saturating_sub(figures + VALUE + 2);
    // Where not both fit, the id has priority.
    let [longest_id, longest_kind] = board.names;
    let kind = longest_kind.clamp(4, names.saturating_sub(longest_id + 1).max(names * 2 / 5).max(4));
    let id = longest_id.max(2).min(names.saturating_sub(kind + 1));
    let start = id + kind + 2;
    pane.put(1, 1, id, "id", FAINT);
    pane.put(id + 2, 1, kind, "kind", FAINT);
    let mut end = start;
    for (title, width) in FIGURES {
        end += width;
        pane.put_right(end, 1, width - 1, title, FAINT);
    }
    pane.put(end + 2, 1, VALUE, "value", FAINT);
    for (line, (node, row)) in board.layout.nodes.iter().zip(&board.rows).take(to).skip(from).enumerate() {
        let line = line + 2;
        pane.put(1, line, id, &node.id, PLAIN);
        pane.put(id + 2, line, kind, &node.kind, FAINT);
        draw_figures(row, pane, line, start, time);
        let room = pane.width().saturating_sub(end + 2);
        if row.last.quarantined {
            pane.put(end + 2, line, room, &format!("OUT: {}", row.last.last_fault), ALARM);
            pane.restyle(line, ALARM);
        } else if row.faults.risen(time) > 0 {
            pane.put(end + 2, line, room, &format!("! {}", row.last.last_fault), ALARM);
        } else if let Some(value) = row.value {
            let unit = node.outputs.first().map_or("", |[_, unit]| unit);
            let style = if value.is_finite() { PLAIN } else { ALARM };
            pane.put_right(end + 11, line, 9, &number(value.into()), style);
            pane.put(end + 12, line, room.saturating_sub(10), &clean(unit, room), FAINT);
        }
    }
}

fn draw_figures(row: &Row, pane: &mut Pane, line: usize, start: usize, time: Duration) {
    let node = &row.last;
    let idle = node.calls == 0;
    let asleep = row.us == 0.0 && row.asleep > 0.0;
    let texts = [
        if idle || asleep { "-".into() } else { micros(row.us) },
        if idle { "-".into() } else { micros(node.max_us) },
        if idle { "-".into() } else { percent(row.share) },
        count(node.calls),
        if row.asleep > 0.0 { format!("{} %", percent(row.asleep)) } else { "-".into() },
        count(node.faults),
    ];
    let mut end = start;
    for (k, ((_, width), text)) in FIGURES.iter().zip(texts).enumerate() {
        end += width;
        let quiet = text == "-" || text == "0";
        let style = if k == 5 && row.faults.risen(time) > 0 {
            ALARM
        } else if quiet {
            FAINT
        } else {
            PLAIN
        };
        pane.put_right(end, line, width - 1, &text, style);
    }
}
