//! Arguments of commands that do not hold their own yet: `tradeoff`, `choose`, `selftest`, `plugin check`.

mod selftest;
mod tradeoff;

pub use crate::commands::plugin::{Cases, CasesOfPlugin, CheckPlugin};
pub use crate::load::{GraphArgs, PluginArgs};
use crate::number;
pub use selftest::{EffortArg, SelfTest};
pub use tradeoff::{Choose, Merge, Tradeoff, TradeoffCommand};
