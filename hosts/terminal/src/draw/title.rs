//! The two lines at the top and the line of keys.

use std::time::Duration;

use asperity_live::view::Condition;
use ratatui::style::{Color, Style};

use super::pane::{ALARM, BOLD, CURVE, FAINT, PLAIN, Pane, badge, bar};
use crate::board::{Board, Tab};
use crate::text::{clock, columns, count, dbfs, decibels};

/// Lowest level of the meter in dBFS, and its columns.
const FLOOR_DB: f64 = -60.0;
const METER: usize = 10;

/// A condition as a word, with its style.
pub(crate) fn condition(condition: Condition) -> (&'static str, Style) {
    match condition {
        Condition::Starting => ("STARTING", badge(Color::Cyan)),
        Condition::Playing => ("PLAYING", badge(Color::Green)),
        Condition::Muted => ("MUTED", badge(Color::Magenta)),
        Condition::Lost => ("DEVICE LOST", badge(Color::Red)),
        Condition::Stopping => ("STOPPING", badge(Color::Cyan)),
        Condition::Failed => ("FAILED", badge(Color::Red)),
    }
}

pub(crate) fn draw(board: &Board, pane: &mut Pane, time: Duration) {
    let (view, layout, width) = (&board.view, &board.layout, pane.width());
    let (word, style) = condition(view.condition);
    let word = format!(" {word} ");
    let right = format!(" {} ", clock(view.seconds));
    let room = width.saturating_sub(columns(&word) + columns(&right) + 2);
    let wide = width >= 100;
    let mut about = Vec::new();
    about.push(if view.device.is_empty() { "no device".into() } else { view.device.clone() });
    about.push(match view.period_frames {
        0 => view.clock.clone(),
        frames if wide => format!("{}, {frames} frames", view.clock),
        frames => format!("{} {frames}", view.clock),
    });
    about.push(match layout.audio_hz {
        audio if audio > 0 && wide => format!("{} Hz, audio {audio} Hz", layout.tick_hz),
        _ => format!("{} Hz", layout.tick_hz),
    });
    about.retain(|text| !text.is_empty());
    let about = about.join(" · ");
    // The end of a path says most. Room is left for the text beside it.
    let file = tail(&layout.file, room.saturating_sub(columns(&about) + 3).max(room / 3));
    let column = 1 + pane.put(1, 0, room, &file, BOLD);
    pane.put(column, 0, room.saturating_sub(column), &format!(" · {about}"), PLAIN);
    pane.put(room + 2, 0, width, &word, style);
    pane.put_right(width, 0, right.len(), &right, BOLD);
    draw_meter(board, &mut pane.part(0, 1, 29, 1));
    draw_counts(board, &mut pane.part(29, 1, width, 1), time);
}

/// The last `width` columns of a name.
fn tail(name: &str, width: usize) -> String {
    let many = name.chars().count();
    (0..=many)
        .map(|skip| {
            let rest: String = name.chars().skip(skip).take(width + 1).collect();
            if skip == 0 { rest } else { format!("…{rest}") }
        })
        .skip(many.saturating_sub(width))
        .find(|rest| columns(rest) <= width)
        .unwrap_or_default()
}

fn draw_meter(board: &Board, pane: &mut Pane) {
    let held = board.peak.value();
    let full = |peak: f32| 1.0 - decibels(peak).clamp(FLOOR_DB, 0.0) / FLOOR_DB;
    // From 1 on samples were clipped; NaN is worse.
    let over = held >= 1.0 || held.is_nan();
    let style = if over { ALARM } else { CURVE };
    let column = 1 + pane.put(1, 0, 5, "peak ", FAINT);
    pane.put(column, 0, METER, &"─".repeat(METER), FAINT);
    pane.put(column, 0, METER, &bar(full(board.view.peak), METER), style);
    if held > 0.0 {
        let mark = (full(held) * METER as f64) as usize;
        pane.put(column + mark.min(METER - 1), 0, 1, "┃", style);
    }
    let text = format!("{} dBFS{}", dbfs(held), if over { "!" } else { "" });
    pane.put_right(28, 0, 12, &text, if over { ALARM } else { PLAIN });
}

fn draw_counts(board: &Board, pane: &mut Pane, time: Duration) {
    let (width, gap) = (pane.width(), if pane.width() > 60 { 3 } else { 1 });
    let names = ["underruns", "lost", "xruns", "losses", "faults"];
    let mut counts: Vec<_> = names
        .into_iter()
        .zip(&board.counts)
        .map(|(name, held)| {
            let risen = held.risen(time) > 0;
            let style = if risen {
                ALARM
            } else if held.now > 0 {
                BOLD
            } else {
                FAINT
            };
            (name, format!("{}{}", count(held.now), if risen { "!" } else { "" }), style)
        })
        .collect();
    // Where not all fit, zeros are left out first.
    let wanted = |counts: &[(&str, String, Style)]| -> usize {
        counts.iter().map(|(name, text, _)| name.len() + text.len() + 1 + gap).sum()
    };
    while wanted(&counts) > width {
        match counts.iter().rposition(|(_, text, _)| text == "0") {
            Some(zero) => drop(counts.remove(zero)),
            None => break,
        }
    }
    let mut column = 1;
    for (name, text, style) in counts {
        column = gap + pane.words(column, 0, &[(name, FAINT), (" ", PLAIN), (&text, style)]);
    }
}

pub(crate) fn draw_keys(board: &Board, pane: &mut Pane, tabs: bool) {
    let mut column = 1;
    let keys = [
        ("q", "stop"),
        ("space", "mute"),
        ("↑↓", "choose"),
        ("←→", "move"),
        ("n p", "material"),
        ("?", "help"),
    ];
    let short = [("q", "stop"), ("space", "mute"), ("↑↓←→", "set"), ("n p", "material"), ("?", "help")];
    let keys = if tabs && pane.width() < 100 { &short[..] } else { &keys[..] };
    for &(key, what) in keys {
        column = pane.words(column, 0, &[(key, BOLD), (" ", PLAIN), (what, FAINT), ("  ", PLAIN)]);
    }
    if tabs {
        let names = [(Tab::Nodes, "1 nodes"), (Tab::Scopes, "2 scopes"), (Tab::Parameters, "3 set")];
        for (tab, name) in names {
            let style = if tab == board.tab { badge(Color::Reset) } else { FAINT };
            column = pane.words(column, 0, &[(name, style), (" ", PLAIN)]);
        }
    }
}
