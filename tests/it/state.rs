//! Every built-in node under a graph that changes: what it remembers goes over to another instance of it, and
//! its live parameters take any value at any time.

use std::sync::{Arc, Mutex};

use asperity_engine::{Engine, Options};
use asperity_graph::GraphFile;
use asperity_node::{Fault, NodeKind, Param, ParamKind, Processor, Status, Tick, random};
use harness::any_node::{SIGNALS, compiled, graph, run};

/// A node in an engine that the test holds too.
#[derive(Clone)]
struct Held(Arc<Mutex<Box<dyn Processor>>>);

impl Held {
    fn with<T>(&self, f: impl FnOnce(&mut dyn Processor) -> T) -> T {
        // A panic of the node is the engine's to report, at every call.
        f(self.0.lock().expect("a node that did not panic").as_mut())
    }

    fn replace(&self, processor: Box<dyn Processor>) {
        *self.0.lock().expect("a node that did not panic") = processor;
    }
}

impl Processor for Held {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.with(|p| p.process(tick))
    }
    fn reset(&mut self) {
        self.with(|p| p.reset());
    }
    fn inner(&mut self, call: &mut dyn FnMut(&mut dyn Processor)) {
        self.with(call);
    }
}

/// An engine, and its node `it`.
fn held(graph: &GraphFile) -> (Engine, Held) {
    let mut compiled = compiled(graph);
    let it = compiled.schedule.index_of("it").expect("the node");
    let node = &mut compiled.nodes[it].processor;
    let held = Held(Arc::new(Mutex::new(std::mem::replace(node, fresh(graph)))));
    *node = Box::new(held.clone());
    (Engine::new(compiled, Options::default()), held)
}

/// Another instance of the node `it`.
fn fresh(graph: &GraphFile) -> Box<dyn Processor> {
    let mut compiled = compiled(graph);
    let it = compiled.schedule.index_of("it").expect("the node");
    compiled.nodes.swap_remove(it).processor
}

fn saved(p: &mut dyn Processor) -> Vec<u8> {
    let mut bytes = vec![0; p.state_size()];
    let len = p.save(&mut bytes).expect("a state that is no larger than was said");
    bytes.truncate(len);
    bytes
}

fn kinds() -> Vec<Arc<NodeKind>> {
    harness::registry().iter().cloned().collect()
}

/// Parameters that are live, with their places.
fn live(kind: &NodeKind) -> Vec<(usize, Param)> {
    let params = kind.descriptor().params.iter().cloned().enumerate();
    params.filter(|(_, p)| p.live).collect()
}

/// The ends of a parameter's range and something between, as the engine and as a graph file say it.
fn values(param: &Param) -> Vec<(f64, String)> {
    match &param.kind {
        ParamKind::Number(r) => [*r.start(), *r.end(), r.start() + 0.3 * (r.end() - r.start())]
            .map(|x| (x, format!("{x:?}")))
            .to_vec(),
        ParamKind::Integer(r) => [*r.start(), *r.end()].map(|i| (i as f64, i.to_string())).to_vec(),
        ParamKind::Flag => vec![(0.0, "false".into()), (1.0, "true".into())],
        ParamKind::Choice(words) => {
            words.iter().enumerate().map(|(i, w)| (i as f64, format!("{w:?}"))).collect()
        }
        other => panic!("{} is live and {other:?}", param.name),
    }
}

/// Sets each live parameter to one of its values.
fn set_all(p: &mut dyn Processor, live: &[(usize, Param)], which: usize) {
    for (i, param) in live {
        let values = values(param);
        p.set_parameter(*i, values[which % values.len()].0);
    }
}

fn faults(engine: &Engine) -> (u64, Option<Fault>, bool) {
    let it = engine.schedule().index_of("it").expect("the node");
    let report = engine.report(it).expect("a report");
    (report.faults, report.last_fault, report.quarantined)
}

#[test]
fn restored_node_goes_on_as_the_saved_one_would() {
    let mut remember = Vec::new();
    let mut told = Vec::new();
    for kind in kinds() {
        let live = live(kind.as_ref());
        for signal in ["random", "huge", "waves"] {
            let name = format!("{} on {signal}", kind.descriptor().kind);
            let graph = graph(kind.as_ref(), signal, 500, 44_100);
            let (mut a, it) = held(&graph);
            run(&mut a, 148);
            // Parameters change shortly before, so that what leads from one value to another is under way.
            it.with(|p| set_all(p, &live, 2));
            run(&mut a, 2);
            let bytes = it.with(saved);
            assert_eq!(it.with(saved), bytes, "{name}: saving changes what is saved");
            let expected = run(&mut a, 150);

            let after = [true, false].map(|restored| {
                let (mut b, it) = held(&graph);
                run(&mut b, 150);
                let mut new = fresh(&graph);
                assert_eq!(it.with(|p| p.state_size()), new.state_size(), "{name}");
                set_all(new.as_mut(), &live, 2);
                if restored {
                    assert!(new.restore(&bytes), "{name}");
                }
                it.replace(new);
                run(&mut b, 150)
            });
            assert!(after[0] == expected, "{name}");
            if !bytes.is_empty() {
                remember.push(kind.descriptor().kind.to_string());
            }
            if after[1] != expected {
                told.push(kind.descriptor().kind.to_string());
            }
        }
    }
    remember.dedup();
    told.dedup();
    // What has faded in and stays so cannot be told from what never faded: `audio_out` has a test of its own.
    remember.retain(|k| k != "audio_out");
    assert_eq!(told, remember, "kinds that differ without their state, and kinds that have one");
}

/// Bytes like a state's, but wild.
fn spoilt(bytes: &[u8]) -> Vec<Vec<u8>> {
    const WILD: [[u8; 8]; 5] = [
        f64::NAN.to_le_bytes(),
        1e300_f64.to_le_bytes(),
        [0; 8],
        u64::MAX.to_le_bytes(),
        (u64::MAX / 2).to_le_bytes(),
    ];
    let mut all = vec![bytes[..bytes.len() / 2].to_vec(), [bytes, &[0]].concat()];
    all.extend((0..20).map(|seed| (0..bytes.len()).map(|i| random::bits(seed, i as u64) as u8).collect()));
    all.extend([0, 1, 0x3f, 0x7f, 0xff].map(|b| vec![b; bytes.len()]));
    // Numbers and places stand in front of or behind long lists.
    let last = bytes.len().saturating_sub(8);
    for at in (0..=last).filter(|at| *at < 48 || last - at < 48) {
        all.extend(WILD.iter().map(|wild| {
            let mut out = bytes.to_vec();
            let n = (out.len() - at).min(8);
            out[at..at + n].copy_from_slice(&wild[..n]);
            out
        }));
    }
    all
}

/// Gives a node in a running engine bytes as its state, resets it where it refuses them if that is wanted
/// (the engine does), and goes on.
fn survives(name: &str, (engine, it): &mut (Engine, Held), bytes: &[u8], reset: bool) {
    engine.reset();
    run(engine, 20);
    it.with(|p| {
        if !p.restore(bytes) && reset {
            p.reset();
        }
    });
    run(engine, 10);
    let (_, last, quarantined) = faults(engine);
    assert!(last != Some(Fault::Panicked) && !quarantined, "{name}: {last:?}, {bytes:?}");
}

#[test]
fn no_bytes_make_a_node_panic_or_keep_it_from_going_on() {
    for kind in kinds() {
        let mut held = held(&graph(kind.as_ref(), "random", 500, 44_100));
        run(&mut held.0, 20);
        let bytes = held.1.with(saved);
        if bytes.is_empty() {
            continue;
        }
        for (i, wild) in spoilt(&bytes).iter().enumerate() {
            survives(&format!("{}, {i}", kind.descriptor().kind), &mut held, wild, i % 2 == 0);
        }
    }
}

#[test]
fn the_state_of_another_kind_is_refused_or_does_no_harm() {
    let states: Vec<(String, Vec<u8>)> = kinds()
        .iter()
        .map(|kind| {
            let (mut engine, it) = held(&graph(kind.as_ref(), "random", 500, 44_100));
            run(&mut engine, 50);
            (kind.descriptor().kind.to_string(), it.with(saved))
        })
        .filter(|(_, bytes)| !bytes.is_empty())
        .collect();
    for kind in kinds() {
        let mut held = held(&graph(kind.as_ref(), "random", 500, 44_100));
        let size = held.1.with(|p| p.state_size());
        for (other, bytes) in states.iter().filter(|(k, _)| *k != kind.descriptor().kind) {
            let name = format!("{} from {other}", kind.descriptor().kind);
            // A delay's state says itself how long it is.
            let fits = bytes.len() == size || kind.descriptor().kind == "delay";
            assert!(fits || !held.1.with(|p| p.restore(bytes)), "{name}");
            survives(&name, &mut held, bytes, true);
        }
    }
}

#[test]
fn live_parameter_takes_any_value_at_any_time() {
    for kind in kinds() {
        let live = live(kind.as_ref());
        if live.is_empty() {
            continue;
        }
        for signal in SIGNALS {
            let (mut engine, it) = held(&graph(kind.as_ref(), signal, 500, 48_000));
            for step in 0..60 {
                it.with(|p| set_all(p, &live, random::bits(3, step) as usize));
                run(&mut engine, 1 + step % 7);
            }
            assert_eq!(faults(&engine).0, 0, "{} on {signal}", kind.descriptor().kind);
        }
    }
}

#[test]
fn live_parameter_and_reset_equal_preparing_with_it() {
    let mut count = 0;
    for kind in kinds() {
        for (i, param) in live(kind.as_ref()) {
            let mut distinct = std::collections::HashSet::new();
            for (value, text) in values(&param) {
                let name = format!("{}.{} = {text}", kind.descriptor().kind, param.name);
                let out = ["huge", "waves"].map(|signal| {
                    let mut graph = graph(kind.as_ref(), signal, 500, 48_000);
                    let (mut a, it) = held(&graph);
                    it.with(|p| {
                        p.set_parameter(i, value);
                        p.reset();
                    });
                    graph.set(&format!("it.{}={text}", param.name), "test").expect("a setting");
                    let out = run(&mut a, 300);
                    assert!(out == run(&mut held(&graph).0, 300), "{name} on {signal}");
                    out
                });
                distinct.insert(out);
                count += 1;
            }
            // A parameter that does nothing would pass all the same.
            assert!(distinct.len() > 1, "{}.{}", kind.descriptor().kind, param.name);
        }
    }
    assert!(count > 0);
}
