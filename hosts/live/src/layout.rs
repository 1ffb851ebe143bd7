//! A graph for a person: its layout, and its latency from the hand to the actuator.

use asperity_graph::{GraphFile, LiveParam, Schedule, ScheduledNode};
use asperity_node::{Latency, ParamKind, ParamValue, PortType, Role, Shape, Unit};

use crate::view::{Layout, LiveLayout, Materials, NodeLayout, Pointer, ScopeLayout};

/// Scope of the acceleration that the texture models ask for, before the limiters.
pub(crate) const ACCELERATION: &str = "acceleration";

/// Signal of a scope: node and output.
pub(crate) type Signal = (usize, usize);

/// Signals for scopes, with their names: speed and force of the hand, output of the texture model, drive of
/// the coil.
pub(crate) fn scopes(schedule: &Schedule) -> Vec<(Signal, ScopeLayout)> {
    let outputs = || {
        let of = |(i, n): (usize, &'_ ScheduledNode)| {
            n.outputs.iter().enumerate().map(move |(o, out)| ((i, o), out.port.clone())).collect::<Vec<_>>()
        };
        schedule.nodes.iter().enumerate().flat_map(of)
    };
    let scope = |(name, unit, audio): (&str, Unit, bool)| {
        let of_graph = Shape::Audio { rate_hz: schedule.audio_hz };
        let fits = |(_, port): &(Signal, PortType)| {
            let shape =
                if audio { port.shape == of_graph } else { matches!(port.shape, Shape::Control { .. }) };
            shape && port.unit == unit
        };
        // The last audio one in running order is nearest to the actuator.
        let (signal, _) = if audio { outputs().rfind(fits) } else { outputs().find(fits) }?;
        let rate_hz = if audio { schedule.audio_hz } else { schedule.tick_hz };
        Some((signal, ScopeLayout { name: name.into(), unit: unit.to_string(), rate_hz }))
    };
    let wanted = [
        ("speed", Unit::MILLIMETRE_PER_SECOND, false),
        ("force", Unit::NEWTON, false),
        (ACCELERATION, Unit::METRE_PER_SECOND_SQUARED, true),
        ("current", Unit::AMPERE, true),
        ("voltage", Unit::VOLT, true),
    ];
    wanted.into_iter().filter_map(scope).collect()
}

/// Layout of the running graph.
pub(crate) fn layout(
    number: u64,
    graph: &GraphFile,
    schedule: &Schedule,
    materials: Vec<Materials>,
) -> Layout {
    let ports = |name: &str, unit: &Unit| [name.to_owned(), unit.to_string()];
    let node = |n: &ScheduledNode| NodeLayout {
        id: n.id.clone(),
        kind: n.kind.clone(),
        inputs: n
            .inputs
            .iter()
            .map(|i| ports(&i.name, i.port.as_ref().map_or(&Unit::NONE, |p| &p.unit)))
            .collect(),
        outputs: n.outputs.iter().map(|o| ports(&o.name, &o.port.unit)).collect(),
        live: n.live.iter().filter_map(|l| live(l, n.params.get(&l.name)?)).collect(),
        sink: n.sink,
    };
    let wires = schedule.nodes.iter().enumerate().flat_map(|(to, n)| {
        let from = n.inputs.iter().enumerate().filter_map(move |(input, i)| Some((i.from?, input)));
        from.map(move |((node, output), input)| [node, output, to, input])
    });
    Layout {
        number,
        file: graph.source.path().display().to_string(),
        tick_hz: schedule.tick_hz,
        audio_hz: schedule.audio_hz,
        nodes: schedule.nodes.iter().map(node).collect(),
        wires: wires.collect(),
        scopes: scopes(schedule).into_iter().map(|(_, s)| s).collect(),
        materials,
        pointer: schedule.with_role(Role::Hand).find_map(|(_, n)| pointer(n)),
        peak_drive: None,
    }
}

/// The pointer of a page that a node is; `None` for another hand.
fn pointer(node: &ScheduledNode) -> Option<Pointer> {
    let number = |name| node.params.get_number(name);
    Some(Pointer {
        height_mm: number("height_mm")?,
        depth_mm: number("depth_mm")?,
        lift_mm: number("lift_mm")?,
        max_force_n: number("max_force_n")?,
    })
}

/// Live parameter with its value; `None` if it is no number.
fn live(param: &LiveParam, value: &ParamValue) -> Option<LiveLayout> {
    let (value, [least, most], words) = match (&param.kind, value) {
        (ParamKind::Number(r), ParamValue::Number(x)) => (*x, [*r.start(), *r.end()], vec![]),
        (ParamKind::Integer(r), ParamValue::Integer(i)) => {
            (*i as f64, [*r.start() as f64, *r.end() as f64], vec![])
        }
        (ParamKind::Flag, ParamValue::Flag(on)) => {
            (f64::from(u8::from(*on)), [0.0, 1.0], vec!["off".into(), "on".into()])
        }
        (ParamKind::Choice(words), ParamValue::Text(word)) => {
            let at = words.iter().position(|w| w == word)?;
            let words: Vec<String> = words.iter().map(|w| w.to_string()).collect();
            (at as f64, [0.0, words.len().saturating_sub(1) as f64], words)
        }
        _ => return None,
    };
    Some(LiveLayout {
        name: param.name.clone(),
        doc: param.doc.clone(),
        unit: param.unit.clone(),
        value,
        least,
        most,
        reach: if words.is_empty() { reach(value, [least, most]) } else { None },
        whole: !matches!(param.kind, ParamKind::Number(_)),
        words,
    })
}

/// Useful slider range of a value: up to about four times the value. `None` if the whole range is not much
/// wider, or is used by factors.
fn reach(value: f64, [least, most]: [f64; 2]) -> Option<[f64; 2]> {
    const FACTORS: f64 = 100.0;
    if least > 0.0 && most / least > FACTORS {
        return None;
    }
    let far = if value == 0.0 { (most - least) / 100.0 } else { 4.0 * value.abs() };
    let decade = 10f64.powf(far.log10().floor());
    let far = [1.0, 2.0, 5.0, 10.0].map(|x| x * decade).into_iter().find(|x| *x >= far * 0.999)?;
    let low = if value < 0.0 || (value == 0.0 && least < 0.0) { -far } else { 0.0 };
    let high = if value < 0.0 { 0.0 } else { far };
    let part = [low.max(least), high.min(most)];
    (most - least > 4.0 * (part[1] - part[0])).then_some(part)
}

/// Nodes that delay samples on the slowest path to an audio output, each with its milliseconds.
pub(crate) fn latency(schedule: &Schedule) -> Vec<(String, f64)> {
    if schedule.with_role(Role::AudioOutput).next().is_none() {
        return Vec::new();
    }
    let nodes = schedule.slowest().through.into_iter().map(|i| &schedule.nodes[i]);
    let late = nodes.filter(|node| node.latency > Latency::ZERO);
    late.map(|node| (format!("graph: `{}` ({})", node.id, node.kind), node.latency.ms())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(kind: ParamKind, value: &ParamValue) -> Option<LiveLayout> {
        live(&LiveParam { name: "p".into(), index: 3, kind, unit: "mm".into(), doc: String::new() }, value)
    }

    #[test]
    fn live_parameter_of_each_kind_becomes_a_number() {
        let all = |l: LiveLayout| (l.value, l.least, l.most, l.whole, l.words);
        let number = of(ParamKind::Number(0.5..=4.0), &ParamValue::Number(2.0)).map(all);
        assert_eq!(number, Some((2.0, 0.5, 4.0, false, vec![])));
        let integer = of(ParamKind::Integer(-2..=9), &ParamValue::Integer(7)).map(all);
        assert_eq!(integer, Some((7.0, -2.0, 9.0, true, vec![])));
        let flag = of(ParamKind::Flag, &ParamValue::Flag(true)).map(all);
        assert_eq!(flag, Some((1.0, 0.0, 1.0, true, vec!["off".into(), "on".into()])));
        let words = ParamKind::Choice(vec!["a".into(), "b".into(), "c".into()].into());
        let choice = of(words.clone(), &ParamValue::Text("c".into())).map(all);
        assert_eq!(choice, Some((2.0, 0.0, 2.0, true, vec!["a".into(), "b".into(), "c".into()])));
        assert_eq!(of(words, &ParamValue::Text("d".into())), None);
    }

    #[test]
    fn slider_range_follows_the_value() {
        for (value, range, is) in [
            (0.5, [-1e6, 1e6], Some([0.0, 2.0])),
            (-3.0, [-1e6, 1e6], Some([-20.0, 0.0])),
            (0.0, [-1000.0, 1000.0], Some([-20.0, 20.0])),
            (5.0, [0.0, 1000.0], Some([0.0, 20.0])),
            (0.02, [0.0, 100.0], Some([0.0, 0.1])),
            (5.0, [1.0, 100.0], Some([1.0, 20.0])),
            (0.9, [0.0, 0.99], None),
            (5.0, [0.5, 20.0], None),
            (200.0, [10.0, 5000.0], None),
        ] {
            assert_eq!(reach(value, range), is, "{value} of {range:?}");
        }
    }
}
