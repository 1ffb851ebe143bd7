//! The result as a picture.

use asperity_accuracy::accuracy::rhythm::{self, RhythmAgreement};
use asperity_plot::{Column, Dots};

use super::contest::{Outcome, Row};
use super::published::{Delay, Score};
use super::vectors::Set;

/// All figures of all methods; published scores as ticks beside them.
pub fn svg(set: &Set, outcome: &Outcome, published: &[Row]) -> String {
    let rows = outcome.rows.as_slice();
    let accuracy = Accuracy { rows, published };
    let one_rate = set.rates().len() == 1;
    let convergence = set.vectors.iter().enumerate().map(|(v, vector)| {
        let unit = if one_rate { "dB".into() } else { format!("dB, {} Hz", vector.rate_hz) };
        accuracy.column(vector.short_name(), &unit, v, |s| Some(s.convergence_db))
    });
    let mut groups = vec![("Spectral convergence, less is better".to_owned(), convergence.collect())];
    let mut cost = Vec::new();
    if let Some(v) = set.smoothest() {
        let on = |unit: &str| format!("{unit} on {}", set.vectors[v].short_name());
        cost.push(Column {
            decimals: 2,
            ..accuracy.column("level error", &on("|dB|"), v, |s| (!s.is_silent()).then_some(s.level_db.abs()))
        });
        cost.push(Column {
            decimals: 2,
            ..accuracy.column("LTAS error", &on("rms dB"), v, |s| (!s.is_silent()).then_some(s.ltas_rms_db))
        });
    }
    let figures = |name: &str, unit: &str, logarithmic: bool, of: &dyn Fn(&Row) -> Vec<f64>| Column {
        name: name.into(),
        unit: unit.into(),
        decimals: 1,
        logarithmic,
        values: rows.iter().map(of).collect(),
        others: Vec::new(),
    };
    let ms = |lag: Option<[f64; 3]>| lag.map_or(Vec::new(), Vec::from);
    cost.push(figures("lag of a texture", "ms, 10 to 90 %", false, &|r| ms(r.texture_lag_ms)));
    cost.push(figures("lag of a tone", "ms, 10 to 90 %", false, &|r| ms(r.tone_lag_ms)));
    cost.push(figures("added latency", "ms", false, &|r| match r.delay {
        Delay::Ms(ms) => vec![ms],
        Delay::Offline | Delay::Unknown => Vec::new(),
    }));
    for rate in set.rates() {
        let us = |r: &Row| r.frame_us.get(&rate).copied().filter(|us| *us > 0.0).into_iter().collect();
        cost.push(figures("us a frame", &format!("median, N = {}", rate / 10), true, &us));
    }
    groups.push(("Level, response and cost".to_owned(), cost));
    if let Some(noise) = outcome.noise {
        let off = |row: &Row| rhythm::compare(&row.rhythm?, &[noise]).ok();
        let column = |name: &str, unit: &str, decimals, figure: fn(RhythmAgreement) -> f64| Column {
            decimals,
            ..figures(name, unit, false, &|row| off(row).map(figure).into_iter().collect())
        };
        let rhythm = vec![
            column("pulses", "15 to 25 Hz, |dB|", 1, |a| a.pulses_db.abs()),
            column("repetition", "0 to 1", 2, |a| a.repetition),
            column("kurtosis", "|dB|", 1, |a| a.kurtosis_db),
        ];
        groups.push(("Rhythm on steady magnitudes, off that of Gaussian noise".to_owned(), rhythm));
    }
    Dots {
        title: "Phase retrieval compared".into(),
        subtitles: vec![
            format!("Vectors: {}. Methods by their mean rank in spectral convergence.", set.from),
            "Orange: least of its column. Level and LTAS on the vector smoothest over frequency, where convergence says little.".into(),
        ],
        rows: rows.iter().map(|r| r.label.clone()).collect(),
        others: "published".into(),
        groups,
    }
    .to_svg()
}

/// Scores of own rows and of published ones.
struct Accuracy<'a> {
    rows: &'a [Row],
    published: &'a [Row],
}

impl Accuracy<'_> {
    fn column(&self, name: &str, unit: &str, v: usize, of: fn(&Score) -> Option<f64>) -> Column {
        let value = |row: &Row| row.scores[v].as_ref().and_then(of);
        Column {
            name: name.into(),
            unit: unit.into(),
            decimals: 1,
            logarithmic: false,
            values: self.rows.iter().map(|r| value(r).into_iter().collect()).collect(),
            others: self.published.iter().filter_map(|r| Some((r.label.clone(), value(r)?))).collect(),
        }
    }
}
