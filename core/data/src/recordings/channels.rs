//! What a recording may hold.

use std::ops::RangeInclusive;

use asperity_diagnostics::{Diagnostic, one_of};
use asperity_motion::{MAX_ABS_FORCE_N, MAX_ABS_POSITION_MM, MAX_ABS_TIME_S, MAX_SPEED_MM_S};

use super::stroke::{Motion, Stroke};

/// Largest acceleration in m/s^2, either sign.
const MAX_ABS_ACCELERATION_M_S2: f64 = 1e5;
/// Rates that are read, in Hz.
const RATES_HZ: RangeInclusive<f64> = 1000.0..=10_000.0;
/// Rates are taken for a whole multiple of this, in Hz, ..
const RATE_STEP_HZ: f64 = 10.0;
/// .. where they are as near to it as this, in parts: clocks are not exact.
const RATE_TOLERANCE: f64 = 2e-4;
/// How far they may be beyond the ends of the range, in parts.
const END_TOLERANCE: f64 = 2e-3;

/// A quantity's name, its least and greatest value, and the unit for errors.
pub(super) struct Quantity {
    pub(super) name: &'static str,
    pub(super) range: (f64, f64),
    pub(super) unit: &'static str,
}

const fn within(name: &'static str, limit: f64, unit: &'static str) -> Quantity {
    Quantity { name, range: (-limit, limit), unit }
}

/// What a channel is called that is left out.
pub(super) const NONE: &str = "none";
pub(super) const TIME: usize = 0;
const FORCE: usize = 1;
const VELOCITY: [usize; 2] = [2, 3];
const PLACE: [usize; 2] = [4, 5];
const SPEED: usize = 6;
const AXES: std::ops::Range<usize> = 7..10;
const ACCELERATION: usize = 10;

/// All quantities.
pub(super) const QUANTITIES: [Quantity; 11] = [
    within("t_s", MAX_ABS_TIME_S, "s"),
    within("force_n", MAX_ABS_FORCE_N, "N"),
    within("vx_mm_s", MAX_SPEED_MM_S, "mm/s"),
    within("vy_mm_s", MAX_SPEED_MM_S, "mm/s"),
    within("x_mm", MAX_ABS_POSITION_MM, "mm"),
    within("y_mm", MAX_ABS_POSITION_MM, "mm"),
    Quantity { name: "speed_mm_s", range: (0.0, MAX_SPEED_MM_S), unit: "mm/s" },
    within("ax_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2"),
    within("ay_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2"),
    within("az_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2"),
    within("acceleration_m_s2", MAX_ABS_ACCELERATION_M_S2, "m/s^2"),
];

/// The number of a quantity of a name; `time_s` is another name of `t_s`.
pub(super) fn quantity(name: &str) -> Option<usize> {
    let name = if name == "time_s" { "t_s" } else { name };
    QUANTITIES.iter().position(|q| q.name == name)
}

/// Samples by quantity; none where a quantity was not recorded.
pub(super) type Channels = [Option<Vec<f64>>; QUANTITIES.len()];

/// Which of the quantities there are.
pub(super) fn check(has: impl Fn(usize) -> bool) -> Result<(), Diagnostic> {
    let missing = |what: &str, help: &str| Err(Diagnostic::new(format!("no {what}")).help(help));
    let both = |of: [usize; 2]| of.into_iter().all(&has);
    if !has(FORCE) {
        return missing("force", "`force_n`");
    }
    if !(both(VELOCITY) || both(PLACE) || has(SPEED)) {
        return missing("motion", "`vx_mm_s` and `vy_mm_s`, or `x_mm` and `y_mm`, or `speed_mm_s`");
    }
    let axes = AXES.into_iter().any(&has);
    match (axes, has(ACCELERATION)) {
        (false, false) => {
            missing("acceleration", "`ax_m_s2`, `ay_m_s2`, `az_m_s2`, one at least, or `acceleration_m_s2`")
        }
        (true, true) => Err(Diagnostic::new("the acceleration of one axis and of several")
            .help("either `acceleration_m_s2` or `ax_m_s2`, `ay_m_s2`, `az_m_s2`")),
        _ => Ok(()),
    }
}

/// A rate in Hz as it was meant.
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

/// A stroke from columns by name.
pub(super) fn named(columns: Vec<(&str, Vec<f64>)>, rate_hz: f64) -> Result<Stroke, Diagnostic> {
    let known = || QUANTITIES.iter().skip(TIME + 1).map(|q| q.name).chain([NONE]);
    let mut channels: Channels = std::array::from_fn(|_| None);
    let len = columns.first().map_or(0, |(_, samples)| samples.len());
    for (name, samples) in columns {
        let number = match quantity(name).filter(|q| *q != TIME) {
            Some(number) => number,
            None if name == NONE => continue,
            None => {
                return Err(Diagnostic::new(format!("unknown column `{name}`"))
                    .help(one_of(name, known().collect::<Vec<_>>())));
            }
        };
        if samples.len() != len {
            return Err(Diagnostic::new(format!("columns of {len} and of {} samples", samples.len())));
        }
        let Quantity { range: (least, greatest), unit, .. } = &QUANTITIES[number];
        if let Some((row, x)) = samples.iter().enumerate().find(|(_, x)| !(*least..=*greatest).contains(*x)) {
            return Err(Diagnostic::new(format!(
                "`{name}` is {x} in row {row}, at {} s",
                row as f64 / rate_hz
            ))
            .help(format!("`{name}` is a number from {least} to {greatest} {unit}")));
        }
        if channels[number].replace(samples).is_some() {
            return Err(Diagnostic::new(format!("the column `{name}` is there twice")));
        }
    }
    stroke(channels, rate_hz)
}

/// A stroke from its channels, which [`check`] has passed.
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
