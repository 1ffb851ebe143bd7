//! Results as a table of comma-separated values.

use std::fmt::Write as _;

use crate::figure::Figure;
use crate::result::Results;
use crate::short::reason;

impl Results {
    /// A line for each setting, under one of names; what is not known is empty.
    pub fn csv(&self) -> String {
        let mut out = String::from("setting,graph,grids,default,mark,tick_hz");
        for figure in Figure::ALL {
            let unit = figure.unit().to_lowercase();
            let unit = if unit.is_empty() { unit } else { format!("_{unit}") };
            let _ = write!(out, ",{}{unit}", figure.name());
        }
        out += ",lag_10_ms,lag_50_ms,lag_90_ms,latency_ms,load_percent,p50_us,p50_percent,p99_us,p99_percent,p999_us,p999_percent,max_us,max_percent,\
                stall_us,cold_us,misses,ticks,memory_kib,faults,cases,fails,error\n";
        for row in &self.rows {
            let grids = row.grids.join("; ");
            let _ = write!(
                out,
                "{},{},{},{},{},{}",
                field(&row.name),
                field(&row.graph),
                field(&grids),
                row.default,
                row.mark,
                row.tick_hz
            );
            let number = |out: &mut String, x: Option<f64>| {
                let _ = match x {
                    Some(x) => write!(out, ",{}", (x * 1e4).round() / 1e4),
                    None => write!(out, ","),
                };
            };
            Figure::ALL.into_iter().for_each(|f| number(&mut out, row.figure(f)));
            (0..3).for_each(|i| number(&mut out, row.lag_ms.map(|l| l[i])));
            number(&mut out, row.latency_ms);
            let t = row.time;
            number(&mut out, t.map(|t| t.load_percent));
            for us in [t.map(|t| t.p50_us), t.map(|t| t.p99_us), t.map(|t| t.p999_us), t.map(|t| t.max_us)] {
                number(&mut out, us);
                // Of a tick, in per cent.
                number(&mut out, us.map(|us| us * f64::from(row.tick_hz) * 1e-4));
            }
            number(&mut out, t.map(|t| t.stall_us));
            number(&mut out, t.map(|t| t.cold_us));
            let count = |x: Option<u64>| x.map_or(String::new(), |x| x.to_string());
            let _ = write!(out, ",{},{}", count(t.map(|t| t.misses)), count(t.map(|t| t.ticks)));
            number(&mut out, t.and_then(|t| t.memory_kib));
            let fails: Vec<&str> = row.fails.keys().map(String::as_str).collect();
            let error = row.error.as_deref().map_or(String::new(), reason);
            let _ =
                writeln!(out, ",{},{},{},{}", row.faults, row.cases, field(&fails.join("; ")), field(&error));
        }
        out
    }
}

/// A field, in quotes where it needs them.
fn field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::{measured, results, row};

    #[test]
    fn every_line_has_as_many_fields_as_the_first_and_texts_are_quoted() {
        let mut bad = row("a, \"b\"");
        bad.error = Some("line 1\nline 2".into());
        let csv = results(vec![measured("x", 2.0, 0.25, 20.0), bad]).csv();
        let mut reader = Vec::new();
        let mut fields = vec![String::new()];
        let mut quoted = false;
        for c in csv.chars() {
            match c {
                '"' => quoted = !quoted,
                ',' if !quoted => fields.push(String::new()),
                '\n' if !quoted => reader.push(std::mem::replace(&mut fields, vec![String::new()])),
                c => fields.last_mut().unwrap().push(c),
            }
        }
        assert_eq!(reader.len(), 3);
        assert!(reader.iter().all(|line| line.len() == reader[0].len()), "{reader:?}");
        let at = |name: &str| reader[0].iter().position(|n| n == name).unwrap();
        assert_eq!(reader[1][at("level_db")], "0.25");
        assert_eq!(reader[1][at("pitch_ms")], "");
        assert_eq!(reader[1][at("p50_percent")], "2");
        assert_eq!(reader[2][at("error")], "line 1 line 2");
    }
}
