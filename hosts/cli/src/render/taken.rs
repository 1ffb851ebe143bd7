//! All that a render takes down while it runs.

use std::sync::Arc;

use asperity_accuracy::timing::Recorder as Times;
use asperity_engine::{Clock as _, Engine};
use asperity_graph::{Compiled, Schedule};
use asperity_live::Outlet;

use super::Wall;
use super::record::{Master, Recorder};
use super::report::Level;
use super::traces::Traces;
use super::watch::{Beside, Sent};
use crate::args::Render;
use crate::failure::Failure;
use crate::load::OfScene;

/// Files, figures and traces in the making.
pub struct Taken {
    pub master: Option<Master>,
    pub recorders: Vec<Recorder>,
    pub traces: Option<Traces>,
    pub times: Times,
    pub drive: Level,
    schedule: Arc<Schedule>,
    /// Scenes and guards of graphs that are to be taken over.
    beside: Sent,
    /// Holds the file's channels to their limits, where graphs change under it.
    outlet: Option<Outlet>,
    /// Time of each node in this tick, in ns.
    spent: Vec<u64>,
    /// Calls of each node before it.
    calls: Vec<u64>,
}

impl Taken {
    /// Opens what the command line and the graph's sinks ask for.
    pub fn new(
        args: &Render,
        compiled: &Compiled,
        scene: Option<OfScene>,
        beside: Sent,
    ) -> Result<Self, Failure> {
        let schedule = &compiled.schedule;
        let nodes = schedule.nodes.len();
        Ok(Self {
            recorders: Recorder::for_sinks(schedule)?,
            master: args.out.as_ref().map(|path| Master::new(path, schedule, args.format)).transpose()?,
            traces: args.plot.as_ref().map(|_| Traces::new(schedule).with(scene, schedule)),
            times: Times::new(nodes),
            drive: Level::new(schedule),
            schedule: Arc::new(schedule.clone()),
            beside,
            outlet: args.watch.then(|| Outlet::new(compiled, Master::channels(schedule))),
            spent: vec![0; nodes],
            calls: vec![0; nodes],
        })
    }

    /// Runs tick number `tick` and takes down what came of it.
    pub fn tick(&mut self, engine: &mut Engine, wall: &Wall, tick: u64) -> Result<(), Failure> {
        let swaps = engine.swaps();
        self.spent.fill(0);
        let before = wall.now_ns();
        engine.tick_timed(wall, &mut self.spent);
        self.times.tick(wall.now_ns() - before);
        if engine.swaps() != swaps {
            self.follow(engine.schedule().clone());
        }
        for (i, ns) in self.spent.iter().enumerate() {
            let calls = engine.report(i).map_or(0, |r| r.calls);
            if calls > self.calls[i] {
                self.times.node(i, *ns);
            }
            self.calls[i] = calls;
        }
        self.drive.take(engine);
        if let Some(master) = &mut self.master {
            master.take(engine, self.outlet.as_mut())?;
        }
        for recorder in &mut self.recorders {
            recorder.take(engine, tick)?;
        }
        if let Some(traces) = &mut self.traces {
            traces.take(engine, tick);
        }
        Ok(())
    }

    /// Goes on with the nodes of the same names in another graph. That the sinks are there has been seen to.
    fn follow(&mut self, schedule: Arc<Schedule>) {
        let moved = |i: usize| {
            let id = self.schedule.nodes.get(i).map_or("", |n| n.id.as_str());
            schedule.index_of(id).unwrap_or(usize::MAX)
        };
        self.drive.follow(moved);
        if let Some(master) = &mut self.master {
            master.follow(moved);
        }
        self.recorders.iter_mut().for_each(|r| r.follow(moved));
        let Beside { scene, outlet } = self.beside.take().unwrap_or_default();
        if let Some(before) = &mut self.outlet {
            let mut before = std::mem::replace(before, outlet);
            self.outlet.as_mut().into_iter().for_each(|outlet| outlet.go_on(&mut before));
        }
        if let Some(traces) = &mut self.traces {
            traces.follow(&schedule, scene);
        }
        // This tick's times were taken by the new numbers, in a table of the old length: they are left out.
        let from: Vec<Option<usize>> = schedule.nodes.iter().map(|n| self.schedule.index_of(&n.id)).collect();
        self.times.renumber(&from);
        self.spent = vec![0; schedule.nodes.len()];
        self.calls = vec![u64::MAX; schedule.nodes.len()];
        self.schedule = schedule;
    }
}
