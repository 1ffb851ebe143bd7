//! A stroke from a CSV file.

use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::{Diagnostic, Source, Span, one_of};

use super::channels::{self, Channels, QUANTITIES, TIME};
use super::stroke::Stroke;

const HEADER_HELP: &str =
    "the first line names the columns, such as `t_s,force_n,vx_mm_s,vy_mm_s,ax_m_s2,ay_m_s2,az_m_s2`";

/// Reads a file; what it holds is said in the [module above](super).
pub(super) fn read(path: &Path) -> Result<Stroke, Diagnostic> {
    parse(&Source::read(path)?)
}

/// Reads a text.
pub(super) fn parse(source: &Arc<Source>) -> Result<Stroke, Diagnostic> {
    let mut lines = lines(source.text());
    let end = Span::at(source.text().len());
    let Some(header) = lines.next() else {
        return Err(Diagnostic::new("no header line").at(source, end).help(HEADER_HELP));
    };
    let columns = columns(source, header)?;
    let header_end = Span::at(columns.last().map_or(0, |c| c.span.end));
    let named = |i: usize| columns.iter().any(|c| c.quantity == i);
    if !named(TIME) {
        return Err(Diagnostic::new("no clock").at(source, header_end).help("`t_s` or `time_s`"));
    }
    channels::check(named).map_err(|e| e.at(source, header_end))?;
    let mut channels: Channels = std::array::from_fn(|i| named(i).then(Vec::new));
    let mut clock = Vec::new();
    for line in lines {
        let mut found = cells(source.text(), line);
        for column in &columns {
            let Some(cell) = found.next() else {
                return Err(Diagnostic::new("a row with fewer cells than the header")
                    .at(source, Span::at(line.end))
                    .label(format!("no `{}`", QUANTITIES[column.quantity].name)));
            };
            let value = number(source, cell, column.quantity)?;
            if column.quantity == TIME {
                clock.push(cell);
            }
            if let Some(channel) = &mut channels[column.quantity] {
                channel.push(value);
            }
        }
        if let Some(extra) = found.next() {
            return Err(Diagnostic::new("a row with more cells than the header")
                .at(source, extra)
                .label("belongs to no column"));
        }
    }
    let time = channels[TIME].take().unwrap_or_default();
    let rate_hz = steady_rate(source, &time, &clock)?;
    channels::stroke(channels, rate_hz).map_err(|e| e.at(source, end))
}

struct Column {
    quantity: usize,
    span: Span,
}

fn columns(source: &Arc<Source>, header: Span) -> Result<Vec<Column>, Diagnostic> {
    let mut columns: Vec<Column> = Vec::new();
    for span in cells(source.text(), header) {
        let name = &source.text()[span.start..span.end];
        let Some(quantity) = channels::quantity(name) else {
            let help = match name.contains([';', '\t']) {
                true => "cells are separated by commas, and a decimal mark is a point".to_owned(),
                false => one_of(name, QUANTITIES.iter().map(|q| q.name)),
            };
            return Err(Diagnostic::new(format!("unknown column `{name}`")).at(source, span).help(help));
        };
        if let Some(first) = columns.iter().find(|c| c.quantity == quantity) {
            return Err(Diagnostic::new(format!("the column `{name}` is there twice"))
                .at(source, span)
                .related(source, first.span, "first here"));
        }
        columns.push(Column { quantity, span });
    }
    Ok(columns)
}

fn number(source: &Arc<Source>, cell: Span, quantity: usize) -> Result<f64, Diagnostic> {
    let text = &source.text()[cell.start..cell.end];
    let channels::Quantity { name, range: (least, greatest), unit } = &QUANTITIES[quantity];
    let what = match text.parse::<f64>() {
        Ok(x) if x >= *least && x <= *greatest => return Ok(x),
        Ok(x) if x.is_nan() => "which is not finite",
        Ok(_) => "out of range",
        Err(_) if text.is_empty() => "which is nothing",
        Err(_) => "which is not a number",
    };
    Err(Diagnostic::new(format!("`{name}` is `{text}`, {what}"))
        .at(source, cell)
        .help(format!("`{name}` is a number from {least} to {greatest} {unit}")))
}

/// The rate of a clock that goes on by one step a row, to within half a step of where it should be.
fn steady_rate(source: &Arc<Source>, time: &[f64], cells: &[Span]) -> Result<f64, Diagnostic> {
    let end = Span::at(source.text().len());
    let ([first, .., last], steps) = (time, time.len().saturating_sub(1) as f64) else {
        return Err(Diagnostic::new("a stroke of no rows or one").at(source, end));
    };
    let step = (last - first) / steps;
    let off = |(i, t): (usize, &f64)| (t - first - i as f64 * step).abs() > 0.5 * step;
    // Where samples are lost the clock leaves the line through its ends anywhere: the row that is named is the first of the oddest step.
    if step <= 0.0 || time.iter().enumerate().any(off) {
        let oddest = (1..time.len()).rev().max_by(|a, b| {
            let jump = |i: &usize| (time[*i] - time[*i - 1] - step).abs();
            jump(a).total_cmp(&jump(b))
        });
        let span = oddest.and_then(|i| cells.get(i)).copied().unwrap_or(end);
        return Err(Diagnostic::new("the clock is not steady")
            .at(source, span)
            .label("furthest from the mean step")
            .help("each row is one sample, none is missing, and `t_s` rises by the same step"));
    }
    // The end of the last row is where a reader of the file looks for its length.
    channels::rate(1.0 / step).map_err(|e| e.at(source, cells.last().copied().unwrap_or(end)))
}

/// The lines of a text that are neither blank nor comments, without spaces around them.
fn lines(text: &str) -> impl Iterator<Item = Span> + '_ {
    let mut start = 0;
    text.split_inclusive('\n').filter_map(move |line| {
        let span = trimmed(text, Span { start, end: start + line.len() });
        start += line.len();
        let content = &text[span.start..span.end];
        (!content.is_empty() && !content.starts_with('#')).then_some(span)
    })
}

/// The cells of a line, without spaces and quotes around them.
fn cells(text: &str, line: Span) -> impl Iterator<Item = Span> + '_ {
    let mut start = line.start;
    text[line.start..line.end].split(',').map(move |cell| {
        let span = trimmed(text, Span { start, end: start + cell.len() });
        start += cell.len() + 1;
        let content = &text[span.start..span.end];
        match content.strip_prefix('"').and_then(|c| c.strip_suffix('"')) {
            Some(_) => trimmed(text, Span { start: span.start + 1, end: span.end - 1 }),
            None => span,
        }
    })
}

fn trimmed(text: &str, span: Span) -> Span {
    let part = &text[span.start..span.end];
    let start = span.start + part.len() - part.trim_start().len();
    Span { start, end: start + part.trim().len() }
}
