//! The quantities of a recording.

use std::ops::RangeInclusive;

use asperity_diagnostics::{Diagnostic, one_of};
use asperity_motion::{Column, MAX_ABS_FORCE_N, MAX_ABS_POSITION_MM, MAX_ABS_TIME_S, MAX_SPEED_MM_S};

use super::stroke::{Motion, Stroke};

/// Largest acceleration in m/s^2, either sign.
const MAX_ABS_ACCELERATION_M_S2: f64 = 1e5;
/// Rates that are accepted, in Hz.
const RATES_HZ: RangeInclusive<f64> = 1000.0..=10_000.0;
/// A rate near a multiple of this, in Hz, ..
const RATE_STEP_HZ: f64 = 10.0;
/// .. within this part, counts as that multiple: clocks are not exact.
const RATE_TOLERANCE: f64 = 2e-4;
/// Tolerance beyond the ends of the range, as a part.
const END_TOLERANCE: f64 = 2e-3;

/// Name of a channel that is left out.
pub(super) const NONE: &str = "none";
pub(super) const TIME: usize = 0;
const FORCE: usize = 1;
const VELOCITY: [usize; 2] = [2, 3];
const PLACE: [usize; 2] = [4, 5];
const SPEED: usize = 6;
const AXES: std::ops::Range<usize> = 7..10;
const ACCELERATION: usize = 10;

/// All quantities.
pub(super) const QUANTITIES: [Column; 11] = [
    Column { alias: Some("time_s"), ..Column::within("t_s", MAX_ABS_TIME_S, "s") },
    Column::within("force_n", MAX_ABS_FORCE_N, "N"),
    Column::within("vx_mm_s", MAX_SPEED_MM_S, "mm/s"),
    Column::within("vy_mm_s", MAX_SPEED_MM_S, "mm/s"),
    Column::within("x_mm", MAX_ABS_POSITION_MM, "mm"),
    Column::within("y_mm", MAX_ABS_POSITION_MM, "mm"),
    Column { least: 0.0, ..Column::within("speed_mm_s", MAX_SPEED_MM_S, "mm/s") },
    Column::within("ax_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2"),
    Column::within("ay_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2"),
    Column::within("az_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2"),
    Column::within("acceleration_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2"),
];

/// The number of a quantity other than the time by its name. None for [`NONE`]; else help for the error.
pub(super) fn number(name: &str) -> Result<Option<usize>, String> {
    let mut known = QUANTITIES.iter().enumerate().skip(TIME + 1);
    match known.clone().find(|(_, q)| q.name == name) {
        Some((number, _)) => Ok(Some(number)),
        None if name == NONE => Ok(None),
        None => Err(one_of(name, known.by_ref().map(|(_, q)| q.name).chain([NONE]).collect::<Vec<_>>())),
    }
}

/// Samples by quantity, if recorded.
pub(super) type Channels = [Option<Vec<f64>>; QUANTITIES.len()];

/// Checks that the quantities make a stroke.
pub(super) fn check(has: impl Fn(usize) -> bool) -> Result<(), Diagnostic> {
    let both = |of: [usize; 2]| of.into_iter().all(&has);
    let motion = both(VELOCITY) || both(PLACE) || has(SPEED);
    let (what, help) = match (has(FORCE), motion, AXES.into_iter().any(&has), has(ACCELERATION)) {
        (false, ..) => ("no force", "`force_n`"),
        (_, false, ..) => ("no motion", "`vx_mm_s` and `vy_mm_s`, or `x_mm` and `y_mm`, or `speed_mm_s`"),
        (_, _, false, false) => {
            ("no acceleration", "`ax_m_s2`, `ay_m_s2`, `az_m_s2`, one at least, or `acceleration_m_s2`")
        }
        (_, _, true, true) => (
            "the acceleration of one axis and of several",
            "either `acceleration_m_s2` or `ax_m_s2`, `ay_m_s2`, `az_m_s2`",
        ),
        _ => return Ok(()),
    };
    Err(Diagnostic::new(what).help(help))
}

/// Rounds a measured rate in Hz to the intended one.
pub(super) fn rate(hz: f64) -> Result<f64, Diagnostic> {
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

/// A stroke from named columns.
pub(super) fn named(columns: Vec<(&str, Vec<f64>)>, rate_hz: f64) -> Result<Stroke, Diagnostic> {
    let mut channels: Channels = std::array::from_fn(|_| None);
    let len = columns.first().map_or(0, |(_, samples)| samples.len());
    for (name, samples) in columns {
        let number =
            number(name).map_err(|help| Diagnostic::new(format!("unknown column `{name}`")).help(help))?;
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

/// A stroke from its channels.
pub(super) fn stroke(mut channels: Channels, rate_hz: f64) -> Result<Stroke, Diagnostic> {
    check(|i| channels[i].is_some())?;
    let mut take = |i: usize| channels[i].take();
    let force = take(FORCE).unwrap_or_default();
    let motion = match (VELOCITY.map(&mut take), PLACE.map(&mut take), take(SPEED)) {
        ([Some(x), Some(y)], _, _) => Motion::Velocity([x, y]),
        (_, [Some(x), Some(y)], _) => Motion::Place([x, y]),
        (_, _, speed) => Motion::Speed(speed.unwrap_or_default()),
    };
    let mut acceleration: Vec<Vec<f64>> = AXES.filter_map(&mut take).collect();
    acceleration.extend(take(ACCELERATION));
    Stroke::new(rate_hz, force, motion, acceleration)
}
