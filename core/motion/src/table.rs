//! Tables of numbers in text files: every error points at its cell, and ambiguous tables are refused.

use std::cmp::Reverse;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, Span};

use super::{Column, ColumnMap};

/// Most cells of a line.
pub(crate) const MOST_CELLS: usize = 10_000;
/// Characters that begin a comment.
const COMMENT: [char; 2] = ['#', '%'];

/// The rows of a table under its header.
///
/// The header names columns in any order. Lines that start with `#` or `%` and blank lines are skipped. If
/// the first line after them is numbers, the header is the comment above that has as many names, as NumPy
/// writes it. Without such a comment columns go by their numbers, from 1. Names and numbers may stand in
/// double quotes.
///
/// Semicolons, tabs, commas or blanks separate cells; the first of these that a line has counts. Where it is
/// not the comma, a comma may be the decimal mark. Columns that nobody reads may hold anything.
pub struct Table<'s> {
    source: &'s Arc<Source>,
    columns: &'static [Column],
    /// Names of the file's columns, with their places.
    header: Vec<(String, Span)>,
    /// Of each column the cell that holds it and the factor of its values.
    read: Vec<Option<(usize, f64)>>,
    separator: Separator,
    /// First byte that was not read.
    next: usize,
    /// First cells with a decimal comma, and with a point.
    comma: Option<Span>,
    point: Option<Span>,
    /// Whether a comma cannot separate thousands in one of the cells.
    is_decimal: bool,
}

/// Separator of the cells of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Separator {
    Char(char),
    Blanks,
}

impl Separator {
    fn of(line: &str) -> Self {
        let has_blanks = |cell: &str| cell.trim().contains(char::is_whitespace);
        let line = line.trim();
        match [';', '\t', ','].into_iter().find(|c| line.contains(*c)) {
            // `0,01 1,5` is two numbers. `t [s], F [N]` is two names.
            Some(',') if line.split(',').any(has_blanks) && !line.contains(char::is_alphabetic) => {
                Self::Blanks
            }
            Some(found) => Self::Char(found),
            None => Self::Blanks,
        }
    }

    fn is(self, c: char) -> bool {
        match self {
            Self::Char(own) => c == own,
            Self::Blanks => c.is_whitespace(),
        }
    }
}

impl<'s> Table<'s> {
    /// Reads the header. `header_help` says how it should look.
    ///
    /// # Errors
    /// Each at its cell: no line; a column that is there twice, or is mapped and not there; a unit that is
    /// unknown; more than 10000 cells.
    pub fn open(
        source: &'s Arc<Source>,
        columns: &'static [Column],
        map: &ColumnMap,
        header_help: &str,
    ) -> Result<Self, Diagnostic> {
        let (header, read, separator) = (Vec::new(), Vec::new(), Separator::Blanks);
        let (comma, point, is_decimal) = (None, None, false);
        let mut table = Self { source, columns, header, read, separator, next: 0, comma, point, is_decimal };
        let mut comments = Vec::new();
        let first = loop {
            match table.line() {
                Some(line) if table.is_comment(line) => comments.push(line),
                Some(line) => break line,
                None => {
                    return Err(Diagnostic::new("no header line").at(source, table.end()).help(header_help));
                }
            }
        };
        table.separator = Separator::of(table.text(first));
        let cells = table.named(first, table.separator)?;
        let is_number = |(text, _): &(String, Span)| text.replace(',', ".").parse::<f64>().is_ok();
        if cells.iter().all(is_number) {
            table.next = first.start;
            let is_known = |name: &str| columns.iter().any(|c| c.is_named(name) || map.names(c, name));
            let known = |names: &Vec<(String, Span)>| names.iter().filter(|(name, _)| is_known(name)).count();
            let names = comments.into_iter().filter_map(|line| {
                let line = table.trimmed(line, |c| COMMENT.contains(&c) || c.is_whitespace());
                table.named(line, Separator::of(table.text(line))).ok()
            });
            let best = names.filter(|names| names.len() == cells.len() && known(names) > 0).max_by_key(known);
            let numbers =
                || (1..).zip(&cells).map(|(n, (_, cell)): (usize, _)| (n.to_string(), *cell)).collect();
            table.header = best.unwrap_or_else(numbers);
        } else {
            table.header = cells;
            let end = table.next;
            // Rows may have another separator than the header.
            if let Some(row) = table.row()
                && (table.separator == Separator::Blanks
                    || !table.text(row).contains(|c| table.separator.is(c)))
            {
                table.separator = Separator::of(table.text(row));
            }
            table.next = end;
        }
        table.read = table.find(map)?;
        Ok(table)
    }

    /// Finds the cell of each column.
    fn find(&self, map: &ColumnMap) -> Result<Vec<Option<(usize, f64)>>, Diagnostic> {
        let names = self.header.iter().map(|(name, _)| name.as_str());
        let mapped = self.columns.iter().map(|column| map.find(column, names.clone()).transpose());
        let mapped: Result<Vec<_>, _> = mapped.collect();
        let mut found = mapped.map_err(|e| e.at(self.source, self.header_end()))?;
        let taken: Vec<usize> = found.iter().flatten().map(|(cell, _)| *cell).collect();
        for (column, found) in self.columns.iter().zip(&mut found).filter(|(_, found)| found.is_none()) {
            let named = |(cell, name): &(usize, &str)| column.is_named(name) && !taken.contains(cell);
            let mut cells = names.clone().enumerate().filter(named).map(|(cell, _)| cell);
            *found = cells.next().map(|cell| (cell, 1.0));
            if let (Some((first, _)), Some(second)) = (*found, cells.next()) {
                let (name, span) = &self.header[second];
                return Err(Diagnostic::new(format!("the column `{name}` is there twice"))
                    .at(self.source, *span)
                    .related(self.source, self.header[first].1, "first here"));
            }
        }
        Ok(found)
    }

    /// Whether there is a column, by its number.
    pub fn has(&self, column: usize) -> bool {
        self.read.get(column).is_some_and(Option::is_some)
    }

    /// Names of the file's columns that nobody reads.
    pub fn ignored(&self) -> Vec<String> {
        self.unread().into_iter().map(str::to_owned).collect()
    }

    fn unread(&self) -> Vec<&str> {
        let is_read = |cell: usize| self.read.iter().flatten().any(|(read, _)| *read == cell);
        let names = self.header.iter().enumerate().filter(|(cell, _)| !is_read(*cell));
        names.map(|(_, (name, _))| name.as_str()).filter(|name| !name.is_empty()).collect()
    }

    /// An error about columns that are not there. It names those that are, and options that would help.
    pub fn lacks(&self, what: impl Into<String>, columns: &[usize], help: &str) -> Diagnostic {
        let mut unread = self.unread();
        let options = columns.iter().filter_map(|column| {
            let column = self.columns.get(*column)?;
            let like = |&i: &usize| (column.likeness(unread[i]), Reverse(i));
            let best = (0..unread.len()).max_by_key(like)?;
            Some(column.option(unread.remove(best)))
        });
        let options: Vec<String> = options.collect();
        let found: Vec<String> = self.header.iter().map(|(name, _)| format!("`{name}`")).collect();
        let mut text = format!("the file has {}", found.join(", "));
        if !options.is_empty() {
            text += &format!("; name the right ones, such as {}", options.join(" "));
        }
        if !help.is_empty() {
            text = format!("{help}; {text}");
        }
        Diagnostic::new(what).at(self.source, self.header_end()).help(text)
    }

    /// Place behind the header.
    pub fn header_end(&self) -> Span {
        Span::at(self.header.last().map_or(0, |(_, cell)| cell.end))
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
    /// out of range; commas and points as decimal marks of one file; commas that may separate thousands.
    pub fn next_row(&mut self, row: &mut [f64]) -> Result<Option<Span>, Diagnostic> {
        let Some(line) = self.row() else { return self.is_clear().map(|()| None) };
        let mut cells = self.cells(line, self.separator)?;
        let want = self.header.len();
        // Some programs end every line with a separator.
        if cells.len() == want + 1 {
            cells.pop_if(|cell| cell.start == cell.end);
        }
        let found = cells.len();
        if found != want {
            let span = cells.get(want).copied();
            let span = span.unwrap_or(Span::at(cells.last().map_or(line.end, |cell| cell.end)));
            let many = if found == 1 { "" } else { "s" };
            let error = Diagnostic::new(format!("a row of {found} cell{many} under a header of {want}"));
            let label = match self.header.get(found) {
                Some((missing, _)) => format!("no `{missing}`"),
                None => "belongs to no column".into(),
            };
            let help = "where commas are decimal marks, semicolons or tabs separate the numbers";
            return Err(error.at(self.source, span).label(label).help(help));
        }
        let mut first = Span::at(line.start);
        for (column, value) in row.iter_mut().enumerate().take(self.columns.len()) {
            let Some((cell, factor)) = self.read[column] else { continue };
            *value = self.number(&self.columns[column], cell, cells[cell], factor)?;
            if column == 0 {
                first = cells[cell];
            }
        }
        Ok(Some(first))
    }

    /// Refuses decimal commas that may as well separate thousands.
    fn is_clear(&self) -> Result<(), Diagnostic> {
        let Some(cell) = self.comma.filter(|_| !self.is_decimal) else { return Ok(()) };
        let text = self.text(cell);
        let what = format!("`{text}` may be {} or {}", text.replace(',', ""), text.replace(',', "."));
        Err(Diagnostic::new(what).at(self.source, cell).help("write numbers with a point"))
    }

    fn number(&mut self, column: &Column, cell: usize, span: Span, factor: f64) -> Result<f64, Diagnostic> {
        let text = self.text(span);
        let parsed = match text.split_once(',') {
            Some((before, after)) => {
                self.comma.get_or_insert(span);
                let digits = before.trim_start_matches(['-', '+']);
                let is_group =
                    after.len() == 3 && (1..=3).contains(&digits.len()) && !digits.starts_with('0');
                self.is_decimal |= !is_group;
                format!("{before}.{after}").parse::<f64>()
            }
            None => text.parse(),
        };
        if text.contains('.') {
            self.point.get_or_insert(span);
        }
        if let (Some(comma), Some(point)) = (self.comma, self.point) {
            let (first, second) = if comma.start < point.start { (comma, point) } else { (point, comma) };
            let what = format!("both `{}` and `{}` as numbers", self.text(first), self.text(second));
            let what = if first == second { format!("`{text}` has a comma and a point") } else { what };
            return Err(Diagnostic::new(what)
                .at(self.source, second)
                .help("write all numbers with a point, and nothing between thousands"));
        }
        let name = match &self.header[cell].0 {
            own if column.is_named(own) => format!("`{own}`"),
            own => format!("`{own}` (`{}`)", column.name),
        };
        let what = match parsed {
            Ok(x) if column.holds(factor * x) => return Ok(factor * x),
            Err(_) if text.is_empty() => format!("{name} is empty"),
            Err(_) => format!("{name} is `{text}`, which is not a number"),
            // A number too large for a double has digits.
            Ok(x) if !x.is_finite() && !text.bytes().any(|b| b.is_ascii_digit()) => {
                format!("{name} is `{text}`, which is not finite")
            }
            Ok(_) => format!("{name} is `{text}`, out of range"),
        };
        Err(Diagnostic::new(what).at(self.source, span).help(column.help()))
    }

    fn text(&self, span: Span) -> &'s str {
        &self.source.text()[span.start..span.end]
    }

    /// The next line that is not blank, without spaces around it.
    fn line(&mut self) -> Option<Span> {
        loop {
            let rest = self.source.text().get(self.next..).filter(|rest| !rest.is_empty())?;
            let start = self.next;
            self.next += rest.find(['\n', '\r']).map_or(rest.len(), |at| at + 1);
            // A tab may stand for an empty cell.
            let line = self.trimmed(Span { start, end: self.next }, |c| matches!(c, ' ' | '\r' | '\n'));
            if !self.text(line).trim().is_empty() {
                return Some(line);
            }
        }
    }

    fn is_comment(&self, line: Span) -> bool {
        self.text(line).trim_start().starts_with(COMMENT)
    }

    /// The next line of cells.
    fn row(&mut self) -> Option<Span> {
        loop {
            let line = self.line()?;
            if !self.is_comment(line) {
                return Some(line);
            }
        }
    }

    /// The cells of a line, without spaces and quotes around them.
    fn cells(&self, line: Span, separator: Separator) -> Result<Vec<Span>, Diagnostic> {
        let mut start = line.start;
        let cell = |cell: &str| {
            let own = cell.strip_suffix(|c| separator.is(c)).unwrap_or(cell);
            let span = self.trimmed(Span { start, end: start + own.len() }, char::is_whitespace);
            start += cell.len();
            let quoted = self.text(span).strip_prefix('"').is_some_and(|text| text.ends_with('"'));
            let inner = || Span { start: span.start + 1, end: span.end - 1 };
            if quoted { self.trimmed(inner(), char::is_whitespace) } else { span }
        };
        let all = self.text(line).split_inclusive(|c| separator.is(c)).map(cell);
        let is_cell = |cell: &Span| separator != Separator::Blanks || cell.start < cell.end;
        let mut cells: Vec<Span> = all.filter(is_cell).take(MOST_CELLS + 1).collect();
        if matches!(separator, Separator::Char(c) if self.text(line).ends_with(c)) {
            cells.push(Span::at(line.end));
        }
        if cells.len() > MOST_CELLS {
            let what = format!("a line of more than {MOST_CELLS} cells");
            return Err(Diagnostic::new(what).at(self.source, Span::at(line.start)).help("is this a table?"));
        }
        Ok(cells)
    }

    /// The cells of a line with their texts.
    fn named(&self, line: Span, separator: Separator) -> Result<Vec<(String, Span)>, Diagnostic> {
        let mut cells = self.cells(line, separator)?;
        cells.pop_if(|cell| cell.start == cell.end);
        Ok(cells.into_iter().map(|cell| (self.text(cell).to_owned(), cell)).collect())
    }

    fn trimmed(&self, span: Span, is_space: impl Fn(char) -> bool) -> Span {
        let text = self.text(span);
        let start = span.start + text.len() - text.trim_start_matches(&is_space).len();
        Span { start, end: start + text.trim_matches(&is_space).len() }
    }
}
