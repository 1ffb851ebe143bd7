//! The law of a wall as it answers: force by place at rest, and what speed adds.

use asperity_scene::effect::passivity::{Law, Passivity, Sampling};

use super::{Spot, Wall};
use crate::case::{Not, holds, not_applicable};

/// No wall is looked at further in or out \[mm\].
const FAR_MM: f64 = 6.0;
/// Points of a curve on either side of the surface.
const POINTS: i32 = 200;

/// Forces along the normal, at rest.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    /// Place \[mm\], from in to out; force \[N\]; energy \[mJ\], 0 where it is least.
    points: Vec<[f64; 3]>,
}

impl Curve {
    /// Energy of the wall at a place \[mJ\]: what it takes to bring a stylus there, however slowly, from where it takes least.
    pub(crate) fn energy_mj(&self, x_mm: f64) -> f64 {
        let at = self.points.partition_point(|p| p[0] < x_mm);
        match (at.checked_sub(1).and_then(|i| self.points.get(i)), self.points.get(at)) {
            (Some(a), Some(b)) => {
                let part = (x_mm - a[0]) / (b[0] - a[0]);
                // The force between two points is a straight line.
                let here = a[1] + part * (b[1] - a[1]);
                b[2] + 0.5 * (here + b[1]) * (b[0] - x_mm)
            }
            (None, Some(first)) => first[2] + first[1] * (first[0] - x_mm),
            _ => self.points.last().map_or(0.0, |p| p[2]),
        }
    }
}

/// A wall near its surface.
#[derive(Clone, Debug)]
pub(crate) struct Near {
    /// Where.
    pub spot: Spot,
    /// Its stiffness and damping as they were found.
    pub law: Law,
    /// How deep Hooke's law holds within some hundredths \[mm\].
    pub deep_mm: f64,
    /// By which part the force is less than Hooke's there at most.
    pub gentler: f64,
    /// From how deep on it is stiffer, if it is \[mm\].
    pub stiffens_mm: Option<f64>,
    /// When places are read and forces set.
    pub sampling: Sampling,
}

impl Near {
    /// The damping that a device needs for it \[N s/m\], beside more delay than the graph's own.
    pub(crate) fn needed_ns_per_m(&self, late_s: f64) -> f64 {
        let sampling = Sampling { delay_s: self.sampling.delay_s + late_s, ..self.sampling };
        Passivity::of(self.law, sampling, 0.0).needed_ns_per_m
    }

    /// Whether it is Hooke's spring and nothing else, within 1e-4, and comes without delay: what motions take out of it is then known, not only bounded.
    pub(crate) fn is_hooke(&self) -> bool {
        self.law.damping_ns_per_m == 0.0 && self.sampling.delay_s == 0.0 && self.gentler <= 1e-4
    }

    /// From one force to the next \[s\].
    pub(crate) fn tick_s(&self) -> f64 {
        1.0 / self.sampling.tick_hz
    }

    /// A mass that swings in it with so many radians a tick \[kg\].
    pub(crate) fn mass_kg(&self, radians: f64) -> f64 {
        1e3 * self.law.stiffness_n_per_mm * (self.tick_s() / radians).powi(2)
    }
}

impl Wall {
    /// The force at rest \[N\] there: after three runs of the wall.
    fn at_rest(&mut self, spot: &Spot, x_mm: f64) -> f64 {
        let mut force = 0.0;
        (0..3 * self.every()).for_each(|_| force = self.above(spot, x_mm));
        force
    }

    /// The law of the wall at a spot, by which it is to be judged: its force by place at rest, and the damping that it tells. Where speed adds more than that, a drag
    /// or so, it counts; where it adds less, the force comes late or the wall drives, and that is no law.
    ///
    /// # Errors
    /// No wall there that pushes out.
    pub(crate) fn near(&mut self, spot: Spot) -> Result<Near, Not> {
        self.reset();
        self.at_rest(&spot, FAR_MM);
        let start = 1e-3;
        // Not from the surface itself, which is where it was found to be touched.
        let surface = self.at_rest(&spot, -start);
        let stiffness = (self.at_rest(&spot, -2.0 * start) - surface) / start;
        if stiffness <= 0.0 {
            return not_applicable("the wall does not push out");
        }
        let (mut deep, mut gentlest, mut steepest, mut before) =
            (start, stiffness, stiffness, (start, surface));
        let mut stiffens = None;
        for n in 4..50 {
            let depth = start * 1.2_f64.powi(n);
            if depth > FAR_MM {
                break;
            }
            let force = self.at_rest(&spot, -depth);
            let slope = (force - before.1) / (depth - before.0);
            if !(0.99..=1.05).contains(&(slope / stiffness)) {
                stiffens = (slope > stiffness).then_some(deep);
                break;
            }
            (gentlest, steepest) = (gentlest.min(slope), steepest.max(slope));
            (deep, before) = (depth, (depth, force));
        }
        let stiffness = steepest;
        let told = if self.vector { spot.damping_ns_per_m } else { 0.0 };
        let damping = self.damping(&spot, deep, stiffness).max(told);
        let law = Law { stiffness_n_per_mm: stiffness, damping_ns_per_m: damping };
        holds(self.faults() == 0, || format!("{} faults", self.faults()))?;
        let (gentler, sampling) = (1.0 - gentlest / stiffness, self.sampling());
        Ok(Near { spot, law, deep_mm: deep, gentler, stiffens_mm: stiffens, sampling })
    }

    /// What speed adds to the force, by the speed \[N s/m\]: against the motion above 0.
    fn damping(&mut self, spot: &Spot, deep_mm: f64, stiffness_n_per_mm: f64) -> f64 {
        let middle = -0.5 * deep_mm;
        let still = self.at_rest(spot, middle);
        let step = 1e-3 * deep_mm;
        let runs = self.every();
        // In, then on at the same speed; the place is that of the last run.
        let mut force = 0.0;
        for n in 1..=4 {
            (0..runs).for_each(|_| force = self.above(spot, middle - f64::from(n) * step));
        }
        let beyond = force - still - stiffness_n_per_mm * 4.0 * step;
        let speed_mm_s = step * self.sampling().tick_hz;
        let damping = 1e3 * beyond / speed_mm_s;
        // What is left of rounding is none.
        if damping.abs() < 1e-6 * 1e3 * stiffness_n_per_mm / self.sampling().tick_hz { 0.0 } else { damping }
    }

    /// The force at rest from as deep as Hooke's law holds, and as much again, to well outside.
    pub(crate) fn curve(&mut self, near: &Near) -> Curve {
        self.reset();
        let mut points: Vec<[f64; 3]> = Vec::new();
        for n in (-2 * POINTS..=POINTS).rev() {
            let x = f64::from(n) / f64::from(POINTS) * if n > 0 { FAR_MM } else { near.deep_mm };
            let force = self.at_rest(&near.spot, x);
            let energy = points.last().map_or(0.0, |p| p[2] + 0.5 * (p[1] + force) * (p[0] - x));
            points.push([x, force, energy]);
        }
        points.reverse();
        let least = points.iter().map(|p| p[2]).fold(f64::INFINITY, f64::min);
        points.iter_mut().for_each(|p| p[2] -= least);
        Curve { points }
    }
}
