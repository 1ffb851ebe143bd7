//! In the engine itself.

use super::{Found, Not, main};
use crate::conformance::signal::Signal;
use crate::conformance::subject::Subject;
use crate::conformance::trace::Trace;

const TICKS: u64 = 600;

pub(super) fn engine(subject: &Subject<'_>) -> Found {
    let place = main(subject)?;
    let direct = place.stand(subject, Signal::Scattered, false)?.run(0..TICKS);
    let (mut engine, at) = place.engine(subject, Signal::Scattered)?;
    let mut trace = Trace::new(place.outputs.len(), 0);
    for tick in 0..TICKS {
        engine.tick();
        trace.push_outputs((0..place.outputs.len()).filter_map(|o| engine.output(at, o)));
        if tick.is_multiple_of(32) {
            subject.alive();
        }
    }
    if let Some(report) = engine.report(at)
        && let Some(fault) = report.last_fault
    {
        return Err(Not::Failed(format!("{fault} ({} faults in {TICKS} ticks)", report.faults)));
    }
    if let Some(what) = direct.trace.first_output_difference(&trace, |o| subject.output_name(o)) {
        return Err(Not::Failed(format!(
            "the engine lets it sleep when it says it may, and then {what} from what it puts out when called"
        )));
    }
    let slept = engine.report(at).map_or(0, |r| r.slept);
    Ok(format!("{TICKS} ticks, {slept} of them asleep"))
}
