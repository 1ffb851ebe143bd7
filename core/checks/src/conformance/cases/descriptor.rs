//! What the kind says of itself.

use super::{Found, Not, main};
use crate::conformance::signal::Signal;
use crate::conformance::subject::Subject;

pub(super) fn descriptor(subject: &Subject<'_>) -> Found {
    let d = subject.kind.descriptor();
    d.check().map_err(|e| Not::Failed(e.message))?;
    if !d.sink && d.outputs.is_empty() {
        return Err(Not::Failed("it has no outputs and is no sink, so no graph would build it".into()));
    }
    Ok(format!("{} inputs, {} outputs, {} parameters", d.inputs.len(), d.outputs.len(), d.params.len()))
}

pub(super) fn prepare(subject: &Subject<'_>) -> Found {
    subject.main().map_err(Not::Failed)?;
    let place = main(subject)?;
    // Twice, and both dropped: what is made can be freed.
    for _ in 0..2 {
        place.stand(subject, Signal::Random, false)?.processor.facts();
    }
    let stand = place.stand(subject, Signal::Random, false)?;
    let (latency, tail) = (stand.processor.latency().ms(), stand.processor.tail().ms());
    Ok(format!("{}; latency {latency:.3} ms, tail {tail:.1} ms", place.conditions))
}
