//! What it remembers, and forgets.

use asperity_node::Resume;

use super::{Found, Not, main, not_applicable};
use crate::conformance::signal::Signal;
use crate::conformance::subject::Subject;
use crate::conformance::trace::Trace;

/// Ticks that are compared.
const TICKS: u64 = 200;

/// Fails where two runs differ.
pub(super) fn same(subject: &Subject<'_>, a: &Trace, b: &Trace, when: &str) -> Result<(), Not> {
    match a.first_difference(b, |o| subject.output_name(o)) {
        Some(what) => Err(Not::Failed(format!("{when}: {what}"))),
        None => Ok(()),
    }
}

pub(super) fn reset(subject: &Subject<'_>) -> Found {
    main(subject)?;
    let fresh = subject.stand(Signal::Scattered)?.run(0..TICKS).trace;
    let mut stand = subject.stand(Signal::Scattered)?;
    for (before, ticks) in [
        (Signal::Scattered, TICKS),
        (Signal::Random, 37),
        (Signal::Huge, 150),
        (Signal::Bad, 50),
        (Signal::Zero, 1),
    ] {
        subject.doing(&format!("after {ticks} ticks of {} input", before.word()));
        stand.play(before);
        // A frame late, so that a counter that is not set back shows.
        stand.run(1..ticks + 1);
        stand.reset()?;
        stand.play(Signal::Scattered);
        let again = stand.run(0..TICKS).trace;
        same(subject, &fresh, &again, &format!("reset after {ticks} ticks of {} input", before.word()))?;
        stand.reset()?;
    }
    Ok(format!("{TICKS} ticks after each of 5 runs"))
}

pub(super) fn determinism(subject: &Subject<'_>) -> Found {
    main(subject)?;
    let alone = subject.stand(Signal::Scattered)?.run(0..TICKS).trace;
    let second = subject.stand(Signal::Scattered)?.run(0..TICKS).trace;
    same(subject, &alone, &second, "a second instance")?;
    let (mut one, mut other) = (subject.stand(Signal::Scattered)?, subject.stand(Signal::Random)?);
    let (mut beside, mut noise) = (Trace::new(one.outputs.len(), 0), Trace::new(other.outputs.len(), 0));
    for tick in 0..TICKS {
        // What goes wrong is seen by other cases.
        let _ = other.tick(tick, &mut noise);
        let _ = one.tick(tick, &mut beside);
    }
    same(subject, &alone, &beside, "with another instance in between")?;
    // A second process can compare this.
    Ok(format!("{TICKS} ticks, {:016x}", alone.digest()))
}

pub(super) fn sleep(subject: &Subject<'_>) -> Found {
    main(subject)?;
    let (asleep, awake, end) = (60, 180, 300);
    let resume = subject.kind.descriptor().resume;
    let elapsed = match resume {
        Resume::Restart => return not_applicable("it is reset when it wakes"),
        Resume::Never => return not_applicable("it never sleeps"),
        Resume::Resume => false,
        Resume::Elapsed => true,
    };
    let (mut whole, mut slept) = (subject.stand(Signal::Random)?, subject.stand(Signal::Random)?);
    whole.run(0..asleep);
    whole.muted = elapsed;
    whole.run(asleep..awake);
    whole.muted = false;
    slept.run(0..asleep);
    if elapsed {
        slept.processor.elapsed(awake - asleep).map_err(|f| format!("elapsed {f}"))?;
    }
    let (a, b) = (whole.run(awake..end).trace, slept.run(awake..end).trace);
    same(subject, &a, &b, &format!("after {} ticks asleep", awake - asleep))?;
    Ok(format!("{} ticks asleep", awake - asleep))
}

pub(super) fn cycle(subject: &Subject<'_>) -> Found {
    let place = main(subject)?;
    if subject.kind.descriptor().feedback.is_none() {
        return not_applicable("it closes no cycles");
    }
    let mut stand = place.stand(subject, Signal::Scattered, true)?;
    let first = stand.run(0..TICKS);
    if let Some(wrong) = first.wrong {
        return Err(Not::Failed(wrong));
    }
    stand.reset()?;
    same(subject, &first.trace, &stand.run(0..TICKS).trace, "reset in a cycle")?;
    Ok(format!("{TICKS} ticks"))
}
