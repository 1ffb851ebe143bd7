//! The program and its libraries as a whole, one module a subject. Nothing here plays in real time.
#![allow(unreachable_pub, reason = "a test program has no outside")]

mod adopt;
mod bad_input;
mod chain;
mod compare;
mod compile;
mod drive;
mod effect_plugin;
mod encode;
mod engine;
mod everywhere;
mod fed;
mod fit_ar;
mod hostile;
mod invert;
mod passivity;
mod phase_scores;
mod phase_survival;
mod plugin_check;
mod plugins;
mod range;
mod regression;
mod render;
mod response;
mod scene;
mod scene_mended;
mod scene_plot;
mod selftest;
mod shipped;
mod texture;
mod tradeoff;
mod trust;
mod wrappers;
mod zigzag;
