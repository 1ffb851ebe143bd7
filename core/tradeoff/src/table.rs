//! Results as comma-separated values.

use crate::figure::Figure;
use crate::markdown::reason;
use crate::results::Results;

/// Columns before and behind those of the figures.
const BEFORE_FIGURES: &str = "setting,graph,grids,default,baseline,tick_hz";
const AFTER_FIGURES: &str = "lag_10_ms,lag_50_ms,lag_90_ms,latency_ms,load_percent,\
    p50_us,p50_percent,p99_us,p99_percent,p999_us,p999_percent,max_us,max_percent,\
    stall_us,cold_us,misses,ticks,memory_kib,faults,cases,fails,error";

impl Results {
    /// A table with a line for each setting. Unknown values are empty.
    pub fn csv(&self) -> String {
        let name = |f: Figure| f.with_unit().to_lowercase().replace(' ', "_");
        let mut titles: Vec<String> = BEFORE_FIGURES.split(',').map(str::to_owned).collect();
        titles.extend(Figure::all().map(name));
        titles.extend(AFTER_FIGURES.split(',').map(str::to_owned));
        let mut lines = vec![titles];
        for row in &self.rows {
            let number = |x: Option<f64>| x.map_or(String::new(), |x| ((x * 1e4).round() / 1e4).to_string());
            let count = |x: Option<u64>| x.map_or(String::new(), |x| x.to_string());
            let mut line = vec![
                row.name.clone(),
                row.graph.clone(),
                row.grids.join("; "),
                row.default.to_string(),
                row.baseline.to_string(),
                row.tick_hz.to_string(),
            ];
            line.extend(Figure::all().map(|f| number(row.figure(f))));
            line.extend((0..3).map(|i| number(row.lag_ms.map(|l| l[i]))));
            line.push(number(row.latency_ms));
            let t = row.time;
            line.push(number(t.map(|t| t.load_percent)));
            for us in [t.map(|t| t.p50_us), t.map(|t| t.p99_us), t.map(|t| t.p999_us), t.map(|t| t.max_us)] {
                // And in per cent of a tick.
                line.extend([number(us), number(us.map(|us| us * f64::from(row.tick_hz) * 1e-4))]);
            }
            line.extend([number(t.map(|t| t.stall_us)), number(t.map(|t| t.cold_us))]);
            line.extend([count(t.map(|t| t.misses)), count(t.map(|t| t.ticks))]);
            line.push(number(t.and_then(|t| t.memory_kib)));
            line.extend([row.faults.to_string(), row.cases.to_string()]);
            line.push(row.fails.keys().cloned().collect::<Vec<_>>().join("; "));
            line.push(row.error.as_deref().map_or(String::new(), reason));
            lines.push(line);
        }
        let mut out = csv::Writer::from_writer(Vec::new());
        for line in lines {
            // Into memory, and all lines have as many fields: nothing can fail.
            let _ = out.write_record(line);
        }
        String::from_utf8(out.into_inner().unwrap_or_default()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::{measured, results, row};

    #[test]
    fn lines_have_equally_many_fields_and_texts_are_quoted() {
        let mut bad = row("a, \"b\"");
        bad.error = Some("line 1\nline 2".into());
        let csv = results(vec![measured("x", 2.0, 0.25, 20.0), bad]).csv();
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(csv.as_bytes());
        // The reader refuses lines of different lengths.
        let lines: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(lines.len(), 3);
        let at = |name: &str| lines[0].iter().position(|n| n == name).unwrap();
        for (line, column, want) in [
            (1, "level_db", "0.25"),
            (1, "pitch_ms", ""),
            (1, "p50_percent", "2"),
            (2, "setting", "a, \"b\""),
            (2, "error", "line 1 line 2"),
        ] {
            assert_eq!(&lines[line][at(column)], want);
        }
    }
}
