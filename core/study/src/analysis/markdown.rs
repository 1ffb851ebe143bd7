//! Tables and numbers of the report.

use asperity_numbers::Elementary as _;

/// Text of a missing value.
pub(super) const NONE: &str = "–";

/// A table whose columns are as wide as their longest cell. Columns of numbers are aligned to the right.
pub(super) struct Grid {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Grid {
    pub(super) fn new<T: AsRef<str>>(head: impl IntoIterator<Item = T>) -> Self {
        Self { head: head.into_iter().map(|h| escaped(h.as_ref())).collect(), rows: Vec::new() }
    }

    /// Adds a row of as many cells as the head has.
    pub(super) fn row<T: AsRef<str>>(&mut self, cells: impl IntoIterator<Item = T>) {
        self.rows.push(cells.into_iter().map(|c| escaped(c.as_ref())).collect());
    }

    /// The table with a blank line behind it; nothing without rows.
    pub(super) fn text(&self) -> String {
        if self.rows.is_empty() {
            return String::new();
        }
        let column = |i: usize| self.rows.iter().filter_map(move |row| row.get(i));
        let length = |text: &String| text.chars().count();
        let width = |i: usize| column(i).chain([&self.head[i]]).map(length).max().unwrap_or(0).max(3);
        let is_number = |text: &String| {
            text == NONE
                || !text.contains(": ")
                    && text.trim_start_matches(['-', '<']).starts_with(|c: char| c.is_ascii_digit())
        };
        let columns: Vec<(usize, bool)> =
            (0..self.head.len()).map(|i| (width(i), column(i).all(is_number))).collect();
        let line = |cells: &[String]| {
            let mut out = String::from("|");
            for (cell, (width, right)) in cells.iter().zip(&columns) {
                let space = " ".repeat(width.saturating_sub(length(cell)));
                out += &if *right { format!(" {space}{cell} |") } else { format!(" {cell}{space} |") };
            }
            out + "\n"
        };
        let dashes = |(width, right): &(usize, bool)| match right {
            true => "-".repeat(width - 1) + ":",
            false => "-".repeat(*width),
        };
        let rule: Vec<String> = columns.iter().map(dashes).collect();
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("{}{}{rows}\n", line(&self.head), line(&rule))
    }
}

/// A paragraph in lines of at most 100 characters, with a blank line behind it.
pub(super) fn paragraph(text: &str) -> String {
    let mut out = String::new();
    let mut length = 0;
    for word in text.split_whitespace() {
        let count = word.chars().count();
        let (gap, before) = match length {
            0 => ("", 0),
            _ if length + 1 + count > 100 => ("\n", 0),
            _ => (" ", length + 1),
        };
        out.extend([gap, word]);
        length = before + count;
    }
    out + "\n\n"
}

/// A text in one line, without the characters that Markdown takes for its own.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '\\' | '`' | '*' | '<' | '[' | ']' | '|' => out.extend(['\\', c]),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out.trim().to_owned()
}

/// A p-value: three digits, or two with a power of ten below 0.001. It is never written as 0.
pub(super) fn p_value(p: Option<f64>) -> String {
    match p {
        None => NONE.into(),
        Some(p) if p < 1e-300 => "1e-300 or less".into(),
        Some(p) if p < 0.001 => format!("{p:.1e}"),
        Some(p) => digits(p, 3),
    }
}

/// A number with some significant digits.
pub(super) fn digits(x: f64, count: i32) -> String {
    if !x.is_finite() {
        return if x > 0.0 { "infinite".into() } else { NONE.into() };
    }
    let power = if x == 0.0 { 0.0 } else { x.abs().log_10().floor() };
    if !(-5.0..7.0).contains(&power) {
        return format!("{x:.*e}", (count - 1).max(0) as usize);
    }
    format!("{x:.*}", (count - 1 - power as i32).max(0) as usize)
}

/// A number with at most two decimals, such as a median.
pub(super) fn short(x: f64) -> String {
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

/// A value, or a dash.
pub(super) fn or_none<T>(value: Option<T>, written: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| NONE.to_owned(), written)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn p_values_are_never_written_as_zero() {
        for (p, text) in [
            (0.007_316_6, "0.00732"),
            (0.002_038_6, "0.00204"),
            (5.96e-8, "6.0e-8"),
            (0.000_78, "7.8e-4"),
            (0.05, "0.0500"),
            (0.823_4, "0.823"),
            (1.0, "1.00"),
            (0.0, "1e-300 or less"),
        ] {
            assert_eq!(p_value(Some(p)), text);
        }
        assert_eq!(p_value(None), NONE);
        assert_eq!(
            [digits(1234.5, 3), digits(0.0, 3), digits(f64::INFINITY, 3)],
            ["1234", "0.00", "infinite"]
        );
    }

    #[test]
    fn columns_align_and_their_text_is_escaped() {
        let mut grid = Grid::new(["name", "n"]);
        grid.row(["a|b\nc", "5"]);
        grid.row(["x", "12"]);
        let lines = ["| name   |   n |", "| ------ | --: |", "| a\\|b c |   5 |", "| x      |  12 |", "", ""];
        assert_eq!(grid.text(), lines.join("\n"));
        assert_eq!(Grid::new(["name"]).text(), "");
    }
}
