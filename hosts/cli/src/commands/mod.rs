//! Commands that do not run a graph in time: `check`, `nodes`, `graph`, `invert`, `compare`, `plugin`.

pub mod calibrate;
pub mod check;
pub mod compare;
pub mod devices;
pub mod graph;
pub mod invert;
pub mod latency;
pub mod nodes;
pub mod plugin;
pub mod tone;
