//! A simulated stylus on a surface, and the signal of its accelerometer.
//!
//! # The model
//!
//! A hand holds a tool with a round tip of radius `R` on the surface. The tip's middle moves on the
//! surface's [envelope](crate::topography::envelope) `E(x, y)`. Along the normal:
//!
//! ```text
//! m1 z1'' = N - k_s (z1 - z2) - c_s (z1' - z2')
//! m2 z2'' = k_s (z1 - z2) + c_s (z1' - z2') - F - k_h (z2 - z_h) - c_h z2'
//! N  = K d^(3/2) (1 + b d')   where d = E - z1 > 0, never less than 0; else 0
//! K  = 4/3 E* sqrt(R),        1 / E* = (1 - nu^2) (1 / E_surface + 1 / E_tip)
//! ```
//!
//! `N` follows Hertz 1882 with Hunt and Crossley's damping of 1975. The hand presses with the force
//! `F`; its rest `z_h` follows the tool in half a second. Along the surface the whole tool (mass `m`)
//! hangs on the hand. The hand moves at the stroke's velocity `v`. The tool's deflection `u` along x
//! and y obeys
//!
//! ```text
//! m u'' = -N grad E - mu N s - k_t u - c_t u',    s = w / sqrt(|w|^2 + (2 mm/s)^2), w = v + u'
//! ```
//!
//! with `grad E` the envelope's slopes. Contact is conservative except for `b` and `mu`. `F` includes
//! the weights. The stroke's own acceleration, far below 10 Hz, is left out.
//!
//! [`Tool::track`] first averages the surface over its dent under the tip.
//!
//! # Levels
//!
//! Root mean square acceleration in m/s^2 of the 112 made surfaces at 100 mm/s and 1 N (10 to 1000 Hz,
//! all axes together):
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
//! 110 of the 112 lie within 0.1 and 20, like most surfaces under pens with accelerometers; 5 % are at
//! most 0.31 and 5 % above 14. Masses and ball are those of the usual instrument. Stiffness, damping
//! and the surfaces' moduli are chosen to give these levels. So the model predicts only the effect of
//! force, speed and place. At 250 mm/s machined gratings make the tip jump, up to 50 m/s^2.
//!
//! Rise of levels in decibels with a doubling of speed (at 1 N) and of force (at 100 mm/s). Each range
//! covers the 14 surfaces of a family in strokes of 2 s, rounded outwards.
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
//! Levels do not rise with force on gratings, where a light tip jumps. From 0.4 to 0.8 N a sine of 2.5
//! mm falls by 3.0 dB and narrow ridges of 1 mm by 2.9; from 0.8 to 1.6 N square ridges of 2 mm fall by
//! 1.2. Square ridges of 0.8 mm, narrow grooves and a sine of 1 mm stay. Levels also stay on smooth
//! hard sheets, where the tip follows the surface at any force (float glass, acrylic; milled aluminium
//! and tile from 0.8 N on). With speed, levels stay from 100 mm/s on for waves so short that they pass
//! above 700 Hz (spark-eroded plastic, fine).
//!
//! # Pitch
//!
//! Each of the 14 gratings at 60, 100 and 180 mm/s and 1 N, straight and 40 degrees aslant, has a line
//! at `v cos(angle) / period` within 2 Hz. It is at least 22 dB above the level between its multiples.
//! It is not always the loudest line: the contact resonates at 200 to 400 Hz, and even a sine has sharp
//! valleys under a ball. For pitches below 175 Hz the loudest is mostly the multiple there, by up to 11
//! dB (narrow grooves: 23 dB, as the ball nearly fills them). Above 175 Hz the pitch itself is the
//! loudest, except for narrow grooves. On the finest grating at 180 mm/s and 0.5 N, half the pitch is
//! the loudest (seen, not tested).
//!
//! # Step
//!
//! The integrator is symplectic with [`STEPS`] steps a sample (kick, then drift), so the contact does
//! not gain energy. A sample of acceleration is the mean over its steps. Without friction, the energy
//! balance of a stroke forth and back has an error of 0.3 % of the losses at 70 mm/s and 1 N, and 1.2 %
//! at 250 mm/s and 2.5 N. (Glass loses nothing, and its heights are too inexact to tell.) The error
//! halves with the step; less than 0.02 % is left when extrapolated to no step. Half the step changes
//! every band of 100 Hz within 30 dB of the loudest by less than 0.5 dB, for every made surface at 90
//! mm/s and 0.8 N. At 250 mm/s and 2.5 N gratings change by up to 0.27 dB, float glass by 0.19, and the
//! 14 other surfaces tried by less than 0.1. A second of a stroke takes 2 ms on one core of a server.

mod simulate;
#[cfg(test)]
mod testing;
mod tool;

pub use simulate::{Acceleration, Energy, Moment, SAMPLE_HZ, STEPS, Stylus};
pub use tool::{AVERAGED_N, Tool};
