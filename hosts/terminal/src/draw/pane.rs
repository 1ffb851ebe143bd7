//! A rectangle to write in. Text that does not fit is left out.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::Line;
use ratatui::widgets::{Block, Clear, Widget};

use crate::text::{clean, columns};

/// Plain text in the terminal's own colours.
pub(crate) const PLAIN: Style = Style::new();
/// Labels and explanations.
pub(crate) const FAINT: Style = Style::new().add_modifier(Modifier::DIM);
/// The most important text.
pub(crate) const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);
/// Faults and losses; always with a word or a sign beside it.
pub(crate) const ALARM: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);
/// Curves and bars. Magenta and cyan are distinct from each other and from light and dark backgrounds.
pub(crate) const CURVE: Style = Style::new().fg(Color::Cyan);
/// The second kind of bars.
pub(crate) const CURVE_2: Style = Style::new().fg(Color::Magenta);
/// A word on a coloured background.
pub(crate) const fn badge(color: Color) -> Style {
    Style::new().fg(color).add_modifier(Modifier::BOLD.union(Modifier::REVERSED))
}

/// A rectangle of the frame.
pub(crate) struct Pane<'a> {
    buffer: &'a mut Buffer,
    area: Rect,
}

impl<'a> Pane<'a> {
    /// The whole buffer.
    pub(crate) fn all(buffer: &'a mut Buffer) -> Self {
        let area = buffer.area;
        Self { buffer, area }
    }

    pub(crate) fn width(&self) -> usize {
        usize::from(self.area.width)
    }

    pub(crate) fn height(&self) -> usize {
        usize::from(self.area.height)
    }

    /// A part of the pane, cut to its size.
    pub(crate) fn part(&mut self, column: usize, row: usize, width: usize, height: usize) -> Pane<'_> {
        let (column, row) = (column.min(self.width()), row.min(self.height()));
        let area = Rect {
            x: self.area.x + column as u16,
            y: self.area.y + row as u16,
            width: width.min(self.width() - column) as u16,
            height: height.min(self.height() - row) as u16,
        };
        Pane { buffer: self.buffer, area }
    }

    /// Writes at most `width` columns. Returns how many it took.
    pub(crate) fn put(&mut self, column: usize, row: usize, width: usize, text: &str, style: Style) -> usize {
        if column >= self.width() || row >= self.height() {
            return 0;
        }
        let width = width.min(self.width() - column);
        let text = clean(text, width);
        let (x, y) = (self.area.x + column as u16, self.area.y + row as u16);
        let (end, _) = self.buffer.set_stringn(x, y, text, width, Style::reset().patch(style));
        usize::from(end - x)
    }

    /// Writes at most `width` columns that end before column `end`.
    pub(crate) fn put_right(&mut self, end: usize, row: usize, width: usize, text: &str, style: Style) {
        let text = clean(text, width);
        let columns = columns(&text);
        self.put(end.saturating_sub(columns), row, columns, &text, style);
    }

    /// The head of a pane: a bold title, plain text and a line.
    pub(crate) fn head(&mut self, title: &str, more: &str) {
        let width = self.width();
        let line = "─".repeat(width);
        self.put(0, 0, width, &line, FAINT);
        let mut column = 1;
        column += self.put(column, 0, width.saturating_sub(3), &format!(" {title} "), BOLD);
        if !more.is_empty() {
            self.put(column, 0, width.saturating_sub(column + 1), &format!("{more} "), PLAIN);
        }
    }

    /// Writes words one after another, each with its style. Returns the column after the last.
    pub(crate) fn words(&mut self, column: usize, row: usize, words: &[(&str, Style)]) -> usize {
        words
            .iter()
            .fold(column, |column, (word, style)| column + self.put(column, row, usize::MAX, word, *style))
    }

    /// Gives a row another style.
    pub(crate) fn restyle(&mut self, row: usize, style: Style) {
        if row < self.height() {
            let area = Rect { y: self.area.y + row as u16, height: 1, ..self.area };
            self.buffer.set_style(area, style);
        }
    }

    /// Clears the pane and draws a border with a title.
    pub(crate) fn frame(&mut self, title: &str) {
        Clear.render(self.area, self.buffer);
        let title = Line::styled(title.to_owned(), Style::reset().patch(BOLD));
        Block::bordered().border_style(FAINT).title(title).render(self.area, self.buffer);
    }
}

/// A bar that fills `share` of `width` columns, to half a column.
pub(crate) fn bar(share: f64, width: usize) -> String {
    let halves = (share.clamp(0.0, 1.0) * 2.0 * width as f64).round() as usize;
    let mut bar = "━".repeat(halves / 2);
    if halves % 2 == 1 {
        bar.push('╸');
    }
    bar
}
