//! Merges the results of shards.

use std::collections::BTreeSet;

use asperity_diagnostics::Diagnostic;

use crate::noise;
use crate::results::Results;

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
        noise::find_floors(&mut merged);
        Ok(merged)
    }
}

/// Adds what is not there yet.
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
