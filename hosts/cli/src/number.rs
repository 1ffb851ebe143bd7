//! Parsers of numbers on the command line. An error names the option and its range.

use clap::Arg;

pub use asperity_offline::number::{channel, memory, number, whole};

/// Makes `--amps -1` a number out of range, not an option `-1`.
pub fn may_be_negative(arg: Arg) -> Arg {
    let takes = !arg.is_positional() && arg.get_action().takes_values();
    if takes { arg.allow_negative_numbers(true) } else { arg }
}
