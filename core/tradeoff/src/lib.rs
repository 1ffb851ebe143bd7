//! The trade-off between accuracy and cost: many settings of a graph over the same strokes and materials.
//!
//! A [`Tradeoff`] file lists knobs with their values, strokes and materials. Each combination of values is a
//! setting. [`Prepared::run`] measures each of them: [accuracy](Figure), hard cases, time and response lag.
//! [`Results`] choose a setting for a [`Budget`] and write the report.

mod accuracy;
mod chain;
mod choose;
mod digest;
mod figure;
mod file;
mod fragment;
mod knob;
mod noise;
mod patch;
mod pictures;
mod progress;
mod report;
mod results;
mod run;
mod setting;
mod stroke;
#[cfg(test)]
mod testing;
mod time;

pub use chain::{Chain, Path3, Rendered};
pub use choose::{Budget, Choice, Misfit};
pub use digest::content;
pub use figure::{Figure, Figures};
pub use file::{Baseline, Tradeoff};
pub use results::{Fragment, Machine, Results, Row, Time};
pub use run::{Job, Prepared};
pub use setting::LoadedGraph;
pub use time::Monitor;
