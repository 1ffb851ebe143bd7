//! What accuracy costs in time: many settings of a graph over the same strokes and materials.
//!
//! A [`Study`] is a file that says which knobs of a graph are turned to what, and over what they are
//! played; [`Settings`] are the graphs that come of it. Each is heard for its [accuracy](Figure), put to
//! the hard cases, timed in turns with others, and measured for how late it answers; [`Results`] are what
//! came of all.

mod accuracy;
mod chart;
mod choose;
mod digest;
mod figure;
mod file;
mod floor;
mod fragment;
mod front;
mod hear;
mod keep;
mod knob;
mod lag;
mod merge;
mod order;
mod picture;
mod report;
mod result;
mod run;
mod setting;
mod short;
mod spot;
mod stroke;
mod table;
#[cfg(test)]
mod testing;
mod time;
mod truth;

pub use choose::{Budget, Choice, Reason};
pub use digest::content;
pub use figure::{Figure, Figures};
pub use file::{Grid, Mark, Named, Study, Times};
pub use hear::{Chain, Heard, Path3};
pub use knob::Knob;
pub use lag::Response;
pub use order::{Order, Prepared};
pub use result::{Fragment, Machine, Results, Row, Time};
pub use setting::{Base, Setting, Settings};
pub use stroke::{Stroke, StrokeDecl};
pub use time::{LOAD_MS, Onlooker};
pub use truth::Truth;
