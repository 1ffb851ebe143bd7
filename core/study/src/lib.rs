//! Studies with people.
//!
//! - [`Experiment`]: the file that declares stimuli, parts, questions and tests.
//! - [`Trial`]: a planned trial. A participant's plan follows from file, seed and number alone.
//! - [`Progress`]: a participant's way through the plan, also of adaptive methods.
//! - [`Conduct`]: a session as a state machine, with both screens.
//! - [`log`]: events on disk, one line of JSON each.
//! - [`Person`]: a simulated participant.
//! - [`Table`]: answers in long form, also as CSV and TSV.
//! - [`Analysis`]: descriptions, tests, thresholds, with a report and pictures.

pub mod analysis;
mod conduct;
mod export;
mod file;
pub mod log;
mod method;
mod person;
mod plan;
mod progress;
mod question;
mod table;
mod test;
#[cfg(test)]
mod testing;

pub use analysis::Analysis;
pub use conduct::{Conduct, Felt, Given, Press, Refused, Side};
pub use export::sidecar;
pub use file::{Experiment, Factor, Masking, Matching, Order, Part, Sides, Stimulus, StimulusKind};
pub use method::{Method, Varied, Vary};
pub use person::Person;
pub use plan::Trial;
pub use progress::{Progress, Step, Track};
pub use question::{Answer, Question, QuestionKind};
pub use table::{Row, Session, Table};
pub use test::{Test, TestKind};
