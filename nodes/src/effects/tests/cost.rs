//! Time of a tick of each node.

use std::time::Instant;

use asperity_engine::{Clock, Engine};
use asperity_node::{ShapeSpec, Unit, UnitSpec};

use super::bench::{Bench, Script};

struct Wall(Instant);

impl Clock for Wall {
    fn now_ns(&self) -> u64 {
        self.0.elapsed().as_nanos() as u64
    }
}

/// Median time of a node in a tick, in microseconds, and the number of its calls.
fn median(engine: &mut Engine, node: &str, ticks: u64) -> (f64, u64) {
    let clock = Wall(Instant::now());
    let it = engine.schedule().index_of(node).unwrap();
    let mut all = Vec::new();
    for _ in 0..ticks {
        let mut spent = vec![0; engine.schedule().nodes.len()];
        engine.tick_timed(&clock, &mut spent);
        all.push(spent[it]);
    }
    all.sort_unstable();
    (all[all.len() / 2] as f64 * 1e-3, engine.report(it).unwrap().calls)
}

#[test]
#[ignore = "prints what a tick of 96 samples takes, in contact and out of it, with one slot and with a \
            thousand; medians of 4000"]
fn cost() {
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/models/made_ar/rough.ron");
    let texts = [
        ("friction", "laws", "lugre".to_owned()),
        ("viscosity", "drags", "(viscosity_ns_per_m: 2)".to_owned()),
        ("magnet", "magnets", "(stiffness_n_per_mm: 0.2, max_force_n: 0.5, reach_mm: 40)".to_owned()),
        (
            "tap",
            "taps",
            "(sinusoids: [(frequency_hz: 200, decay_ms: 30, gain: 30), (frequency_hz: 310, decay_ms: 20, \
             gain: 30), (frequency_hz: 90, decay_ms: 40, gain: 9)])"
                .to_owned(),
        ),
        ("vibration", "sources", "(frequency_hz: 120, amplitude_m_s2: 2)".to_owned()),
        ("autoregressive", "models", format!("autoregressive(model: {model:?})")),
        ("waveform", "loops", "waveform(segments: [(0, 0), (0.3, 1), (1, 0)])".to_owned()),
        ("relief", "reliefs", "relief(heights: made(surface: \"hessian\", side: 64))".to_owned()),
        ("force_limiter", "", String::new()),
    ];
    for (kind, param, text) in texts {
        for (slots, touched) in [(1, 0.0), (1000, 777.0), (1, -1.0), (1000, -1.0)] {
            let inputs = crate::registry().get(kind).unwrap().descriptor().inputs.clone();
            let controls: Vec<(String, usize, Unit)> = inputs
                .iter()
                .filter_map(|i| match (i.shape, &i.unit) {
                    (ShapeSpec::Control(n), UnitSpec::Is(unit)) => {
                        Some((i.name.to_string(), n, unit.clone()))
                    }
                    _ => None,
                })
                .collect();
            let names: Vec<(&'static str, usize, Unit)> =
                controls.iter().map(|(name, n, unit)| (&*name.clone().leak(), *n, unit.clone())).collect();
            let play = names.clone();
            let script = Script::new(&names, move |tick| {
                let t = tick as f64 * 0.002;
                let value = |name: &str, i: usize| match name {
                    "slot" => touched,
                    "speed" => 120.0 + 50.0 * (3.0 * t).sin(),
                    "approach" => {
                        if tick.is_multiple_of(16) {
                            100.0
                        } else {
                            0.0
                        }
                    }
                    "place" => 20.0 * (5.0 * t + i as f64).sin(),
                    "level" => 0.5 + 0.4 * (7.0 * t).sin(),
                    "stroke" | "moment" => 0.5,
                    _ => (11.0 * t + i as f64).sin(),
                };
                play.iter().map(|(name, n, _)| (0..*n).map(|i| value(name, i)).collect()).collect()
            });
            let list = format!("{:?}", vec![text.as_str(); slots]);
            let settings: &[(&str, &str)] = if param.is_empty() { &[] } else { &[(param, &list)] };
            let mut engine = Bench::new(500, 48_000, kind, settings, script).engine("it", true).unwrap();
            let (us, calls) = median(&mut engine, "it", 4000);
            println!("{kind:15} {slots:5} slots, slot {touched:4}: {us:.2} us, {calls} calls");
        }
    }
    for (level, what) in [(1.0, "open"), (0.0, "closed")] {
        let outputs = [("slot", 1, Unit::NONE), ("level", 1, Unit::NONE)];
        let script = Script::new(&outputs, move |tick| {
            vec![vec![0.0], vec![level * (0.5 + 0.4 * (tick as f64).sin())]]
        });
        let sources = "[\"(frequency_hz: 120, amplitude_m_s2: 2)\"]";
        let bench = Bench::new(500, 48_000, "vibration", &[("sources", sources)], script).behind_level();
        let (us, calls) = median(&mut bench.engine("level", true).unwrap(), "level", 4000);
        println!("level {what}: {us:.2} us, {calls} calls");
    }
}
