//! Inputs, rates, layouts and wires of every kind.

use asperity_node::{
    Buffer, FactValue, Fault, LayoutSpec, Param, ParamKind, RateSpec, Shape, ShapeSpec, random,
};

use super::main;
use super::signal::Signal;
use super::stand::{Conditions, Place, Stand, Trace, UNWRITTEN, USUAL, described};
use crate::buffers::words;
use crate::case::{Found, Stop, not_applicable};
use crate::subject::Subject;

/// Ticks of a run on one signal.
const TICKS: u64 = 300;
/// Time that a node has to recover from inputs that are not finite \[s\].
const RECOVERY_S: u64 = 1;

/// A place with the longest frames, and hops of 88 and 89 samples.
const LONG: Conditions =
    Conditions { audio_hz: 44_100, source_hz: 44_100, frames: (44_100, 4410, 2206), ..USUAL };

/// The main place, and the one with long frames where the kind takes it.
fn places(subject: &Subject<'_>) -> Result<Vec<Place>, Stop> {
    let mut all = vec![main(subject)?.clone()];
    all.extend(Place::settle(subject, &LONG));
    Ok(all)
}

pub(super) fn on(subject: &Subject<'_>, signal: Signal) -> Found {
    for place in &places(subject)? {
        let told = format!("{}, {} input", place.conditions, signal.word());
        subject.doing(&told);
        if let Some(wrong) = place.stand(subject, signal, false)?.run(0..TICKS).wrong {
            bail!("{wrong} ({told})");
        }
    }
    Ok(format!("{TICKS} ticks"))
}

/// Plays noise, then values that are not finite, then noise. Answers the ticks from their end to the last
/// wrong output, with or without the resets of the engine.
fn recovery(stand: &mut Stand<'_>, hz: u64, resets: bool) -> Result<u64, Stop> {
    let (bad, good, end) = (100, 200, 200 + hz * RECOVERY_S + 100);
    let mut last = good;
    for tick in 0..end {
        stand.play(if (bad..good).contains(&tick) { Signal::Bad } else { Signal::Random });
        let answer = stand.run_tick(tick);
        let wrong = answer.is_err() || stand.not_finite().is_some();
        if answer == Err(Fault::Panicked) {
            bail!("panicked at tick {tick}");
        }
        if wrong && tick < bad {
            return Err(Stop::NotApplicable("it fails on noise already".into()));
        }
        if wrong && tick >= good {
            last = tick + 1;
        }
        let stays = matches!(answer, Err(Fault::Failed(_)));
        if wrong && resets && !stays {
            stand.ask("reset", |it| it.reset())?;
        }
    }
    Ok(last - good)
}

pub(super) fn not_finite(subject: &Subject<'_>) -> Found {
    let place = main(subject)?;
    if !place.node.inputs.iter().any(|i| i.from.is_some()) {
        return not_applicable("it has no inputs");
    }
    let hz = u64::from(place.conditions.tick_hz);
    subject.doing("without a reset");
    let alone = recovery(&mut place.stand(subject, Signal::Random, false)?, hz, false)?;
    if alone <= hz * RECOVERY_S {
        return Ok(format!("well again after {alone} ticks"));
    }
    subject.doing("with the resets of the engine");
    let helped = recovery(&mut place.stand(subject, Signal::Random, false)?, hz, true)?;
    if helped <= hz * RECOVERY_S {
        return Ok(format!("well again after {helped} ticks, by the reset that the engine does"));
    }
    bail!(
        "still not finite, or failing, {RECOVERY_S} s after the input was finite again, and a reset does not \
         help"
    )
}

pub(super) fn missing_frames(subject: &Subject<'_>) -> Found {
    let place = main(subject)?;
    let mut shapes = place.node.inputs.iter().filter_map(|i| Some(i.port.as_ref()?.shape));
    if !shapes.any(|shape| matches!(shape, Shape::Magnitude(_) | Shape::Spectrum(_))) {
        return not_applicable("it takes no frames");
    }
    let mut stand = place.stand(subject, Signal::Random, false)?;
    let mut trace = Trace::default();
    for tick in 0..800 {
        stand.muted = match tick {
            0..100 | 200..400 => true,
            500.. => random::uniform(7, tick) < 0.5,
            _ => false,
        };
        stand.tick(tick, &mut trace)?;
    }
    Ok("gaps of 1 to 200 ticks, also at the start".into())
}

pub(super) fn outputs(subject: &Subject<'_>) -> Found {
    let places = places(subject)?;
    for place in &places {
        subject.doing(&place.conditions.to_string());
        let mut stand = place.stand(subject, Signal::Scattered, false)?;
        for tick in 0..TICKS {
            stand.set_up(tick);
            stand.mark();
            let before = stand.inputs.clone();
            let answer = stand.call(tick);
            if let Some(wrong) = untouched(&stand, &before, place.node.gate).or_else(|| whole(&stand)) {
                bail!("{wrong} at tick {tick} ({})", place.conditions);
            }
            stand.conclude(answer);
        }
        if let Some(n) = unsaid(&mut stand) {
            bail!("wrote samples without saying so, so that they count as silence, in {n} of {TICKS} ticks");
        }
    }
    match places[0].node.outputs.is_empty() {
        true => Ok("it has no outputs; inputs untouched".into()),
        false => Ok(format!("{TICKS} ticks")),
    }
}

/// Ticks in which the loader found samples that the node did not report.
fn unsaid(stand: &mut Stand<'_>) -> Option<u64> {
    stand.node.processor.facts().iter().find(|f| f.name == "unsaid_writes").and_then(|f| match f.value {
        FactValue::Count(n) if n > 0 => Some(n),
        _ => None,
    })
}

/// The first input that the node changed. A gate may close the input that it gates.
fn untouched(stand: &Stand<'_>, before: &[Buffer], gate: Option<usize>) -> Option<String> {
    let mut pairs = before.iter().zip(&stand.inputs).enumerate().filter(|(i, _)| gate != Some(*i));
    pairs.find(|(_, (was, is))| words(was).ne(words(is))).map(|(i, _)| format!("wrote to input {i}"))
}

/// The first output that is not written whole, or without a report.
fn whole(stand: &Stand<'_>) -> Option<String> {
    let unwritten = |x: &f32| x.to_bits() == UNWRITTEN;
    let frame = |bins: &mut dyn Iterator<Item = f32>, there: bool| {
        let (mut all, mut left) = (0, 0);
        for x in bins {
            all += 1;
            left += usize::from(unwritten(&x));
        }
        match there {
            true if left > 0 => Some(format!("left {left} of {all} values of a frame unwritten")),
            false if left < all => Some("wrote a frame without saying so".to_owned()),
            _ => None,
        }
    };
    stand.outputs.iter().enumerate().find_map(|(o, buffer)| {
        let wrong = match buffer {
            Buffer::Control { .. } => None,
            Buffer::Audio { samples, len, .. } => samples[*len..]
                .iter()
                .any(|x| *x != 0.0)
                .then(|| format!("wrote past the {len} samples of the tick")),
            Buffer::Magnitude { bins, frame: f, .. } => frame(&mut bins.iter().copied(), f.is_some()),
            Buffer::Spectrum { bins, frame: f, .. } => {
                frame(&mut bins.iter().flat_map(|z| [z.re, z.im]), f.is_some())
            }
        }?;
        Some(format!("`{}`: {wrong}", stand.output_name(o)))
    })
}

/// A value of a live parameter, from the lower end (0) to the upper end (1) of its range.
pub(super) fn somewhere(p: &Param, at: f64) -> Option<f64> {
    let most = |x: f64| x.clamp(-1e15, 1e15);
    match &p.kind {
        _ if !p.live => None,
        ParamKind::Number(r) => Some(most(*r.start()) * (1.0 - at) + most(*r.end()) * at),
        ParamKind::Integer(r) => {
            Some((most(*r.start() as f64) * (1.0 - at) + most(*r.end() as f64) * at).round())
        }
        ParamKind::Flag => Some(at.round()),
        ParamKind::Choice(words) => Some((at * (words.len().max(1) - 1) as f64).round()),
        _ => None,
    }
}

pub(super) fn random_ticks(subject: &Subject<'_>) -> Found {
    let places = places(subject)?;
    let params = &places[0].kind.descriptor().params;
    // A tenth of them with long frames, which take long.
    for (place, ticks) in places.iter().zip([subject.ticks * 9 / 10, subject.ticks / 10]) {
        subject.doing(&place.conditions.to_string());
        let mut stand = place.stand(subject, Signal::Scattered, false)?;
        for tick in 0..ticks {
            let draw = |what: u64| random::uniform(11 + what, tick);
            if draw(0) < 2e-4 {
                stand.ask(&format!("at tick {tick}, reset"), |it| it.reset())?;
            }
            if draw(1) < 0.02 && !params.is_empty() {
                let i = (draw(2) * params.len() as f64) as usize;
                if let Some(value) = somewhere(&params[i], draw(3)) {
                    let told = format!("at tick {tick}, set_parameter");
                    stand.ask(&told, |it| it.set_parameter(i, value))?;
                }
            }
            let answer = stand.run_tick(tick);
            let here = || format!("at tick {tick} ({})", place.conditions);
            if let Err(fault) = answer {
                bail!("{} {}", described(fault), here());
            }
            ensure!(stand.not_finite().is_none(), "output a value that is not finite {}", here());
        }
    }
    Ok(format!("{} ticks", subject.ticks))
}

/// Ticks in each place of other rates, layouts and wires.
const PLACE_TICKS: u64 = 120;

/// Runs in every place that takes the kind.
fn run_in(subject: &Subject<'_>, places: &[Conditions]) -> Found {
    let (mut ran, mut refused) = (0, Vec::new());
    for conditions in places {
        subject.doing(&conditions.to_string());
        match Place::settle(subject, conditions) {
            Err(why) => refused.push(format!("{conditions}: {why}")),
            Ok(place) => {
                ran += 1;
                let ticks = PLACE_TICKS * u64::from(conditions.every);
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
    run_in(subject, &places)
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
    run_in(subject, &places)
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
    run_in(subject, &places)
}
