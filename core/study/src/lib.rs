//! What accuracy costs in time: many settings of a graph over the same strokes and materials.
//!
//! A [`Study`] is a file that says which knobs of a graph are turned to what, and over what they are played; [`Settings`] are the graphs that come of it. Each
//! is heard for its [accuracy](Figure), put to the hard cases, timed in turns with others, and measured for how late it answers; [`Results`]
//! are what came of all.

mod figure;
mod file;
mod hear;
mod knob;
mod lag;
mod result;
mod setting;
mod stroke;
mod time;

pub use figure::{Figure, Figures};
pub use file::{Grid, Mark, Named, Study, Times};
pub use hear::{Chain, Heard};
pub use knob::Knob;
pub use lag::response;
pub use result::{Fragment, Machine, Results, Row, Time};
pub use setting::{Base, Setting, Settings};
pub use stroke::{Stroke, StrokeDecl};
pub use time::{LOAD_MS, Onlooker};
