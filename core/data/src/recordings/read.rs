//! Strokes from files: tables, and WAV files with the file that names their channels.

use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::ron;
use asperity_diagnostics::{Diagnostic, Source, Span};
use asperity_motion::Table;

use super::channels::{self, Channels, NONE, QUANTITIES, TIME};
use super::stroke::Stroke;
use crate::wav::Wav;

const HEADER_HELP: &str =
    "the first line names the columns, such as `t_s,force_n,vx_mm_s,vy_mm_s,ax_m_s2,ay_m_s2,az_m_s2`";
/// Largest full scale in any unit.
const MAX_FULL_SCALE: f64 = 1e6;

/// Reads a table; the [module above](super) says what it holds.
pub(super) fn table(source: &Arc<Source>) -> Result<Stroke, Diagnostic> {
    let mut table = Table::open(source, &QUANTITIES, HEADER_HELP)?;
    if !table.has(TIME) {
        return Err(Diagnostic::new("no clock").at(source, table.header_end()).help("`t_s` or `time_s`"));
    }
    channels::check(|i| table.has(i)).map_err(|e| e.at(source, table.header_end()))?;
    let mut channels: Channels = std::array::from_fn(|i| table.has(i).then(Vec::new));
    let mut clock = Vec::new();
    let mut row = [0.0; QUANTITIES.len()];
    while let Some(span) = table.next_row(&mut row)? {
        clock.push(span);
        for (channel, value) in channels.iter_mut().zip(row) {
            channel.iter_mut().for_each(|samples| samples.push(value));
        }
    }
    let time = channels[TIME].take().unwrap_or_default();
    let rate_hz = steady_rate(source, &time, &clock)?;
    channels::stroke(channels, rate_hz).map_err(|e| e.at(source, table.end()))
}

/// The rate of a clock that is never more than half a step off a steady one.
fn steady_rate(source: &Arc<Source>, time: &[f64], cells: &[Span]) -> Result<f64, Diagnostic> {
    let end = Span::at(source.text().len());
    let ([first, .., last], steps) = (time, time.len().saturating_sub(1) as f64) else {
        return Err(Diagnostic::new("a stroke of no rows or one").at(source, end));
    };
    let step = (last - first) / steps;
    let off = |(i, t): (usize, &f64)| (t - first - i as f64 * step).abs() > 0.5 * step;
    // Lost samples take the clock off the line anywhere. The row to name is the first of the oddest step.
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
    // A reader looks for the file's length at its last row.
    channels::rate(1.0 / step).map_err(|e| e.at(source, cells.last().copied().unwrap_or(end)))
}

/// Reads a WAV file; `names` is the file that names its channels.
pub(super) fn wav(path: &Path, names: &Path) -> Result<Stroke, Diagnostic> {
    let fail = |what: String| Diagnostic::new(what).in_file(path);
    if !names.is_file() {
        return Err(fail("nothing says what the channels of this file are".into())
            .help(format!("write {} with `Recording(channels: [...])`", names.display())));
    }
    let source = Source::read(names)?;
    let listed = names_of(&source)?;
    let wav = Wav::read(path, u32::MAX)?;
    let rate_hz = channels::rate(f64::from(wav.rate_hz)).map_err(|e| e.in_file(path))?;
    if wav.channels != listed.len() {
        return Err(fail(format!("{} channels, and {} are named", wav.channels, listed.len()))
            .help(format!("{} names all, those to be left out as `{NONE}`", names.display())));
    }
    let mut read: Channels = std::array::from_fn(|_| None);
    for (number, &(quantity, full_scale)) in listed.iter().enumerate() {
        let Some(quantity) = quantity else { continue };
        let channel: Vec<f64> = wav.channel(number).map(|x| x * full_scale).collect();
        let column = &QUANTITIES[quantity];
        if let Some((i, x)) = channel.iter().enumerate().find(|(_, x)| !column.holds(**x)) {
            let what = format!("`{}` is {x} at {} s", column.name, i as f64 / rate_hz);
            return Err(fail(what).help(column.help()));
        }
        read[quantity] = Some(channel);
    }
    channels::stroke(read, rate_hz).map_err(|e| e.in_file(path))
}

/// For each channel the number of its quantity, unless it is left out, and its full scale.
fn names_of(source: &Arc<Source>) -> Result<Vec<(Option<usize>, f64)>, Diagnostic> {
    let whole = ron::parse(source)?;
    let mut record = whole.record("Recording")?;
    let list = record.required("channels")?;
    record.finish()?;
    let mut named: Vec<(Option<usize>, f64)> = Vec::new();
    for entry in list.list()? {
        let mut channel = entry.record("Channel")?;
        let value = channel.required("quantity")?;
        let full_scale = channel.optional("full_scale");
        channel.finish()?;
        let name = value.text()?;
        let quantity = channels::number(name)
            .map_err(|help| value.error(format!("unknown quantity `{name}`")).help(help))?;
        if quantity.is_some() && named.iter().any(|(q, _)| *q == quantity) {
            return Err(value.error(format!("`{name}` is there twice")));
        }
        let full_scale = match (full_scale, quantity) {
            (Some(value), _) => value.f64_in(1e-6..=MAX_FULL_SCALE, "")?,
            (None, None) => 1.0,
            (None, Some(_)) => {
                return Err(entry
                    .error("the field `full_scale` is missing")
                    .help("the value at full scale, in the quantity's unit"));
            }
        };
        named.push((quantity, full_scale));
    }
    channels::check(|i| named.iter().any(|(q, _)| *q == Some(i))).map_err(|e| e.at(source, list.span()))?;
    Ok(named)
}
