//! Tactile images: pictures by a camera behind a gel on a surface, as a GelSight takes them.
//!
//! # The model
//!
//! A soft gel with an opaque skin is pressed onto a surface to a stated depth below the highest points.
//! Where it touches, the skin has the surface's shape. Over a valley it hangs as its stiffness allows.
//! The pressed relief is blurred with Gaussians from wide to narrow, and the touching parts are
//! restored each time (Si and Yuan 2022, "Taxim: an example-based simulation model for GelSight tactile
//! sensors"). The skin's own thickness finally blurs by 0.025 mm. Three low lights (red, green and
//! blue) stand around the gel, 120 degrees apart, so colour shows the skin's slope (Yuan, Dong, Adelson
//! 2017, "GelSight: high-resolution robot tactile sensors for estimating geometry and force"). A
//! channel is
//!
//! ```text
//! I = ambient + light fall s(n . l) / s(l_z) + noise
//! n = (-g_x, -g_y, 1) / |..|,   s(c) = (c + sqrt(c^2 + w^2)) / 2
//! ```
//!
//! `s` is the shade under a light of width `w`, `fall` the lights' unevenness over the field. A camera
//! adds its blur, its noise (shot and read), dust on the gel, and 8 bits. Steep parts that face a light
//! are white; steep parts turned away are dark.
//!
//! # Resolution
//!
//! A pixel is 0.04 mm. Without noise, fine surfaces differ from a flat skin by (root mean square in
//! parts of 255): sandpaper P400 6, maple 4, brushed steel 1.6. A pixel's noise is 1.0; only float
//! glass and acrylic are below it. The coarsest surfaces have less than a tenth of their values at an
//! end of the range. A press and its picture take about 20 ms on one core of a server, a patch of 1024
//! x 1024 points 30 to 150 ms.

mod camera;
mod gel;

pub use camera::Camera;
pub use gel::{Press, indentation};
