//! Made surfaces: their topography, and the stylus and the gel that touch them.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod stylus;
pub mod tactile;
pub mod topography;
