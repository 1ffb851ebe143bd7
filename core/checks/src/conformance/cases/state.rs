//! Saved states, and what is none.

use asperity_node::random;

use super::{Found, Not, main, not_applicable};
use crate::conformance::cases::memory::same;
use crate::conformance::signal::Signal;
use crate::conformance::stand::Stand;
use crate::conformance::subject::Subject;

/// Ticks that are compared after a state was taken over.
const TICKS: u64 = 150;
/// What stands behind the memory that a state is saved to.
const GUARD: [u8; 16] = [0xa5; 16];

/// The state of an instance.
fn save(stand: &mut Stand<'_>, size: usize) -> Result<Vec<u8>, Not> {
    let now = stand.processor.state_size();
    if now != size {
        return Err(Not::Failed(format!("state_size answers {size} at first and {now} later")));
    }
    let mut bytes = vec![0; size];
    bytes.extend(GUARD);
    let saved = stand.processor.save(&mut bytes[..size]);
    if bytes[size..] != GUARD {
        return Err(Not::Failed("save wrote past the memory it was given".into()));
    }
    let len = saved.ok_or_else(|| Not::Failed(format!("save fails with the {size} bytes it asks for")))?;
    bytes.truncate(len);
    Ok(bytes)
}

pub(super) fn state(subject: &Subject<'_>) -> Found {
    main(subject)?;
    let size = subject.stand(Signal::Scattered)?.processor.state_size();
    if size == 0 {
        return not_applicable("it hands over no state");
    }
    for at in [0, 1, 64, 133] {
        subject.doing(&format!("saved after {at} ticks"));
        let mut undisturbed = subject.stand(Signal::Scattered)?;
        undisturbed.run(0..at);
        let expected = undisturbed.run(at..at + TICKS).trace;
        let mut old = subject.stand(Signal::Scattered)?;
        old.run(0..at);
        let bytes = save(&mut old, size)?;
        let buffers = (old.inputs.clone(), old.outputs.clone());
        if save(&mut old, size)? != bytes {
            return Err(Not::Failed(format!("saved twice after {at} ticks, it is not the same")));
        }
        for small in [0, size / 2, size - 1].into_iter().filter(|n| *n < bytes.len()) {
            let mut room = vec![0; small];
            room.extend(GUARD);
            let saved = old.processor.save(&mut room[..small]);
            if saved.is_some() || room[small..] != GUARD {
                return Err(Not::Failed(format!("saved {} bytes into {small}", bytes.len())));
            }
        }
        same(
            subject,
            &expected,
            &old.run(at..at + TICKS).trace,
            &format!("goes on after a save at tick {at}"),
        )?;
        for used in [false, true] {
            let mut new = subject.stand(Signal::Scattered)?;
            if used {
                new.play(Signal::Random);
                new.run(0..71);
                new.play(Signal::Scattered);
            }
            if !new.processor.restore(&bytes) {
                return Err(Not::Failed(format!("refuses its own state of tick {at}")));
            }
            let which = if used { "a used" } else { "a fresh" };
            let when = format!("restored at tick {at} into {which} instance");
            // Buffers are the engine's, and stay when it swaps a node.
            (new.inputs, new.outputs) = buffers.clone();
            same(subject, &expected, &new.run(at..at + TICKS).trace, &when)?;
        }
    }
    Ok(format!("{size} bytes"))
}

/// Bytes that are no state: of other lengths, random, all alike, or a state with a few bits flipped.
fn garbage(state: &[u8]) -> Vec<Vec<u8>> {
    let mut out = vec![vec![0], vec![0xff; 64]];
    if state.is_empty() {
        return out;
    }
    out.push(Vec::new());
    for byte in [0, 1, 0x7f, 0x80, 0xff] {
        out.push(vec![byte; state.len()]);
    }
    let lengths = [1, 4, 7, 8, 16, state.len() / 2, state.len().saturating_sub(1)];
    out.extend(lengths.into_iter().filter(|n| *n < state.len()).map(|n| state[..n].to_vec()));
    for longer in [1, 8, 4096] {
        out.push(state.iter().copied().chain(vec![0x55; longer]).collect());
    }
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
    out
}

pub(super) fn garbage_state(subject: &Subject<'_>) -> Found {
    main(subject)?;
    let mut stand = subject.stand(Signal::Scattered)?;
    let size = stand.processor.state_size();
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
        if stand.processor.restore(bytes) {
            taken += 1;
            // What it took may be anything; the engine resets what then puts out a NaN or panics.
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
