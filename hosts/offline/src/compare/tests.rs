//! Methods that fail, and response lags that are known.

use asperity_node::Registry;

use super::contest::{Lag, Stimulus};
use super::contest::{Outcome, Row, run};
use super::report;
use super::vectors::{Published, Set, Vector, built_in};
use crate::phase::Method;
use crate::phase::tests::{Counter, Tone};

fn registry() -> Registry {
    asperity_nodes::registry().with::<Tone>().with::<Counter>()
}

/// One short vector: the tone that the test node plays.
fn set() -> Set {
    let sine = |i: u32| (std::f64::consts::TAU * 250.0 * f64::from(i) / 2500.0).sin();
    let signal: Vec<f64> = (0..1000).map(sine).collect();
    let vector = Vector::of_signal("sine_2500", 2500, &signal).unwrap();
    Set::new("a test".into(), vec![vector], Published::default())
}

fn outcome(labels: &[&str]) -> Outcome {
    let registry = registry();
    let methods: Vec<Method> = labels.iter().map(|l| Method::parse(l, &registry).unwrap()).collect();
    run(&registry, &methods, &set(), || Ok(())).unwrap()
}

fn row<'a>(rows: &'a [Row], label: &str) -> &'a Row {
    rows.iter().find(|r| r.label == label).unwrap_or_else(|| panic!("no row {label}"))
}

#[test]
fn failing_node_reports_in_its_row_and_others_go_on() {
    let labels =
        ["nan", "error", "panic", "prepare", "clock"].map(|how| format!("tone:how={how}")).into_iter();
    let labels: Vec<String> = labels.chain(["tone".into(), "spsi".into()]).collect();
    let outcome = outcome(&labels.iter().map(String::as_str).collect::<Vec<_>>());
    let rows = &outcome.rows;
    assert_eq!(rows.len(), labels.len());
    for (how, faults, says) in [
        ("nan", 1, "it failed once: it wrote a value that is not finite (sine)"),
        ("error", 8, "it failed 8 times, the last time it failed with code 42, and was called no more"),
        ("panic", 1, "it failed once: it panicked (sine)"),
        ("prepare", 0, "it panicked outside a tick (sine, steady, response to a texture, response to a"),
        ("clock", 0, "the same frames gave other samples the second time"),
    ] {
        let row = row(rows, &format!("tone:how={how}"));
        let score = row.scores["sine_2500"];
        assert_eq!(score.map_or(0, |s| s.faults), faults, "{how}");
        assert!(row.notes.iter().any(|n| n.starts_with(says)), "{how}: {:?}", row.notes);
        assert_eq!(score.is_some(), how != "prepare", "{how}");
    }
    for label in ["tone", "spsi"] {
        let row = row(rows, label);
        let good = row.scores["sine_2500"].is_some_and(|s| s.convergence_db < -50.0);
        assert!(row.notes.is_empty() && good, "{row:?}");
    }
    let set = set();
    let (text, svg) = (report::text(&set, &outcome, &[]), report::svg(&set, &outcome, &[]));
    let (csv, json) = (report::csv(&set, &outcome, &[]), report::json(&set, &outcome, &[]));
    for label in &labels {
        assert!(text.contains(label) && svg.contains(label) && csv.contains(label), "{label}");
    }
    assert_eq!(json["methods"].as_array().unwrap().len(), labels.len());
    assert!(text.lines().any(|l| l.starts_with("  tone:how=error: it failed 8 times")), "{text}");
    assert!(row(rows, "tone:how=error").us_a_frame.is_empty(), "the time of a failing run does not count");
    assert!(text.contains("silent") && !svg.contains("300.00"), "nothing is measured of silence: {text}");
    assert!(text.contains(" !"), "a score of a node that failed is marked: {text}");
}

#[test]
fn tone_has_no_pulses_and_silence_no_rhythm() {
    let outcome = outcome(&["tone", "tone:how=error"]);
    let tone = row(&outcome.rows, "tone").rhythm.unwrap();
    assert!(tone.pulses() < 0.01 && tone.repetition() > 0.99, "{tone:?}");
    assert!((tone.kurtosis - 1.5).abs() < 0.01, "{tone:?}");
    assert!(row(&outcome.rows, "tone:how=error").rhythm.is_none());
    let noise = outcome.noise.unwrap();
    assert!((noise.kurtosis - 3.0).abs() < 0.3 && noise.pulses() > 0.1, "{noise:?}");
    let json = report::json(&set(), &outcome, &[]);
    assert!(json["noise"]["pulses"].is_f64(), "{json}");
    assert!(json["methods"][0]["rhythm"]["repetition"].is_f64(), "{json}");
    let text = report::text(&set(), &outcome, &[]);
    assert!(text.lines().any(|l| l.trim_start().starts_with("Gaussian noise ")), "{text}");
}

#[test]
fn best_on_most_vectors_comes_first() {
    let rows = outcome(&["tone:delay=60", "tone:how=error", "tone"]).rows;
    assert_eq!(rows[0].label, "tone");
    assert_eq!(rows[2].label, "tone:how=error");
    assert_eq!(row(&rows, "tone").latency_ms, Some(0.0));
}

fn lag(stimulus: &Stimulus, label: &str) -> Lag {
    let registry = registry();
    let method = Method::parse(label, &registry).unwrap();
    stimulus.drive(&registry, &method).unwrap()
}

#[test]
fn response_lag_of_a_delay_is_the_delay() {
    for stimulus in [Stimulus::tone().unwrap(), Stimulus::texture().unwrap()] {
        assert_eq!(lag(&stimulus, "tone").ms, Some([0.0; 3]));
        let ms = lag(&stimulus, "tone:delay=10").ms.unwrap();
        for (ms, early) in ms.into_iter().zip([3.0, 1.0, 0.2]) {
            // The level is taken over 8 ms, and of 1 + 3 x, squared, more than half lies in the louder
            // part.
            assert!(ms < 24.0 && ms > 20.0 - 4.2 && ms >= 20.0 - early - 1.0, "{ms}");
        }
        assert!(!lag(&stimulus, "tone:delay=10").differs);
        assert!(lag(&stimulus, "tone:how=clock").differs);
    }
}

#[test]
fn silent_node_and_long_latency_have_no_lag() {
    let stimulus = Stimulus::tone().unwrap();
    assert_eq!(lag(&stimulus, "tone:how=error").ms, None);
    let registry = registry();
    let method = Method::parse("counter:late=200", &registry).unwrap();
    let why = stimulus.drive(&registry, &method).err().map(|e| e.reason()).unwrap_or_default();
    assert!(why.contains("80 ms of latency"), "{why}");
}

#[test]
fn published_rows_are_those_with_a_score_on_the_vectors() {
    let set = built_in().unwrap();
    assert!(set.vectors.len() == 7 && set.vectors.iter().all(|v| set.published.sc.contains_key(&v.name)));
    assert_eq!(set.smoothest().name, "nnsmooth_2500");
    let rows = super::contest::published(&set);
    assert_eq!(rows.len(), 24);
    // Each carries its reference, and no node can be called like it.
    let cited = |label: &str| row(&rows, label).reference.as_ref().unwrap().text.clone();
    assert!(cited("rtpghi0 [4]").contains("Sondergaard, Real-time Spectrogram Inversion"));
    assert!(cited("rtpghi0 [4]").ends_with("DAFx, 2016"));
    assert!(rows.iter().all(|row| row.label.ends_with(']') && row.reference.is_some()));
    assert!(!rows.iter().any(|row| row.reference.as_ref().unwrap().text.contains("no reference")));
    let row = row(&rows, "scr5x5_centre [13]");
    assert_eq!(row.latency_ms, Some(-50.0));
    assert_eq!(row.scores["texture_2500"].unwrap().convergence_db, -22.09);
    assert!(super::contest::published(&self::set()).is_empty());
}
