//! Numbers on the command line: what is wrong is said with the option and its range, before anything else is looked at.

use std::fmt::Display;
use std::str::FromStr;

use clap::Arg;

/// Reads a number within a range, both ends included; `nan` is in none.
pub fn number(
    least: f64,
    most: f64,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| {
        let number = text.parse().ok().filter(|x| (least..=most).contains(x));
        number.ok_or_else(|| wanted("a number", least, most, unit))
    }
}

/// Reads a whole number within a range, both ends included.
pub fn whole<T>(
    least: T,
    most: T,
    unit: &'static str,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static,
{
    move |text| {
        let number = text.parse().ok().filter(|n| (least..=most).contains(n));
        number.ok_or_else(|| wanted("a whole number", least, most, unit))
    }
}

/// Reads a size of memory, such as `500MiB` or `4GiB`, in bytes.
pub fn memory(text: &str) -> Result<u64, String> {
    let units = [("MiB", 1 << 20), ("GiB", 1 << 30)];
    let read =
        |(unit, bytes): (&str, u64)| text.strip_suffix(unit)?.trim().parse::<u64>().ok()?.checked_mul(bytes);
    let size = units.into_iter().find_map(read).filter(|size| *size > 0);
    size.ok_or_else(|| "a whole number of MiB or GiB is wanted, such as 500MiB or 4GiB".to_owned())
}

/// Reads the number of a device's channel.
pub fn channel(text: &str) -> Result<u16, String> {
    const MOST: u16 = 1024;
    let number = text.parse().ok().filter(|n| (1..=MOST).contains(n));
    number.ok_or_else(|| wanted("the number of a channel", 1, MOST, ""))
}

/// Lets `--amps -1` be a number that is out of range, and not an option `-1`.
pub fn may_be_negative(arg: Arg) -> Arg {
    let takes = !arg.is_positional() && arg.get_action().takes_values();
    if takes { arg.allow_negative_numbers(true) } else { arg }
}

fn wanted(what: &str, least: impl Display, most: impl Display, unit: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    format!("{what} from {least} to {most}{unit} is wanted")
}
