//! Rows to test on.

use crate::figure::{Figure, Figures};
use crate::result::{Fragment, Results, Row, Time, VERSION};

/// A row of which nothing is known.
pub(crate) fn row(name: &str) -> Row {
    Row {
        name: name.into(),
        key: name.into(),
        graph: "g.ron".into(),
        turned: Vec::new(),
        grids: Vec::new(),
        default: false,
        mark: false,
        tick_hz: 500,
        fragment: Fragment::default(),
        error: None,
        figures: Figures::new(),
        draws: Vec::new(),
        lag_ms: None,
        lag_draws_ms: Vec::new(),
        latency_ms: None,
        faults: 0,
        cases: 1,
        fails: Default::default(),
        time: None,
    }
}

/// A row with a load in per cent (a tick of 500 Hz takes 20 us for each), an error of the level and a lag.
pub(crate) fn measured(name: &str, load_percent: f64, level: f64, lag: f64) -> Row {
    let p50_us = 20.0 * load_percent;
    let time =
        Time { load_percent, p50_us, p99_us: p50_us, p999_us: 1.5 * p50_us, ticks: 1000, ..Time::default() };
    Row {
        figures: Figures::from([(Figure::Level, level)]),
        lag_ms: Some([lag - 5.0, lag, lag + 5.0]),
        time: Some(time),
        ..row(name)
    }
}

/// Results with these rows, and a floor of 0.1 dB of the level.
pub(crate) fn results(rows: Vec<Row>) -> Results {
    Results {
        version: VERSION,
        study: "s.ron".into(),
        digest: "d".into(),
        seed: 1,
        strokes: vec!["circle (5 s)".into()],
        materials: vec!["canvas".into()],
        machines: Vec::new(),
        shards: vec![(1, 1)],
        unfinished: 0,
        cases: 3,
        floor: Figures::from([(Figure::Level, 0.1)]),
        lag_floor_ms: Some(1.0),
        load_floor: Some(1.02),
        model: Figures::from([(Figure::Level, 0.3)]),
        empty: Some(Time { p999_us: 2.0, ..Time::default() }),
        notes: Vec::new(),
        rows,
    }
}
