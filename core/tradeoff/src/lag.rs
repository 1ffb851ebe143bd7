//! The response lag: how late the output follows a step of speed.

use std::sync::Arc;

use asperity_accuracy::response::{Steps, lag_ms};
use asperity_diagnostics::Diagnostic;
use asperity_engine::Options;
use asperity_graph::GraphFile;
use asperity_node::Registry;

use crate::chain::{Chain, Path3};
use crate::patch::{Patch, along};

/// Half a period of the steps \[s\].
const HALF_S: f64 = 0.4;
/// First steps, which are left out while the chain starts.
const LEFT_OUT: usize = 2;
/// The two speeds \[mm/s\]. A period covers 64.618 mm, so that anything periodic along the path is met at
/// every phase.
const SPEEDS: [f64; 2] = [40.4, 121.145];
/// Penetration into the floor \[mm\]: 1 N at 0.5 N/mm.
const DEPTH_MM: f64 = 2.0;

/// Position of a stylus whose speed along x steps up and down, or stays at the lower speed.
fn stylus(t: f64, stepped: bool) -> [f64; 3] {
    let [slow, fast] = if stepped { SPEEDS } else { [SPEEDS[0]; 2] };
    let period = (t / (2.0 * HALF_S)).floor();
    let within = t - period * 2.0 * HALF_S;
    let x = period * HALF_S * (slow + fast) + slow * within.min(HALF_S) + fast * (within - HALF_S).max(0.0);
    [x, 0.0, -DEPTH_MM]
}

/// Paths of a stylus with stepped and with constant speed; circles on a patch.
pub(crate) fn paths(patch: Option<&Patch>) -> [Path3; 2] {
    [true, false].map(|stepped| along(patch, Arc::new(move |t| stylus(t, stepped))))
}

/// Speed of the straight stroke \[mm/s\]; time to settle and time to analyse \[s\].
pub(crate) const STRAIGHT: (f64, [f64; 2]) = (100.0, [0.5, 1.5]);

/// Path along x at constant speed.
pub(crate) fn straight() -> Path3 {
    Arc::new(|t| [STRAIGHT.0 * t, 0.0, -DEPTH_MM])
}

impl Chain {
    /// Mean of the two speeds of [`lag_ms`](Self::lag_ms) \[mm/s\].
    pub const MEAN_MM_S: f64 = (SPEEDS[0] + SPEEDS[1]) / 2.0;

    /// Compiles a graph to measure its response lag. In a scene the stylus follows a circle; a scene without
    /// room gets a straight line.
    ///
    /// # Errors
    /// Those of the compiler; a graph without a stylus.
    pub fn stepped(graph: &GraphFile, registry: &Registry) -> Result<Self, Diagnostic> {
        let paths = paths(Patch::of(graph, registry).unwrap_or(None).as_ref());
        Self::new(graph, registry, paths.into(), Options::default())
    }

    /// Response lag \[ms\]: from a step from 40 to 121 mm/s until 10, 50 and 90 % of the change of level,
    /// over so many steps. None where the level does not rise with speed. The chain's stepped path has this
    /// index, and the steady one is behind it.
    pub fn lag_ms(&mut self, path: usize, steps: usize) -> Option<[f64; 3]> {
        let periods = steps + LEFT_OUT;
        let seconds = 2.0 * HALF_S * periods as f64;
        self.play(path);
        let (stepped, rate_hz) = self.render_output(seconds);
        self.play(path + 1);
        let (still, _) = self.render_output(seconds);
        let half = (HALF_S * f64::from(rate_hz)) as usize;
        let at: Vec<usize> = (LEFT_OUT..periods).map(|k| (2 * k + 1) * half).collect();
        lag_ms(&stepped, &still, &Steps { rate_hz, at: &at, before: half / 2, after: half / 2 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stylus_moves_at_the_two_speeds() {
        for (t, want) in [(0.1, 40.4), (0.5, 121.145), (0.9, 40.4), (8.3, 40.4), (8.7, 121.145)] {
            let speed = (stylus(t + 1e-3, true)[0] - stylus(t, true)[0]) / 1e-3;
            assert!((speed - want).abs() < 1e-6, "{t}: {speed}");
            let still = (stylus(t + 1e-3, false)[0] - stylus(t, false)[0]) / 1e-3;
            assert!((still - 40.4).abs() < 1e-6, "{t}: {still}");
        }
        // The path is continuous between periods.
        assert!((stylus(0.8 - 1e-9, true)[0] - stylus(0.8, true)[0]).abs() < 1e-6);
    }
}
