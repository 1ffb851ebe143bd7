//! What a scene's graph did along a stroke: calls and times of its nodes, and what was touched.

use std::time::Instant;

use asperity_accuracy::timing::Recorder;
use asperity_engine::{Engine, Options};
use asperity_graph::Compiled;
use asperity_node::Buffer;

use crate::load::OfScene;
use crate::render::Wall;
use crate::render::effects::Effects;

/// Figures of one node.
#[derive(Clone, Debug)]
pub struct Work {
    /// Its id.
    pub id: String,
    /// Its kind.
    pub kind: String,
    /// Calls of `process`.
    pub calls: u64,
    /// Median of a call \[us\].
    pub call_us: f64,
    /// All its time over all ticks \[us\].
    pub tick_us: f64,
}

/// Figures of a run.
#[derive(Clone, Debug)]
pub struct Account {
    /// Ticks that ran.
    pub ticks: u64,
    /// Median of a tick in which a surface was touched, and of one in the air \[us\].
    pub tick_us: [f64; 2],
    /// Nodes in the order in which they run.
    pub nodes: Vec<Work>,
    /// Ticks in which each surface was touched.
    pub touched: Vec<u64>,
    /// Ticks in which each effect was felt: stiffness, damping, and what nodes render in its order.
    pub active: Vec<u64>,
}

impl Account {
    /// Runs the graph of a scene with its stroke.
    pub fn of(compiled: Compiled, sleep: bool, ticks: u64, of_scene: &OfScene) -> Self {
        let nodes: Vec<(String, String)> =
            compiled.schedule.nodes.iter().map(|n| (n.id.clone(), n.kind.clone())).collect();
        // Walls and volumes are told of apart.
        let contact = ["surface", "volume"].map(|name| {
            let node = compiled.schedule.nodes.iter().position(|n| n.kind == "contact")?;
            let output = compiled.schedule.nodes[node].outputs.iter().position(|o| o.name == name)?;
            Some((node, output))
        });
        let mut effects = Effects::new(of_scene.clone(), &compiled.schedule);
        let mut engine = Engine::new(compiled, Options { sleep, ..Options::default() });
        let wall = Wall::new(Instant::now());
        let (mut spent, mut total) = (vec![0; nodes.len()], vec![0_u64; nodes.len()]);
        let mut calls = vec![0; nodes.len()];
        let mut times = Recorder::new(nodes.len());
        let mut ticks_of = [Recorder::new(0), Recorder::new(0)];
        let mut touched = vec![0; of_scene.scene.surfaces.len()];
        for _ in 0..ticks {
            spent.fill(0);
            let began = Instant::now();
            engine.tick_timed(&wall, &mut spent);
            let tick_ns = began.elapsed().as_nanos() as u64;
            effects.take(&engine);
            let now = contact.map(|port| {
                let (node, output) = port?;
                match engine.output(node, output) {
                    Some(Buffer::Control { values, .. }) => {
                        values.first().filter(|number| **number >= 0.0).map(|number| *number as usize)
                    }
                    _ => None,
                }
            });
            for surface in now.into_iter().flatten() {
                if let Some(count) = touched.get_mut(surface) {
                    *count += 1;
                }
            }
            ticks_of[usize::from(now == [None, None])].tick(tick_ns);
            for (node, spent) in spent.iter().enumerate() {
                total[node] += spent;
                let now = engine.report(node).map_or(0, |r| r.calls);
                if now > calls[node] {
                    times.node(node, *spent);
                }
                calls[node] = now;
            }
        }
        let us = |ns: u64| ns as f64 / 1e3;
        let nodes = nodes
            .into_iter()
            .enumerate()
            .map(|(i, (id, kind))| Work {
                id,
                kind,
                calls: calls[i],
                call_us: times.node_summary(i).map_or(0.0, |s| us(s.p50_ns)),
                tick_us: us(total[i]) / ticks.max(1) as f64,
            })
            .collect();
        let tick_us = ticks_of.each_ref().map(|of| us(of.tick_summary().p50_ns));
        Self { ticks, tick_us, nodes, touched, active: effects.active() }
    }

    /// A node's figures.
    pub fn node(&self, id: &str) -> Option<&Work> {
        self.nodes.iter().find(|work| work.id == id)
    }
}
