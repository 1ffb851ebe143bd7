//! Topography of surfaces: patches of heights, how they are made, and what a round tip meets of them.

mod catalogue;
mod envelope;
pub mod family;
mod field;
pub mod spectrum;

pub use catalogue::{Contact, Family, MadeSurface, made_surfaces};
pub use envelope::envelope;
pub use field::{HeightField, Sample};
