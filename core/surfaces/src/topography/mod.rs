//! Topography of surfaces: patches of heights, their making, and their contact with a round tip.

mod catalogue;
mod envelope;
pub mod family;
mod field;
mod made;
pub mod spectrum;

pub use catalogue::made_surfaces;
pub use envelope::envelope;
pub use field::weights;
pub use field::{HeightField, Sample};
pub use made::{Contact, Family, MadeSurface};
