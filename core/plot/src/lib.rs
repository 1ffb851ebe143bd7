//! Pictures as SVG: what a render did, the graph that did it, and how phase-retrieval methods compare.
//!
//! [`Render`] holds the signals of a render and stacks them as panels over one time axis, under the scene
//! from [`Above`] where there is one; [`Picture`] lays a graph out in layers; [`Dots`] sets figures side by
//! side; [`Response`] is a frequency response, measured and fitted; [`Fit`] is a texture that was fitted to
//! a recording; [`Curves`] is how a training went; [`Pulses`] is how vibrations swell and fade; [`Scatter`]
//! is what each of many settings costs and is worth. The SVG is written here rather than by a chart
//! library: lines are thinned to what a pixel can show, coordinates keep a tenth of a pixel, and no fonts
//! are loaded.

mod above;
mod axis;
mod curves;
mod dots;
mod figure;
mod fit;
mod layers;
mod lines;
mod picture;
mod pulses;
mod response;
mod scatter;
mod series;
mod spectrogram;
mod svg;

pub use above::{Above, Moment, Seen};
pub use curves::{Curve, Curves};
pub use dots::{Column, Dots};
pub use figure::Render;
pub use fit::{Fit, Spectrum};
pub use picture::{Picture, PictureNode, PictureWire};
pub use pulses::{Pulses, PulsesRow, Pulsing};
pub use response::{Measured, Response};
pub use scatter::{Dot, Mark, Scatter};
pub use series::Series;

#[cfg(test)]
mod tests;
