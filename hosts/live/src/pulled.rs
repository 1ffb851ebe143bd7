//! A run whose samples another program pulls, in an audio callback of its own.

use std::sync::Arc;
use std::time::Instant;

use crate::driver::{CallbackHalf, Controls, Driver, Options, callback};
use crate::meters::Meters;
use crate::view::{Condition, View};
use crate::{GraphController, Player, RunControl};

/// Control side of such a run. Dropping it ramps the output down.
#[derive(Debug)]
pub struct Pulled {
    /// Dropped first: that ramps the output down.
    driver: Driver<Player>,
    graph_controller: GraphController,
    meters: Arc<Meters>,
    run_control: RunControl,
    looked: Instant,
}

impl Pulled {
    /// Starts a run. The other half fills blocks of the player's channels, on one thread at a time.
    pub fn start(
        graph_controller: GraphController,
        mut player: Player,
        run_control: RunControl,
    ) -> (Self, CallbackHalf<Player>) {
        player.obey(&run_control);
        let meters = Arc::new(Meters::new(graph_controller.schedule().tick_hz));
        let mut options = Options::new(meters.clone());
        options.run_control = run_control.clone();
        options.limits = Some(graph_controller.limits().shared.clone());
        // The thread is the other program's, which has given it a priority.
        options.priority = None;
        let (driver, half) = callback(player, &options);
        (Self { driver, graph_controller, meters, run_control, looked: Instant::now() }, half)
    }

    /// Control side of the graph.
    pub fn graph_controller(&mut self) -> &mut GraphController {
        &mut self.graph_controller
    }

    /// State of the driver.
    pub fn controls(&self) -> &Arc<Controls> {
        self.driver.controls()
    }

    /// How the run stands.
    pub fn condition(&self) -> Condition {
        let controls = self.controls();
        match controls.up() {
            _ if controls.failed() => Condition::Failed,
            _ if self.run_control.stopping() => Condition::Stopping,
            _ if self.run_control.muted() => Condition::Muted,
            true => Condition::Playing,
            false => Condition::Starting,
        }
    }

    /// Figures now.
    pub fn view(&mut self) -> View {
        let since = self.looked.elapsed();
        self.looked = Instant::now();
        let ticks = self.meters.next_tick();
        let mut view = View {
            condition: self.condition(),
            muted: self.run_control.muted(),
            strength: self.run_control.strength(),
            clock: self.driver.clock().name().into(),
            ticks,
            seconds: ticks as f64 / f64::from(self.graph_controller.schedule().tick_hz),
            timing: self.meters.timing(),
            lost_samples: self.meters.lost_samples.get(),
            guarded: self.graph_controller.limits().seen.changed(),
            xruns: self.meters.xruns.get(),
            skipped_ticks: self.meters.skipped_ticks.get(),
            peak: self.controls().peak(),
            ..View::default()
        };
        self.graph_controller.look(&mut view, since);
        view
    }
}
