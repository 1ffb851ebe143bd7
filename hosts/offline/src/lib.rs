//! From files and settings to a graph that runs, without a device: for the program, Python and C.
//!
//! [`load`] makes a schedule of a graph or scene, with the [`kinds`] of nodes that it may use. [`render`]
//! runs it tick by tick and reports; [`probe`] reads the values of a port. [`phase`] turns magnitudes into
//! a signal, and [`compare`] ranks the ways to do so. The [`host`] shows warnings and asks questions.

pub mod compare;
pub mod failure;
pub mod host;
pub mod kinds;
pub mod lag;
pub mod load;
pub mod number;
pub mod phase;
pub mod picture;
pub mod probe;
pub mod render;
pub mod shipped;
pub mod trust;
