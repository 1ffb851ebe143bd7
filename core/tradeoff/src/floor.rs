//! What is not told apart, and times of several batches put together.

use std::collections::HashMap;

use crate::figure::{Figure, Figures};
use crate::result::{Results, Row, Time};
use crate::time::Batch;

/// Standard deviations of a difference within which two settings are not told apart: 95 % of differences of equals are less.
const DEVIATIONS: f64 = 1.96;

/// The middle of some numbers; 0 of none.
pub(crate) fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    match all.len() {
        0 => 0.0,
        n if n % 2 == 1 => all[n / 2],
        n => 0.5 * (all[n / 2 - 1] + all[n / 2]),
    }
}

/// Gives rows the times of their batches, each by its ratio to the default of the same batch.
pub(crate) fn put_times(rows: &mut [Row], batches: &[Batch]) {
    let middle = median(batches.iter().map(|b| b.anchor.load_percent).collect());
    let mut times = HashMap::new();
    for batch in batches {
        let factor = middle / batch.anchor.load_percent.max(1e-12);
        for (key, time) in &batch.rows {
            times.insert(key.as_str(), time.clone().map(|t| t.scaled(factor)));
        }
    }
    for row in rows {
        match times.remove(row.key.as_str()) {
            Some(Ok(time)) => {
                row.faults += time.faults;
                row.time = Some(time);
            }
            Some(Err(why)) => row.error = Some(why),
            None => {}
        }
    }
}

/// A tick in which nothing is done: the middle of all batches' figures.
pub(crate) fn empty(batches: &[Batch]) -> Option<Time> {
    if batches.is_empty() {
        return None;
    }
    let of = |f: fn(&Time) -> f64| median(batches.iter().map(|b| f(&b.empty)).collect());
    Some(Time {
        p50_us: of(|t| t.p50_us),
        p99_us: of(|t| t.p99_us),
        p999_us: of(|t| t.p999_us),
        max_us: of(|t| t.max_us),
        load_percent: of(|t| t.load_percent),
        cold_us: of(|t| t.cold_us),
        spread: of(|t| t.spread),
        misses: batches.iter().map(|b| b.empty.misses).sum(),
        ticks: batches.iter().map(|b| b.empty.ticks).sum(),
        stall_us: of(|t| t.stall_us),
        memory_kib: None,
        faults: 0,
    })
}

/// Finds how far equals are apart.
///
/// Draws of one setting differ by chance alone. With a variance of a draw that is pooled over all settings, means of D draws differ with a standard
/// deviation of `sqrt(2 / D)` times that of a draw.
pub(crate) fn find(results: &mut Results) {
    let of = |figure: Figure| {
        let draws =
            results.rows.iter().map(|r| r.draws.iter().filter_map(|d| d.get(&figure).copied()).collect());
        Some((figure, pooled(draws)?))
    };
    let floor: Figures = Figure::ALL.into_iter().filter_map(of).collect();
    let lag = pooled(results.rows.iter().map(|r| r.lag_draws_ms.clone()));
    let spreads: Vec<f64> = results.rows.iter().filter_map(|r| r.time.map(|t| t.spread)).collect();
    results.floor = floor;
    results.lag_floor_ms = lag;
    results.load_floor = (!spreads.is_empty()).then(|| median(spreads));
}

/// [`DEVIATIONS`] of the difference of two means, from draws of several settings.
fn pooled(settings: impl Iterator<Item = Vec<f64>>) -> Option<f64> {
    let (mut squares, mut freedom, mut fewest) = (0.0, 0.0, usize::MAX);
    for draws in settings.filter(|d| d.len() > 1) {
        let mean = draws.iter().sum::<f64>() / draws.len() as f64;
        squares += draws.iter().map(|d| (d - mean).powi(2)).sum::<f64>();
        freedom += (draws.len() - 1) as f64;
        fewest = fewest.min(draws.len());
    }
    (freedom > 0.0).then(|| DEVIATIONS * (squares / freedom * 2.0 / fewest as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_is_two_deviations_of_a_difference_of_means() {
        // Draws 1 and 3: their variance is 2, that of the mean of both 1, that of a difference of two such means 2.
        let floor = pooled([vec![1.0, 3.0], vec![11.0, 13.0], vec![5.0]].into_iter()).unwrap();
        assert!((floor - 1.96 * 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(pooled([vec![1.0]].into_iter()), None);
    }

    #[test]
    fn batches_are_put_together_by_their_ratio_to_the_default() {
        let time = |load_percent: f64| Time {
            load_percent,
            p50_us: 10.0 * load_percent,
            max_us: 4000.0,
            ..Time::default()
        };
        let batch = |anchor: f64, key: &str, load: f64| Batch {
            empty: time(0.0),
            anchor: time(anchor),
            rows: vec![(key.into(), Ok(time(load)))],
        };
        let mut rows = ["a", "b", "c"].map(crate::testing::row);
        // The second was taken while everything took twice as long.
        put_times(&mut rows, &[batch(1.0, "a", 3.0), batch(2.0, "b", 6.0), batch(1.0, "c", 0.5)]);
        let loads: Vec<f64> = rows.iter().filter_map(Row::load).collect();
        assert_eq!(loads, [3.0, 3.0, 0.5]);
        assert_eq!(rows[1].time.unwrap().p50_us, 30.0);
        // A stall takes what it takes.
        assert_eq!(rows[1].time.unwrap().max_us, 4000.0);
    }

    #[test]
    fn a_setting_of_which_a_node_failed_while_it_was_timed_cannot_be_chosen() {
        let time = |faults| Ok(Time { load_percent: 1.0, faults, ..Time::default() });
        let rows = vec![("a".into(), time(0)), ("b".into(), time(3))];
        let batch =
            Batch { empty: Time::default(), anchor: Time { load_percent: 1.0, ..Time::default() }, rows };
        let mut rows = ["a", "b"].map(crate::testing::row);
        rows[1].faults = 2;
        put_times(&mut rows, &[batch]);
        assert_eq!((rows[0].sound(), rows[1].sound(), rows[1].faults), (true, false, 5));
    }

    #[test]
    fn the_middle_of_an_even_number_lies_between() {
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(vec![4.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(Vec::new()), 0.0);
    }
}
