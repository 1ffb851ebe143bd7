//! Made materials: the law that says what vibration a stroke causes, and the library file of their vectors.
//!
//! # The law
//!
//! A rigid tool tip is dragged at speed `v` [mm/s] and normal force `F` [N] over a surface whose roughness has
//! the one-sided spatial power spectral density `G(q)` [mm], `q` in cycles per mm:
//!
//! ```text
//! G(q) = [ floor(q) + sum_i share_i line(q; q_i, w_i) ] / (1 + (q / q_tip)^4)
//!
//! floor(q)      = p sin(pi/p) / (pi q_c) / (1 + (q / q_c)^p)                    power law above a corner
//! line(q; a, w) = (w / pi) [ 1 / ((q - a)^2 + w^2) + 1 / ((q + a)^2 + w^2) ]    pitch with a wandering phase
//! ```
//!
//! `floor` and `line` integrate to 1 over `q >= 0`, so a `share` is a power relative to the floor's; the last
//! factor is the tip, which is too wide to enter a groove narrower than itself. A phase that wanders as a random
//! walk along the surface gives exactly such a Lorentzian line, `w` its half width at half power.
//!
//! At constant speed the tip meets `q` at the frequency `f = v q`, and power is kept under that change of
//! variables, `P(f) df = G(q) dq`, so `P(f) = G(f / v) / v` [1/Hz]. With the level and the tool on top, the
//! one-sided PSD of the tool's acceleration is
//!
//! ```text
//! S(f; v, F) = C level^2 (v / 100)^(2 a) (F / 1)^(2 b)  G(f / v) / v  |H(f)|^2     [(m/s^2)^2 / Hz]
//!
//! |H|^2 = r_h^4 / (1 + r_h^4)  *  [ (1 - r^2)^2 + (2 g z r)^2 ] / [ (1 - r^2)^2 + (2 z r)^2 ]
//!         r_h = f / 15 Hz              r = f / resonance
//! ```
//!
//! The first factor of `H` is the hand, which holds the tool still at slow motion (second-order Butterworth
//! high-pass); the second is the tool resonating on the contact, a second-order peak of gain `g` at its top and
//! 1 far from it. `C` is chosen so that `level` is the r.m.s. acceleration in m/s^2 over 0..1000 Hz at 100 mm/s
//! and 1 N. The law is isotropic: direction does not matter. No speed or no force is no vibration.
//!
//! These are made materials: their form follows what is known of tool-surface vibration (power grows with speed
//! and force, pitch moves with speed, tool and hand shape the rest), their numbers were chosen, not measured.
//!
//! # What a predictor should answer
//!
//! A frame is a Hann window of 0.1 s and its magnitudes are amplitudes, `A_k = 2 |sum w x| / sum w` [m/s^2] at
//! `f_k` = 10, 20, .. 1000 Hz. For a stationary Gaussian signal
//!
//! ```text
//! E[A_k^2] = 2 int S(|f|) K(f - f_k) df,   K(d) = |W(d) / W(0)|^2,   W(d) / W(0) = sinc(d T) / (1 - (d T)^2)
//! E[A_k]   = sqrt(pi / 4) sqrt(E[A_k^2])                             (Rayleigh)
//! ```
//!
//! The next 0.1 s is predicted from the last 20 ms, as if they went on: over a history of `n` pairs of speed and
//! force, oldest first, `E[A_k^2]` is the mean over the history weighted by `2 (i + 1) / (n (n + 1))`, `i` from
//! 0. New samples say most; a contact that began 6 ms ago counts for what it is; zeros count as silence.

mod embedding;
mod law;
mod library;
mod made;
mod random;
mod surface;

pub use embedding::{EMBEDDING_LEN, embed};
pub use law::{BIN_HZ, BINS, Law, LawTable, Line, Parameters, WINDOW_S, expected_amplitude, history_weight};
pub use library::{Assignment, Library, LibraryMaterial, Neighbour, VECTOR_LEN};
pub use made::{MadeMaterial, made_materials};
pub use random::Random;
pub use surface::Surface;
