//! Pictures as SVG.
//!
//! Each type is one kind of picture and has `to_svg`:
//!
//! | type | shows |
//! |---|---|
//! | [`Render`] | signals of a render over time, below the scene from above ([`SceneMap`]) |
//! | [`GraphPicture`] | a graph, laid out in layers |
//! | [`Dots`] | figures side by side, one row for each method |
//! | [`Scatter`] | cost and quality of many settings |
//! | [`Response`] | a frequency response, measured and fitted |
//! | [`Fit`] | a texture fitted to a recording |
//! | [`Chart`] | plots of dots and lines, such as training losses |
//! | [`Boxes`] | box plots, or bars with intervals, in groups |
//! | [`Matrix`] | a matrix of numbers |
//!
//! No chart library is used: lines are thinned to the pixels they cover, coordinates keep a tenth of a
//! pixel, and no fonts are loaded.

mod above;
mod axis;
mod boxes;
mod chart;
mod dots;
mod fit;
mod layout;
mod lines;
mod matrix;
mod picture;
mod render;
mod response;
mod scatter;
mod spectrogram;
mod svg;

pub use above::{Moment, SceneMap, Seen, bounds, outline};
pub use boxes::{Boxes, Spread};
pub use chart::{Chart, Plot, Scale, Trace};
pub use dots::{Column, Dots};
pub use fit::{Fit, Spectrum};
pub use lines::Series;
pub use matrix::Matrix;
pub use picture::{GraphPicture, GraphPictureNode, GraphPictureWire};
pub use render::Render;
pub use response::{Measured, Response};
pub use scatter::{Dot, Mark, Scatter};

#[cfg(test)]
mod tests;
