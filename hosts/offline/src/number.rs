//! Parsers of numbers. An error names the range.

use std::fmt::Display;
use std::str::FromStr;

/// Parses a number within a range, both ends included. `nan` is outside every range.
pub fn number(
    least: f64,
    most: f64,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| within(text, "a number", least, most, unit)
}

/// Parses a whole number within a range, both ends included.
pub fn whole<T>(
    least: T,
    most: T,
    unit: &'static str,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static,
{
    move |text| within(text, "a whole number", least, most, unit)
}

/// Parses the number of a channel, 1 to 1024.
///
/// # Errors
/// Another text.
pub fn channel(text: &str) -> Result<u16, String> {
    within(text, "the number of a channel", 1, 1024, "")
}

/// Parses a size of memory, such as `500MiB` or `4GiB`, into bytes.
///
/// # Errors
/// Another text.
pub fn memory(text: &str) -> Result<u64, String> {
    let units = [("MiB", 1 << 20), ("GiB", 1 << 30)];
    let read =
        |(unit, bytes): (&str, u64)| text.strip_suffix(unit)?.trim().parse::<u64>().ok()?.checked_mul(bytes);
    let size = units.into_iter().find_map(read).filter(|size| *size > 0);
    size.ok_or_else(|| "a whole number of MiB or GiB is wanted, such as 500MiB or 4GiB".to_owned())
}

fn within<T>(text: &str, what: &str, least: T, most: T, unit: &str) -> Result<T, String>
where
    T: FromStr + PartialOrd + Display,
{
    let space = if unit.is_empty() { "" } else { " " };
    let number = text.parse().ok().filter(|x| *x >= least && *x <= most);
    let point = if text.contains(',') { ", with a decimal point" } else { "" };
    number.ok_or_else(|| format!("{what} from {least} to {most}{space}{unit} is wanted{point}"))
}
