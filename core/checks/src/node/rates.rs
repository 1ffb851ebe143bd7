//! Rates, layouts and wires of every kind.

use asperity_node::{LayoutSpec, RateSpec, Shape, ShapeSpec};

use super::main;
use super::signal::Signal;
use super::stand::{Conditions, Place, USUAL};
use crate::case::{Found, not_applicable};
use crate::subject::Subject;

/// Ticks in each place.
const TICKS: u64 = 120;

/// Runs in every place that takes the kind.
fn run(subject: &Subject<'_>, places: &[Conditions]) -> Found {
    let (mut ran, mut refused) = (0, Vec::new());
    for conditions in places {
        subject.doing(&conditions.to_string());
        match Place::settle(subject, conditions) {
            Err(why) => refused.push(format!("{conditions}: {why}")),
            Ok(place) => {
                ran += 1;
                let ticks = TICKS * u64::from(conditions.every);
                let run = place.stand(subject, Signal::Random, false)?.run(0..ticks);
                ensure!(run.wrong.is_none(), "{} ({conditions})", run.wrong.unwrap_or_default());
            }
        }
    }
    match (ran, refused.first()) {
        (0, Some(why)) => bail!("refused everywhere; {why}"),
        (_, Some(why)) => Ok(format!("{ran} settings; refused in {}: {why}", refused.len())),
        (_, None) => Ok(format!("{ran} settings")),
    }
}

pub(super) fn rates(subject: &Subject<'_>) -> Found {
    let main = main(subject)?;
    let first = main.conditions;
    let usual =
        [100, 333, 500, 1000, 4000].map(|hz| [8000, 44_100, 48_000, 192_000].map(|audio| (hz, audio)));
    let odd = [250, 700, 2500].map(|hz| [22_050, 96_000].map(|audio| (hz, audio)));
    let rates = usual.into_iter().flatten().chain(odd.into_iter().flatten());
    let sources = [8000, 2500, 44_100, 500, 16_000].into_iter().cycle();
    let place = |((tick_hz, audio_hz), source_hz)| Conditions { tick_hz, audio_hz, source_hz, ..first };
    let mut places: Vec<Conditions> = rates.zip(sources).map(place).collect();
    let node = &main.node;
    let inputs = node.inputs.iter().filter_map(|i| i.port.as_ref());
    let mut ports = inputs.chain(node.outputs.iter().map(|o| &o.port));
    let audio = ports.any(|p| matches!(p.shape, Shape::Audio { .. }));
    let like = main.kind.descriptor().inputs.iter().any(|i| matches!(i.shape, ShapeSpec::Like(_)));
    if like && audio {
        let control = Conditions { like: ShapeSpec::Control(2), ..first };
        places.extend([100, 333, 1000, 4000].map(|tick_hz| Conditions { tick_hz, ..control }));
    }
    // Audio runs in every tick.
    if !audio {
        places.extend([2, 3, 10].map(|every| Conditions { tick_hz: 1000, every, ..first }));
    }
    run(subject, &places)
}

pub(super) fn layouts(subject: &Subject<'_>) -> Found {
    let any = |s: &ShapeSpec| {
        matches!(s, ShapeSpec::Magnitude(LayoutSpec::Of(_)) | ShapeSpec::Spectrum(LayoutSpec::Of(_)))
    };
    if !main(subject)?.kind.descriptor().inputs.iter().any(|i| any(&i.shape)) {
        return not_applicable("no input takes any layout");
    }
    let frames = [
        (500, 50, 26),
        (500, 50, 20),
        (2500, 250, 126),
        (2500, 250, 101),
        (44_100, 4410, 2206),
        (44_100, 4410, 1000),
        (48_000, 4800, 2401),
        (48_000, 4800, 481),
    ];
    let mut places = Vec::new();
    for frames in frames {
        let at = Conditions { frames, ..USUAL };
        places.extend([500, 333, 1000].map(|tick_hz| Conditions { tick_hz, ..at }));
        if frames.0 == 44_100 {
            places.push(Conditions { audio_hz: 44_100, ..at });
        }
    }
    run(subject, &places)
}

pub(super) fn unconnected(subject: &Subject<'_>) -> Found {
    let main = main(subject)?;
    let inputs = &main.kind.descriptor().inputs;
    let optional: Vec<usize> =
        (0..main.node.inputs.len().min(64)).filter(|&i| inputs.get(i).is_some_and(|p| p.optional)).collect();
    if optional.is_empty() {
        return not_applicable("no input is optional");
    }
    let all = optional.iter().fold(0, |bits, i| bits | 1 << i);
    let mut places: Vec<Conditions> =
        optional.iter().map(|i| Conditions { without: 1 << i, ..main.conditions }).collect();
    places.push(Conditions { without: all, ..main.conditions });
    // Without any wire, only the graph's rate is known.
    places.push(Conditions {
        without: all,
        source_hz: 48_000,
        like: ShapeSpec::Audio(RateSpec::Graph),
        ..main.conditions
    });
    run(subject, &places)
}
