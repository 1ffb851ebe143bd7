//! The result as text, JSON, CSV and picture.

use std::fmt::Write as _;

use asperity_accuracy::accuracy::Rhythm;
use asperity_accuracy::accuracy::rhythm::{self as agreement, RhythmAgreement};
use asperity_plot::{Column, Dots};
use serde_json::{Map, Value, json};

use super::contest::{Outcome, Row};
use super::vectors::{Delay, Score, Set};

/// Widest line.
const WIDTH: usize = 108;
/// Widest label that stands in its row; a longer one has a line of its own.
const LABEL: usize = 28;

/// A column: two lines of heading, and the cell of each row.
struct TextColumn<'a> {
    head: [String; 2],
    cell: Box<dyn Fn(&Row) -> String + 'a>,
}

impl<'a> TextColumn<'a> {
    fn new(above: &str, below: &str, cell: impl Fn(&Row) -> String + 'a) -> Self {
        Self { head: [above.to_owned(), below.to_owned()], cell: Box::new(cell) }
    }
}

/// The result as text: accuracy, rhythm and cost of each method, then remarks.
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
            "Level and LTAS (rms error of the long-term spectrum) in dB on {name}, \
             the smoothest over frequency,\n\
             where convergence says little and both should be near 0."
        );
    }
    grid(&mut out, &accuracy, rates_unit(set), &[("", rows), ("published", published)]);
    if let Some(noise) = outcome.noise {
        let name = set.smoothest().map_or("", |v| set.vectors[v].short_name());
        let _ = writeln!(
            out,
            "\nRhythm on the mean spectrum of {name}, held still for 8 s: \
             a texture at constant speed and force.\n\
             Pulses: modulation depth of the envelope from 15 to 25 Hz. \
             Repetition: largest autocorrelation of the\n\
             envelope or the wave at lags of 20 to 200 ms. \
             Right is what Gaussian noise of the same spectrum has."
        );
        let fair = Row { rhythm: Some(noise), ..Row::new("Gaussian noise", set.vectors.len()) };
        grid(&mut out, &rhythm_columns(), "", &[("", rows), ("for comparison", &[fair])]);
    }
    let _ = writeln!(
        out,
        "\nResponse lag: ms from a step of 12 dB in the magnitudes \
         until the output is 10, 50, 90 % of the way there.\n\
         Added latency: ms as declared; early where negative. \
         us/frame: median until there are samples, overlap_add\n\
         included where the node answers spectra; \
         N is the window's length, and a frame has the vectors' bins."
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

/// Unit of the rates above the columns; empty if there is only one rate.
fn rates_unit(set: &Set) -> &'static str {
    if set.rates().len() == 1 { "" } else { "kHz" }
}

fn accuracy(set: &Set) -> Vec<TextColumn<'_>> {
    let one_rate = set.rates().len() == 1;
    let mut columns: Vec<TextColumn<'_>> = Vec::new();
    for (v, vector) in set.vectors.iter().enumerate() {
        let rate = if one_rate { String::new() } else { (f64::from(vector.rate_hz) / 1e3).to_string() };
        columns.push(TextColumn::new(vector.short_name(), &rate, move |row| {
            let mark = if row.faults[v] > 0 { "!" } else { "" };
            row.scores[v].map_or("-".into(), |s| format!("{mark}{}", number(s.convergence_db, 1)))
        }));
    }
    if let Some(v) = set.smoothest() {
        columns.push(TextColumn::new("level", "", move |row| {
            let text = |s: Score| {
                if s.is_silent() {
                    "silent".into()
                } else {
                    format!("{:+.2}", (s.level_db * 100.0).round() / 100.0 + 0.0)
                }
            };
            row.scores[v].map_or("-".into(), text)
        }));
        columns.push(TextColumn::new("LTAS", "", move |row| {
            let heard = row.scores[v].filter(|s| !s.is_silent());
            heard.map_or("-".into(), |s| number(s.ltas_rms_db, 2))
        }));
    }
    columns
}

fn rhythm_columns() -> Vec<TextColumn<'static>> {
    let column = |name: &str, decimals: usize, figure: fn(Rhythm) -> f64| {
        TextColumn::new(name, "", move |row| row.rhythm.map_or("-".into(), |r| number(figure(r), decimals)))
    };
    vec![
        column("pulses", 2, |r| r.pulses()),
        column("repetition", 2, |r| r.repetition()),
        column("kurtosis", 1, |r| r.kurtosis),
    ]
}

fn cost(set: &Set) -> Vec<TextColumn<'_>> {
    let mut columns: Vec<TextColumn<'_>> = Vec::new();
    for (i, share) in ["10 %", "50 %", "90 %"].into_iter().enumerate() {
        let above = if i == 0 { "texture" } else { "" };
        columns.push(TextColumn::new(above, share, move |r| ms(r.texture_lag_ms, i)));
    }
    for (i, share) in ["10 %", "50 %", "90 %"].into_iter().enumerate() {
        columns.push(TextColumn::new(if i == 0 { "tone" } else { "" }, share, move |r| ms(r.tone_lag_ms, i)));
    }
    columns.push(TextColumn::new("added", "latency", |r| match r.delay {
        Delay::Ms(ms) => number(ms, 1),
        Delay::Offline => "offline".into(),
        Delay::Unknown => "-".into(),
    }));
    for rate in set.rates() {
        columns.push(TextColumn::new("us/frame", &format!("N = {}", rate / 10), move |r| {
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

/// Label of a row in its group.
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

/// Writes groups of rows under one heading. Columns that do not fit into the width go on below.
fn grid(out: &mut String, columns: &[TextColumn<'_>], counts: &str, groups: &[(&str, &[Row])]) {
    let rows = || groups.iter().flat_map(|(group, rows)| rows.iter().map(move |row| (*group, row)));
    let first = rows().map(|(group, row)| label(group, row).chars().count()).filter(|n| *n <= LABEL).max();
    let first = first.unwrap_or(0).max(12);
    let width = |c: &TextColumn<'_>| {
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

/// Columns side by side, behind the labels.
struct Band<'a, 'b> {
    columns: &'a [TextColumn<'b>],
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

    fn line(&self, out: &mut String, first: &str, cell: impl Fn(&TextColumn<'_>) -> String) {
        let mut text = format!("{first:width$}", width = self.first);
        for (column, width) in self.columns.iter().zip(self.widths) {
            let _ = write!(text, "{:>width$}", cell(column));
        }
        let _ = writeln!(out, "{}", text.trim_end());
    }
}

/// The result as JSON.
pub fn json(set: &Set, outcome: &Outcome, published: &[Row]) -> Value {
    let vectors: Vec<Value> = set
        .vectors
        .iter()
        .map(|v| {
            let layout = v.frames.layout();
            json!({
                "name": v.name, "rate_hz": v.rate_hz, "window": layout.length, "bins": layout.bins,
                "frames": v.frames.count(), "roughness": v.roughness(),
            })
        })
        .collect();
    let all = |rows: &[Row]| rows.iter().map(|row| row_json(set, row)).collect::<Vec<_>>();
    json!({
        "vectors": vectors, "smoothest": set.smoothest().map(|v| set.vectors[v].name.clone()),
        "noise": outcome.noise.map(rhythm_json), "methods": all(&outcome.rows), "published": all(published),
    })
}

fn row_json(set: &Set, row: &Row) -> Value {
    let mut scores = Map::new();
    for (v, vector) in set.vectors.iter().enumerate() {
        let score = row.scores[v].map(|s| {
            json!({
                "convergence_db": s.convergence_db, "level_db": s.level_db, "ltas_rms_db": s.ltas_rms_db,
                "faults": row.faults[v],
            })
        });
        scores.insert(vector.name.clone(), score.unwrap_or_default());
    }
    let us: Map<String, Value> =
        row.frame_us.iter().map(|(rate, us)| (rate.to_string(), json!(us))).collect();
    let (latency, offline) = delay(row.delay);
    json!({
        "label": row.label, "kind": row.kind, "scores": scores, "latency_ms": latency, "offline": offline,
        "lag_ms": {"texture": row.texture_lag_ms, "tone": row.tone_lag_ms}, "us_a_frame": us,
        "rhythm": row.rhythm.map(rhythm_json), "notes": row.notes,
    })
}

fn rhythm_json(r: Rhythm) -> Value {
    json!({
        "modulation": r.modulation, "pulses": r.pulses(), "envelope_repetition": r.envelope_repetition,
        "wave_repetition": r.wave_repetition, "repetition": r.repetition(), "kurtosis": r.kurtosis,
        "level_deviation_db": r.level_deviation_db,
    })
}

/// Pulses, repetition and kurtosis.
fn rhythm_cells(r: Option<Rhythm>) -> [String; 3] {
    [cell(r.map(|r| r.pulses())), cell(r.map(|r| r.repetition())), cell(r.map(|r| r.kurtosis))]
}

fn delay(delay: Delay) -> (Option<f64>, bool) {
    match delay {
        Delay::Ms(ms) => (Some(ms), false),
        Delay::Offline => (None, true),
        Delay::Unknown => (None, false),
    }
}

/// The result as CSV: a line for each method and vector. Figures of the method alone are repeated.
pub fn csv(set: &Set, outcome: &Outcome, published: &[Row]) -> String {
    let mut out = String::from(
        "method,kind,published,vector,rate_hz,convergence_db,level_db,ltas_rms_db,faults,latency_ms,offline,\
         lag_texture_10_ms,lag_texture_50_ms,lag_texture_90_ms,lag_tone_10_ms,lag_tone_50_ms,lag_tone_90_ms,\
         us_a_frame,pulses,repetition,kurtosis,noise_pulses,noise_repetition,noise_kurtosis,notes\n",
    );
    for (row, published) in outcome.rows.iter().map(|r| (r, false)).chain(published.iter().map(|r| (r, true)))
    {
        for (v, vector) in set.vectors.iter().enumerate() {
            let score = row.scores[v];
            let mut cells = vec![
                quoted(&row.label),
                quoted(row.kind.as_deref().unwrap_or("")),
                published.to_string(),
                quoted(&vector.name),
                vector.rate_hz.to_string(),
                cell(score.map(|s| s.convergence_db)),
                cell(score.map(|s| s.level_db)),
                cell(score.map(|s| s.ltas_rms_db)),
                row.faults[v].to_string(),
                cell(delay(row.delay).0),
                delay(row.delay).1.to_string(),
            ];
            for lag in [row.texture_lag_ms, row.tone_lag_ms] {
                cells.extend((0..3).map(|i| cell(lag.map(|l| l[i]))));
            }
            cells.push(cell(row.frame_us.get(&vector.rate_hz).copied()));
            cells.extend(rhythm_cells(row.rhythm));
            cells.extend(rhythm_cells(outcome.noise));
            cells.push(quoted(&row.notes.join("; ")));
            let _ = writeln!(out, "{}", cells.join(","));
        }
    }
    out
}

/// A number to a ten-thousandth; nothing where there is none.
fn cell(x: Option<f64>) -> String {
    x.map_or(String::new(), |x| format!("{x:.4}"))
}

/// A text as a field (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// The result as a picture, with published scores as ticks.
pub fn svg(set: &Set, outcome: &Outcome, published: &[Row]) -> String {
    let rows = outcome.rows.as_slice();
    let accuracy = Accuracy { rows, published };
    let one_rate = set.rates().len() == 1;
    let convergence = set.vectors.iter().enumerate().map(|(v, vector)| {
        let unit = if one_rate { "dB".into() } else { format!("dB, {} Hz", vector.rate_hz) };
        accuracy.column(vector.short_name(), &unit, v, |s| Some(s.convergence_db))
    });
    let mut groups = vec![("Spectral convergence, less is better".to_owned(), convergence.collect())];
    let mut cost = Vec::new();
    if let Some(v) = set.smoothest() {
        let on = |unit: &str| format!("{unit} on {}", set.vectors[v].short_name());
        cost.push(Column {
            decimals: 2,
            ..accuracy.column("level error", &on("|dB|"), v, |s| (!s.is_silent()).then_some(s.level_db.abs()))
        });
        cost.push(Column {
            decimals: 2,
            ..accuracy.column("LTAS error", &on("rms dB"), v, |s| (!s.is_silent()).then_some(s.ltas_rms_db))
        });
    }
    let figures = |name: &str, unit: &str, logarithmic: bool, of: &dyn Fn(&Row) -> Vec<f64>| Column {
        name: name.into(),
        unit: unit.into(),
        decimals: 1,
        logarithmic,
        values: rows.iter().map(of).collect(),
        others: Vec::new(),
    };
    let ms = |lag: Option<[f64; 3]>| lag.map_or(Vec::new(), Vec::from);
    cost.push(figures("lag of a texture", "ms, 10 to 90 %", false, &|r| ms(r.texture_lag_ms)));
    cost.push(figures("lag of a tone", "ms, 10 to 90 %", false, &|r| ms(r.tone_lag_ms)));
    cost.push(figures("added latency", "ms", false, &|r| match r.delay {
        Delay::Ms(ms) => vec![ms],
        Delay::Offline | Delay::Unknown => Vec::new(),
    }));
    for rate in set.rates() {
        let us = |r: &Row| r.frame_us.get(&rate).copied().filter(|us| *us > 0.0).into_iter().collect();
        cost.push(figures("us a frame", &format!("median, N = {}", rate / 10), true, &us));
    }
    groups.push(("Level, response and cost".to_owned(), cost));
    if let Some(noise) = outcome.noise {
        let off = |row: &Row| agreement::compare(&row.rhythm?, &[noise]).ok();
        let column = |name: &str, unit: &str, decimals, figure: fn(RhythmAgreement) -> f64| Column {
            decimals,
            ..figures(name, unit, false, &|row| off(row).map(figure).into_iter().collect())
        };
        let rhythm = vec![
            column("pulses", "15 to 25 Hz, |dB|", 1, |a| a.pulses_db.abs()),
            column("repetition", "0 to 1", 2, |a| a.repetition),
            column("kurtosis", "|dB|", 1, |a| a.kurtosis_db),
        ];
        groups.push(("Rhythm on steady magnitudes, off that of Gaussian noise".to_owned(), rhythm));
    }
    Dots {
        title: "Phase retrieval compared".into(),
        subtitles: vec![
            format!("Vectors: {}. Methods by their mean rank in spectral convergence.", set.from),
            "Orange: least of its column. Level and LTAS on the vector smoothest over frequency, \
             where convergence says little."
                .into(),
        ],
        rows: rows.iter().map(|r| r.label.clone()).collect(),
        others: "published".into(),
        groups,
    }
    .to_svg()
}

/// Scores of measured and published rows.
struct Accuracy<'a> {
    rows: &'a [Row],
    published: &'a [Row],
}

impl Accuracy<'_> {
    fn column(&self, name: &str, unit: &str, v: usize, of: fn(&Score) -> Option<f64>) -> Column {
        let value = |row: &Row| row.scores[v].as_ref().and_then(of);
        Column {
            name: name.into(),
            unit: unit.into(),
            decimals: 1,
            logarithmic: false,
            values: self.rows.iter().map(|r| value(r).into_iter().collect()).collect(),
            others: self.published.iter().filter_map(|r| Some((r.label.clone(), value(r)?))).collect(),
        }
    }
}
