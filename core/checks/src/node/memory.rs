//! The memory of a node: reset, sleep, saved states, and parameters that change.

use asperity_node::{Param, ParamKind, Resume, random};

use super::input::somewhere;
use super::main;
use super::signal::Signal;
use super::stand::{Stand, Trace};
use crate::case::{Found, Stop, not_applicable};
use crate::subject::Subject;

/// Ticks that are compared.
const TICKS: u64 = 200;

/// Fails where two runs differ.
fn same(subject: &Subject<'_>, a: &Trace, b: &Trace, when: &str) -> Result<(), Stop> {
    let what = a.first_difference(b, |o| subject.output_name(o));
    what.map_or(Ok(()), |what| Err(Stop::Failed(format!("{when}: {what}"))))
}

pub(super) fn reset(subject: &Subject<'_>) -> Found {
    let fresh = subject.stand(Signal::Scattered)?.run(0..TICKS).trace;
    let mut stand = subject.stand(Signal::Scattered)?;
    use Signal::{Bad, Huge, Random, Scattered, Zero};
    for (before, ticks) in [(Scattered, TICKS), (Random, 37), (Huge, 150), (Bad, 50), (Zero, 1)] {
        let when = format!("after {ticks} ticks of {} input", before.word());
        subject.doing(&when);
        stand.play(before);
        // A frame late, so that a counter that the reset leaves alone shows.
        stand.run(1..ticks + 1);
        stand.reset()?;
        stand.play(Signal::Scattered);
        let again = stand.run(0..TICKS).trace;
        same(subject, &fresh, &again, &format!("reset {when}"))?;
        stand.reset()?;
    }
    Ok(format!("{TICKS} ticks after each of 5 runs"))
}

pub(super) fn determinism(subject: &Subject<'_>) -> Found {
    let alone = subject.stand(Signal::Scattered)?.run(0..TICKS).trace;
    let second = subject.stand(Signal::Scattered)?.run(0..TICKS).trace;
    same(subject, &alone, &second, "a second instance")?;
    let (mut one, mut other) = (subject.stand(Signal::Scattered)?, subject.stand(Signal::Random)?);
    let (mut beside, mut noise) = (Trace::default(), Trace::default());
    for tick in 0..TICKS {
        // Other cases find faults.
        let _ = other.tick(tick, &mut noise);
        let _ = one.tick(tick, &mut beside);
    }
    same(subject, &alone, &beside, "with another instance in between")?;
    // A second process can compare this.
    Ok(format!("{TICKS} ticks, {:016x}", alone.digest()))
}

pub(super) fn sleep(subject: &Subject<'_>) -> Found {
    let (asleep, awake, end) = (60, 180, 300);
    let resume = main(subject)?.kind.descriptor().resume;
    let elapsed = match resume {
        Resume::Restart => return not_applicable("it is reset when it wakes"),
        Resume::Never => return not_applicable("it never sleeps"),
        Resume::Continue => false,
        Resume::Elapsed => true,
    };
    let (mut whole, mut slept) = (subject.stand(Signal::Random)?, subject.stand(Signal::Random)?);
    whole.run(0..asleep);
    whole.muted = elapsed;
    whole.run(asleep..awake);
    whole.muted = false;
    slept.run(0..asleep);
    if elapsed {
        slept.ask("elapsed", |it| it.elapsed(awake - asleep))?;
    }
    let (a, b) = (whole.run(awake..end).trace, slept.run(awake..end).trace);
    same(subject, &a, &b, &format!("after {} ticks asleep", awake - asleep))?;
    Ok(format!("{} ticks asleep", awake - asleep))
}

pub(super) fn cycle(subject: &Subject<'_>) -> Found {
    let place = main(subject)?;
    if place.kind.descriptor().feedback.is_none() {
        return not_applicable("it closes no cycles");
    }
    let mut stand = place.stand(subject, Signal::Scattered, true)?;
    let first = stand.run(0..TICKS);
    if let Some(wrong) = first.wrong {
        bail!("{wrong}");
    }
    stand.reset()?;
    same(subject, &first.trace, &stand.run(0..TICKS).trace, "reset in a cycle")?;
    Ok(format!("{TICKS} ticks"))
}

/// Compares the engine, which lets the node sleep, with calls in every tick.
pub(super) fn engine(subject: &Subject<'_>) -> Found {
    const TICKS: u64 = 600;
    let place = main(subject)?;
    let direct = place.stand(subject, Signal::Scattered, false)?.run(0..TICKS);
    let (mut engine, at) = place.engine(subject, Signal::Scattered)?;
    let mut trace = Trace::default();
    for tick in 0..TICKS {
        engine.tick();
        trace.push(None, (0..place.node.outputs.len()).filter_map(|o| engine.output(at, o)));
        if tick.is_multiple_of(32) {
            subject.alive();
        }
    }
    if let Some(report) = engine.report(at)
        && let Some(fault) = report.last_fault
    {
        bail!("{fault} ({} faults in {TICKS} ticks)", report.faults);
    }
    if let Some(what) = direct.trace.first_difference(&trace, |o| subject.output_name(o)) {
        bail!(
            "the engine lets it sleep when it says it may, and then {what} from its outputs when it is called"
        );
    }
    let slept = engine.report(at).map_or(0, |r| r.slept);
    Ok(format!("{TICKS} ticks, {slept} of them asleep"))
}

/// Ticks that are compared after a state was restored or a parameter changed.
const AFTER: u64 = 150;
/// Bytes behind the memory into which a state is saved.
const GUARD: [u8; 16] = [0xa5; 16];

/// Saves the state of an instance.
fn save(stand: &mut Stand<'_>, size: usize) -> Result<Vec<u8>, Stop> {
    let now = stand.node.processor.state_size();
    ensure!(now == size, "state_size answers {size} at first and {now} later");
    let saved = save_into(stand, size)?;
    saved.ok_or_else(|| Stop::Failed(format!("save fails with the {size} bytes it asks for")))
}

/// Saves the state of an instance into so many bytes, if it can.
fn save_into(stand: &mut Stand<'_>, size: usize) -> Result<Option<Vec<u8>>, Stop> {
    let mut bytes = [vec![0; size], GUARD.to_vec()].concat();
    let saved = stand.node.processor.save(&mut bytes[..size]);
    ensure!(bytes[size..] == GUARD, "save wrote past the memory it was given");
    Ok(saved.map(|len| bytes[..len].to_vec()))
}

pub(super) fn state(subject: &Subject<'_>) -> Found {
    let size = subject.stand(Signal::Scattered)?.node.processor.state_size();
    if size == 0 {
        return not_applicable("it hands over no state");
    }
    for at in [0, 1, 64, 133] {
        subject.doing(&format!("saved after {at} ticks"));
        let mut undisturbed = subject.stand(Signal::Scattered)?;
        undisturbed.run(0..at);
        let expected = undisturbed.run(at..at + AFTER).trace;
        let mut old = subject.stand(Signal::Scattered)?;
        old.run(0..at);
        let bytes = save(&mut old, size)?;
        let buffers = (old.inputs.clone(), old.outputs.clone());
        ensure!(save(&mut old, size)? == bytes, "saved twice after {at} ticks, it is not the same");
        for small in [0, size / 2, size - 1].into_iter().filter(|n| *n < bytes.len()) {
            let saved = save_into(&mut old, small)?;
            ensure!(saved.is_none(), "saved {} bytes into {small}", bytes.len());
        }
        let goes_on = old.run(at..at + AFTER).trace;
        same(subject, &expected, &goes_on, &format!("goes on after a save at tick {at}"))?;
        for used in [false, true] {
            let mut new = subject.stand(Signal::Scattered)?;
            if used {
                new.play(Signal::Random);
                new.run(0..71);
                new.play(Signal::Scattered);
            }
            ensure!(new.node.processor.restore(&bytes), "refuses its own state of tick {at}");
            let which = if used { "a used" } else { "a fresh" };
            let when = format!("restored at tick {at} into {which} instance");
            // The engine owns the buffers, and keeps them when it swaps a node.
            (new.inputs, new.outputs) = buffers.clone();
            same(subject, &expected, &new.run(at..at + AFTER).trace, &when)?;
        }
    }
    Ok(format!("{size} bytes"))
}

/// Bytes that are no state: of other lengths, random, all equal, with flipped bits, or with wild numbers.
fn garbage(state: &[u8]) -> Vec<Vec<u8>> {
    let mut out = vec![vec![0], vec![0xff; 64]];
    if state.is_empty() {
        return out;
    }
    out.push(Vec::new());
    out.extend([0, 1, 0x7f, 0x80, 0xff].map(|byte| vec![byte; state.len()]));
    let lengths = [1, 4, 7, 8, 16, state.len() / 2, state.len() - 1];
    out.extend(lengths.into_iter().filter(|n| *n < state.len()).map(|n| state[..n].to_vec()));
    out.extend([1, 8, 4096].map(|longer| [state, &vec![0x55; longer]].concat()));
    for n in 0..40 {
        let noise = |i: usize| random::bits(n, i as u64) as u8;
        out.push((0..state.len()).map(noise).collect());
        let mut flipped = state.to_vec();
        for k in 0..3 {
            if let Some(byte) = flipped.get_mut(random::bits(100 + n, k) as usize % state.len()) {
                *byte ^= 1 << (random::bits(200 + n, k) % 8);
            }
        }
        out.push(flipped);
    }
    // Numbers and places stand in front of or behind long lists.
    let last = state.len().saturating_sub(8);
    for at in (0..=last).filter(|at| at % 4 == 0 && (*at < 48 || last - at < 48)) {
        for wild in [f64::NAN.to_le_bytes(), 1e300_f64.to_le_bytes(), u64::MAX.to_le_bytes()] {
            let mut bytes = state.to_vec();
            let part = bytes.iter_mut().skip(at).zip(wild);
            part.for_each(|(byte, wild)| *byte = wild);
            out.push(bytes);
        }
    }
    out
}

pub(super) fn garbage_state(subject: &Subject<'_>) -> Found {
    let mut stand = subject.stand(Signal::Scattered)?;
    let size = stand.node.processor.state_size();
    let mut state = Vec::new();
    if size > 0 {
        stand.run(0..100);
        state = save(&mut stand, size)?;
    }
    let fresh = subject.stand(Signal::Scattered)?.run(0..50).trace;
    let (mut refused, mut taken) = (0, 0);
    for (n, bytes) in garbage(&state).iter().enumerate() {
        subject.doing(&format!("{} bytes, the {n}th", bytes.len()));
        let mut stand = subject.stand(Signal::Scattered)?;
        if stand.node.processor.restore(bytes) {
            taken += 1;
            // The engine resets a node that then gives a NaN or panics.
            stand.run(0..50);
        } else {
            refused += 1;
        }
        stand.reset()?;
        let again = stand.run(0..50).trace;
        same(subject, &fresh, &again, &format!("reset after {} bytes of garbage", bytes.len()))?;
    }
    Ok(format!("{refused} refused, {taken} taken"))
}

/// A value as text of a graph file.
fn written(p: &Param, value: f64) -> String {
    match &p.kind {
        ParamKind::Integer(_) => format!("{}", value as i64),
        ParamKind::Flag => (value != 0.0).to_string(),
        ParamKind::Choice(words) => format!("{:?}", words.get(value as usize).map_or("", |w| w.as_ref())),
        _ => format!("{value:?}"),
    }
}

fn set(stand: &mut Stand<'_>, p: &Param, index: usize, value: f64) -> Result<(), Stop> {
    let told = format!("set to {}, `{}`", written(p, value), p.name);
    Ok(stand.ask(&told, |it| it.set_parameter(index, value))?)
}

pub(super) fn live_parameters(subject: &Subject<'_>) -> Found {
    let params = &main(subject)?.kind.descriptor().params;
    let all: Vec<(usize, &Param)> = params.iter().enumerate().filter(|(_, p)| p.live).collect();
    if all.is_empty() {
        return not_applicable("no parameter is live");
    }
    for (i, p) in &all {
        for at in [0.0, 1.0, 0.5] {
            let Some(value) = somewhere(p, at) else { continue };
            subject.doing(&format!("{} = {}", p.name, written(p, value)));
            let mut stand = subject.stand(Signal::Random)?;
            stand.run(0..50);
            set(&mut stand, p, *i, value)?;
            if let Some(wrong) = stand.run(50..AFTER).wrong {
                bail!("{wrong} with {} = {}", p.name, written(p, value));
            }
            // After a reset it equals an instance that was prepared with that value.
            let other = subject.clone().set(&*p.name, written(p, value));
            let Ok(mut fresh) = other.stand(Signal::Random) else { continue };
            stand.reset()?;
            let when = format!("{} = {} and reset, against prepared so", p.name, written(p, value));
            same(subject, &fresh.run(0..AFTER).trace, &stand.run(0..AFTER).trace, &when)?;
        }
    }
    // All at once, at one end and the other, every other tick.
    let mut stand = subject.stand(Signal::Random)?;
    for tick in 0..AFTER {
        for (i, p) in &all {
            if let Some(value) = somewhere(p, (tick % 2) as f64) {
                set(&mut stand, p, *i, value)?;
            }
        }
        if let Some(wrong) = stand.run(tick..tick + 1).wrong {
            bail!("{wrong} with all parameters at the ends of their ranges");
        }
    }
    Ok(format!("{} parameters", all.len()))
}
