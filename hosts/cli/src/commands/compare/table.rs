//! The result as text for a terminal.

use std::fmt::Write as _;

use asperity_accuracy::accuracy::Rhythm;

use super::contest::{Outcome, Row};
use super::published::{Delay, Score};
use super::vectors::Set;

/// Widest line.
const WIDTH: usize = 108;
/// Widest label that stands in its row; a longer one has a line of its own.
const LABEL: usize = 28;

/// A column: two lines of heading, and what each row has there. What the second line counts stands before it.
struct Column<'a> {
    head: [String; 2],
    cell: Box<dyn Fn(&Row) -> String + 'a>,
}

impl<'a> Column<'a> {
    fn new(above: &str, below: &str, cell: impl Fn(&Row) -> String + 'a) -> Self {
        Self { head: [above.to_owned(), below.to_owned()], cell: Box::new(cell) }
    }
}

/// Accuracy of all rows, then what each method costs, then what else there is to say.
pub fn text(set: &Set, outcome: &Outcome, published: &[Row]) -> String {
    let mut out = String::new();
    let (accuracy, rows) = (accuracy(set), outcome.rows.as_slice());
    let _ = writeln!(
        out,
        "Spectral convergence in dB, less is better; methods by their mean rank. Vectors: {}.",
        set.from
    );
    if let Some(smooth) = set.smoothest() {
        let name = set.vectors[smooth].short_name();
        let _ = writeln!(
            out,
            "Level and LTAS (rms error of the long-term spectrum) in dB on {name}, the smoothest over frequency,\n\
             where convergence says little and both should be near 0."
        );
    }
    grid(&mut out, &accuracy, rates_unit(set), &[("", rows), ("published", published)]);
    if let Some(noise) = outcome.noise {
        let name = set.smoothest().map_or("", |v| set.vectors[v].short_name());
        let _ = writeln!(
            out,
            "\nRhythm on the mean spectrum of {name}, held still for 8 s: a texture at constant speed and force.\n\
             Pulses: modulation depth of the envelope from 15 to 25 Hz. Repetition: largest autocorrelation of the\n\
             envelope or the wave at lags of 20 to 200 ms. Right is what Gaussian noise of the same spectrum has."
        );
        let fair = Row { rhythm: Some(noise), ..Row::new("Gaussian noise", set.vectors.len()) };
        grid(&mut out, &rhythm(), "", &[("", rows), ("for comparison", &[fair])]);
    }
    let _ = writeln!(
        out,
        "\nResponse lag: ms from a step of 12 dB in the magnitudes until the output is 10, 50, 90 % of the way there.\n\
         Added latency: ms as declared; early where negative. us/frame: median until there are samples, overlap_add\n\
         included where the node answers spectra; N is the window's length, and a frame has the vectors' bins."
    );
    grid(&mut out, &cost(set), "", &[("", rows)]);
    let notes: Vec<String> =
        rows.iter().flat_map(|r| r.notes.iter().map(move |n| format!("  {}: {n}\n", r.label))).collect();
    if !notes.is_empty() {
        let _ =
            write!(out, "\nnotes (! marks a score of a run in which the node failed)\n{}", notes.concat());
    }
    out
}

/// What the rates above the columns are counted in; nothing where there is but one.
fn rates_unit(set: &Set) -> &'static str {
    if set.rates().len() == 1 { "" } else { "kHz" }
}

fn accuracy(set: &Set) -> Vec<Column<'_>> {
    let one_rate = set.rates().len() == 1;
    let mut columns: Vec<Column<'_>> = Vec::new();
    for (v, vector) in set.vectors.iter().enumerate() {
        let rate = if one_rate { String::new() } else { (f64::from(vector.rate_hz) / 1e3).to_string() };
        columns.push(Column::new(vector.short_name(), &rate, move |row| {
            let mark = if row.faults[v] > 0 { "!" } else { "" };
            row.scores[v].map_or("-".into(), |s| format!("{mark}{}", number(s.convergence_db, 1)))
        }));
    }
    if let Some(v) = set.smoothest() {
        columns.push(Column::new("level", "", move |row| {
            let text = |s: Score| {
                if s.is_silent() {
                    "silent".into()
                } else {
                    format!("{:+.2}", (s.level_db * 100.0).round() / 100.0 + 0.0)
                }
            };
            row.scores[v].map_or("-".into(), text)
        }));
        columns.push(Column::new("LTAS", "", move |row| {
            let heard = row.scores[v].filter(|s| !s.is_silent());
            heard.map_or("-".into(), |s| number(s.ltas_rms_db, 2))
        }));
    }
    columns
}

fn rhythm() -> Vec<Column<'static>> {
    let column = |name: &str, decimals: usize, figure: fn(Rhythm) -> f64| {
        Column::new(name, "", move |row| row.rhythm.map_or("-".into(), |r| number(figure(r), decimals)))
    };
    vec![
        column("pulses", 2, |r| r.pulses()),
        column("repetition", 2, |r| r.repetition()),
        column("kurtosis", 1, |r| r.kurtosis),
    ]
}

fn cost(set: &Set) -> Vec<Column<'_>> {
    let mut columns: Vec<Column<'_>> = Vec::new();
    for (i, share) in ["10 %", "50 %", "90 %"].into_iter().enumerate() {
        let above = if i == 0 { "texture" } else { "" };
        columns.push(Column::new(above, share, move |r| ms(r.texture_lag_ms, i)));
    }
    for (i, share) in ["10 %", "50 %", "90 %"].into_iter().enumerate() {
        columns.push(Column::new(if i == 0 { "tone" } else { "" }, share, move |r| ms(r.tone_lag_ms, i)));
    }
    columns.push(Column::new("added", "latency", |r| match r.delay {
        Delay::Ms(ms) => number(ms, 1),
        Delay::Offline => "offline".into(),
        Delay::Unknown => "-".into(),
    }));
    for rate in set.rates() {
        columns.push(Column::new("us/frame", &format!("N = {}", rate / 10), move |r| {
            r.frame_us.get(&rate).map_or("-".into(), |us| format!("{us:.1}"))
        }));
    }
    columns
}

fn ms(lag: Option<[f64; 3]>, i: usize) -> String {
    lag.map_or("-".into(), |l| number(l[i], 1))
}

/// A number without a negative zero.
fn number(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    let zero = text.trim_start_matches('-').chars().all(|c| matches!(c, '0' | '.'));
    if zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// What a row is called among those of its group.
fn label(group: &str, row: &Row) -> String {
    let note = match row.delay {
        _ if group.is_empty() => String::new(),
        Delay::Offline => ", offline".into(),
        Delay::Ms(ms) if ms != 0.0 => format!(", {ms:+.0} ms"),
        _ => String::new(),
    };
    let indent = if group.is_empty() { "" } else { "  " };
    format!("{indent}{}{note}", row.label)
}

/// Groups of rows under one heading; columns that do not fit beside each other go on below.
fn grid(out: &mut String, columns: &[Column<'_>], counts: &str, groups: &[(&str, &[Row])]) {
    let rows = || groups.iter().flat_map(|(group, rows)| rows.iter().map(move |row| (*group, row)));
    let first = rows().map(|(group, row)| label(group, row).chars().count()).filter(|n| *n <= LABEL).max();
    let first = first.unwrap_or(0).max(12);
    let width = |c: &Column<'_>| {
        let cells = rows().map(|(_, row)| (c.cell)(row).chars().count());
        cells.chain(c.head.iter().map(|h| h.chars().count())).max().unwrap_or(0)
    };
    let mut widths: Vec<usize> = columns.iter().map(width).collect();
    let gap = if first + widths.iter().map(|w| w + 2).sum::<usize>() <= WIDTH { 2 } else { 1 };
    widths.iter_mut().for_each(|w| *w += gap);
    let mut from = 0;
    while from < columns.len() {
        let (mut to, mut line) = (from, first);
        while to < columns.len() && (to == from || line + widths[to] <= WIDTH) {
            line += widths[to];
            to += 1;
        }
        Band { columns: &columns[from..to], widths: &widths[from..to], first, counts }.write(out, groups);
        from = to;
    }
}

/// Columns beside each other, behind one of labels.
struct Band<'a, 'b> {
    columns: &'a [Column<'b>],
    widths: &'a [usize],
    first: usize,
    counts: &'a str,
}

impl Band<'_, '_> {
    fn write(&self, out: &mut String, groups: &[(&str, &[Row])]) {
        out.push('\n');
        self.line(out, "", |c| c.head[0].clone());
        if self.columns.iter().any(|c| !c.head[1].is_empty()) {
            self.line(out, &format!("{:>1$}", self.counts, self.first), |c| c.head[1].clone());
        }
        for (group, rows) in groups.iter().filter(|(_, rows)| !rows.is_empty()) {
            if !group.is_empty() {
                let _ = writeln!(out, "{group}");
            }
            for row in *rows {
                let label = label(group, row);
                if label.chars().count() <= self.first {
                    self.line(out, &label, |c| (c.cell)(row));
                } else {
                    let _ = writeln!(out, "{label}");
                    self.line(out, "", |c| (c.cell)(row));
                }
            }
        }
    }

    fn line(&self, out: &mut String, first: &str, cell: impl Fn(&Column<'_>) -> String) {
        let mut text = format!("{first:width$}", width = self.first);
        for (column, width) in self.columns.iter().zip(self.widths) {
            let _ = write!(text, "{:>width$}", cell(column));
        }
        let _ = writeln!(out, "{}", text.trim_end());
    }
}
