//! Chains of nodes with known output.

use std::sync::Arc;

use asperity_node::{Input, RateSpec, Registry, ShapeSpec, Unit};

use super::testing::{Counter, Tone, audio_kind};
use super::*;

fn registry() -> Registry {
    asperity_nodes::registry().with::<Counter>().with::<Tone>()
}

fn frames(count: usize, rate_hz: u32) -> Arc<Frames> {
    Arc::new(Frames::from_amplitudes(vec![1.0; count * 51], 51, rate_hz).unwrap())
}

fn chain(text: &str, frames: &Arc<Frames>) -> Result<Chain, String> {
    let registry = registry();
    let method = Method::parse(text, &registry).unwrap_or_else(|e| panic!("{}", e.reason()));
    Chain::new(&registry, &method, frames, 1).map_err(|e| e.reason())
}

/// Also for early samples, as from a node that emits the middle of its windows.
#[test]
fn declared_latency_is_taken_out_whatever_its_sign() {
    for rate_hz in [2500, 44_100] {
        let frames = frames(40, rate_hz);
        for late in [0, 7, -7, i64::from(rate_hz) / 10, -i64::from(rate_hz) / 20] {
            let mut chain = chain(&format!("counter:late={late}"), &frames).unwrap();
            assert!((chain.latency().ms() - late as f64 * 1e3 / f64::from(rate_hz)).abs() < 1e-9);
            let signal = chain.signal();
            assert_eq!(signal.len() as u64, frames.samples(), "{rate_hz} Hz, {late}");
            let missing = late.min(0).unsigned_abs() as usize;
            for (i, &y) in signal.iter().enumerate() {
                let want = if i < missing { 0.0 } else { i as f32 };
                assert_eq!(y, want, "{rate_hz} Hz, {late}, sample {i}");
            }
        }
    }
}

#[test]
fn live_output_keeps_its_latency() {
    let frames = frames(40, 2500);
    let heard = chain("counter:late=30", &frames).unwrap().live();
    assert_eq!((heard.len(), heard[0], heard[199]), (200, -30.0, 169.0));
}

#[test]
fn long_latency_and_unknown_parameter_are_refused() {
    let frames = frames(40, 2500);
    let why = chain("counter:late=1000000", &frames).err().unwrap();
    assert!(why.contains("declares a latency of 400000 ms"), "{why}");
    let why = chain("counter:late=-1000000", &frames).err().unwrap();
    assert!(why.contains("declares a latency of -400000 ms"), "{why}");
    let why = chain("counter:lat=1", &frames).err().unwrap();
    assert!(why.contains("no parameter `lat`"), "{why}");
}

#[test]
fn retrieval_needs_one_magnitude_input_and_one_output() {
    let control = || Input::new("more", ShapeSpec::Control(1), Unit::NONE);
    let plain = audio_kind("a");
    assert_eq!(
        plain.retrieval().map(|r| (r.input, r.output, r.spectrum)),
        Some(("magnitude", "signal", false))
    );
    assert!(audio_kind("a").input(control().or(1.0)).retrieval().is_some());
    assert!(audio_kind("a").input(control()).retrieval().is_none(), "another required input");
    let mut two = audio_kind("a");
    two.outputs.push(two.outputs[0].clone());
    assert!(two.retrieval().is_none(), "two outputs");
    let mut audio = audio_kind("a");
    audio.inputs[0].shape = ShapeSpec::Audio(RateSpec::Graph);
    assert!(audio.retrieval().is_none(), "no magnitudes");
    let registry = registry();
    let kinds: Vec<&str> = retrievers(&registry).iter().map(|d| d.kind.as_ref()).collect();
    assert!(
        kinds.contains(&"spsi") && kinds.contains(&"tone") && !kinds.contains(&"overlap_add"),
        "{kinds:?}"
    );
}

#[test]
fn default_is_the_node_of_the_shipped_graph() {
    let method = Method::parse("default:seed=3", &registry()).unwrap();
    assert_eq!((method.kind(), method.label.as_str()), ("shaped_noise", "default:seed=3"));
}
