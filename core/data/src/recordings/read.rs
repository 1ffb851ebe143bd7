//! Strokes from files: tables, and WAV files with the file that names their channels. Their quantities.

use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::ron;
use asperity_diagnostics::{Diagnostic, Source, Span, one_of};
use asperity_motion::{Column, ColumnMap, Table};

use super::Recorded;
use crate::wav::Wav;

const HEADER_HELP: &str =
    "the first line names the columns, such as `t_s,force_n,vx_mm_s,vy_mm_s,ax_m_s2,ay_m_s2,az_m_s2`";
/// Largest full scale in any unit.
const MAX_FULL_SCALE: f64 = 1e6;

/// Rates that are accepted, in Hz.
const RATES_HZ: RangeInclusive<f64> = 1000.0..=10_000.0;
/// A rate near a multiple of this, in Hz, ..
const RATE_STEP_HZ: f64 = 10.0;
/// .. within this part, counts as that multiple: clocks are not exact.
const RATE_TOLERANCE: f64 = 2e-4;
/// Tolerance beyond the ends of the range, as a part.
const END_TOLERANCE: f64 = 2e-3;

/// Name of a channel that is left out.
const NONE: &str = "none";
const TIME: usize = 0;
const FORCE: usize = 1;
const VELOCITY: [usize; 2] = [2, 3];
const PLACE: [usize; 2] = [4, 5];
const SPEED: usize = 6;
const AXES: std::ops::Range<usize> = 7..10;
const ACCELERATION: usize = 10;

/// All quantities.
const QUANTITIES: [Column; 11] = [
    Column::TIME,
    Column::FORCE,
    Column::VX,
    Column::VY,
    Column::X,
    Column::Y,
    Column::SPEED,
    Column::AX,
    Column::AY,
    Column::AZ,
    Column::ACCELERATION,
];

/// The number of a quantity other than the time by its name. None for [`NONE`]; else help for the error.
fn number(name: &str) -> Result<Option<usize>, String> {
    let mut known = QUANTITIES.iter().enumerate().skip(TIME + 1);
    match known.clone().find(|(_, q)| q.name == name) {
        Some((number, _)) => Ok(Some(number)),
        None if name == NONE => Ok(None),
        None => Err(one_of(name, known.by_ref().map(|(_, q)| q.name).chain([NONE]).collect::<Vec<_>>())),
    }
}

/// Samples by quantity, if recorded.
type Channels = [Option<Vec<f64>>; QUANTITIES.len()];

/// A fault of some quantities: its words, the quantities that would mend it, and help.
type Wrong = (&'static str, &'static [usize], &'static str);

/// Checks that the quantities make a stroke.
fn check(has: impl Fn(usize) -> bool) -> Result<(), Wrong> {
    let both = |of: [usize; 2]| of.into_iter().all(&has);
    let motion = both(VELOCITY) || both(PLACE) || has(SPEED);
    match (has(FORCE), motion, AXES.into_iter().any(&has), has(ACCELERATION)) {
        (false, ..) => Err(("no force", &[FORCE], "`force_n`")),
        (_, false, ..) => {
            let help = "`vx_mm_s` and `vy_mm_s`, or `x_mm` and `y_mm`, or `speed_mm_s`";
            Err(("no motion", &[SPEED], help))
        }
        (_, _, false, false) => {
            let help = "`ax_m_s2`, `ay_m_s2`, `az_m_s2`, one at least, or `acceleration_m_s2`";
            Err(("no acceleration", &[ACCELERATION], help))
        }
        (_, _, true, true) => {
            let help = "either `acceleration_m_s2` or `ax_m_s2`, `ay_m_s2`, `az_m_s2`";
            Err(("the acceleration of one axis and of several", &[], help))
        }
        _ => Ok(()),
    }
}

fn without_table((what, _, help): Wrong) -> Diagnostic {
    Diagnostic::new(what).help(help)
}

/// Rounds a measured rate in Hz to the intended one.
fn rate(hz: f64) -> Result<f64, Diagnostic> {
    let round = (hz / RATE_STEP_HZ).round() * RATE_STEP_HZ;
    let meant = if (hz - round).abs() <= RATE_TOLERANCE * round { round } else { hz };
    let near = RATES_HZ.start() * (1.0 - END_TOLERANCE)..=RATES_HZ.end() * (1.0 + END_TOLERANCE);
    if near.contains(&meant) {
        return Ok(meant);
    }
    Err(Diagnostic::new(format!("a rate of {hz:.1} Hz")).help(format!(
        "recordings are read at {} to {} Hz; bring this one to such a rate",
        RATES_HZ.start(),
        RATES_HZ.end()
    )))
}

impl Recorded {
    /// A stroke from named columns, for files without names: `force_n`, `ax_m_s2` and the others of the
    /// [table](super), but no clock. A column `none` is left out.
    ///
    /// # Errors
    /// A name that is unknown or there twice; missing quantities; columns of different lengths; a
    /// number out of range; a rate outside 1 to 10 kHz; less than 0.5 s.
    pub fn from_columns(rate_hz: f64, columns: Vec<(&str, Vec<f64>)>) -> Result<Self, Diagnostic> {
        let rate_hz = rate(rate_hz)?;
        let mut channels: Channels = std::array::from_fn(|_| None);
        let len = columns.first().map_or(0, |(_, samples)| samples.len());
        for (name, samples) in columns {
            let number = number(name)
                .map_err(|help| Diagnostic::new(format!("unknown column `{name}`")).help(help))?;
            let Some(number) = number else { continue };
            if samples.len() != len {
                return Err(Diagnostic::new(format!("columns of {len} and of {} samples", samples.len())));
            }
            let column = &QUANTITIES[number];
            if let Some((row, x)) = samples.iter().enumerate().find(|(_, x)| !column.holds(**x)) {
                let what = format!("`{name}` is {x} in row {row}, at {} s", row as f64 / rate_hz);
                return Err(Diagnostic::new(what).help(column.help()));
            }
            if channels[number].replace(samples).is_some() {
                return Err(Diagnostic::new(format!("the column `{name}` is there twice")));
            }
        }
        stroke(channels, rate_hz)
    }
}

/// A stroke from its channels.
fn stroke(mut channels: Channels, rate_hz: f64) -> Result<Recorded, Diagnostic> {
    check(|i| channels[i].is_some()).map_err(without_table)?;
    let mut take = |i: usize| channels[i].take();
    let force = take(FORCE).unwrap_or_default();
    let (place, speed) = match (VELOCITY.map(&mut take), PLACE.map(&mut take), take(SPEED)) {
        ([Some(x), Some(y)], _, _) => ([x, y].map(|axis| travelled(&axis, rate_hz)), None),
        (_, [Some(x), Some(y)], _) => ([x, y], None),
        (_, _, speed) => {
            let speed = speed.unwrap_or_default();
            ([travelled(&speed, rate_hz), vec![0.0; speed.len()]], Some(speed))
        }
    };
    let mut acceleration: Vec<Vec<f64>> = AXES.filter_map(&mut take).collect();
    acceleration.extend(take(ACCELERATION));
    Recorded::new(rate_hz, force, place, speed, acceleration)
}

/// The way of a velocity from the first sample, by trapezoidal sums.
fn travelled(velocity: &[f64], rate_hz: f64) -> Vec<f64> {
    let (mut place, mut before) = (0.0, velocity.first().copied().unwrap_or(0.0));
    let step = |v: &f64| {
        place += 0.5 * (before + v) / rate_hz;
        before = *v;
        place
    };
    std::iter::once(0.0).chain(velocity.iter().skip(1).map(step)).take(velocity.len()).collect()
}

/// Reads one stroke from the text of a table.
///
/// # Errors
/// As [`recorded`](super::recorded) of a CSV file.
pub fn parse(source: &Arc<Source>, map: &ColumnMap) -> Result<Recorded, Diagnostic> {
    let mut table = Table::open(source, &QUANTITIES, map, HEADER_HELP)?;
    if !table.has(TIME) {
        return Err(table.lacks("no clock", &[TIME], "`t_s` or `time_s`"));
    }
    check(|i| table.has(i)).map_err(|(what, columns, help)| table.lacks(what, columns, help))?;
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
    let mut recorded = stroke(channels, rate_hz).map_err(|e| e.at(source, table.end()))?;
    recorded.ignored = table.ignored();
    Ok(recorded)
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
    rate(1.0 / step).map_err(|e| e.at(source, cells.last().copied().unwrap_or(end)))
}

/// Reads a WAV file; `names` is the file that names its channels.
pub(super) fn wav(path: &Path, names: &Path) -> Result<Recorded, Diagnostic> {
    let fail = |what: String| Diagnostic::new(what).in_file(path);
    if !names.is_file() {
        return Err(fail("the channels of this file have no names".into())
            .help(format!("write {} with `Recording(channels: [...])`", names.display())));
    }
    let source = Source::read(names)?;
    let listed = names_of(&source)?;
    let wav = Wav::read(path, u32::MAX)?;
    if wav.channels != listed.len() {
        return Err(fail(format!("{} channels, and {} are named", wav.channels, listed.len()))
            .help(format!("{} names all, those to be left out as `{NONE}`", names.display())));
    }
    let channel = |number: usize| wav.channel(number).map(|x| x * listed[number].1).collect();
    let columns = listed.iter().enumerate().map(|(i, (name, _))| (name.as_str(), channel(i))).collect();
    Recorded::from_columns(f64::from(wav.rate_hz), columns).map_err(|e| e.in_file(path))
}

/// Name and full scale of each channel.
fn names_of(source: &Arc<Source>) -> Result<Vec<(String, f64)>, Diagnostic> {
    let whole = ron::parse(source)?;
    let mut record = whole.record("Recording")?;
    let list = record.required("channels")?;
    record.finish()?;
    let mut named: Vec<(String, f64)> = Vec::new();
    for entry in list.list()? {
        let mut channel = entry.record("Channel")?;
        let value = channel.required("quantity")?;
        let full_scale = channel.optional("full_scale");
        channel.finish()?;
        let name = value.text()?;
        number(name).map_err(|help| value.error(format!("unknown quantity `{name}`")).help(help))?;
        if name != NONE && named.iter().any(|(other, _)| other == name) {
            return Err(value.error(format!("`{name}` is there twice")));
        }
        let full_scale = match full_scale {
            Some(value) => value.f64_in(1e-6..=MAX_FULL_SCALE, "")?,
            None if name == NONE => 1.0,
            None => {
                return Err(entry
                    .error("the field `full_scale` is missing")
                    .help("the value at full scale, in the quantity's unit"));
            }
        };
        named.push((name.to_owned(), full_scale));
    }
    check(|i| named.iter().any(|(name, _)| name == QUANTITIES[i].name))
        .map_err(|e| without_table(e).at(source, list.span()))?;
    Ok(named)
}
