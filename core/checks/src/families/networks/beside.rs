//! A graph beside itself: over the same motion, once as it is and once with a node that goes wrong for a while.

use std::ops::Range;
use std::sync::Arc;

use asperity_graph::Schedule;
use asperity_node::{Buffer, NodeKind, Shape};

use crate::buffers::{denormals, same};
use crate::case::{Not, holds, not_applicable};
use crate::played::Motion;
use crate::rig::{DriveLimits, Rig};
use crate::subject::Subject;
use crate::wrap;

/// How long a graph runs before anything goes wrong \[s\].
const SETTLE_S: f64 = 1.0;
/// How long after something went wrong the level is back \[s\].
pub(super) const RECOVERY_S: f64 = 1.0;
/// Over how long a level is measured \[s\].
const LEVEL_S: f64 = 1.0;
/// How near to the level without the trouble it is then \[dB\].
const LEVEL_DB: f64 = 1.0;

/// What is done to the bins of a frame, by the number of frames that came so far.
pub(super) type Spoil = fn(u64, &mut [f32]);

/// Frames that go wrong.
#[derive(Clone, Copy)]
pub(super) struct Wrong {
    /// What a person calls it.
    pub(super) what: &'static str,
    /// For so long \[s\], and then the level has to come back. Endless trouble lasts a second, and nothing
    /// comes after it.
    pub(super) seconds: f64,
    /// And so many frames at most.
    pub(super) frames: u64,
    /// How.
    pub(super) spoil: Spoil,
}

impl Wrong {
    /// One frame.
    pub(super) fn once(what: &'static str, spoil: Spoil) -> Self {
        Self { what, seconds: 0.02, frames: 1, spoil }
    }

    /// A tenth of a second: a window.
    pub(super) fn burst(what: &'static str, spoil: Spoil) -> Self {
        Self { what, seconds: 0.1, frames: u64::MAX, spoil }
    }

    /// Without an end.
    pub(super) fn for_ever(what: &'static str, spoil: Spoil) -> Self {
        Self { what, seconds: f64::INFINITY, frames: u64::MAX, spoil }
    }
}

/// When something goes wrong, in ticks, and when its level is measured.
pub(super) struct Window {
    what: &'static str,
    pub(super) wrong: Range<u64>,
    level: Range<u64>,
}

/// Lays troubles of so many seconds one behind the other. Answers the ticks that all take, too.
pub(super) fn windows(troubles: &[(&'static str, f64)], tick_hz: u32) -> (Vec<Window>, u64) {
    let ticks = |seconds: f64| (seconds * f64::from(tick_hz)).round() as u64;
    let mut next = ticks(SETTLE_S);
    let mut all = Vec::new();
    for &(what, seconds) in troubles {
        let (endless, start) = (seconds.is_infinite(), next);
        let end = start + ticks(if endless { 1.0 } else { seconds });
        let back = end + ticks(RECOVERY_S);
        next = if endless { end } else { back + ticks(LEVEL_S) };
        let level = if endless { next..next } else { back..next };
        all.push(Window { what, wrong: if endless { start..u64::MAX } else { start..end }, level });
    }
    (all, next)
}

/// A kind whose frames of magnitudes go wrong.
pub(super) fn spoiled(inner: Arc<dyn NodeKind>, wrongs: &[Wrong], windows: &[Window]) -> Arc<dyn NodeKind> {
    let plan: Arc<[(Range<u64>, u64, Spoil)]> =
        windows.iter().zip(wrongs).map(|(at, w)| (at.wrong.clone(), w.frames, w.spoil)).collect();
    let make = move |_: &asperity_node::Setup<'_>| -> wrap::Process {
        let plan = plan.clone();
        let mut came = vec![0; plan.len()];
        Box::new(move |node, tick| {
            let status = node.process(tick)?;
            for ((ticks, most, spoil), came) in plan.iter().zip(&mut came) {
                if !ticks.contains(&tick.index) || *came >= *most {
                    continue;
                }
                for buffer in tick.outputs.buffers() {
                    if let Buffer::Magnitude { bins, frame: Some(_), .. } = buffer {
                        spoil(*came, bins);
                        *came += 1;
                    }
                }
            }
            Ok(status)
        })
    };
    wrap::wrap(inner, Arc::new(make))
}

/// Two runs side by side.
pub(super) struct Beside {
    plain: Rig,
    wrong: Rig,
    /// Nodes that go wrong, and those that hear of it.
    touched: Vec<bool>,
    /// Those that go wrong.
    culprits: Vec<usize>,
    limits: Vec<Option<DriveLimits>>,
    last: Vec<f64>,
    /// Largest sample of the drive while it goes wrong.
    largest: f64,
    /// Largest magnitude of a frame, plain and wrong; infinite for what is none.
    magnitudes: [f64; 2],
    denormals: u64,
}

impl Beside {
    /// The subject's graph under `motion` as it is, and with other kinds; the nodes of these indices go wrong.
    ///
    /// # Errors
    /// What the compiler says.
    pub(super) fn new(
        subject: &Subject<'_>,
        motion: &Motion,
        others: Vec<Arc<dyn NodeKind>>,
        culprits: Vec<usize>,
    ) -> Result<Self, Not> {
        let plain = Rig::new(subject, motion.clone(), &[])?;
        let mut mutant = subject.clone();
        for kind in others {
            mutant = mutant.with(kind);
        }
        let wrong = Rig::new(&mutant, motion.clone(), &[])?;
        let touched = downstream(&plain.schedule, &culprits);
        let limits = wrong.drive_limits();
        let last = vec![0.0; limits.len()];
        Ok(Self {
            plain,
            wrong,
            touched,
            culprits,
            limits,
            last,
            largest: 0.0,
            magnitudes: [0.0; 2],
            denormals: 0,
        })
    }

    /// Runs both over all windows. Answers, for each that ends, its name and how far off the level is after
    /// it, in dB.
    ///
    /// # Errors
    /// What does not hold.
    pub(super) fn run(&mut self, windows: &[Window], ticks: u64) -> Result<Vec<(&'static str, f64)>, Not> {
        let mut sums = vec![[0.0; 2]; windows.len()];
        for tick in 0..ticks {
            self.plain.engine.tick();
            self.wrong.engine.tick();
            let now = windows.iter().rfind(|w| tick >= w.wrong.start).map_or("before", |w| w.what);
            self.look_at_drive(tick, now)?;
            self.look_at_others(tick, now)?;
            let measured = windows.iter().position(|w| w.level.contains(&tick));
            if let Some(sum) = measured.and_then(|i| sums.get_mut(i)) {
                sum[0] += energy(&self.plain);
                sum[1] += energy(&self.wrong);
            }
        }
        for (i, node) in self.wrong.schedule.nodes.iter().enumerate() {
            let faults = |rig: &Rig| rig.engine.report(i).map_or(0, |r| r.faults);
            holds(self.culprits.contains(&i) || faults(&self.wrong) == faults(&self.plain), || {
                let fault = self.wrong.engine.report(i).and_then(|r| r.last_fault);
                let how = fault.map_or_else(String::new, |f| format!(": it {f}"));
                format!("node `{}` fails {} times{how}", node.id, faults(&self.wrong))
            })?;
        }
        let mut off = Vec::new();
        for (window, [plain, wrong]) in windows.iter().zip(sums) {
            if window.level.is_empty() {
                continue;
            }
            let db = 10.0 * (wrong / plain).log10();
            holds(db.abs() <= LEVEL_DB, || {
                format!("{}: the level is {db:+.1} dB off {RECOVERY_S} s after it", window.what)
            })?;
            off.push((window.what, db));
        }
        Ok(off)
    }

    /// What goes to the actuators is finite and within the bounds that their limiters state, in every sample.
    fn look_at_drive(&mut self, tick: u64, now: &str) -> Result<(), Not> {
        for ((samples, limits), last) in self.wrong.drive().zip(&self.limits).zip(&mut self.last) {
            for &x in samples {
                let x = f64::from(x);
                holds(x.is_finite(), || format!("{now}: the drive is not finite at tick {tick}"))?;
                if let Some(limits) = limits {
                    let (size, step) = (x.abs(), (x - *last).abs());
                    // What is bounded is f32: half a unit in its last place on either side.
                    holds(size <= limits.peak * (1.0 + 1e-6), || {
                        format!(
                            "{now}: the drive is {x:.4} at tick {tick}, the limiter's bound {:.4}",
                            limits.peak
                        )
                    })?;
                    holds(step <= limits.step + 1e-6 * limits.peak, || {
                        format!(
                            "{now}: a step of {step:.5} at tick {tick}, the limiter's bound {:.5}",
                            limits.step
                        )
                    })?;
                }
                self.largest = self.largest.max(x.abs());
                *last = x;
            }
        }
        Ok(())
    }

    /// What does not hear of it goes on to the bit, and what goes to the actuators is trusted as before.
    fn look_at_others(&mut self, tick: u64, now: &str) -> Result<(), Not> {
        for (i, node) in self.plain.schedule.nodes.iter().enumerate() {
            for output in 0..node.outputs.len() {
                let (a, b) = (self.plain.engine.output(i, output), self.wrong.engine.output(i, output));
                let (Some(a), Some(b)) = (a, b) else { continue };
                if !self.touched[i] {
                    holds(same(a, b), || {
                        format!(
                            "{now}: node `{}`, which hears nothing of it, changes at tick {tick}",
                            node.id
                        )
                    })?;
                }
                for (most, buffer) in self.magnitudes.iter_mut().zip([a, b]) {
                    *most = most.max(loudest(buffer));
                }
                if !self.culprits.contains(&i) {
                    self.denormals += denormals(b);
                }
            }
        }
        holds(self.wrong.trusted() || !self.plain.trusted(), || {
            format!("{now}: the drive is no longer trusted at tick {tick}, and fades with all that is in it")
        })
    }

    /// Denormal numbers in outputs of nodes that did not go wrong themselves.
    pub(super) fn denormals(&self) -> u64 {
        self.denormals
    }

    /// Largest sample of the drive.
    pub(super) fn largest(&self) -> f64 {
        self.largest
    }

    /// Largest magnitude that a frame held where nothing goes wrong, and where it does \[m/s^2\].
    pub(super) fn magnitudes(&self) -> [f64; 2] {
        self.magnitudes
    }

    /// How many nodes hear nothing of what goes wrong.
    pub(super) fn untouched(&self) -> usize {
        self.touched.iter().filter(|t| !**t).count()
    }
}

/// Nodes that put out frames of magnitudes.
pub(super) fn networks(schedule: &Schedule) -> Vec<usize> {
    let makes =
        |i: &usize| schedule.nodes[*i].outputs.iter().any(|o| matches!(o.port.shape, Shape::Magnitude(_)));
    (0..schedule.nodes.len()).filter(makes).collect()
}

/// The nodes of these indices, and all that hear them.
fn downstream(schedule: &Schedule, from: &[usize]) -> Vec<bool> {
    let mut touched: Vec<bool> = (0..schedule.nodes.len()).map(|i| from.contains(&i)).collect();
    // Again and again, since a cycle leads backwards.
    loop {
        let hears = |i: usize| {
            let mut inputs = schedule.nodes[i].inputs.iter();
            inputs.any(|input| input.from.is_some_and(|(node, _)| touched[node]))
        };
        let new: Vec<usize> = (0..touched.len()).filter(|&i| !touched[i] && hears(i)).collect();
        if new.is_empty() {
            return touched;
        }
        new.into_iter().for_each(|i| touched[i] = true);
    }
}

/// The squares of what is played in this tick, or felt where nothing is played.
pub(super) fn energy(rig: &Rig) -> f64 {
    let squares = |samples: &[f32]| samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    if rig.drives() { rig.drive().map(squares).sum() } else { squares(rig.felt()) }
}

/// The largest magnitude of this tick's frame; infinite for one that is none.
fn loudest(buffer: &Buffer) -> f64 {
    match buffer {
        Buffer::Magnitude { bins, frame: Some(_), .. } if bins.iter().all(|m| m.is_finite()) => {
            bins.iter().fold(0.0, |most, m| most.max(f64::from(*m)))
        }
        Buffer::Magnitude { frame: Some(_), .. } => f64::INFINITY,
        _ => 0.0,
    }
}

/// Where the stylus is moved so that the network is heard: a circle of 8 mm at 60 mm/s there.
///
/// # Errors
/// No graph, no network in it, or none that anything could make sound.
pub(super) fn motion(subject: &Subject<'_>) -> Result<Motion, Not> {
    let hz = f64::from(subject.its_graph()?.tick_hz);
    let around = |at: [f64; 3]| -> Motion {
        Arc::new(move |tick| {
            let turn = tick as f64 / hz * 60.0 / 4.0;
            [at[0] + 4.0 * turn.cos(), at[1] + 4.0 * turn.sin(), at[2]]
        })
    };
    let first = around([0.0, 0.0, -2.0]);
    if sounds(&mut Rig::new(subject, first.clone(), &[])?)? {
        return Ok(first);
    }
    // Where the graph's own motion makes it sound, or else one that looks for it.
    let own = Rig::of(subject, subject.its_graph()?, &[])?;
    let sweep: Motion = Arc::new(move |tick| {
        let way = tick as f64 / hz * 100.0;
        let turn = (way / 200.0).rem_euclid(2.0);
        let x = if turn < 1.0 { turn } else { 2.0 - turn };
        [200.0 * x - 100.0, 20.0 * ((way / 200.0).floor() - 2.0), -2.0]
    });
    for mut rig in [own, Rig::new(subject, sweep, &[])?] {
        let all = networks(&rig.schedule);
        let (mut found, ticks) = (Vec::new(), rig.ticks(10.0));
        rig.run(ticks, |rig, tick| {
            let at = rig.position().filter(|_| came(rig, &all) && tick.is_multiple_of(5));
            found.extend(at);
            Ok(())
        })?;
        // The middle of a stretch of it is furthest from where it ends.
        for part in [2, 4, 8, 16] {
            let Some(at) = found.get(found.len() / part) else { continue };
            let here = around(*at);
            if sounds(&mut Rig::new(subject, here.clone(), &[])?)? {
                return Ok(here);
            }
        }
    }
    not_applicable("nothing that a played stylus did made a network of this graph sound for long")
}

/// Whether a frame came in this tick.
fn came(rig: &Rig, networks: &[usize]) -> bool {
    let frame = |(i, o)| matches!(rig.engine.output(i, o), Some(Buffer::Magnitude { frame: Some(_), .. }));
    networks.iter().any(|&i| (0..rig.schedule.nodes[i].outputs.len()).any(|o| frame((i, o))))
}

/// Whether in each tenth of a second from the sixth on frames come and something is heard.
pub(super) fn sounds(rig: &mut Rig) -> Result<bool, Not> {
    let all = networks(&rig.schedule);
    if all.is_empty() {
        return not_applicable("no node of this graph puts out magnitudes");
    }
    let part = rig.ticks(0.1).max(1);
    let mut heard = [(false, false); 10];
    rig.run(10 * part, |rig, tick| {
        if let Some(heard) = heard.get_mut((tick / part) as usize) {
            *heard = (heard.0 || came(rig, &all), heard.1 || energy(rig) > 1e-12);
        }
        Ok(())
    })?;
    Ok(heard.iter().skip(5).all(|h| h.0 && h.1))
}
