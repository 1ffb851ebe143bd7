//! Live parameters and materials.

use asperity_live::view::{LiveLayout, Materials};
use ratatui::style::Color;

use super::pane::{BOLD, CURVE, FAINT, PLAIN, Pane, badge, bar};
use crate::board::Board;
use crate::keys::place;
use crate::text::{number, short};

pub(crate) fn draw(board: &Board, pane: &mut Pane) {
    let (width, height, many) = (pane.width(), pane.height(), board.parameters());
    let textures = board.layout.materials.len().min(3);
    let rows = height.saturating_sub(1 + textures + usize::from(textures > 0));
    pane.head(
        "parameters",
        &if many == 0 { "none".into() } else { format!("{} of {many}", board.chosen + 1) },
    );
    // The chosen one stays in the middle of a list that does not fit.
    let from = board.chosen.saturating_sub(rows / 2).min(many.saturating_sub(rows));
    for row in 0..rows.min(many) {
        let index = from + row;
        let Some((n, p)) = board.parameter(index) else { break };
        let node = &board.layout.nodes[n];
        let mut line = pane.part(0, row + 1, width, 1);
        draw_one(&node.id, &node.live[p], index == board.chosen, &mut line);
    }
    if textures > 0 {
        pane.part(0, 1 + rows, width, 1).head("materials", "");
    }
    let first = board.texture.saturating_sub(textures.saturating_sub(1));
    for (row, (k, materials)) in
        board.layout.materials.iter().enumerate().skip(first).take(textures).enumerate()
    {
        draw_materials(materials, k == board.texture, &mut pane.part(0, 2 + rows + row, width, 1));
    }
}

fn draw_one(node: &str, live: &LiveLayout, chosen: bool, line: &mut Pane) {
    let width = line.width();
    let style = if chosen { BOLD } else { PLAIN };
    line.put(0, 0, 1, if chosen { ">" } else { "" }, BOLD);
    let range = if live.words.is_empty() {
        let [least, most] = live.slide();
        format!("{} .. {} {}", short(least), short(most), live.unit)
    } else {
        live.words.join(" ")
    };
    // Names take the columns that bars and figures leave. The range is left out first.
    let ranged = if width >= 56 { (width / 4).min(30) } else { 0 };
    let bars = if width >= 36 { 10 } else { 0 };
    let names = width.saturating_sub(bars + ranged + 14);
    line.put(2, 0, names, &format!("{node}.{}", live.name), style);
    let mut column = names + 3;
    if bars > 0 && live.words.is_empty() {
        line.put(column, 0, bars, &"─".repeat(bars), FAINT);
        line.put(column, 0, bars, &bar(place(live), bars), if chosen { CURVE } else { PLAIN });
    }
    column += bars;
    if live.words.is_empty() {
        line.put_right(column + 10, 0, 9, &number(live.value), style);
    } else {
        let word = live.words.get(live.value.round().max(0.0) as usize).map_or("?", String::as_str);
        let style = if chosen { badge(Color::Reset) } else { BOLD };
        let from = column - bars;
        line.put(from, 0, width.saturating_sub(from + ranged), word, style);
    }
    if ranged > 0 {
        line.put(width - ranged + 1, 0, ranged, &range, FAINT);
    }
}

fn draw_materials(materials: &Materials, chosen: bool, line: &mut Pane) {
    line.put(0, 0, 1, if chosen { ">" } else { "" }, BOLD);
    let width = line.width();
    let mut column = 2 + line.put(2, 0, width / 3, &materials.node, if chosen { BOLD } else { PLAIN }) + 1;
    let at = materials.names.iter().position(|name| *name == materials.chosen);
    let place = at.map_or("?".into(), |at| (at + 1).to_string());
    let of = format!("{place} of {} ", materials.names.len());
    column += line.put(column, 0, usize::MAX, &of, FAINT);
    column += 1 + line.put(column, 0, usize::MAX, &format!(" {} ", materials.chosen), badge(Color::Reset));
    // The next materials, as far as there is room.
    let many = materials.names.len();
    for k in (1..many).map(|k| (at.unwrap_or(0) + k) % many) {
        if column + 3 > width {
            break;
        }
        column += 2 + line.put(column, 0, usize::MAX, &materials.names[k], FAINT);
    }
}
