//! How late a graph answers a change of speed.

use std::sync::Arc;

use asperity_accuracy::response::{Steps, lag_ms};
use asperity_diagnostics::Diagnostic;
use asperity_engine::Options;
use asperity_graph::{GraphFile, Schedule};
use asperity_node::Registry;

use crate::hear::{Chain, Path3};
use crate::spot::{Spot, along};

/// Half a period of the steps \[s\].
const HALF_S: f64 = 0.4;
/// Steps that are left out, while the chain starts.
const LEFT_OUT: usize = 2;
/// Speeds between which it steps \[mm/s\]. A period goes 64.618 mm: whatever repeats along the way comes at
/// every phase.
const SPEEDS: [f64; 2] = [40.4, 121.145];
/// How deep the stylus is in a floor at height 0 \[mm\]: 1 N at 0.5 N/mm.
const DEPTH_MM: f64 = 2.0;

/// Where a stylus is whose speed along x steps up and down again, or stays at the lower.
fn stylus(t: f64, stepped: bool) -> [f64; 3] {
    let [slow, fast] = if stepped { SPEEDS } else { [SPEEDS[0]; 2] };
    let period = (t / (2.0 * HALF_S)).floor();
    let within = t - period * 2.0 * HALF_S;
    let x = period * HALF_S * (slow + fast) + slow * within.min(HALF_S) + fast * (within - HALF_S).max(0.0);
    [x, 0.0, -DEPTH_MM]
}

/// The ways of a stylus whose speed steps, and of one whose speed does not; on a surface of a scene they go
/// round.
pub(crate) fn ways(spot: Option<&Spot>) -> [Path3; 2] {
    [true, false].map(|stepped| along(spot, Arc::new(move |t| stylus(t, stepped))))
}

/// Speed of a straight stroke in mm/s, and its time in s: what settles, and what is looked at.
pub(crate) const STRAIGHT: (f64, [f64; 2]) = (100.0, [0.5, 1.5]);

/// The way of a stylus that goes straight along x at a constant speed.
pub(crate) fn straight() -> Path3 {
    Arc::new(|t| [STRAIGHT.0 * t, 0.0, -DEPTH_MM])
}

/// A graph under both.
pub struct Response(Chain);

impl Response {
    /// The mean of the speeds between which it steps \[mm/s\].
    pub const MEAN_MM_S: f64 = (SPEEDS[0] + SPEEDS[1]) / 2.0;

    /// Compiles the graph. On a scene's surface the stylus goes round, straight on where none has room.
    ///
    /// # Errors
    /// What the compiler says; nothing that moves a stylus.
    pub fn new(graph: &GraphFile, registry: &Registry) -> Result<Self, Diagnostic> {
        let ways = ways(Spot::of(graph, registry).unwrap_or(None).as_ref());
        Chain::new(graph, registry, ways.into(), Options::default()).map(Self)
    }

    /// What is run.
    pub fn schedule(&self) -> &Schedule {
        self.0.schedule()
    }

    /// Node and output whose level is looked at: the last acceleration at the audio rate, else what drives
    /// the coil.
    pub fn heard(&self) -> Option<(usize, usize)> {
        self.0.nearest()
    }

    /// Milliseconds from a step of speed, from 40 to 121 mm/s, until the level is 10, 50 and 90 % of the
    /// way; so many steps are taken. None where the level does not rise with speed.
    pub fn lag_ms(mut self, steps: usize) -> Option<[f64; 3]> {
        measured(&mut self.0, 0, steps)
    }
}

/// The response of a chain whose [`ways`] begin at a number.
pub(crate) fn measured(chain: &mut Chain, way: usize, steps: usize) -> Option<[f64; 3]> {
    let periods = steps + LEFT_OUT;
    let seconds = 2.0 * HALF_S * periods as f64;
    chain.play(way);
    let (stepped, rate_hz) = chain.felt(seconds);
    chain.play(way + 1);
    let (still, _) = chain.felt(seconds);
    let half = (HALF_S * f64::from(rate_hz)) as usize;
    let at: Vec<usize> = (LEFT_OUT..periods).map(|k| (2 * k + 1) * half).collect();
    lag_ms(&stepped, &still, &Steps { rate_hz, at: &at, before: half / 2, after: half / 2 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stylus_goes_at_the_speeds_it_is_said_to() {
        for (t, want) in [(0.1, 40.4), (0.5, 121.145), (0.9, 40.4), (8.3, 40.4), (8.7, 121.145)] {
            let speed = (stylus(t + 1e-3, true)[0] - stylus(t, true)[0]) / 1e-3;
            assert!((speed - want).abs() < 1e-6, "{t}: {speed}");
            let still = (stylus(t + 1e-3, false)[0] - stylus(t, false)[0]) / 1e-3;
            assert!((still - 40.4).abs() < 1e-6, "{t}: {still}");
        }
        // It goes on where a period ends.
        assert!((stylus(0.8 - 1e-9, true)[0] - stylus(0.8, true)[0]).abs() < 1e-6);
    }
}
