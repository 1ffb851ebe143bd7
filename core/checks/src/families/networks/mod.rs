//! A texture network that goes wrong: what it puts out is nothing that a model should, or what it is given
//! is nothing that it was trained on.
//!
//! Every case but the last runs the subject's graph twice over the same motion, as it is and with the
//! trouble, and holds the two against each other. What goes wrong lasts a frame, a window (0.1 s), or for
//! ever; a second after the first two the drive has its level back. That is a margin over what was
//! measured: the window, what the actuator's inverse remembers (0.2 s from its largest input), and the
//! limiter's gain, which comes back with a time constant of 0.2 s: within 0.5 dB 0.7 s after a window of
//! 1e30.

mod beside;
mod pulses;

use std::sync::Arc;

use asperity_node::{Buffer, FactValue, NodeKind, Setup, Shape, Unit};

use crate::case::{Case, Family, Found, Not, holds, not_applicable};
use crate::rig::Rig;
use crate::subject::{Effort, Subject};
use crate::wrap;
use beside::{Beside, Wrong, motion, networks, spoiled, windows};

pub(super) const CASES: &[Case] = &[
    Case {
        family: Family::Networks,
        name: "network_not_finite",
        hard: "the network's magnitudes are NaN or infinite: in single frames, for six frames, for ever",
        must: "the drive is finite and within the limiter's bounds in every sample, only the network fails, what does not hear it goes on to the bit, and 1 s after \
               up to seven bad frames the level is back within 1 dB; from the eighth on it is silent",
        of_graph: true,
        run: not_finite,
    },
    Case {
        family: Family::Networks,
        name: "network_huge",
        hard: "the network's magnitudes are 1e30: in one bin, in all, in a single frame, for a window, for ever; and the largest number for a window",
        must: "the drive is finite and within the limiter's bounds in every sample, no node fails, what does not hear it goes on to the bit, and 1 s after it \
               the level is back within 1 dB",
        of_graph: true,
        run: huge,
    },
    Case {
        family: Family::Networks,
        name: "network_negative",
        hard: "the network's magnitudes are negative: every second, all, in a single frame, for a window, for ever",
        must: "all that holds of `network_huge`; a magnitude below 0 is none",
        of_graph: true,
        run: negative,
    },
    Case {
        family: Family::Networks,
        name: "network_denormal",
        hard: "the network's magnitudes are denormal, 1e-40: in a single frame, for a window, for ever",
        must: "no output of any other node ever holds a denormal number, so that none costs time; and all that holds of `network_huge`",
        of_graph: true,
        run: denormal,
    },
    Case {
        family: Family::Networks,
        name: "network_alternates",
        hard: "the network's magnitudes are 0 and 100 m/s^2 in all bins by turns, frame by frame, for a window and for ever",
        must: "all that holds of `network_huge`",
        of_graph: true,
        run: alternates,
    },
    Case {
        family: Family::Networks,
        name: "network_out_of_range",
        hard: "the network is told of forces and speeds 10 times as large as it was trained on, for half a second and for ever",
        must: "its magnitudes stay finite and below 10 times the largest of the same stroke in range; and all that holds of `network_huge`",
        of_graph: true,
        run: out_of_range,
    },
    Case {
        family: Family::Networks,
        name: "network_steady",
        hard: "speed and force do not change, over several materials: the network's magnitudes stand still",
        must: "no texture pulses: the envelope's autocorrelation from 20 to 200 ms is at most 0.25 above that of Gaussian noise of the same spectrum, and its \
               modulation from 15 to 25 Hz at most 2.5 times as deep; of a material that repeats with place it is at most 0.25 above it at any lag that is the \
               same at 60, 82 and 131 mm/s",
        of_graph: true,
        run: pulses::pulses,
    },
];

/// Kinds, and numbers of nodes.
type Culprits = (Vec<Arc<dyn NodeKind>>, Vec<usize>);

/// All kinds that put out magnitudes in the subject's graph, with the nodes that are of them.
fn culprits(subject: &Subject<'_>) -> Result<Culprits, Not> {
    let schedule = subject.compiled(subject.its_graph()?, &[])?.schedule;
    let nodes = networks(&schedule);
    let mut names: Vec<&str> = nodes.iter().map(|&i| schedule.nodes[i].kind.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let kinds = names.into_iter().map(|name| subject.kind(name)).collect::<Result<_, _>>()?;
    Ok((kinds, nodes))
}

/// Runs troubles one behind the other.
fn spoil(subject: &Subject<'_>, wrongs: &[Wrong]) -> Result<(Beside, String), Not> {
    let motion = motion(subject)?;
    let troubles: Vec<_> = wrongs.iter().map(|w| (w.what, w.seconds)).collect();
    let (windows, ticks) = windows(&troubles, subject.its_graph()?.tick_hz);
    let (kinds, nodes) = culprits(subject)?;
    let others = kinds.into_iter().map(|kind| spoiled(kind, wrongs, &windows)).collect();
    let mut both = Beside::new(subject, &motion, others, nodes)?;
    let off = both.run(&windows, ticks)?;
    let worst = off.iter().map(|(_, db)| db.abs()).fold(0.0, f64::max);
    let found = format!(
        "{} troubles; the drive peaks at {:.3}; 1 s later the level is off by {worst:.2} dB at most; {} nodes hear nothing of it",
        wrongs.len(),
        both.largest(),
        both.untouched()
    );
    Ok((both, found))
}

/// Those of some troubles that there is time for: all, or the first and the endless ones.
fn chosen(subject: &Subject<'_>, all: Vec<Wrong>) -> Vec<Wrong> {
    let quick = subject.allowed() == Effort::Quick;
    let wanted = |(i, w): &(usize, Wrong)| !quick || *i == 0 || w.seconds.is_infinite();
    all.into_iter().enumerate().filter(wanted).map(|(_, w)| w).collect()
}

/// One bin of a frame, in the middle of the band where most textures have something.
fn one(bins: &mut [f32], value: f32) {
    let middle = bins.len() / 5;
    if let Some(bin) = bins.get_mut(middle) {
        *bin = value;
    }
}

fn not_finite(subject: &Subject<'_>) -> Found {
    // The engine calls a node no more after eight faults, of which one is forgiven every 10 s: seven in
    // all, then endless ones.
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
    holds(both.denormals() == 0, || {
        format!("{} denormal numbers in the outputs of other nodes", both.denormals())
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

/// How many times as large as trained what the network is told is.
const TIMES: f64 = 10.0;

/// Controls of forces or speeds that a network hears: node and output, and by how much they are to be
/// multiplied.
type Told = Vec<(String, usize, f64)>;

fn out_of_range(subject: &Subject<'_>) -> Found {
    let motion = motion(subject)?;
    let mut rig = Rig::new(subject, motion.clone(), &[])?;
    let told = told(&mut rig)?;
    let seconds = [("out of range for half a second", 0.5), ("out of range for ever", f64::INFINITY)];
    let (windows, ticks) = windows(&seconds, rig.schedule.tick_hz);
    // What is told is multiplied in the nodes that tell it.
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
    let [within, out] = both.magnitudes();
    holds(out <= TIMES * within, || format!("a magnitude of {out:.3e} out of range, {within:.3e} within"))?;
    let worst = off.iter().map(|(_, db)| db.abs()).fold(0.0, f64::max);
    let times = told.iter().map(|t| t.2).fold(0.0, f64::max);
    Ok(format!(
        "inputs {times:.0} times as large: magnitudes up to {out:.3}, {within:.3} in range; the drive peaks at {:.3}; 1 s later the level is off by {worst:.2} dB",
        both.largest()
    ))
}

/// What a network is told: by how much it is to be multiplied so that it is ten times what the network says
/// that it was trained on, or ten times what there is where it does not say.
fn told(rig: &mut Rig) -> Result<Told, Not> {
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

/// A kind whose nodes of these names put out controls that are larger, for some ticks.
fn multiplied(inner: Arc<dyn NodeKind>, told: &Told, at: &[std::ops::Range<u64>]) -> Arc<dyn NodeKind> {
    let (told, at) = (told.clone(), at.to_vec());
    let make = move |setup: &Setup<'_>| -> wrap::Process {
        let of_this = told.iter().filter(|t| t.0 == setup.id);
        let mut mine: Vec<(usize, f64, Vec<f64>)> =
            of_this.map(|(_, o, times)| (*o, *times, Vec::new())).collect();
        let at = at.clone();
        Box::new(move |node, tick| {
            // A node may build on what it put out before.
            for (output, _, before) in &mut mine {
                let values = tick.outputs.control(*output);
                if before.len() == values.len() {
                    values.copy_from_slice(before);
                }
            }
            let status = node.process(tick)?;
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
    wrap::wrap(inner, Arc::new(make))
}
