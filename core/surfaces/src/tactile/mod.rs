//! What a camera behind a gel sees of a surface that is pressed into it: a tactile image, as a GelSight takes it.
//!
//! # The model
//!
//! A soft gel with an opaque skin is pressed onto a surface. It goes in below the highest points as deep as the press says: where
//! it touches, the skin takes the surface's shape; where it spans a valley it hangs as the gel's stiffness lets it. Both come from blurring the
//! pressed relief with Gaussians from wide to narrow, each time restoring what touches, the way of Si and Yuan 2022 ("Taxim: an example-based simulation
//! model for GelSight tactile sensors"); the skin's own thickness blurs by 0.025 mm at last. Three lights, red, green and blue, stand around the gel,
//! 120 degrees apart and low, so that colour tells the skin's slope (Yuan, Dong, Adelson 2017, "GelSight: high-resolution robot tactile sensors for
//! estimating geometry and force"). A channel is
//!
//! ```text
//! I = ambient + light fall s(n . l) / s(l_z) + noise,   n = (-g_x, -g_y, 1) / |..|,   s(c) = (c + sqrt(c^2 + w^2)) / 2
//! ```
//!
//! `s` is the shade under a light of width `w`, `fall` the lights' unevenness over the field. A camera adds its blur, its noise (shot and read), dust
//! that sticks to the gel, and 8 bits: what is steep and faces a light is white, what is steep and turned away is dark.
//!
//! # What it resolves
//!
//! A pixel is 0.04 mm. Without noise the fine surfaces differ from a flat skin by, root mean square in parts of 255: sandpaper P400 by 6, maple by 4,
//! brushed steel by 1.6, against 1.0 of noise in a pixel; only float glass and acrylic are below the noise. Of the coarsest ones less than a tenth of the
//! values is at an end of the range. A press and its picture take some 20 ms of a server's core, a patch of 1024 x 1024 points 30 to 150 ms.

mod camera;
mod gel;

pub use camera::Camera;
pub use gel::{Press, indentation};
