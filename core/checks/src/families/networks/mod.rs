//! A texture network that goes wrong: its output is nonsense, or its input is unlike its training.
//!
//! Every case but the last runs the subject's graph twice over the same motion, as it is and with the
//! trouble, and compares the two. A fault lasts a frame, a window (0.1 s), or to the end. A second after the
//! first two the drive has its level back. That leaves a margin over the measured times: the window, the
//! memory of the actuator's inverse (0.2 s from its largest input), and the gain of the limiter, which comes
//! back with a time constant of 0.2 s. After a window of 1e30 the level was within 0.5 dB after 0.7 s.

mod pulses;

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use asperity_graph::Schedule;
use asperity_node::{Buffer, NodeKind, PortType, Shape, Unit};

use crate::buffers::{denormals, same};
use crate::case::{Case, Family, Found, Stop, not_applicable};
use crate::played::Motion;
use crate::rig::{Rig, number, values};
use crate::subject::{Effort, Subject};
use crate::wrap::{misled, wrap};

const NETWORKS: Family = Family("networks");

pub(super) const CASES: &[Case] = &[
    NETWORKS.graph(
        "network_not_finite",
        not_finite,
        "the network's magnitudes are NaN or infinite: in single frames, for six frames, to the end",
        "in every sample the drive is finite and within the bounds of the limiter. Only the network fails, \
         and nodes that do not depend on it go on to the bit. Up to seven bad frames: 1 s later the level \
         is back within 1 dB. From the eighth on it is silent",
    ),
    NETWORKS.graph(
        "network_huge",
        huge,
        "the network's magnitudes are 1e30: in one bin, in all, in a single frame, for a window, to the \
         end. Or they are the largest number for a window",
        "in every sample the drive is finite and within the bounds of the limiter. No node fails, and \
         nodes that do not depend on the network go on to the bit. 1 s later the level is back within 1 dB",
    ),
    NETWORKS.graph(
        "network_negative",
        negative,
        "the network's magnitudes are negative: every second, all, in a single frame, for a window, to \
         the end",
        "all that holds of `network_huge`. A negative magnitude counts as 0",
    ),
    NETWORKS.graph(
        "network_denormal",
        denormal,
        "the network's magnitudes are denormal, 1e-40: in a single frame, for a window, to the end",
        "no output of any other node ever holds a denormal number, which would cost time; and all that \
         holds of `network_huge`",
    ),
    NETWORKS.graph(
        "network_alternates",
        alternates,
        "the network's magnitudes alternate between 0 and 100 m/s^2 in all bins, frame by frame, for a \
         window and to the end",
        "all that holds of `network_huge`",
    ),
    NETWORKS.graph(
        "network_out_of_range",
        out_of_range,
        "the network gets forces and speeds 10 times as large as in training, for half a second and to \
         the end",
        "its magnitudes stay finite and below 10 times the largest of the same stroke in range; and all \
         that holds of `network_huge`",
    ),
    NETWORKS.graph(
        "network_steady",
        pulses::pulses,
        "speed and force are constant, over several materials: the network's magnitudes do not change",
        "no texture pulses. It is compared with Gaussian noise of the same spectrum. Its envelope's \
         autocorrelation from 20 to 200 ms is at most 0.25 higher. Its modulation from 15 to 25 Hz is at \
         most 2.5 times as deep. For a material that repeats over place, only lags count that are the \
         same at 60, 82 and 131 mm/s",
    ),
];

/// Changes the bins of a frame, by the number of changed frames so far.
type Spoil = fn(u64, &mut [f32]);

/// A trouble of the networks.
#[derive(Clone)]
struct Wrong {
    /// Its name in texts.
    what: &'static str,
    /// Its duration \[s\], after which the level has to come back. Endless trouble runs for a second.
    seconds: f64,
    /// Largest number of frames.
    frames: u64,
    /// The change of magnitudes.
    spoil: Spoil,
    /// Its ticks, and those in which the level after it is measured.
    ticks: Range<u64>,
    level: Range<u64>,
}

/// A trouble of so many frames at most.
fn wrong(what: &'static str, seconds: f64, frames: u64, spoil: Spoil) -> Wrong {
    Wrong { what, seconds, frames, spoil, ticks: 0..0, level: 0..0 }
}

/// One wrong frame.
fn once(what: &'static str, spoil: Spoil) -> Wrong {
    wrong(what, 0.02, 1, spoil)
}

/// A tenth of a second: a window.
fn burst(what: &'static str, spoil: Spoil) -> Wrong {
    wrong(what, 0.1, u64::MAX, spoil)
}

fn for_ever(what: &'static str, spoil: Spoil) -> Wrong {
    wrong(what, f64::INFINITY, u64::MAX, spoil)
}

/// Time before the first trouble, and after a trouble until the level is back \[s\].
const SETTLE_S: f64 = 1.0;
const RECOVERY_S: f64 = 1.0;
/// Time over which a level is measured \[s\].
const LEVEL_S: f64 = 1.0;
/// Allowed difference from the level without trouble \[dB\].
const LEVEL_DB: f64 = 1.0;

/// Sets the ticks of troubles, one after the other. Answers the number of all ticks.
fn timed(wrongs: &mut [Wrong], tick_hz: u32) -> u64 {
    let ticks = |seconds: f64| (seconds * f64::from(tick_hz)).round() as u64;
    wrongs.iter_mut().fold(ticks(SETTLE_S), |start, wrong| {
        if wrong.seconds.is_infinite() {
            wrong.ticks = start..u64::MAX;
            return start + ticks(1.0);
        }
        let end = start + ticks(wrong.seconds);
        let back = end + ticks(RECOVERY_S);
        (wrong.ticks, wrong.level) = (start..end, back..back + ticks(LEVEL_S));
        wrong.level.end
    })
}

/// Runs troubles one after the other.
fn spoil(subject: &Subject<'_>, mut wrongs: Vec<Wrong>) -> Result<(Beside, String), Stop> {
    let ticks = timed(&mut wrongs, subject.its_graph()?.tick_hz);
    let plan: Arc<[Wrong]> = wrongs.into();
    let other = {
        let plan = plan.clone();
        move |kind| spoiled(kind, plan.clone())
    };
    let mut both = Beside::new(subject, &motion(subject)?, other)?;
    let worst = both.run(&plan, ticks)?;
    let found = format!(
        "{} troubles; the drive peaks at {:.3}; 1 s later the level is off by {worst:.2} dB at most; {} \
         nodes do not depend on it",
        plan.len(),
        both.largest,
        both.touched.iter().filter(|touched| !**touched).count()
    );
    Ok((both, found))
}

/// A kind whose frames of magnitudes go wrong.
fn spoiled(inner: Arc<NodeKind>, plan: Arc<[Wrong]>) -> Arc<NodeKind> {
    wrap(inner, move |_| {
        let plan = plan.clone();
        let mut came = vec![0; plan.len()];
        Box::new(move |node, tick| {
            let status = node.run(tick)?;
            for (wrong, came) in plan.iter().zip(&mut came) {
                if !wrong.ticks.contains(&tick.index) || *came >= wrong.frames {
                    continue;
                }
                for buffer in tick.outputs.buffers() {
                    if let Buffer::Magnitude { bins, frame: Some(_), .. } = buffer {
                        (wrong.spoil)(*came, bins);
                        *came += 1;
                    }
                }
            }
            Ok(status)
        })
    })
}

/// All troubles, or with effort `quick` the first and the endless ones.
fn chosen(subject: &Subject<'_>, mut all: Vec<Wrong>) -> Vec<Wrong> {
    let first = all.first().map(|w| w.what);
    let quick = subject.effort == Effort::Quick;
    all.retain(|w| !quick || Some(w.what) == first || w.seconds.is_infinite());
    all
}

/// Sets one bin of a frame, in the middle of the band of most textures.
fn one(bins: &mut [f32], value: f32) {
    let middle = bins.len() / 5;
    bins.iter_mut().skip(middle).take(1).for_each(|bin| *bin = value);
}

fn not_finite(subject: &Subject<'_>) -> Found {
    // The engine quarantines a node after eight faults, and forgives one every 10 s: so seven here, then
    // endless ones.
    let six = |n: u64, bins: &mut [f32]| match n % 3 {
        0 => bins.fill(f32::NAN),
        1 => bins.fill(f32::INFINITY),
        _ => one(bins, f32::NEG_INFINITY),
    };
    let wrongs = vec![
        Wrong { frames: 6, ..burst("six frames that are not finite", six) },
        once("one NaN", |_, bins| one(bins, f32::NAN)),
        for_ever("NaN to the end", |_, bins| bins.fill(f32::NAN)),
    ];
    Ok(spoil(subject, wrongs)?.1)
}

fn huge(subject: &Subject<'_>) -> Found {
    let all: Spoil = |_, bins| bins.fill(1e30);
    let wrongs = vec![
        burst("1e30 in all bins for a window", all),
        once("one frame of 1e30 in all bins", all),
        once("one bin of 1e30", |_, bins| one(bins, 1e30)),
        burst("1e30 in one bin for a window", |_, bins| one(bins, 1e30)),
        burst("1e30 in every tenth frame", |n, bins| {
            if n.is_multiple_of(10) {
                bins.fill(1e30);
            }
        }),
        burst("the largest number in all bins for a window", |_, bins| bins.fill(f32::MAX)),
        for_ever("1e30 to the end", all),
    ];
    Ok(spoil(subject, chosen(subject, wrongs))?.1)
}

fn negative(subject: &Subject<'_>) -> Found {
    let turned: Spoil = |_, bins| bins.iter_mut().for_each(|m| *m = -*m);
    let wrongs = vec![
        burst("negative magnitudes for a window", turned),
        once("one frame of negative magnitudes", turned),
        burst("every second magnitude negative", |_, bins| bins.iter_mut().step_by(2).for_each(|m| *m = -*m)),
        burst("-1e30 in all bins for a window", |_, bins| bins.fill(-1e30)),
        for_ever("negative magnitudes to the end", |_, bins| bins.fill(-1.0)),
    ];
    Ok(spoil(subject, chosen(subject, wrongs))?.1)
}

fn denormal(subject: &Subject<'_>) -> Found {
    let all: Spoil = |_, bins| bins.fill(1e-40);
    let wrongs = vec![
        burst("denormal magnitudes for a window", all),
        once("one frame of denormal magnitudes", all),
        burst("denormal and 0 alternately", |n, bins| bins.fill(1e-40 * (n % 2) as f32)),
        for_ever("denormal magnitudes to the end", all),
    ];
    let (both, found) = spoil(subject, chosen(subject, wrongs))?;
    ensure!(both.denormals == 0, "{} denormal numbers in the outputs of other nodes", both.denormals);
    Ok(format!("no denormal number; {found}"))
}

fn alternates(subject: &Subject<'_>) -> Found {
    let by_turns: Spoil = |n, bins| bins.fill(if n.is_multiple_of(2) { 100.0 } else { 0.0 });
    let ever = for_ever("0 and most alternately, to the end", by_turns);
    Ok(spoil(subject, vec![burst("0 and most alternately", by_turns), ever])?.1)
}

/// Factor of the inputs beyond those of training.
const TIMES: f64 = 10.0;

fn out_of_range(subject: &Subject<'_>) -> Found {
    let motion = motion(subject)?;
    let factors: Arc<[Factor]> = factors(&mut Rig::new(subject, motion.clone(), &[])?)?.into();
    let nothing: Spoil = |_, _| {};
    let mut wrongs = [
        wrong("out of range for half a second", 0.5, u64::MAX, nothing),
        for_ever("out of range to the end", nothing),
    ];
    let ticks = timed(&mut wrongs, subject.its_graph()?.tick_hz);
    let (told, at) = (factors.clone(), wrongs.clone().map(|wrong| wrong.ticks));
    let other = move |kind| {
        let (told, at) = (told.clone(), at.clone());
        misled(kind, move |setup| {
            let mine: Vec<Factor> = told.iter().filter(|it| it.node == setup.id).cloned().collect();
            let at = at.clone();
            Box::new(move |tick, inputs| {
                for it in mine.iter().filter(|_| at.iter().any(|ticks| ticks.contains(&tick))) {
                    if let Some(Buffer::Control { values, .. }) = inputs.get_mut(it.input) {
                        values.iter_mut().for_each(|x| *x *= it.times);
                    }
                }
            })
        })
    };
    let mut both = Beside::new(subject, &motion, other)?;
    let worst = both.run(&wrongs, ticks)?;
    let [within, out] = both.magnitudes;
    ensure!(out <= TIMES * within, "a magnitude of {out:.3e} out of range, {within:.3e} within");
    let times = factors.iter().map(|it| it.times).fold(0.0, f64::max);
    Ok(format!(
        "inputs {times:.0} times as large: magnitudes up to {out:.3}, {within:.3} in range; the drive \
         peaks at {:.3}; 1 s later the level is off by {worst:.2} dB",
        both.largest
    ))
}

/// The factor of an input of a network.
#[derive(Clone)]
struct Factor {
    node: String,
    input: usize,
    times: f64,
}

/// Factors of forces and speeds that make them ten times the largest values of training, or ten times as
/// large where a network does not state those.
fn factors(rig: &mut Rig) -> Result<Vec<Factor>, Stop> {
    let schedule = rig.schedule.clone();
    let mut told: Vec<(usize, usize, Option<f64>, f64)> = Vec::new();
    for i in networks(&schedule) {
        let node = &schedule.nodes[i];
        for (input, it) in node.inputs.iter().enumerate().filter(|(_, it)| it.from.is_some()) {
            let Some(PortType { shape: Shape::Control { .. }, unit, .. }) = &it.port else { continue };
            let facts = [(Unit::NEWTON, "trained_force"), (Unit::MILLIMETRE_PER_SECOND, "trained_speed")];
            let fact = facts.iter().find(|(of, _)| of == unit);
            told.extend(fact.map(|(_, fact)| (i, input, number(&node.facts, fact), 0.0)));
        }
    }
    if told.is_empty() {
        return not_applicable("nothing tells a network of this graph of a force or a speed");
    }
    rig.run(rig.ticks(0.5), |rig, _| {
        for (node, input, _, most) in &mut told {
            let values = values(rig.engine.input(*node, *input));
            *most = values.iter().fold(*most, |m, x| m.max(x.abs()));
        }
        Ok(())
    })?;
    let factor = |(node, input, trained, most): (usize, usize, Option<f64>, f64)| {
        let times = trained.filter(|_| most > 0.0).map_or(TIMES, |trained| TIMES * trained / most);
        Factor { node: schedule.nodes[node].id.clone(), input, times: times.max(TIMES) }
    };
    Ok(told.into_iter().map(factor).collect())
}

/// Two runs of a graph over the same motion side by side: as it is, and with networks that go wrong.
struct Beside {
    plain: Rig,
    wrong: Rig,
    /// The networks.
    culprits: Vec<usize>,
    /// Networks, and nodes that depend on them.
    touched: Vec<bool>,
    limits: Vec<Option<[f64; 2]>>,
    last: Vec<f64>,
    /// Largest sample of the drive with the trouble.
    largest: f64,
    /// Largest magnitude of a frame, plain and wrong; infinite for one that is not finite.
    magnitudes: [f64; 2],
    /// Denormal numbers in outputs of other nodes than networks.
    denormals: u64,
}

impl Beside {
    /// The subject's graph under `motion` as it is, and with `other` kinds of networks.
    fn new(
        subject: &Subject<'_>,
        motion: &Motion,
        other: impl Fn(Arc<NodeKind>) -> Arc<NodeKind>,
    ) -> Result<Self, Stop> {
        let plain = Rig::new(subject, motion.clone(), &[])?;
        let culprits = networks(&plain.schedule);
        let kinds: BTreeSet<&str> = culprits.iter().map(|&i| plain.schedule.nodes[i].kind.as_str()).collect();
        let mut mutant = subject.clone();
        for kind in kinds {
            mutant = mutant.with(other(subject.kind(kind)?));
        }
        let wrong = Rig::new(&mutant, motion.clone(), &[])?;
        let touched = downstream(&plain.schedule, &culprits);
        let limits = wrong.drive_limits();
        let last = vec![0.0; limits.len()];
        let (largest, magnitudes, denormals) = (0.0, [0.0; 2], 0);
        Ok(Self { plain, wrong, culprits, touched, limits, last, largest, magnitudes, denormals })
    }

    /// Runs both. Answers the largest difference of the level after a trouble \[dB\].
    fn run(&mut self, wrongs: &[Wrong], ticks: u64) -> Result<f64, Stop> {
        let mut sums = vec![[0.0; 2]; wrongs.len()];
        for tick in 0..ticks {
            self.plain.engine.tick();
            self.wrong.engine.tick();
            let now = wrongs.iter().rfind(|w| tick >= w.ticks.start).map_or("before", |w| w.what);
            let now = format!("{now}, tick {tick}");
            self.look_at_drive(&now)?;
            self.look_at_others(&now)?;
            if let Some(i) = wrongs.iter().position(|w| w.level.contains(&tick)) {
                sums[i][0] += energy(&self.plain);
                sums[i][1] += energy(&self.wrong);
            }
        }
        for (i, node) in self.wrong.schedule.nodes.iter().enumerate() {
            let [plain, wrong] = [&self.plain, &self.wrong].map(|rig| rig.engine.report(i));
            let faults = wrong.map_or(0, |r| r.faults);
            let how = wrong.and_then(|r| r.last_fault).map_or_else(String::new, |f| format!(": it {f}"));
            let same = faults == plain.map_or(0, |r| r.faults);
            ensure!(self.culprits.contains(&i) || same, "node `{}` fails {faults} times{how}", node.id);
        }
        let mut worst = 0.0_f64;
        for (wrong, [before, after]) in wrongs.iter().zip(sums).filter(|(w, _)| !w.level.is_empty()) {
            let db: f64 = 10.0 * f64::log10(after / before);
            let what = wrong.what;
            ensure!(db.abs() <= LEVEL_DB, "{what}: the level is {db:+.1} dB off {RECOVERY_S} s after it");
            worst = worst.max(db.abs());
        }
        Ok(worst)
    }

    /// Checks that every sample of the drive is finite and within the bounds of its limiter.
    fn look_at_drive(&mut self, now: &str) -> Result<(), Stop> {
        for ((samples, limits), last) in self.wrong.drive().zip(&self.limits).zip(&mut self.last) {
            for &x in samples {
                let x = f64::from(x);
                ensure!(x.is_finite(), "{now}: the drive is not finite");
                if let Some([peak, most]) = *limits {
                    let step = (x - *last).abs();
                    // The bounded sample is f32: half a unit in its last place on either side.
                    let room = 1e-6 * peak;
                    ensure!(
                        x.abs() <= peak + room,
                        "{now}: the drive is {x:.4}, the limiter's bound {peak:.4}"
                    );
                    ensure!(step <= most + room, "{now}: a step of {step:.5}, the limiter's bound {most:.5}");
                }
                self.largest = self.largest.max(x.abs());
                *last = x;
            }
        }
        Ok(())
    }

    /// Checks that independent nodes go on to the bit, and that the drive is as valid as before.
    fn look_at_others(&mut self, now: &str) -> Result<(), Stop> {
        for (i, output) in self.plain.outputs() {
            let (a, b) = (self.plain.engine.output(i, output), self.wrong.engine.output(i, output));
            let (Some(a), Some(b)) = (a, b) else { continue };
            let id = &self.plain.schedule.nodes[i].id;
            ensure!(self.touched[i] || same(a, b), "{now}: node `{id}`, which hears nothing of it, changes");
            for (most, buffer) in self.magnitudes.iter_mut().zip([a, b]) {
                *most = most.max(loudest(buffer));
            }
            if !self.culprits.contains(&i) {
                self.denormals += denormals(b);
            }
        }
        let valid = self.wrong.trusted() || !self.plain.trusted();
        ensure!(valid, "{now}: the drive is no longer valid, and fades as a whole");
        Ok(())
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
    // As often as there are nodes, since a cycle leads backwards.
    for _ in 0..touched.len() {
        for (i, node) in schedule.nodes.iter().enumerate() {
            touched[i] |= node.inputs.iter().any(|input| input.from.is_some_and(|(node, _)| touched[node]));
        }
    }
    touched
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
