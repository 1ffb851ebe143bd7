//! The commands. Each has its arguments `Args`, whose docs are its help, and `run`.

pub mod calibrate;
pub mod check;
pub mod choose;
pub mod compare;
pub mod devices;
pub mod encode;
pub mod fit_ar;
pub mod graph;
pub mod invert;
pub mod latency;
pub mod materials;
pub mod nodes;
pub mod plugin;
pub mod recover;
pub mod render;
pub mod run;
pub mod scene;
pub mod selftest;
pub mod setup;
pub mod tone;
pub mod tradeoff;
pub mod trust;
