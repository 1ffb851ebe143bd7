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
//! Before it is rolled over, a surface is averaged as far as it yields under the tip ([`Tool::track`]).
//!
//! # Levels
//!
//! Of the 112 made surfaces at 100 mm/s and 1 N, from 10 to 1000 Hz, both axes together, root mean square in m/s^2:
//!
//! | | quietest | median | loudest |
//! |---|---|---|---|
//! | sandpaper, P400 to P36 | 0.58 | 3.2 | 11 |
//! | weave, voile to hessian | 0.41 | 3.7 | 9.0 |
//! | grating | 3.4 | 15 | 21 |
//! | foam | 0.22 | 0.7 | 3.6 |
//! | carpet | 0.29 | 3.5 | 6.1 |
//! | wood, balsa to brushed oak | 1.1 | 3.3 | 10 |
//! | pebbled plastic | 0.71 | 3.3 | 8.1 |
//! | sheet, float glass to tile | 0.02 | 2.9 | 6.4 |
//! | all | 0.02 | 3.2 | 21 |
//!
//! 110 of the 112 lie within 0.1 and 20, where pens with accelerometers find most surfaces; 5 % are below 0.3 and 5 % above 15. The masses and the ball are
//! those of the usual instrument, but stiffness, damping and the surfaces' moduli are chosen so that levels come out like that: what follows from the model
//! is how they change with force, speed and place. At 250 mm/s machined gratings make the tip jump, up to 50 m/s^2.
//!
//! The step is a symplectic one of [`STEPS`] a sample (kick, then drift), so that the contact does not gain energy. A sample of acceleration is the
//! mean over its steps. Halving the step changes no band of 100 Hz of any made surface by 0.5 dB. A second of a stroke
//! takes 2 ms of a server's core.

mod simulate;
#[cfg(test)]
mod testing;
mod tool;

pub use simulate::{Acceleration, Energy, Moment, SAMPLE_HZ, STEPS, Stylus};
pub use tool::{AVERAGED_N, Tool};
