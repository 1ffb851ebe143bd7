//! Facts that a node reports about itself.

use std::borrow::Cow;
use std::fmt;

/// A fact about a node, after its preparation or after a run.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct Fact {
    /// Key: lower case, words joined by `_`.
    pub name: Cow<'static, str>,
    pub value: FactValue,
}

impl Fact {
    /// A text.
    pub fn text(name: impl Into<Cow<'static, str>>, text: impl Into<String>) -> Self {
        Self { name: name.into(), value: FactValue::Text(text.into()) }
    }

    /// A number in a unit; an empty unit for none.
    pub fn number(
        name: impl Into<Cow<'static, str>>,
        number: f64,
        unit: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self { name: name.into(), value: FactValue::Number(number, unit.into()) }
    }

    /// A count.
    pub fn count(name: impl Into<Cow<'static, str>>, count: u64) -> Self {
        Self { name: name.into(), value: FactValue::Count(count) }
    }
}

/// The value of a [`Fact`].
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum FactValue {
    Text(String),
    Number(f64, Cow<'static, str>),
    Count(u64),
}

impl fmt::Display for FactValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FactValue::Text(t) => f.write_str(t),
            FactValue::Number(x, unit) if unit.is_empty() => f.write_str(&rounded(*x)),
            FactValue::Number(x, unit) => write!(f, "{} {unit}", rounded(*x)),
            FactValue::Count(n) => write!(f, "{n}"),
        }
    }
}

/// Rounds to four significant digits, for a person.
fn rounded(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let digits = 3 - x.abs().log10().floor() as i32;
    match digits {
        0..=6 => {
            let text = format!("{x:.*}", digits as usize);
            if text.contains('.') {
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            } else {
                text
            }
        }
        -5..0 => format!("{x:.0}"),
        _ => format!("{x:.3e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facts_are_rounded_for_reading() {
        let text = |x| FactValue::Number(x, "Hz".into()).to_string();
        let found = [64.999_862_5, 11.194_653, 1698.125, 123_456.0, 1.058_99e-6, -0.0, -0.25].map(text);
        let want = ["65 Hz", "11.19 Hz", "1698 Hz", "123456 Hz", "1.059e-6 Hz", "0 Hz", "-0.25 Hz"];
        assert_eq!(found, want);
    }
}
