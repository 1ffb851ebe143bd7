//! Graphs of any shape and size.

use std::sync::atomic::{AtomicU64, Ordering};

use asperity_checks::{Became, Drawn, Subject, drawn};
use asperity_node::{Fault, Status, Tick};
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestError, TestRng, TestRunner};

use crate::{broken, called, fails, graph, holds, holds_on, subject};

/// A mutant that does something else in its 30th call.
fn once(
    subject: &Subject<'static>,
    kind: &str,
    does: fn(&mut Tick<'_>) -> Result<Status, Fault>,
) -> Subject<'static> {
    called(subject, kind, move |_| {
        let mut calls = 0;
        Box::new(move |node, tick| {
            calls += 1;
            let status = node.run(tick)?;
            if calls == 30 { does(tick) } else { Ok(status) }
        })
    })
}

#[test]
fn random_graphs() {
    let subject = subject(None);
    holds("random_graphs", &subject);
    let fault = once(&subject, "gain", |_| Err(Fault::Failed(3)));
    fails("random_graphs", &fault, "failed with code 3");
    let panics = once(&subject, "velocity", |_| panic!("asked for"));
    fails("random_graphs", &panics, "panicked");
    let nan = once(&subject, "resample", |tick| {
        tick.outputs.audio(0).iter_mut().for_each(|y| *y = f32::NAN);
        Ok(Status::Continue)
    });
    fails("random_graphs", &nan, "wrote a value that is not finite");
}

#[test]
fn same_bytes() {
    let graphs = ["texture.ron", "heravi2024.ron", "live.ron", "haply.ron"].map(graph);
    holds_on("same_bytes", &graphs);
    holds_on("same_bytes", &["scenes/every_effect.ron", "scenes/side_by_side.ron"].map(graph));
    let subject = subject(Some(&graphs[0]));
    static CALLS: AtomicU64 = AtomicU64::new(0);
    // What it answers follows from how often any node of its kind was called.
    let shared = broken(&subject, "virtual_floor", |(): &mut (), tick| {
        let calls = CALLS.fetch_add(1, Ordering::Relaxed);
        tick.outputs.control(0).iter_mut().for_each(|x| *x += 1e-15 * calls as f64);
    });
    fails("same_bytes", &shared, "differs in tick");
}

/// Draws a graph by a list of choices; those beyond its end are 0.
fn by_choices(subject: &Subject<'_>, choices: &[u16]) -> Drawn {
    let mut at = 0;
    let mut choose = |n: usize| {
        at += 1;
        usize::from(choices.get(at - 1).copied().unwrap_or(0)) % n.max(1)
    };
    drawn(subject, &mut choose)
}

fn choices() -> impl Strategy<Value = Vec<u16>> {
    prop::collection::vec(any::<u16>(), 0..600)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn drawn_graph_runs_or_is_refused_with_a_reason(choices in choices()) {
        let subject = subject(None);
        let graph = by_choices(&subject, &choices);
        match graph.run(&subject) {
            Ok(Became::Ran { .. }) => {}
            Ok(Became::Refused(why)) => prop_assert!(!why.is_empty()),
            Err(wrong) => prop_assert!(false, "{wrong:?}:\n{}", graph.text),
        }
    }
}

/// A fault in one kind of node is found, and the graph that shows it is cut down to what one can read.
#[test]
fn failing_graph_shrinks_to_a_few_nodes() {
    let subject = once(&subject(None), "gain", |_| Err(Fault::Failed(3)));
    let config = ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() };
    // A draw may be stuck where nothing that is left out alone still fails: the best of some.
    let shrunk = (0..6_u8).map(|seed| {
        let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]);
        let found = TestRunner::new_with_rng(config.clone(), rng).run(&choices(), |choices| {
            let stood = by_choices(&subject, &choices).run(&subject);
            prop_assert!(stood.is_ok(), "{stood:?}");
            Ok(())
        });
        let Err(TestError::Fail(_, least)) = found else { panic!("the mutant is not found: {found:?}") };
        by_choices(&subject, &least)
    });
    let graph = shrunk.min_by_key(|graph| graph.text.matches("(kind: ").count()).expect("some");
    println!("{}", graph.text);
    let nodes = graph.text.matches("(kind: ").count();
    assert!(graph.text.contains("\"gain\"") && nodes <= 16, "{nodes} nodes:\n{}", graph.text);
}
