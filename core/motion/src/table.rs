//! Tables of numbers in CSV files, read strictly: every error points at its cell.

use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, Span, one_of};

/// Most cells of a line.
pub(crate) const MOST_CELLS: usize = 10_000;

/// A quantity that a table may have as a column.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Its name.
    pub name: &'static str,
    /// Another name that is understood.
    pub alias: Option<&'static str>,
    /// Least value.
    pub least: f64,
    /// Greatest value.
    pub greatest: f64,
    /// Unit, for errors.
    pub unit: &'static str,
}

impl Column {
    /// A quantity within `-limit` to `limit`.
    pub const fn within(name: &'static str, limit: f64, unit: &'static str) -> Self {
        Self { name, alias: None, least: -limit, greatest: limit, unit }
    }

    /// Whether a value is in range. NaN is not.
    pub fn holds(&self, value: f64) -> bool {
        (self.least..=self.greatest).contains(&value)
    }

    /// The help of an error about a value.
    pub fn help(&self) -> String {
        format!("`{}` is a number from {} to {} {}", self.name, self.least, self.greatest, self.unit)
    }
}

/// The rows of a CSV text under its header.
///
/// The header names columns in any order. Lines that start with `#` and blank lines are skipped. Names and
/// numbers may stand in double quotes.
pub struct Table<'s> {
    source: &'s Arc<Source>,
    columns: &'static [Column],
    header: Vec<Span>,
    /// For each cell the number of its column.
    column_of: Vec<usize>,
    /// First byte that was not read.
    next: usize,
}

impl<'s> Table<'s> {
    /// Reads the header. `header_help` says how it should look. Error: each at its cell: no header; a column
    /// that is unknown or there twice; more than 10000 cells.
    pub fn open(
        source: &'s Arc<Source>,
        columns: &'static [Column],
        header_help: &str,
    ) -> Result<Self, Diagnostic> {
        let mut table = Self { source, columns, header: Vec::new(), column_of: Vec::new(), next: 0 };
        let Some(line) = table.line() else {
            return Err(Diagnostic::new("no header line").at(source, table.end()).help(header_help));
        };
        table.header =
            table.cells(line).map_err(|e| e.help(format!("at most {MOST_CELLS}; {header_help}")))?;
        for &span in &table.header {
            let name = table.text(span);
            let Some(column) = columns.iter().position(|c| c.name == name || c.alias == Some(name)) else {
                let help = match table.header.len() {
                    1 => format!("{header_help}; cells are separated by commas"),
                    _ => one_of(name, columns.iter().map(|c| c.name)),
                };
                return Err(Diagnostic::new(format!("unknown column `{name}`")).at(source, span).help(help));
            };
            if let Some(first) = table.column_of.iter().position(|other| *other == column) {
                return Err(Diagnostic::new(format!("the column `{name}` is there twice"))
                    .at(source, span)
                    .related(source, table.header[first], "first here"));
            }
            table.column_of.push(column);
        }
        Ok(table)
    }

    /// Whether there is a column, by its number.
    pub fn has(&self, column: usize) -> bool {
        self.column_of.contains(&column)
    }

    /// Place behind the header.
    pub fn header_end(&self) -> Span {
        Span::at(self.header.last().map_or(0, |cell| cell.end))
    }

    /// Place behind the text.
    pub fn end(&self) -> Span {
        Span::at(self.source.text().len())
    }

    /// Reads the next row into `row`, by number of the column, and returns the place of column 0. Columns
    /// that are not there keep their value. None behind the last row.
    ///
    /// # Errors
    /// Each at its cell: more or fewer cells than in the header; a cell that is not a number, not finite or
    /// out of range.
    pub fn next_row(&mut self, row: &mut [f64]) -> Result<Option<Span>, Diagnostic> {
        let Some(line) = self.line() else { return Ok(None) };
        let cells = self.cells(line).map_err(|e| e.help(format!("at most {MOST_CELLS}")))?;
        let (found, want) = (cells.len(), self.header.len());
        if found != want {
            let span = cells.get(want).copied();
            let span = span.unwrap_or(Span::at(cells.last().map_or(line.end, |cell| cell.end)));
            let many = if found == 1 { "" } else { "s" };
            let error = Diagnostic::new(format!("a row of {found} cell{many} under a header of {want}"));
            let label = match self.header.get(found) {
                Some(missing) => format!("no `{}`", self.text(*missing)),
                None => "belongs to no column".into(),
            };
            return Err(error
                .at(self.source, span)
                .label(label)
                .help("numbers are written with a point and separated by commas"));
        }
        let mut first = Span::at(line.start);
        for (&cell, &column) in cells.iter().zip(&self.column_of) {
            row[column] = self.number(cell, &self.columns[column])?;
            if column == 0 {
                first = cell;
            }
        }
        Ok(Some(first))
    }

    fn number(&self, cell: Span, column: &Column) -> Result<f64, Diagnostic> {
        let (text, name) = (self.text(cell), column.name);
        let what = match text.parse::<f64>() {
            Ok(x) if column.holds(x) => return Ok(x),
            Err(_) if text.is_empty() => format!("`{name}` is empty"),
            Err(_) => format!("`{name}` is `{text}`, which is not a number"),
            // A number too large for a double has digits.
            Ok(x) if !x.is_finite() && !text.bytes().any(|b| b.is_ascii_digit()) => {
                format!("`{name}` is `{text}`, which is not finite")
            }
            Ok(_) => format!("`{name}` is `{text}`, out of range"),
        };
        Err(Diagnostic::new(what).at(self.source, cell).help(column.help()))
    }

    fn text(&self, span: Span) -> &'s str {
        &self.source.text()[span.start..span.end]
    }

    /// The next line that is neither blank nor a comment, without spaces around it.
    fn line(&mut self) -> Option<Span> {
        loop {
            let rest = self.source.text().get(self.next..).filter(|rest| !rest.is_empty())?;
            let start = self.next;
            self.next += rest.find(['\n', '\r']).map_or(rest.len(), |at| at + 1);
            let line = self.trimmed(Span { start, end: self.next });
            let text = self.text(line);
            if !text.is_empty() && !text.starts_with('#') {
                return Some(line);
            }
        }
    }

    /// The cells of a line, without spaces and quotes around them.
    fn cells(&self, line: Span) -> Result<Vec<Span>, Diagnostic> {
        let text = self.text(line);
        let count = text.matches(',').count() + 1;
        if count > MOST_CELLS {
            let what = format!("a line of {count} cells");
            return Err(Diagnostic::new(what).at(self.source, Span::at(line.start)));
        }
        let mut start = line.start;
        let cell = |cell: &str| {
            let span = self.trimmed(Span { start, end: start + cell.len() });
            start += cell.len() + 1;
            let quoted = self.text(span).strip_prefix('"').is_some_and(|text| text.ends_with('"'));
            if quoted { self.trimmed(Span { start: span.start + 1, end: span.end - 1 }) } else { span }
        };
        Ok(text.split(',').map(cell).collect())
    }

    fn trimmed(&self, span: Span) -> Span {
        let text = self.text(span);
        let start = span.start + text.len() - text.trim_start().len();
        Span { start, end: start + text.trim().len() }
    }
}
