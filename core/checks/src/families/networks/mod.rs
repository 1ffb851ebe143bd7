//! A texture network that goes wrong: its output is nonsense, or its input is unlike its training.
//!
//! Every case but the last runs the subject's graph twice over the same motion, as it is and with the
//! trouble, and compares the two. A trouble lasts a frame, a window (0.1 s), or for ever. A second after the
//! first two the drive has its level back. That leaves a margin over what was measured: the window, the
//! memory of the actuator's inverse (0.2 s from its largest input), and the gain of the limiter, which comes
//! back with a time constant of 0.2 s. After a window of 1e30 the level was within 0.5 dB after 0.7 s.

mod pulses;

use std::ops::Range;
use std::sync::Arc;

use asperity_graph::Schedule;
use asperity_node::{Buffer, FactValue, NodeKind, Setup, Shape, Unit};

use crate::buffers::{denormals, same};
use crate::case::{Case, Family, Found, Stop, holds, not_applicable};
use crate::played::Motion;
use crate::rig::{DriveLimits, Rig};
use crate::subject::{Effort, Subject};
use crate::wrap::{Process, wrap};

const NETWORKS: Family = Family("networks");

pub(super) const CASES: &[Case] = &[
    NETWORKS.graph(
        "network_not_finite",
        not_finite,
        "the network's magnitudes are NaN or infinite: in single frames, for six frames, for ever",
        "in every sample the drive is finite and within the bounds of the limiter. Only the network fails, \
         and nodes that do not depend on it go on to the bit. Up to seven bad frames: 1 s later the level \
         is back within 1 dB. From the eighth on it is silent",
    ),
    NETWORKS.graph(
        "network_huge",
        huge,
        "the network's magnitudes are 1e30: in one bin, in all, in a single frame, for a window, for ever. \
         Or they are the largest number for a window",
        "in every sample the drive is finite and within the bounds of the limiter. No node fails, and \
         nodes that do not depend on the network go on to the bit. 1 s later the level is back within 1 dB",
    ),
    NETWORKS.graph(
        "network_negative",
        negative,
        "the network's magnitudes are negative: every second, all, in a single frame, for a window, for \
         ever",
        "all that holds of `network_huge`. A negative magnitude counts as 0",
    ),
    NETWORKS.graph(
        "network_denormal",
        denormal,
        "the network's magnitudes are denormal, 1e-40: in a single frame, for a window, for ever",
        "no output of any other node ever holds a denormal number, which would cost time; and all that \
         holds of `network_huge`",
    ),
    NETWORKS.graph(
        "network_alternates",
        alternates,
        "the network's magnitudes are 0 and 100 m/s^2 in all bins by turns, frame by frame, for a window \
         and for ever",
        "all that holds of `network_huge`",
    ),
    NETWORKS.graph(
        "network_out_of_range",
        out_of_range,
        "the network gets forces and speeds 10 times as large as in training, for half a second and for \
         ever",
        "its magnitudes stay finite and below 10 times the largest of the same stroke in range; and all \
         that holds of `network_huge`",
    ),
    NETWORKS.graph(
        "network_steady",
        pulses::pulses,
        "speed and force are constant, over several materials: the network's magnitudes do not change",
        "no texture pulses. Its envelope's autocorrelation from 20 to 200 ms is at most 0.25 above that of \
         Gaussian noise of the same spectrum, and its modulation from 15 to 25 Hz at most 2.5 times as \
         deep. For a material that repeats with place, the autocorrelation is at most 0.25 above it at any \
         lag that is the same at 60, 82 and 131 mm/s",
    ),
];

/// Kinds, and indices of nodes.
type Culprits = (Vec<Arc<NodeKind>>, Vec<usize>);

/// All kinds with an output of magnitudes in the subject's graph, and their nodes.
fn culprits(subject: &Subject<'_>) -> Result<Culprits, Stop> {
    let schedule = subject.compiled(subject.its_graph()?, &[])?.schedule;
    let nodes = networks(&schedule);
    let mut names: Vec<&str> = nodes.iter().map(|&i| schedule.nodes[i].kind.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let kinds = names.into_iter().map(|name| subject.kind(name)).collect::<Result<_, _>>()?;
    Ok((kinds, nodes))
}

/// Runs troubles one after the other.
fn spoil(subject: &Subject<'_>, wrongs: &[Wrong]) -> Result<(Beside, String), Stop> {
    let motion = motion(subject)?;
    let troubles: Vec<_> = wrongs.iter().map(|w| (w.what, w.seconds)).collect();
    let (windows, ticks) = windows(&troubles, subject.its_graph()?.tick_hz);
    let (kinds, nodes) = culprits(subject)?;
    let others = kinds.into_iter().map(|kind| spoiled(kind, wrongs, &windows)).collect();
    let mut both = Beside::new(subject, &motion, others, nodes)?;
    let off = both.run(&windows, ticks)?;
    let worst = off.iter().map(|(_, db)| db.abs()).fold(0.0, f64::max);
    let found = format!(
        "{} troubles; the drive peaks at {:.3}; 1 s later the level is off by {worst:.2} dB at most; {} \
         nodes do not depend on it",
        wrongs.len(),
        both.largest,
        both.untouched()
    );
    Ok((both, found))
}

/// All troubles, or with effort `quick` the first and the endless ones.
fn chosen(subject: &Subject<'_>, all: Vec<Wrong>) -> Vec<Wrong> {
    let quick = subject.allowed() == Effort::Quick;
    let wanted = |(i, w): &(usize, Wrong)| !quick || *i == 0 || w.seconds.is_infinite();
    all.into_iter().enumerate().filter(wanted).map(|(_, w)| w).collect()
}

/// Sets one bin of a frame, in the middle of the band of most textures.
fn one(bins: &mut [f32], value: f32) {
    let middle = bins.len() / 5;
    if let Some(bin) = bins.get_mut(middle) {
        *bin = value;
    }
}

fn not_finite(subject: &Subject<'_>) -> Found {
    // The engine quarantines a node after eight faults, and forgives one every 10 s: so seven here, then
    // endless ones.
    let six = |n: u64, bins: &mut [f32]| match n % 3 {
        0 => bins.fill(f32::NAN),
        1 => bins.fill(f32::INFINITY),
        _ => one(bins, f32::NEG_INFINITY),
    };
    let wrongs = [
        Wrong { frames: 6, ..Wrong::burst("six frames that are not finite", six) },
        Wrong::once("one NaN", |_, bins| one(bins, f32::NAN)),
        Wrong::for_ever("NaN for ever", |_, bins| bins.fill(f32::NAN)),
    ];
    spoil(subject, &wrongs).map(|(_, found)| found)
}

fn huge(subject: &Subject<'_>) -> Found {
    let wrongs = vec![
        Wrong::burst("1e30 in all bins for a window", |_, bins| bins.fill(1e30)),
        Wrong::once("one frame of 1e30 in all bins", |_, bins| bins.fill(1e30)),
        Wrong::once("one bin of 1e30", |_, bins| one(bins, 1e30)),
        Wrong::burst("1e30 in one bin for a window", |_, bins| one(bins, 1e30)),
        Wrong::burst("1e30 in every tenth frame", |n, bins| {
            if n.is_multiple_of(10) {
                bins.fill(1e30);
            }
        }),
        Wrong::burst("the largest number in all bins for a window", |_, bins| bins.fill(f32::MAX)),
        Wrong::for_ever("1e30 for ever", |_, bins| bins.fill(1e30)),
    ];
    spoil(subject, &chosen(subject, wrongs)).map(|(_, found)| found)
}

fn negative(subject: &Subject<'_>) -> Found {
    let wrongs = vec![
        Wrong::burst("negative magnitudes for a window", |_, bins| bins.iter_mut().for_each(|m| *m = -*m)),
        Wrong::once("one frame of negative magnitudes", |_, bins| bins.iter_mut().for_each(|m| *m = -*m)),
        Wrong::burst("every second magnitude negative", |_, bins| {
            bins.iter_mut().step_by(2).for_each(|m| *m = -*m);
        }),
        Wrong::burst("-1e30 in all bins for a window", |_, bins| bins.fill(-1e30)),
        Wrong::for_ever("negative magnitudes for ever", |_, bins| bins.fill(-1.0)),
    ];
    spoil(subject, &chosen(subject, wrongs)).map(|(_, found)| found)
}

fn denormal(subject: &Subject<'_>) -> Found {
    let wrongs = vec![
        Wrong::burst("denormal magnitudes for a window", |_, bins| bins.fill(1e-40)),
        Wrong::once("one frame of denormal magnitudes", |_, bins| bins.fill(1e-40)),
        Wrong::burst("denormal and 0 by turns", |n, bins| bins.fill(1e-40 * (n % 2) as f32)),
        Wrong::for_ever("denormal magnitudes for ever", |_, bins| bins.fill(1e-40)),
    ];
    let (both, found) = spoil(subject, &chosen(subject, wrongs))?;
    holds(both.denormals == 0, || {
        format!("{} denormal numbers in the outputs of other nodes", both.denormals)
    })?;
    Ok(format!("no denormal number; {found}"))
}

fn alternates(subject: &Subject<'_>) -> Found {
    let by_turns = |n: u64, bins: &mut [f32]| bins.fill(if n.is_multiple_of(2) { 100.0 } else { 0.0 });
    let wrongs = [
        Wrong::burst("0 and most by turns", by_turns),
        Wrong::for_ever("0 and most by turns, for ever", by_turns),
    ];
    spoil(subject, &wrongs).map(|(_, found)| found)
}

/// Factor of the inputs beyond those of training.
const TIMES: f64 = 10.0;

/// Outputs of forces and speeds before a network: node, output, and the factor of the case.
type Told = Vec<(String, usize, f64)>;

fn out_of_range(subject: &Subject<'_>) -> Found {
    let motion = motion(subject)?;
    let mut rig = Rig::new(subject, motion.clone(), &[])?;
    let told = told(&mut rig)?;
    let seconds = [("out of range for half a second", 0.5), ("out of range for ever", f64::INFINITY)];
    let (windows, ticks) = windows(&seconds, rig.schedule.tick_hz);
    // The nodes before the network multiply their outputs.
    let mut kinds: Vec<&str> = Vec::new();
    let mut nodes = networks(&rig.schedule);
    for (id, _, _) in &told {
        let Some(i) = rig.schedule.index_of(id) else { continue };
        kinds.push(&rig.schedule.nodes[i].kind);
        nodes.push(i);
    }
    kinds.sort_unstable();
    kinds.dedup();
    nodes.dedup();
    let at: Vec<_> = windows.iter().map(|w| w.wrong.clone()).collect();
    let others = kinds.into_iter().map(|kind| subject.kind(kind).map(|kind| multiplied(kind, &told, &at)));
    let others: Vec<_> = others.collect::<Result<_, _>>()?;
    let mut both = Beside::new(subject, &motion, others, nodes)?;
    let off = both.run(&windows, ticks)?;
    let [within, out] = both.magnitudes;
    holds(out <= TIMES * within, || format!("a magnitude of {out:.3e} out of range, {within:.3e} within"))?;
    let worst = off.iter().map(|(_, db)| db.abs()).fold(0.0, f64::max);
    let times = told.iter().map(|t| t.2).fold(0.0, f64::max);
    Ok(format!(
        "inputs {times:.0} times as large: magnitudes up to {out:.3}, {within:.3} in range; the drive \
         peaks at {:.3}; 1 s later the level is off by {worst:.2} dB",
        both.largest
    ))
}

/// The inputs of the networks, with the factors that make them ten times the largest values of training, or
/// ten times as large where a network does not state those.
fn told(rig: &mut Rig) -> Result<Told, Stop> {
    let schedule = rig.schedule.clone();
    let mut told: Vec<(usize, usize, Option<f64>)> = Vec::new();
    for i in networks(&schedule) {
        let node = &schedule.nodes[i];
        let trained = |name| {
            let fact = node.facts.iter().find(|f| f.name == name)?;
            if let FactValue::Number(most, _) = fact.value { Some(most) } else { None }
        };
        for input in &node.inputs {
            let (Some((from, output)), Some(port)) = (input.from, &input.port) else { continue };
            let Shape::Control { .. } = port.shape else { continue };
            let units = [(Unit::NEWTON, "trained_force"), (Unit::MILLIMETRE_PER_SECOND, "trained_speed")];
            let Some((_, fact)) = units.into_iter().find(|(unit, _)| *unit == port.unit) else { continue };
            told.push((from, output, trained(fact)));
        }
    }
    if told.is_empty() {
        return not_applicable("nothing tells a network of this graph of a force or a speed");
    }
    let mut most = vec![0.0_f64; told.len()];
    let ticks = rig.ticks(0.5);
    rig.run(ticks, |rig, _| {
        for ((node, output, _), most) in told.iter().zip(&mut most) {
            if let Some(Buffer::Control { values, .. }) = rig.engine.output(*node, *output) {
                *most = values.iter().fold(*most, |m, x| m.max(x.abs()));
            }
        }
        Ok(())
    })?;
    let times = |(trained, most): (Option<f64>, f64)| match trained {
        Some(trained) if most > 0.0 => (TIMES * trained / most).max(TIMES),
        _ => TIMES,
    };
    let id = |node: usize| schedule.nodes[node].id.clone();
    Ok(told
        .into_iter()
        .zip(most)
        .map(|((node, output, trained), most)| (id(node), output, times((trained, most))))
        .collect())
}

/// A kind whose nodes of these names multiply their outputs for some ticks.
fn multiplied(inner: Arc<NodeKind>, told: &Told, at: &[Range<u64>]) -> Arc<NodeKind> {
    let (told, at) = (told.clone(), at.to_vec());
    let make = move |setup: &Setup<'_>| -> Process {
        let of_this = told.iter().filter(|t| t.0 == setup.id);
        let mut mine: Vec<(usize, f64, Vec<f64>)> =
            of_this.map(|(_, o, times)| (*o, *times, Vec::new())).collect();
        let at = at.clone();
        Box::new(move |node, tick| {
            // A node may build on its last outputs.
            for (output, _, before) in &mut mine {
                let values = tick.outputs.control(*output);
                if before.len() == values.len() {
                    values.copy_from_slice(before);
                }
            }
            let status = node.run(tick)?;
            let wrong = at.iter().any(|ticks| ticks.contains(&tick.index));
            for (output, times, before) in &mut mine {
                let values = tick.outputs.control(*output);
                before.clear();
                before.extend_from_slice(values);
                if wrong {
                    values.iter_mut().for_each(|x| *x *= *times);
                }
            }
            Ok(status)
        })
    };
    wrap(inner, Arc::new(make))
}

/// Time before the first trouble \[s\].
const SETTLE_S: f64 = 1.0;
/// Time after a trouble in which the level comes back \[s\].
const RECOVERY_S: f64 = 1.0;
/// Time over which a level is measured \[s\].
const LEVEL_S: f64 = 1.0;
/// Allowed difference from the level without trouble \[dB\].
const LEVEL_DB: f64 = 1.0;

/// Changes the bins of a frame, by the number of changed frames so far.
type Spoil = fn(u64, &mut [f32]);

/// A trouble: frames that go wrong.
#[derive(Clone, Copy)]
struct Wrong {
    /// Its name in texts.
    what: &'static str,
    /// Its duration \[s\], after which the level has to come back. Endless trouble runs for a second.
    seconds: f64,
    /// Largest number of frames.
    frames: u64,
    /// The change.
    spoil: Spoil,
}

impl Wrong {
    /// One frame.
    fn once(what: &'static str, spoil: Spoil) -> Self {
        Self { what, seconds: 0.02, frames: 1, spoil }
    }

    /// A tenth of a second: a window.
    fn burst(what: &'static str, spoil: Spoil) -> Self {
        Self { what, seconds: 0.1, frames: u64::MAX, spoil }
    }

    /// Without an end.
    fn for_ever(what: &'static str, spoil: Spoil) -> Self {
        Self { what, seconds: f64::INFINITY, frames: u64::MAX, spoil }
    }
}

/// Ticks of a trouble, and ticks in which the level after it is measured.
struct Window {
    what: &'static str,
    wrong: Range<u64>,
    level: Range<u64>,
}

/// Windows of troubles of so many seconds, one after the other, and the number of all ticks.
fn windows(troubles: &[(&'static str, f64)], tick_hz: u32) -> (Vec<Window>, u64) {
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
fn spoiled(inner: Arc<NodeKind>, wrongs: &[Wrong], windows: &[Window]) -> Arc<NodeKind> {
    let plan: Arc<[(Range<u64>, u64, Spoil)]> =
        windows.iter().zip(wrongs).map(|(at, w)| (at.wrong.clone(), w.frames, w.spoil)).collect();
    let make = move |_: &Setup<'_>| -> Process {
        let plan = plan.clone();
        let mut came = vec![0; plan.len()];
        Box::new(move |node, tick| {
            let status = node.run(tick)?;
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
    wrap(inner, Arc::new(make))
}

/// Two runs of a graph over the same motion side by side: as it is, and with nodes that go wrong.
struct Beside {
    plain: Rig,
    wrong: Rig,
    /// Nodes that go wrong, and those that depend on them.
    touched: Vec<bool>,
    /// Those that go wrong.
    culprits: Vec<usize>,
    limits: Vec<Option<DriveLimits>>,
    last: Vec<f64>,
    /// Largest sample of the drive with the trouble.
    largest: f64,
    /// Largest magnitude of a frame, plain and wrong; infinite for one that is not finite.
    magnitudes: [f64; 2],
    /// Denormal numbers in outputs of nodes that do not go wrong themselves.
    denormals: u64,
}

impl Beside {
    /// The subject's graph under `motion` as it is, and with other kinds; the nodes of these indices go
    /// wrong.
    ///
    /// # Errors
    /// Errors of the compiler.
    fn new(
        subject: &Subject<'_>,
        motion: &Motion,
        others: Vec<Arc<NodeKind>>,
        culprits: Vec<usize>,
    ) -> Result<Self, Stop> {
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

    /// Runs both over all windows. Answers the name of each that ends, and the difference of the level after
    /// it \[dB\].
    ///
    /// # Errors
    /// A requirement that does not hold.
    fn run(&mut self, windows: &[Window], ticks: u64) -> Result<Vec<(&'static str, f64)>, Stop> {
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

    /// Checks that every sample of the drive is finite and within the bounds of its limiter.
    fn look_at_drive(&mut self, tick: u64, now: &str) -> Result<(), Stop> {
        for ((samples, limits), last) in self.wrong.drive().zip(&self.limits).zip(&mut self.last) {
            for &x in samples {
                let x = f64::from(x);
                holds(x.is_finite(), || format!("{now}: the drive is not finite at tick {tick}"))?;
                if let Some(limits) = limits {
                    let (size, step) = (x.abs(), (x - *last).abs());
                    // The bounded sample is f32: half a unit in its last place on either side.
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

    /// Checks that independent nodes go on to the bit, and that the drive is as valid as before.
    fn look_at_others(&mut self, tick: u64, now: &str) -> Result<(), Stop> {
        for (i, output) in self.plain.outputs() {
            let (a, b) = (self.plain.engine.output(i, output), self.wrong.engine.output(i, output));
            let (Some(a), Some(b)) = (a, b) else { continue };
            holds(self.touched[i] || same(a, b), || {
                let id = &self.plain.schedule.nodes[i].id;
                format!("{now}: node `{id}`, which hears nothing of it, changes at tick {tick}")
            })?;
            for (most, buffer) in self.magnitudes.iter_mut().zip([a, b]) {
                *most = most.max(loudest(buffer));
            }
            if !self.culprits.contains(&i) {
                self.denormals += denormals(b);
            }
        }
        holds(self.wrong.trusted() || !self.plain.trusted(), || {
            format!("{now}: the drive is no longer valid at tick {tick}, and fades as a whole")
        })
    }

    /// Number of nodes that do not depend on the trouble.
    fn untouched(&self) -> usize {
        self.touched.iter().filter(|t| !**t).count()
    }
}

/// Nodes with an output of magnitudes.
fn networks(schedule: &Schedule) -> Vec<usize> {
    let makes =
        |i: &usize| schedule.nodes[*i].outputs.iter().any(|o| matches!(o.port.shape, Shape::Magnitude(_)));
    (0..schedule.nodes.len()).filter(makes).collect()
}

/// Marks the nodes of these indices, and all that depend on them.
fn downstream(schedule: &Schedule, from: &[usize]) -> Vec<bool> {
    let mut touched: Vec<bool> = (0..schedule.nodes.len()).map(|i| from.contains(&i)).collect();
    // Until nothing changes, since a cycle leads backwards.
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

/// Sum of the squares of this tick's drive, or of the felt acceleration where there is no drive.
fn energy(rig: &Rig) -> f64 {
    let squares = |samples: &[f32]| samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    if rig.drives() { rig.drive().map(squares).sum() } else { squares(rig.felt()) }
}

/// Largest magnitude of this tick's frame; infinite for one that is not finite.
fn loudest(buffer: &Buffer) -> f64 {
    match buffer {
        Buffer::Magnitude { bins, frame: Some(_), .. } if bins.iter().all(|m| m.is_finite()) => {
            bins.iter().fold(0.0, |most, m| most.max(f64::from(*m)))
        }
        Buffer::Magnitude { frame: Some(_), .. } => f64::INFINITY,
        _ => 0.0,
    }
}

/// A motion at which the network sounds: a circle of 8 mm at 60 mm/s.
///
/// # Errors
/// No graph; no network in it; no place at which one sounds.
fn motion(subject: &Subject<'_>) -> Result<Motion, Stop> {
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
    // A place on the graph's own motion, or on a sweep over all of the area.
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
        // The middle of a stretch is farthest from its ends.
        for part in [2, 4, 8, 16] {
            let Some(at) = found.get(found.len() / part) else { continue };
            let here = around(*at);
            if sounds(&mut Rig::new(subject, here.clone(), &[])?)? {
                return Ok(here);
            }
        }
    }
    not_applicable("no motion of the case made a network of this graph sound for long")
}

/// Whether a frame came in this tick.
fn came(rig: &Rig, networks: &[usize]) -> bool {
    let frame = |(i, o)| matches!(rig.engine.output(i, o), Some(Buffer::Magnitude { frame: Some(_), .. }));
    networks.iter().any(|&i| (0..rig.schedule.nodes[i].outputs.len()).any(|o| frame((i, o))))
}

/// Whether frames come and something sounds in each tenth of a second from the sixth to the tenth.
fn sounds(rig: &mut Rig) -> Result<bool, Stop> {
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
