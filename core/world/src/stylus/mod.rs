//! A stylus that is dragged over a surface: what its accelerometer would say.
//!
//! # The model
//!
//! A hand holds a tool, the tool ends in a tip, and the tip's round end, of radius `R`, rests on the surface. Seen from the tip's middle the surface
//! is its [envelope](crate::topography::envelope) `E(x, y)`. Along the normal:
//!
//! ```text
//! m1 z1'' = N - k_s (z1 - z2) - c_s (z1' - z2')
//! m2 z2'' = k_s (z1 - z2) + c_s (z1' - z2') - F - k_h (z2 - z_h) - c_h z2'
//! N  = K d^(3/2) (1 + b d')   where d = E - z1 > 0, never less than 0; else 0       [Hertz 1882; Hunt and Crossley 1975]
//! K  = 4/3 E* sqrt(R),        1 / E* = (1 - nu^2) (1 / E_surface + 1 / E_tip)
//! ```
//!
//! The hand presses with the force `F` and yields: its rest `z_h` follows the tool in half a second. Along the stroke the whole tool, mass
//! `m`, hangs on the hand, which moves at the stroke's speed `v`; its deflection `u` obeys
//!
//! ```text
//! m u'' = -N E_x - mu N s - k_t u - c_t u',    s = w / sqrt(1 + w^2), w = (v + u') / 2 mm/s
//! ```
//!
//! with `E_x` the envelope's slope along the stroke. Contact is conservative but for `b` and `mu`: what the stroke's slope takes from the drag
//! is what the contact stores. Weights are in `F`; the stroke's own acceleration, far below 10 Hz, is left out.
//!
//! The step is a symplectic one of [`STEPS`] a sample (kick, then drift), so that the contact does not gain energy. A sample of acceleration is the
//! mean over its steps.

mod simulate;
#[cfg(test)]
mod testing;
mod tool;

pub use simulate::{Acceleration, Energy, Moment, SAMPLE_HZ, STEPS, Stylus};
pub use tool::{AVERAGED_N, Tool};
