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
//! The hand presses with the force `F` and yields: its rest `z_h` follows the tool in half a second. Along the surface the whole tool, mass
//! `m`, hangs on the hand, which moves at the stroke's velocity `v`; its deflection `u` along x and y obeys
//!
//! ```text
//! m u'' = -N grad E - mu N s - k_t u - c_t u',    s = w / sqrt(|w|^2 + (2 mm/s)^2), w = v + u'
//! ```
//!
//! with `grad E` the envelope's slopes. Contact is conservative but for `b` and `mu`: what the stroke's slope takes from the drag
//! is what the contact stores. Weights are in `F`; the stroke's own acceleration, far below 10 Hz, is left out.
//!
//! Before it is rolled over, a surface is averaged as far as it yields under the tip ([`Tool::track`]).
//!
//! # Levels
//!
//! Of the 112 made surfaces at 100 mm/s and 1 N, from 10 to 1000 Hz, all axes together, root mean square in m/s^2:
//!
//! | | quietest | median | loudest |
//! |---|---|---|---|
//! | sandpaper, P400 to P36 | 0.55 | 2.8 | 11 |
//! | weave, voile to hessian | 0.53 | 3.0 | 9.4 |
//! | grating | 3.5 | 14 | 21 |
//! | foam | 0.21 | 0.6 | 3.5 |
//! | carpet | 0.30 | 3.1 | 6.1 |
//! | wood, balsa to brushed oak | 1.3 | 3.3 | 10 |
//! | pebbled plastic | 0.77 | 3.3 | 7.6 |
//! | sheet, float glass to tile | 0.02 | 2.8 | 6.7 |
//! | all | 0.02 | 3.3 | 21 |
//!
//! 110 of the 112 lie within 0.1 and 20, where pens with accelerometers find most surfaces; 5 % are at most 0.31 and 5 % above 14. The masses and the ball are
//! those of the usual instrument, but stiffness, damping and the surfaces' moduli are chosen so that levels come out like that: what follows from the model
//! is how they change with force, speed and place. At 250 mm/s machined gratings make the tip jump, up to 50 m/s^2.
//!
//! By so many decibels levels rise with a doubling of speed, at 1 N, and of force, at 100 mm/s: ranges of the fourteen surfaces of a family, of
//! strokes of 2 s, rounded outwards.
//!
//! | | 50 to 100 mm/s | 100 to 200 mm/s | 0.4 to 0.8 N | 0.8 to 1.6 N |
//! |---|---|---|---|---|
//! | sandpaper | 6 to 8 | 3 to 5.5 | 1 to 3 | 1 to 2 |
//! | weave | 4 to 7 | 3 to 5.5 | 2 to 4 | 2 to 4.5 |
//! | grating | 5 to 11 | 2 to 13.5 | -3 to 4 | -1.5 to 1.5 |
//! | foam | 6 to 10 | 5.5 to 9 | 1.5 to 5.5 | 2 to 6 |
//! | carpet | 6 to 9 | 5.5 to 9.5 | 3.5 to 6.5 | 3.5 to 7 |
//! | wood | 5.5 to 8.5 | 2 to 7.5 | 1 to 2.5 | 0.5 to 2.5 |
//! | pebbled plastic | 2 to 10.5 | -0.5 to 11.5 | 0 to 3.5 | 0 to 4.5 |
//! | sheet | 6.5 to 12.5 | 1 to 7.5 | -0.5 to 2.5 | -0.5 to 2.5 |
//!
//! Where levels do not rise: with force on gratings, on which a light tip jumps (a sine of 2.5 mm falls by 3.0 dB from 0.4 to 0.8 N, narrow ridges of
//! 1 mm by 2.9, square ridges of 2 mm by 1.2 from 0.8 to 1.6 N; square ridges of 0.8 mm, narrow grooves and a sine of 1 mm stay), and on smooth hard sheets,
//! which the tip follows at any force (float glass, acrylic; milled aluminium and tile from 0.8 N on); with speed from 100 mm/s on where waves are so short
//! that they pass above 700 Hz (spark-eroded plastic, fine).
//!
//! # Pitch
//!
//! All fourteen gratings at 60, 100 and 180 mm/s and 1 N, straight and 40 degrees aslant: a line stands at `v cos(angle) / period` within 2 Hz, 22 dB or
//! more above what lies between its multiples. It is not always the loudest. The contact resonates at 200 to 400 Hz, and under a ball even a sine has
//! sharp valleys, so that of pitches below 175 Hz it is mostly the multiple there, up to 11 dB louder (narrow grooves: 23 dB, the ball all but
//! fills them); above, the pitch itself but for narrow grooves. At 0.5 N, of the finest one at 180 mm/s, half the pitch is the
//! loudest (seen, not tested).
//!
//! # Step
//!
//! The step is a symplectic one of [`STEPS`] a sample (kick, then drift), so that the contact does not gain energy. A sample of acceleration is the
//! mean over its steps. Without friction, what the hand puts in forth and back is stored or lost but for 0.3 % of what is lost at 70 mm/s and 1 N and 1.2 % at 250 mm/s and 2.5 N
//! (of glass, which takes nothing, heights are not exact enough to tell); that
//! halves with the step, and extrapolated to no step at all less than 0.02 % is left. Halving the step changes no band of 100 Hz that is within 30 dB of the loudest, of any made
//! surface, by 0.5 dB at 90 mm/s and 0.8 N; at 250 mm/s and 2.5 N gratings by up to 0.27 dB, float glass by 0.19, the fourteen others that were tried by less than 0.1. A second of
//! a stroke takes 2 ms of a server's core.

mod simulate;
#[cfg(test)]
mod testing;
mod tool;

pub use simulate::{Acceleration, Energy, Moment, SAMPLE_HZ, STEPS, Stylus};
pub use tool::{AVERAGED_N, Tool};
