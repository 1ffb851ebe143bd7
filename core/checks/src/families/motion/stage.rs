//! A subject's whole graph under a stylus that is pressed into a level wall of it and moves there.

use asperity_dsp::low_pass::opened_hz;
use asperity_node::Buffer;

use crate::case::{Not, holds, not_applicable};
use crate::rig::Rig;
use crate::subject::Subject;
use crate::wall::Wall;

/// How hard the stylus presses \[N\].
const PRESS_N: f64 = 1.0;
/// How deep it is where nothing tells of a wall \[mm\].
const DEPTH_MM: f64 = 2.0;

/// What a tick brings.
pub(super) enum Next {
    /// A place beside the spot on the wall \[mm\], and whether it is to be trusted.
    At([f64; 2], bool),
    /// So many ticks are lost.
    Skip(u64),
}

/// The graph, and where its stylus is pressed down.
pub(super) struct Stage {
    rig: Rig,
    spot_mm: [f64; 3],
    gate: Option<Gate>,
}

/// A gate over a speed: node, the input of the speed, the output that says whether it is open, and the
/// speed at which it opens where that is known.
#[derive(Clone, Copy)]
struct Gate {
    node: usize,
    speed: usize,
    active: usize,
    opens_mm_s: Option<f64>,
}

/// What was seen and heard of a motion.
#[derive(Clone, Debug, Default)]
pub(super) struct Heard {
    /// How often the gate opened and shut.
    pub changes: u32,
    /// Ticks in which it was open.
    pub open: u64,
    /// The last tick in which it changed.
    pub changed: u64,
    /// Least and greatest speed \[mm/s\]; none where no gate tells of one.
    pub speed: Option<(f64, f64)>,
    /// The largest of what was played, and its largest step from one sample to the next.
    pub peak: f32,
    pub step: f32,
    /// Sum of squares, and how many.
    square: (f64, u64),
}

impl Heard {
    /// Root mean square of what was played.
    pub(super) fn rms(&self) -> f64 {
        (self.square.0 / self.square.1.max(1) as f64).sqrt()
    }
}

impl Stage {
    /// # Errors
    /// No graph, or nothing in it that moves a stylus.
    pub(super) fn new(subject: &Subject<'_>) -> Result<Self, Not> {
        let rig = Rig::fed(subject)?;
        let spot_mm = match spot(subject) {
            Ok(at) => at,
            Err(Not::Applicable(_)) => [0.0, 0.0, -DEPTH_MM],
            Err(other) => return Err(other),
        };
        let gate = rig.schedule.nodes.iter().enumerate().find_map(|(node, n)| {
            let speed = n.inputs.iter().position(|i| i.name == "speed")?;
            let active = n.outputs.iter().position(|o| o.name == "active")?;
            n.gate?;
            let has = n.params.iter().any(|(name, _)| name == "speed_mm_s");
            let opens_mm_s = has.then(|| n.params.number("speed_mm_s"));
            Some(Gate { node, speed, active, opens_mm_s })
        });
        Ok(Self { rig, spot_mm, gate })
    }

    pub(super) fn tick_hz(&self) -> f64 {
        f64::from(self.rig.schedule.tick_hz)
    }

    /// The speed at which the gate opens \[mm/s\].
    ///
    /// # Errors
    /// There is no gate over a speed, or it is always open.
    pub(super) fn opens_mm_s(&self) -> Result<f64, Not> {
        let Some(gate) = self.gate else { return not_applicable("there is no gate over a speed") };
        match gate.opens_mm_s {
            Some(speed) if speed > 0.0 => Ok(speed),
            _ => not_applicable("the gate opens at no speed that is known"),
        }
    }

    /// The corner at the gate's speed of the low-pass behind which `velocity` tells it \[Hz\]; none where
    /// another kind tells it, or there is no low-pass.
    pub(super) fn cutoff_hz(&self) -> Option<f64> {
        let nodes = &self.rig.schedule.nodes;
        let gate = self.gate?;
        let mut next: Vec<usize> =
            nodes[gate.node].inputs[gate.speed].from.iter().map(|from| from.0).collect();
        let mut seen = vec![false; nodes.len()];
        while let Some(at) = next.pop().filter(|&at| !std::mem::replace(&mut seen[at], true)) {
            if nodes[at].kind == "velocity" {
                let [hz, per_mm_s] =
                    ["cutoff_hz", "cutoff_hz_per_mm_s"].map(|name| nodes[at].params.number(name));
                let opens = gate.opens_mm_s.unwrap_or_default();
                return (hz > 0.0).then_some(opened_hz(hz, per_mm_s, opens, self.tick_hz()));
            }
            next.extend(nodes[at].inputs.iter().filter_map(|input| Some(input.from?.0)));
        }
        None
    }

    /// Samples a second of what is played.
    pub(super) fn audio_hz(&self) -> f64 {
        f64::from(self.rig.schedule.audio_hz)
    }

    /// From the first tick on, `next` says what comes in tick after tick, until it says nothing. Answers
    /// what was seen and heard in each of some times, from and to \[s\].
    ///
    /// # Errors
    /// A node fails, or plays what is not finite.
    pub(super) fn play<const N: usize>(
        &mut self,
        times_s: [(f64, f64); N],
        mut next: impl FnMut(u64) -> Option<Next>,
    ) -> Result<[Heard; N], Not> {
        self.rig.engine.reset();
        let faults = self.rig.engine.faults();
        let hz = self.tick_hz();
        let mut all: [Heard; N] = std::array::from_fn(|_| Heard::default());
        let (mut open, mut last) = (false, [0.0_f32; 8]);
        loop {
            let tick = self.rig.engine.next_tick();
            let [x, y, z] = self.spot_mm;
            match next(tick) {
                None => break,
                Some(Next::Skip(ticks)) => {
                    self.rig.engine.skip(ticks);
                    continue;
                }
                Some(Next::At(at, valid)) => self.rig.place([x + at[0], y + at[1], z], valid),
            }
            self.rig.engine.tick();
            let now = tick as f64 / hz;
            let mut counts: Vec<&mut Heard> = all
                .iter_mut()
                .zip(times_s)
                .filter(|(_, t)| now >= t.0 && now < t.1)
                .map(|(h, _)| h)
                .collect();
            for (samples, last) in self.rig.drive().zip(&mut last) {
                for &x in samples {
                    holds(x.is_finite(), || format!("what is played is not finite in tick {tick}"))?;
                    for heard in &mut counts {
                        heard.peak = heard.peak.max(x.abs());
                        heard.step = heard.step.max((x - *last).abs());
                        heard.square = (heard.square.0 + f64::from(x * x), heard.square.1 + 1);
                    }
                    *last = x;
                }
            }
            let Some(gate) = self.gate else { continue };
            let value = |buffer: Option<&Buffer>| match buffer {
                Some(Buffer::Control { values, .. }) => values.first().copied().unwrap_or(0.0),
                _ => 0.0,
            };
            let is_open = value(self.rig.engine.output(gate.node, gate.active)) > 0.0;
            let speed = value(self.rig.engine.input(gate.node, gate.speed));
            for heard in counts {
                let (least, most) = heard.speed.unwrap_or((speed, speed));
                heard.speed = Some((least.min(speed), most.max(speed)));
                heard.open += u64::from(is_open);
                if is_open != open {
                    (heard.changes, heard.changed) = (heard.changes + 1, tick);
                }
            }
            open = is_open;
        }
        let faults = self.rig.engine.faults() - faults;
        holds(faults == 0, || format!("{faults} faults"))?;
        Ok(all)
    }
}

/// A place in the middle of a level wall, as deep as a hand presses.
fn spot(subject: &Subject<'_>) -> Result<[f64; 3], Not> {
    let mut wall = Wall::of_graph(subject)?;
    let spots = wall.walls(subject.by_effort(20.0, 10.0, 10.0));
    let Some(spot) = spots.into_iter().find(|s| s.normal[2] > 1.0 - 1e-9) else {
        return not_applicable("there is no level wall");
    };
    let near = wall.near(spot)?;
    Ok(spot.above(-(PRESS_N / near.law.stiffness_n_per_mm).min(near.deep_mm)))
}
