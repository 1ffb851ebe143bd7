//! A rectangle to write in; what does not fit is left out.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};

use crate::text::{clean, columns};

/// Plain text in the terminal's own colours.
pub(crate) const PLAIN: Style = Style::new();
/// What labels and explains.
pub(crate) const FAINT: Style = Style::new().add_modifier(Modifier::DIM);
/// What is to be found first.
pub(crate) const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);
/// What went wrong; always with a word or a sign beside it.
pub(crate) const ALARM: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);
/// Curves and bars. Magenta and cyan are told from each other, and from the ground, on light and on dark terminals.
pub(crate) const CURVE: Style = Style::new().fg(Color::Cyan);
/// The second kind of bars.
pub(crate) const CURVE_2: Style = Style::new().fg(Color::Magenta);
/// A word on a coloured ground.
pub(crate) const fn badge(color: Color) -> Style {
    Style::new().fg(color).add_modifier(Modifier::BOLD.union(Modifier::REVERSED))
}

/// Where something may be drawn.
pub(crate) struct Pane<'a> {
    buffer: &'a mut Buffer,
    area: Rect,
}

impl<'a> Pane<'a> {
    /// All of a buffer.
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

    /// A part of it, cut to what there is.
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

    /// Writes at most `width` columns, and says how many it took.
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

    /// Writes so that it ends before column `end`, on at most `width` columns.
    pub(crate) fn put_right(&mut self, end: usize, row: usize, width: usize, text: &str, style: Style) {
        let text = clean(text, width);
        let columns = columns(&text);
        self.put(end.saturating_sub(columns), row, columns, &text, style);
    }

    /// A title with a line after it: the head of a pane. What follows the title in `more` is plain.
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

    /// Writes words one after another, each with its style, and says where the last one ends.
    pub(crate) fn words(&mut self, column: usize, row: usize, words: &[(&str, Style)]) -> usize {
        words
            .iter()
            .fold(column, |column, (word, style)| column + self.put(column, row, usize::MAX, word, *style))
    }

    /// Gives what stands there another style.
    pub(crate) fn restyle(&mut self, row: usize, style: Style) {
        if row < self.height() {
            let area = Rect { y: self.area.y + row as u16, height: 1, ..self.area };
            self.buffer.set_style(area, style);
        }
    }

    /// Makes it blank.
    pub(crate) fn blank(&mut self) {
        let line = " ".repeat(self.width());
        for row in 0..self.height() {
            self.put(0, row, self.width(), &line, Style::reset());
        }
    }
}

/// A bar of `width` columns, `share` of it full, to half a column.
pub(crate) fn bar(share: f64, width: usize) -> String {
    let halves = (share.clamp(0.0, 1.0) * 2.0 * width as f64).round() as usize;
    let mut bar = "━".repeat(halves / 2);
    if halves % 2 == 1 {
        bar.push('╸');
    }
    bar
}
