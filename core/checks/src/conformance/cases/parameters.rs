//! Live parameters.

use asperity_node::{Param, ParamKind};

use super::input::somewhere;
use super::memory::same;
use super::{Found, Not, main, not_applicable};
use crate::conformance::signal::Signal;
use crate::conformance::stand::{Stand, contained, described};
use crate::conformance::subject::Subject;

const TICKS: u64 = 150;

/// A value as it stands in a graph file.
fn written(p: &Param, value: f64) -> String {
    match &p.kind {
        ParamKind::Integer(_) => format!("{}", value as i64),
        ParamKind::Flag => (value != 0.0).to_string(),
        ParamKind::Choice(words) => format!("{:?}", words.get(value as usize).map_or("", |w| w.as_ref())),
        _ => format!("{value:?}"),
    }
}

fn set(stand: &mut Stand<'_>, p: &Param, index: usize, value: f64) -> Result<(), Not> {
    let processor = &mut stand.processor;
    contained(|| processor.set_parameter(index, value))
        .map_err(|f| Not::Failed(format!("set to {}, `{}` {}", written(p, value), p.name, described(f))))
}

pub(super) fn live(subject: &Subject<'_>) -> Found {
    main(subject)?;
    let params = &subject.kind.descriptor().params;
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
            if let Some(wrong) = stand.run(50..TICKS).wrong {
                return Err(Not::Failed(format!("{wrong} with {} = {}", p.name, written(p, value))));
            }
            // After a reset it is as if it had been prepared with that value.
            let other = subject.with(&p.name, written(p, value));
            let Ok(mut fresh) = other.stand(Signal::Random) else { continue };
            stand.reset()?;
            let when = format!("{} = {} and reset, against prepared so", p.name, written(p, value));
            same(subject, &fresh.run(0..TICKS).trace, &stand.run(0..TICKS).trace, &when)?;
        }
    }
    // All at once, at one end and the other, every other tick.
    let mut stand = subject.stand(Signal::Random)?;
    for tick in 0..TICKS {
        for (i, p) in &all {
            if let Some(value) = somewhere(p, (tick % 2) as f64) {
                set(&mut stand, p, *i, value)?;
            }
        }
        if let Some(wrong) = stand.run(tick..tick + 1).wrong {
            return Err(Not::Failed(format!("{wrong} with all parameters at the ends of their ranges")));
        }
    }
    Ok(format!("{} parameters", all.len()))
}
