//! Friction on the walls of a user's graph.

use std::f64::consts::TAU;

use asperity_scene::effect::passivity::Law;

use super::{MASS_KG, needed, slide};
use crate::case::{Found, applicable, holds, not_applicable};
use crate::handle::Device;
use crate::subject::Subject;
use crate::wall::{Near, Spot, Wall, pitch_mm};

/// How hard a stylus presses that rubs lightly \[N\].
const LIGHT_N: f64 = 0.3;

/// A stylus that is pressed into a wall so deep, and moves along it.
struct Pressed<'a> {
    wall: &'a mut Wall,
    spot: Spot,
    depth_mm: f64,
}

impl Pressed<'_> {
    /// One tick there \[mm\] along x; answers the force along it \[N\].
    fn at(&mut self, x_mm: f64) -> f64 {
        let [x, y, z] = self.spot.above(-self.depth_mm);
        let mut force = 0.0;
        (0..self.wall.every()).for_each(|_| [force, ..] = self.wall.at([x + x_mm, y, z]));
        force
    }

    fn begin(&mut self) {
        self.wall.reset();
        (0..3).for_each(|_| _ = self.at(0.0));
    }

    /// The law along the surface at rest: one step so short that nothing slips, and a rest.
    fn law(&mut self) -> Law {
        let (step, tick_s) = (1e-7, 1.0 / self.wall.sampling().tick_hz);
        self.begin();
        let still = self.at(0.0);
        let moved = still - self.at(step);
        let held = still - self.at(step);
        let clean = |x: f64| if x.abs() < 1e-4 { 0.0 } else { x };
        Law {
            stiffness_n_per_mm: clean(held / step),
            damping_ns_per_m: clean(1e3 * (moved - held) / step * tick_s),
        }
    }
}

pub(super) fn rubs(subject: &Subject<'_>) -> Found {
    let mut wall = Wall::of_graph(subject)?;
    let level = |spot: &Spot| spot.normal[2] > 1.0 - 1e-9;
    let spots = wall.walls(pitch_mm(subject)).into_iter().filter(level);
    let near = spots.map(|spot| wall.near(spot));
    let all: Vec<Near> = applicable(near, "no level wall was found in this graph")?;
    let mut found: Vec<String> = Vec::new();
    let tick_hz = wall.sampling().tick_hz;
    for near in all.iter().take(subject.by_effort(4, 16, 400)) {
        let light = (LIGHT_N / near.law.stiffness_n_per_mm).min(near.deep_mm);
        for depth_mm in [light, near.deep_mm] {
            let mut it = Pressed { wall: &mut wall, spot: near.spot, depth_mm };
            let law = it.law();
            // To and fro by 4 mm at 1 Hz, by 0.05 mm at 20 Hz, at once and by little.
            for (size, hz) in [(2.0, 1.0), (0.025, 20.0), (1.0, 60.0), (1e-4, 5.0)] {
                it.begin();
                let (mut before, mut sum, mut sizes) = (0.0, 0.0, 0.0);
                for tick in 1..=(subject.by_effort(0.5, 1.0, 20.0) * tick_hz) as u64 {
                    let x = size * (1.0 - (TAU * hz * tick as f64 / tick_hz).cos());
                    let taken = -it.at(x) * (x - before);
                    before = x;
                    sum += taken;
                    sizes += taken.abs();
                    holds(sum >= -1e-9 * sizes - 1e-12, || {
                        format!(
                            "rubbing {:.1} N it has given {:.3e} mJ of {sizes:.3e}",
                            depth_mm * near.law.stiffness_n_per_mm,
                            -sum
                        )
                    })?;
                }
            }
            let bound = needed(law, tick_hz);
            let device = Device { mass_kg: MASS_KG, damping_ns_per_m: 1.05 * bound, friction_n: 0.0 };
            it.begin();
            // No further than some mm, lest the wall ends.
            let slid = slide(&mut |x| it.at(x), device, tick_hz, (0.03 * tick_hz) as u64);
            holds(slid.most <= 1.0 + 1e-9, || {
                format!("1.05 times {bound:.4} N s/m: {:.6} of its energy at first", slid.most)
            })?;
            found.push(format!(
                "{:.1} N: {:.2} N/mm and {:.2} N s/m, at least {bound:.2} N s/m",
                depth_mm * near.law.stiffness_n_per_mm,
                law.stiffness_n_per_mm,
                law.damping_ns_per_m
            ));
        }
    }
    holds(wall.faults() == 0, || format!("{} faults", wall.faults()))?;
    if found.iter().all(|f| f.ends_with("at least 0.00 N s/m")) {
        return not_applicable("no wall of this graph has friction");
    }
    found.sort();
    found.dedup();
    found.truncate(8);
    Ok(format!("rubbed with {}", found.join("; ")))
}
