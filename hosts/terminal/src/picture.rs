//! One frame of the terminal as an SVG picture.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use asperity_live::view::{Layout, View};
use ratatui::buffer::{Buffer, Cell};
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier};
use unicode_width::UnicodeWidthStr;

use crate::board::Board;

/// A cell in pixels.
const CELL: [f64; 2] = [8.0, 18.0];
const MARGIN: f64 = 12.0;
/// Where letters stand in their cell.
const BASELINE: f64 = 13.5;
const GROUND: &str = "#16181d";

/// A frame of 120 columns and 40 rows, as [`crate::Terminal`] draws `view` when it is the first one.
pub fn svg(view: &View, layout: &Layout) -> String {
    svg_of(view, layout, 120, 40)
}

/// A frame of some columns and rows. Bars, curves and lines are shapes, so that the picture looks the same with any fixed-width font.
pub fn svg_of(view: &View, layout: &Layout, columns: u16, rows: u16) -> String {
    let mut board = Board::default();
    board.lay_out(layout);
    board.take(view, Duration::ZERO);
    let mut buffer = Buffer::empty(Rect::new(0, 0, columns.clamp(1, 1000), rows.clamp(1, 1000)));
    board.draw(&mut buffer, Duration::ZERO);
    render(&buffer)
}

/// Follows a run as a [`crate::Terminal`] does, where there is no terminal, to draw what one would show.
pub struct Follower {
    board: Board,
    start: Instant,
}

impl Default for Follower {
    fn default() -> Self {
        Self { board: Board::default(), start: Instant::now() }
    }
}

impl Follower {
    /// Takes over another graph, or the same one with other values or materials.
    pub fn layout(&mut self, layout: &Layout) {
        self.board.lay_out(layout);
    }

    /// Takes figures in, 20 to 60 times a second.
    pub fn take(&mut self, view: &View) {
        self.board.take(view, self.start.elapsed());
    }

    /// The frame of now, of some columns and rows.
    pub fn svg(&mut self, columns: u16, rows: u16) -> String {
        let mut buffer = Buffer::empty(Rect::new(0, 0, columns.clamp(1, 1000), rows.clamp(1, 1000)));
        self.board.draw(&mut buffer, self.start.elapsed());
        render(&buffer)
    }
}

fn render(buffer: &Buffer) -> String {
    let (w, h) = (f64::from(buffer.area.width) * CELL[0], f64::from(buffer.area.height) * CELL[1]);
    let (width, height) = (w + 2.0 * MARGIN, h + 2.0 * MARGIN);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.1} {height:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" role=\"img\">\n\
         <title>Figures of a running graph in a terminal</title>\n\
         <style>text{{font-family:'DejaVu Sans Mono','Liberation Mono',Menlo,Consolas,monospace;font-size:13.3px}}</style>\n\
         <rect width=\"{width:.1}\" height=\"{height:.1}\" rx=\"8\" fill=\"{GROUND}\"/>\n\
         <g transform=\"translate({MARGIN} {MARGIN})\">\n"
    );
    for row in 0..buffer.area.height {
        let cells: Vec<&Cell> = (0..buffer.area.width).filter_map(|x| buffer.cell((x, row))).collect();
        let mut column = 0;
        while column < cells.len() {
            column += run(&mut out, &cells, column, f64::from(row) * CELL[1]);
        }
    }
    out.push_str("</g>\n</svg>\n");
    out
}

/// Draws the cells from `column` on that look alike, and says how many they are.
fn run(out: &mut String, cells: &[&Cell], column: usize, y: f64) -> usize {
    let first = cells[column];
    let look = Look::of(first);
    let x = column as f64 * CELL[0];
    let wide = first.symbol().width().max(1);
    if look.ground.is_some() {
        let many = cells[column..].iter().take_while(|cell| Look::of(cell) == look).count();
        rect(out, [x, y, many as f64 * CELL[0], CELL[1]], look.ground.unwrap_or(GROUND), 1.0);
        let text: String = cells[column..column + many].iter().map(|cell| cell.symbol()).collect();
        letters(out, x, y, &text, many, look);
        return many;
    }
    if let Some(c) = first.symbol().chars().next().filter(|c| is_shape(*c)) {
        let many = cells[column..]
            .iter()
            .take_while(|cell| cell.symbol() == first.symbol() && Look::of(cell) == look);
        let many = if matches!(c, '─' | '━' | '█') { many.count() } else { 1 };
        shape(out, c, [x, y], many as f64 * CELL[0], look);
        return many;
    }
    if first.symbol() == " " {
        return 1;
    }
    if wide > 1 {
        letters(out, x, y, first.symbol(), wide, look);
        return wide;
    }
    let plain = |pair: &[&Cell]| {
        let text = pair[0].symbol();
        let gap = text == " " && pair.get(1).is_none_or(|next| next.symbol() == " ");
        !gap && Look::of(pair[0]) == look && text.width() == 1 && !text.chars().next().is_some_and(is_shape)
    };
    let many = (column..cells.len()).take_while(|k| plain(&cells[*k..])).count().max(1);
    let text: String = cells[column..column + many].iter().map(|cell| cell.symbol()).collect();
    letters(out, x, y, &text, many, look);
    many
}

/// Colours and weight of a cell.
#[derive(Clone, Copy, PartialEq)]
struct Look {
    ink: &'static str,
    ground: Option<&'static str>,
    bold: bool,
    faint: bool,
}

impl Look {
    fn of(cell: &Cell) -> Self {
        let ink = match cell.fg {
            Color::Red => "#f2777a",
            Color::Green => "#8fce7b",
            Color::Cyan => "#67c7d4",
            Color::Magenta => "#d49be6",
            _ => "#d8dce3",
        };
        let reversed = cell.modifier.contains(Modifier::REVERSED);
        Self {
            ink: if reversed { GROUND } else { ink },
            ground: reversed.then_some(ink),
            bold: cell.modifier.contains(Modifier::BOLD),
            faint: cell.modifier.contains(Modifier::DIM),
        }
    }

    fn opacity(self) -> f64 {
        if self.faint { 0.55 } else { 1.0 }
    }
}

fn letters(out: &mut String, x: f64, y: f64, text: &str, columns: usize, look: Look) {
    let trimmed = text.trim_start();
    let skipped = text.width() - trimmed.width();
    let after = trimmed.width() - trimmed.trim_end().width();
    let (x, trimmed) = (x + skipped as f64 * CELL[0], trimmed.trim_end());
    let length = columns.saturating_sub(skipped + after) as f64 * CELL[0];
    if trimmed.is_empty() {
        return;
    }
    let weight = if look.bold { " font-weight=\"700\"" } else { "" };
    let opacity = if look.faint { " opacity=\".55\"" } else { "" };
    // Writing to a String cannot fail.
    let _ = writeln!(
        out,
        "<text x=\"{x:.1}\" y=\"{:.1}\" textLength=\"{length:.1}\" lengthAdjust=\"spacingAndGlyphs\" fill=\"{}\"{weight}{opacity}>{}</text>",
        y + BASELINE,
        look.ink,
        escape(trimmed),
    );
}

fn rect(out: &mut String, [x, y, w, h]: [f64; 4], fill: &str, opacity: f64) {
    let opacity = if opacity < 1.0 { format!(" opacity=\"{opacity}\"") } else { String::new() };
    let _ = writeln!(
        out,
        "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" fill=\"{fill}\"{opacity}/>"
    );
}

fn is_shape(c: char) -> bool {
    matches!(c, '─' | '━' | '╸' | '│' | '┊' | '┃' | '┌' | '┐' | '└' | '┘' | '▁'..='▏' | '\u{2800}'..='\u{28FF}')
}

/// Draws a block, a line or the dots of a braille character over `width` pixels.
fn shape(out: &mut String, c: char, [x, y]: [f64; 2], width: f64, look: Look) {
    let [w, h] = CELL;
    let (ink, opacity) = (look.ink, look.opacity());
    let (left, top) = (x + w / 2.0 - 0.5, y + h / 2.0 - 0.5);
    let code = c as u32;
    match c {
        '▁'..='█' => {
            let part = f64::from(code - 0x2580) / 8.0 * h;
            rect(out, [x, y + h - part, width, part], ink, opacity);
        }
        '▉'..='▏' => rect(out, [x, y, f64::from(0x2590 - code) / 8.0 * w, h], ink, opacity),
        '─' => rect(out, [x, top, width, 1.0], ink, opacity),
        '━' => rect(out, [x, top - 1.5, width, 4.0], ink, opacity),
        '╸' => rect(out, [x, top - 1.5, width / 2.0, 4.0], ink, opacity),
        '│' => rect(out, [left, y, 1.0, h], ink, opacity),
        '┃' => rect(out, [left - 0.5, y, 2.0, h], ink, opacity),
        '┊' => {
            (0..4).for_each(|k| rect(out, [left, y + f64::from(k) * h / 4.0, 1.0, h / 8.0], ink, opacity))
        }
        '┌' | '┐' | '└' | '┘' => {
            let right = matches!(c, '┌' | '└');
            let down = matches!(c, '┌' | '┐');
            rect(out, [if right { left } else { x }, top, w / 2.0 + 0.5, 1.0], ink, opacity);
            rect(out, [left, if down { top } else { y }, 1.0, h / 2.0 + 0.5], ink, opacity);
        }
        _ => dots(out, code - 0x2800, [x, y], ink),
    }
}

fn dots(out: &mut String, bits: u32, [x, y]: [f64; 2], ink: &str) {
    // The numbers of braille dots: 1 2 3 7 down the left, 4 5 6 8 down the right.
    const PLACES: [(u32, u32); 8] = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3)];
    let step = [CELL[0] / 2.0, CELL[1] / 4.0];
    let mut path = String::new();
    for (bit, (column, row)) in PLACES.into_iter().enumerate() {
        if bits >> bit & 1 == 1 {
            let (x, y) = (x + step[0] * (f64::from(column) + 0.5), y + step[1] * (f64::from(row) + 0.5));
            let _ = write!(path, "M{x:.1} {y:.1}h0");
        }
    }
    if !path.is_empty() {
        let _ = writeln!(
            out,
            "<path d=\"{path}\" stroke=\"{ink}\" stroke-width=\"3\" stroke-linecap=\"round\"/>"
        );
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use asperity_live::view::NodeLayout;

    use super::*;

    #[test]
    fn names_from_a_file_are_escaped_and_the_picture_is_balanced() {
        let node = NodeLayout { id: "<script>&".into(), ..NodeLayout::default() };
        let picture = svg(&View::default(), &Layout { nodes: vec![node], ..Layout::default() });
        assert!(picture.contains("&lt;script&gt;&amp;") && !picture.contains("<script"));
        assert_eq!(picture.matches("<text").count(), picture.matches("</text>").count());
        assert!(picture.ends_with("</g>\n</svg>\n"));
    }

    #[test]
    fn letters_stand_in_their_columns() {
        let picture = svg(&View::default(), &Layout { file: "weave.ron".into(), ..Layout::default() });
        // The file begins in the second column, and its nine letters take nine.
        let at = format!("x=\"{:.1}\" y=\"{BASELINE}\" textLength=\"{:.1}\"", CELL[0], 9.0 * CELL[0]);
        assert!(picture.contains(&at), "{at}");
    }
}
