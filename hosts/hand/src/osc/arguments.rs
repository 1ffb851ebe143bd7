//! Meaning of a message's arguments.

use asperity_node::Diagnostic;
use rosc::OscType;

use crate::error;

/// Standard gravity \[m/s^2\]: one gram-force is a thousandth of it in newtons.
const GRAVITY: f64 = 9.806_65;

/// Help in every error of a list.
const HELP: &str = "list the message's arguments in order, each with its unit, separated by commas: \
    `x_mm, y_mm, -z_m, force_n, _, time_ms`. Positions are in mm, cm or m, forces in n or gf, times in s, \
    ms, us or ns. `pressure`, `stroke` and `touch` have no unit. `_` skips an argument, `-` changes its sign";

#[derive(Clone, Copy, Debug, PartialEq)]
enum Meaning {
    Skip,
    /// Axis, and signed factor to mm.
    Axis(usize, f64),
    /// Signed factor to N.
    Force(f64),
    Pressure,
    Touch,
    /// Factor to ns.
    Time(f64),
}

/// Meanings and units of a message's arguments, in order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Arguments(Vec<Meaning>);

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reading {
    /// x, y, z in mm; 0 for an axis that is not listed.
    pub(super) position: [f64; 3],
    /// Force in N, at least 0, or pressure from 0 to 1; 0 if neither is listed.
    pub(super) force: f64,
    /// Whether the hand touches, if listed.
    pub(super) touch: Option<bool>,
    /// Time of the sender in ns, if listed.
    pub(super) time_ns: Option<f64>,
}

/// Meaning of a word, and the name that must not be repeated.
fn one(word: &str) -> Result<(Meaning, &'static str), String> {
    if word == "_" {
        return Ok((Meaning::Skip, ""));
    }
    let (sign, rest) = match word.strip_prefix('-') {
        Some(rest) => (-1.0, rest.trim_start()),
        None => (1.0, word.strip_prefix('+').unwrap_or(word).trim_start()),
    };
    let lower = rest.to_ascii_lowercase();
    let (name, unit) = lower.split_once('_').map_or((lower.as_str(), None), |(n, u)| (n, Some(u)));
    let length = &[("mm", 1.0), ("cm", 10.0), ("m", 1000.0)][..];
    // The name, its units with their factors, whether it takes a `-`, and its meaning with a signed factor.
    type Known = (&'static str, &'static [(&'static str, f64)], bool, fn(f64) -> Meaning);
    let known: [Known; 8] = [
        ("x", length, true, |mm| Meaning::Axis(0, mm)),
        ("y", length, true, |mm| Meaning::Axis(1, mm)),
        ("z", length, true, |mm| Meaning::Axis(2, mm)),
        ("force", &[("n", 1.0), ("gf", GRAVITY * 1e-3)], true, Meaning::Force),
        ("time", &[("s", 1e9), ("ms", 1e6), ("us", 1e3), ("ns", 1.0)], false, Meaning::Time),
        ("pressure", &[], false, |_| Meaning::Pressure),
        ("touch", &[], false, |_| Meaning::Touch),
        ("stroke", &[], false, |_| Meaning::Touch),
    ];
    let found = known.into_iter().find(|(known, ..)| *known == name);
    let (known, units, signed, meaning) = found.ok_or_else(|| format!("`{word}` is not known"))?;
    if sign < 0.0 && !signed {
        return Err(format!("`{word}`: {known} takes no `-`"));
    }
    let all = || units.iter().map(|(u, _)| format!("`{name}_{u}`")).collect::<Vec<_>>().join(", ");
    let factor = match unit {
        None if units.is_empty() => 1.0,
        None => return Err(format!("`{word}` has no unit; write one of {}", all())),
        Some(_) if units.is_empty() => return Err(format!("`{word}` has a unit, and {known} has none")),
        Some(unit) => units.iter().find(|(u, _)| *u == unit).map(|(_, factor)| *factor).ok_or_else(|| {
            format!("`{unit}` in `{word}` is not a unit of `{name}`; write one of {}", all())
        })?,
    };
    Ok((meaning(sign * factor), if known == "stroke" { "touch" } else { known }))
}

impl Arguments {
    /// Parses a list such as `x_mm, y_mm, -z_m, force_n, _, time_ms`. Spaces and case do not matter. Error:
    /// an unknown word, a wrong unit, a repeated word, or no axis.
    pub(super) fn parse(text: &str) -> Result<Self, Diagnostic> {
        let fail = |what: String| Err(error(what, HELP));
        let (mut list, mut seen) = (Vec::new(), Vec::new());
        for (place, word) in text.split(',').map(str::trim).enumerate() {
            if word.is_empty() {
                return fail(format!("argument {} of `{text}` is empty", place + 1));
            }
            let (meaning, name) =
                one(word).map_err(|what| error(format!("argument {}: {what}", place + 1), HELP))?;
            if !name.is_empty() && seen.contains(&name) {
                return fail(format!("`{name}` is listed twice in `{text}`"));
            }
            seen.push(name);
            list.push(meaning);
        }
        if seen.contains(&"force") && seen.contains(&"pressure") {
            return fail(format!("`{text}` has a force and a pressure; a hand's sample carries one of them"));
        }
        if !list.iter().any(|m| matches!(m, Meaning::Axis(..))) {
            return fail(format!("`{text}` has none of x, y and z"));
        }
        Ok(Self(list))
    }

    /// Reads a message's arguments; extra ones are ignored. Error: why the message is unusable, for a person.
    pub(super) fn read(&self, args: &[OscType]) -> Result<Reading, String> {
        if args.len() < self.0.len() {
            return Err(format!("it has {} arguments, {} are listed", args.len(), self.0.len()));
        }
        let mut reading = Reading::default();
        for (place, (meaning, arg)) in self.0.iter().zip(args).enumerate() {
            if *meaning == Meaning::Skip {
                continue;
            }
            let value = number(arg, *meaning == Meaning::Touch)
                .ok_or_else(|| format!("argument {} is no number", place + 1))?;
            if !value.is_finite() {
                return Err(format!("argument {} is {value}", place + 1));
            }
            match *meaning {
                Meaning::Skip => {}
                Meaning::Axis(axis, mm) => reading.position[axis] = value * mm,
                // A gauge at rest wanders around 0.
                Meaning::Force(newton) => reading.force = (value * newton).max(0.0),
                Meaning::Pressure if !(-0.01..=1.01).contains(&value) => {
                    return Err(format!("argument {}, a pressure, is {value}, not from 0 to 1", place + 1));
                }
                Meaning::Pressure => reading.force = value.clamp(0.0, 1.0),
                Meaning::Touch => reading.touch = Some(value != 0.0),
                Meaning::Time(ns) => reading.time_ns = Some(value * ns),
            }
        }
        if reading.touch == Some(false) {
            reading.force = 0.0;
        }
        let finite = reading.position.iter().all(|x| x.is_finite()) && reading.force.is_finite();
        if finite { Ok(reading) } else { Err("a value is too large".to_owned()) }
    }
}

fn number(arg: &OscType, or_flag: bool) -> Option<f64> {
    match arg {
        OscType::Int(x) => Some(f64::from(*x)),
        OscType::Long(x) => Some(*x as f64),
        OscType::Float(x) => Some(f64::from(*x)),
        OscType::Double(x) => Some(*x),
        OscType::Bool(x) if or_flag => Some(f64::from(u8::from(*x))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_and_signs_convert_to_mm_n_and_ns() {
        let list = Arguments::parse("x_mm, Y_cm,-z_m , force_gf, _, touch, time_ms").unwrap();
        let args = [
            OscType::Float(1.5),
            OscType::Int(2),
            OscType::Double(0.004),
            OscType::Long(100),
            OscType::String("pen".into()),
            OscType::Bool(true),
            OscType::Double(12.5),
            OscType::Nil,
        ];
        let r = list.read(&args).unwrap();
        assert_eq!((r.position, r.touch, r.time_ns), ([1.5, 20.0, -4.0], Some(true), Some(12.5e6)));
        // 100 gf is 0.980665 N.
        assert!((r.force - 0.980_665).abs() < 1e-12);
    }

    #[test]
    fn force_is_0_without_touch_and_pressure_is_bounded() {
        let list = Arguments::parse("x_m, pressure, stroke").unwrap();
        let read = |p: f64, t: i32| list.read(&[OscType::Int(0), OscType::Double(p), OscType::Int(t)]);
        assert_eq!(read(0.7, 1).unwrap().force, 0.7);
        assert_eq!(read(0.7, 0).unwrap().force, 0.0);
        assert_eq!(read(1.005, 1).unwrap().force, 1.0);
        // A sender that counts to 127 is told, not clamped.
        assert!(read(64.0, 1).unwrap_err().contains("from 0 to 1"));
    }

    #[test]
    fn wrong_list_error_names_the_fault_and_the_help() {
        for (text, what) in [
            ("", "argument 1 of `` is empty"),
            ("x_mm,,y_mm", "argument 2 of `x_mm,,y_mm` is empty"),
            ("x, y_mm", "`x` has no unit; write one of `x_mm`, `x_cm`, `x_m`"),
            ("x_in", "`in` in `x_in` is not a unit of `x`"),
            ("x_mm, w_mm", "argument 2: `w_mm` is not known"),
            ("x_mm, x_m", "`x` is listed twice"),
            ("x_mm, touch, stroke", "`touch` is listed twice"),
            ("x_mm, force_n, pressure", "has a force and a pressure"),
            ("_, force_n", "has none of x, y and z"),
            ("x_mm, -touch", "takes no `-`"),
            ("x_mm, -time_s", "takes no `-`"),
            ("x_mm, pressure_n", "pressure has none"),
            ("x_mm, --y_mm", "`--y_mm` is not known"),
        ] {
            let e = Arguments::parse(text).unwrap_err();
            assert!(e.message.contains(what), "`{text}`: {e}");
            assert!(e.help.unwrap().contains("x_mm, y_mm, -z_m"));
        }
    }

    #[test]
    fn unusable_message_error_says_why() {
        let list = Arguments::parse("x_m, y_m").unwrap();
        for (args, what) in [
            (vec![OscType::Float(1.0)], "it has 1 arguments, 2 are listed"),
            (vec![OscType::Float(1.0), OscType::String("2".into())], "argument 2 is no number"),
            (vec![OscType::Float(f32::NAN), OscType::Int(1)], "argument 1 is NaN"),
            (vec![OscType::Int(1), OscType::Double(f64::NEG_INFINITY)], "argument 2 is -inf"),
            (vec![OscType::Int(1), OscType::Double(1e308)], "too large"),
            (vec![OscType::Bool(true), OscType::Int(1)], "argument 1 is no number"),
        ] {
            assert!(list.read(&args).unwrap_err().contains(what), "{args:?}");
        }
    }
}
