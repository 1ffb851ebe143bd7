//! The noise floor, and times of several batches and shards on one scale.

use std::collections::{BTreeSet, HashMap};

use asperity_diagnostics::Diagnostic;

use crate::figure::Figure;
use crate::results::{Results, Row, Time};
use crate::time::Batch;

/// Two-sided 95 % quantile of the normal distribution: 95 % of differences by chance are smaller.
const DEVIATIONS: f64 = 1.96;

pub(crate) fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    match all.len() {
        0 => 0.0,
        n if n % 2 == 1 => all[n / 2],
        n => 0.5 * (all[n / 2 - 1] + all[n / 2]),
    }
}

/// Gives rows the times of their batches, scaled by the ratio of the batches' defaults.
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

/// Time of an idle tick: medians over all batches.
pub(crate) fn idle(batches: &[Batch]) -> Option<Time> {
    if batches.is_empty() {
        return None;
    }
    let of = |f: fn(&Time) -> f64| median(batches.iter().map(|b| f(&b.idle)).collect());
    Some(Time {
        p50_us: of(|t| t.p50_us),
        p99_us: of(|t| t.p99_us),
        p999_us: of(|t| t.p999_us),
        max_us: of(|t| t.max_us),
        load_percent: of(|t| t.load_percent),
        cold_us: of(|t| t.cold_us),
        spread: of(|t| t.spread),
        misses: batches.iter().map(|b| b.idle.misses).sum(),
        ticks: batches.iter().map(|b| b.idle.ticks).sum(),
        stall_us: of(|t| t.stall_us),
        ..Time::default()
    })
}

/// Computes the noise floors.
///
/// Draws of one setting differ by chance alone. The variance of a draw is pooled over all settings. Means of
/// D draws then differ with a standard deviation of `sqrt(2 / D)` times that of a draw.
pub(crate) fn find_floors(results: &mut Results) {
    let of = |figure: Figure| {
        let draws =
            results.rows.iter().map(|r| r.draws.iter().filter_map(|d| d.get(&figure).copied()).collect());
        Some((figure, pooled(draws)?))
    };
    let spreads: Vec<f64> = results.rows.iter().filter_map(|r| r.time.map(|t| t.spread)).collect();
    results.noise_floor = Figure::all().filter_map(of).collect();
    results.lag_noise_floor_ms = pooled(results.rows.iter().map(|r| r.lag_draws_ms.clone()));
    results.load_noise_floor = (!spreads.is_empty()).then(|| median(spreads));
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

impl Results {
    /// Merges shards. Each of them timed the default of the first graph. Medians and loads of the others are
    /// scaled by the ratio of the defaults, to those of the first shard's machine. All else stays as
    /// measured. Shards may be [missing](Self::missing_shards).
    ///
    /// # Errors
    /// Results of different trade-offs or ways of measuring, a shard twice or without a time of the default,
    /// no results at all.
    pub fn merge(shards: Vec<(String, Self)>) -> Result<Self, Diagnostic> {
        let wrong = |name: &str, what: String| Diagnostic::new(what).in_file(name);
        let mut shards = shards.into_iter();
        let Some((first, mut merged)) = shards.next() else {
            return Err(Diagnostic::new("there are no results to merge"));
        };
        let default_load = |results: &Self, name: &str| {
            let load = results.default_row().and_then(|r| r.load());
            load.ok_or_else(|| wrong(name, "this shard has no time of the default".into()))
        };
        let here = default_load(&merged, &first)?;
        let default = merged.default_row().map(|r| r.key.clone());
        let mut known: BTreeSet<String> = merged.rows.iter().map(|r| r.key.clone()).collect();
        for (name, shard) in shards {
            if shard.digest != merged.digest || shard.default_row().map(|r| r.key.clone()) != default {
                let how = "or measured in another way";
                let what = format!("these results are of another trade-off than {first}, {how}");
                let help = "merge shards of one trade-off, run with the same file, graphs, seed and options";
                return Err(wrong(&name, what).help(help));
            }
            if let Some((number, of)) = shard.shards.iter().find(|s| merged.shards.contains(s)) {
                return Err(wrong(&name, format!("shard {number} of {of} is given twice")));
            }
            if shard.shards.iter().chain(&merged.shards).any(|s| s.1 != merged.shards[0].1) {
                return Err(wrong(&name, format!("{first} was split into another number of shards")));
            }
            let factor = here / default_load(&shard, &name)?.max(1e-12);
            for mut row in shard.rows {
                if known.insert(row.key.clone()) {
                    row.time = row.time.map(|t| t.scaled(factor));
                    merged.rows.push(row);
                }
            }
            add_new(&mut merged.machines, shard.machines);
            add_new(&mut merged.notes, shard.notes);
            merged.shards.extend(shard.shards);
            merged.unfinished += shard.unfinished;
        }
        merged.shards.sort_unstable();
        find_floors(&mut merged);
        Ok(merged)
    }
}

/// Adds missing entries.
fn add_new<T: PartialEq>(to: &mut Vec<T>, more: Vec<T>) {
    for item in more {
        if !to.contains(&item) {
            to.push(item);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{default_row, measured, results};

    fn time(load_percent: f64) -> Time {
        Time { load_percent, p50_us: 10.0 * load_percent, max_us: 4000.0, ..Time::default() }
    }

    fn batch(anchor: f64, rows: &[(&str, Time)]) -> Batch {
        let rows = rows.iter().map(|(key, time)| ((*key).to_owned(), Ok(*time))).collect();
        Batch { idle: time(0.0), anchor: time(anchor), rows }
    }

    #[test]
    fn noise_floor_is_two_deviations_of_a_difference() {
        // Draws 1 and 3: variance 2; that of the mean of both 1; that of a difference of two such means 2.
        let floor = pooled([vec![1.0, 3.0], vec![11.0, 13.0], vec![5.0]].into_iter()).unwrap();
        assert!((floor - 1.96 * 2f64.sqrt()).abs() < 1e-12);
        assert_eq!(pooled([vec![1.0]].into_iter()), None);
    }

    #[test]
    fn batches_are_scaled_by_the_ratio_of_their_defaults() {
        let mut rows = ["a", "b", "c"].map(crate::testing::row);
        // Everything took twice as long during the second.
        let batches = [(1.0, "a", 3.0), (2.0, "b", 6.0), (1.0, "c", 0.5)];
        put_times(&mut rows, &batches.map(|(anchor, key, load)| batch(anchor, &[(key, time(load))])));
        let loads: Vec<f64> = rows.iter().filter_map(Row::load).collect();
        assert_eq!(loads, [3.0, 3.0, 0.5]);
        assert_eq!(rows[1].time.unwrap().p50_us, 30.0);
        // A stall is not scaled.
        assert_eq!(rows[1].time.unwrap().max_us, 4000.0);
    }

    #[test]
    fn setting_with_a_fault_during_timing_is_not_sound() {
        let time = |faults| Time { faults, ..time(1.0) };
        let mut rows = ["a", "b"].map(crate::testing::row);
        rows[1].faults = 2;
        put_times(&mut rows, &[batch(1.0, &[("a", time(0)), ("b", time(3))])]);
        assert_eq!((rows[0].sound(), rows[1].sound(), rows[1].faults), (true, false, 5));
    }

    #[test]
    fn median_of_an_even_count_lies_between() {
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(vec![4.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(Vec::new()), 0.0);
    }

    #[test]
    fn shards_are_scaled_by_the_ratio_of_their_defaults() {
        let shard = |number: usize, load: f64, name: &str, own: f64| {
            let rows = vec![default_row(load, 1.0, 20.0), measured(name, own, 0.5, 20.0)];
            Results { shards: vec![(number, 3)], ..results(rows) }
        };
        let merged = Results::merge(vec![
            ("a".into(), shard(3, 2.0, "one", 4.0)),
            // A machine of half the speed.
            ("b".into(), shard(1, 4.0, "two", 12.0)),
        ])
        .unwrap();
        let loads: Vec<(&str, f64)> =
            merged.rows.iter().map(|r| (r.name.as_str(), r.load().unwrap())).collect();
        assert_eq!(loads, [("default", 2.0), ("one", 4.0), ("two", 6.0)]);
        let times: Vec<(f64, f64)> =
            merged.rows.iter().map(|r| r.time.unwrap()).map(|t| (t.p50_us, t.p999_us)).collect();
        // Medians of 20 us for each per cent. Percentiles may stem from stalls, and are not scaled.
        assert_eq!(times, [(40.0, 60.0), (80.0, 120.0), (120.0, 360.0)]);
        assert_eq!((merged.shards.clone(), merged.missing_shards()), (vec![(1, 3), (3, 3)], vec![2]));
        let twice = Results::merge(vec![("a".into(), merged), ("b".into(), shard(3, 2.0, "one", 4.0))]);
        let said = twice.unwrap_err().to_string();
        assert!(said.contains("shard 3 of 3 is given twice"), "{said}");
    }

    #[test]
    fn shards_of_different_tradeoffs_are_refused() {
        let one = results(vec![default_row(1.0, 1.0, 20.0)]);
        let other = Results { digest: "another".into(), ..one.clone() };
        let e = Results::merge(vec![("a".into(), one.clone()), ("b".into(), other)]).unwrap_err();
        assert!(e.to_string().contains("another trade-off") && e.to_string().starts_with("b"), "{e}");
        let mut untimed = one.clone();
        untimed.rows[0].time = None;
        assert!(Results::merge(vec![("a".into(), one), ("b".into(), untimed)]).is_err());
        assert!(Results::merge(Vec::new()).is_err());
    }
}
