//! The result as text, JSON, CSV and picture.

use std::collections::BTreeMap;

use asperity_accuracy::accuracy::Rhythm;
use asperity_accuracy::accuracy::rhythm::{self as agreement, RhythmAgreement};
use asperity_plot::{Column, Dots};
use serde_json::{Value, json};

use super::contest::{Outcome, Row, rhythm_json};
use super::vectors::{Score, Set, Vector};

/// The result as text: accuracy, rhythm and cost of each method, then remarks.
pub fn text(set: &Set, outcome: &Outcome, published: &[Row]) -> String {
    let (smooth, from) = (set.smoothest().short_name(), &set.from);
    let rows = outcome.rows.as_slice();
    let mut out = format!(
        "Spectral convergence in dB, less is better; methods by their mean rank. Vectors: {from}.\n\
         Level and LTAS (rms error of the long-term spectrum) in dB on {smooth}, \
         the smoothest over frequency,\n\
         where convergence says little and both should be near 0.\n\n"
    );
    let one_rate = set.rates().len() == 1;
    let rate = |v: &Vector| if one_rate { String::new() } else { format!("{} Hz", v.rate_hz) };
    let mut heads: Vec<[String; 2]> =
        set.vectors.iter().map(|v| [v.short_name().to_owned(), rate(v)]).collect();
    heads.extend(["level", "LTAS"].map(|head| [head.to_owned(), String::new()]));
    out += &table(&heads, &[("", rows), ("published", published)], |row| {
        let convergence = |v| {
            row.score(v).map_or("-".into(), |s: Score| {
                let mark = if s.faults > 0 { "!" } else { "" };
                format!("{mark}{}", number(s.convergence_db, 1))
            })
        };
        let smooth = row.score(set.smoothest());
        let heard = smooth.and_then(Score::heard);
        let level = if smooth.is_some() && heard.is_none() {
            "silent".to_owned()
        } else {
            heard.map_or("-".into(), |s| format!("{:+.2}", (s.level_db * 100.0).round() / 100.0 + 0.0))
        };
        let ltas = heard.map_or("-".into(), |s| number(s.ltas_rms_db, 2));
        set.vectors.iter().map(convergence).chain([level, ltas]).collect()
    });
    if let Some(noise) = outcome.noise {
        out += &format!(
            "\nRhythm on the mean spectrum of {smooth}, held still for 8 s: \
             a texture at constant speed and force.\n\
             Pulses: modulation depth of the envelope from 15 to 25 Hz. \
             Repetition: largest autocorrelation of the\n\
             envelope or the wave at lags of 20 to 200 ms.\n\
             The target is the value of Gaussian noise with the same spectrum.\n\n"
        );
        let fair = [Row { rhythm: Some(noise), ..Row::new("Gaussian noise", set) }];
        let heads = ["pulses", "repetition", "kurtosis"].map(|head| [head.to_owned(), String::new()]);
        out += &table(&heads, &[("", rows), ("for comparison", &fair)], |row| {
            let figures = row.rhythm.map(|r| [(r.pulses(), 2), (r.repetition(), 2), (r.kurtosis, 1)]);
            figures.map_or(vec!["-".into(); 3], |all| all.map(|(x, decimals)| number(x, decimals)).into())
        });
    }
    out += "\nResponse lag: ms from a step of 12 dB in the magnitudes \
            until the output is 10, 50, 90 % of the way there.\n\
            Added latency: ms as declared; early where negative. \
            us/frame: median until there are samples, overlap_add\n\
            included where the node answers spectra; \
            N is the window's length, and a frame has the vectors' bins.\n\n";
    let lag = |name: &'static str| ["10 %", "50 %", "90 %"].map(|share| [name.to_owned(), share.to_owned()]);
    let mut heads = [lag("texture"), lag("tone")].concat();
    heads.push(["added".into(), "latency".into()]);
    heads.extend(set.rates().iter().map(|rate| ["us/frame".into(), format!("N = {}", rate / 10)]));
    out += &table(&heads, &[("", rows)], |row| {
        let lags = row.lag_ms.values();
        let mut cells: Vec<String> = lags
            .flat_map(|lag| lag.map_or(vec!["-".into(); 3], |ms| ms.map(|ms| number(ms, 1)).into()))
            .collect();
        let latency = row.latency_ms.map_or("-".into(), |ms| number(ms, 1));
        cells.push(if row.offline { "offline".into() } else { latency });
        let us = |rate: &u32| row.us_a_frame.get(rate).map_or("-".into(), |us| format!("{us:.1}"));
        cells.extend(set.rates().iter().map(us));
        cells
    });
    let notes: String =
        rows.iter().flat_map(|r| r.notes.iter().map(move |n| format!("  {}: {n}\n", r.label))).collect();
    if !notes.is_empty() {
        out += &format!("\nnotes (! marks a score of a run in which the node failed)\n{notes}");
    }
    let cited = references(published);
    if !cited.is_empty() {
        out += "\nreferences of the published methods\n";
    }
    for (number, text) in cited {
        out += &folded(&format!("[{number}] {text}"), 6);
    }
    out
}

/// The references of published rows, by their numbers.
fn references(published: &[Row]) -> BTreeMap<usize, &str> {
    let cited = published.iter().filter_map(|row| row.reference.as_ref());
    cited.map(|cited| (cited.number, cited.text.as_str())).collect()
}

/// A text in lines of at most 100 characters; those behind the first are indented.
fn folded(text: &str, indent: usize) -> String {
    let (mut out, mut line) = (String::new(), "  ".to_owned());
    for word in text.split(' ') {
        if line.chars().count() + word.chars().count() > 100 {
            out += &format!("{}\n", line.trim_end());
            line = " ".repeat(indent);
        }
        line += word;
        line.push(' ');
    }
    out + line.trim_end() + "\n"
}

/// A number without a negative zero.
fn number(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    let zero = text.trim_start_matches('-').chars().all(|c| matches!(c, '0' | '.'));
    if zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Groups of rows under two lines of heading, labels first.
fn table(heads: &[[String; 2]], groups: &[(&str, &[Row])], cells: impl Fn(&Row) -> Vec<String>) -> String {
    let head = |i: usize| (String::new(), heads.iter().map(|h| h[i].clone()).collect::<Vec<_>>());
    let mut lines = vec![head(0), head(1)];
    for (group, rows) in groups.iter().filter(|(_, rows)| !rows.is_empty()) {
        if !group.is_empty() {
            lines.push(((*group).to_owned(), Vec::new()));
        }
        lines.extend(rows.iter().map(|row| {
            let note = match row.latency_ms {
                _ if group.is_empty() => return (row.label.clone(), cells(row)),
                _ if row.offline => ", offline".into(),
                Some(ms) if ms != 0.0 => format!(", {ms:+.0} ms"),
                _ => String::new(),
            };
            (format!("  {}{note}", row.label), cells(row))
        }));
    }
    let longest =
        |texts: &mut dyn Iterator<Item = &String>| texts.map(|t| t.chars().count()).max().unwrap_or(0);
    let first = longest(&mut lines.iter().map(|(label, _)| label));
    let widths: Vec<usize> =
        (0..heads.len()).map(|i| longest(&mut lines.iter().filter_map(|(_, cells)| cells.get(i)))).collect();
    let line = |(label, cells): &(String, Vec<String>)| {
        let cells: String =
            cells.iter().zip(&widths).map(|(cell, width)| format!("  {cell:>width$}")).collect();
        format!("{label:first$}{cells}").trim_end().to_owned() + "\n"
    };
    lines.iter().map(line).filter(|line| line != "\n").collect()
}

/// The result as JSON.
pub fn json(set: &Set, outcome: &Outcome, published: &[Row]) -> Value {
    let vector = |v: &Vector| {
        let layout = v.frames.layout();
        json!({
            "name": v.name, "rate_hz": v.rate_hz, "window": layout.length, "bins": layout.bins,
            "frames": v.frames.count(), "roughness": v.roughness(),
        })
    };
    json!({
        "vectors": set.vectors.iter().map(vector).collect::<Vec<_>>(), "smoothest": set.smoothest().name,
        "noise": rhythm_json(outcome.noise), "methods": outcome.rows, "published": published,
    })
}

/// The result as CSV: a line for each method and vector. Figures of the method alone are repeated.
pub fn csv(set: &Set, outcome: &Outcome, published: &[Row]) -> String {
    const HEADER: &str = "\
        method,kind,published,vector,rate_hz,convergence_db,level_db,ltas_rms_db,faults,latency_ms,offline,\
        lag_texture_10_ms,lag_texture_50_ms,lag_texture_90_ms,lag_tone_10_ms,lag_tone_50_ms,lag_tone_90_ms,\
        us_a_frame,pulses,repetition,kurtosis,noise_pulses,noise_repetition,noise_kurtosis,notes,reference\n";
    // A number to a ten-thousandth; nothing where there is none.
    let cell = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:.4}"));
    let rhythm = |r: Option<Rhythm>| {
        [cell(r.map(|r| r.pulses())), cell(r.map(|r| r.repetition())), cell(r.map(|r| r.kurtosis))]
    };
    let rows = outcome.rows.iter().map(|r| (r, false)).chain(published.iter().map(|r| (r, true)));
    let mut lines = csv::Writer::from_writer(Vec::new());
    for (row, published) in rows {
        for vector in &set.vectors {
            let score = row.score(vector);
            let mut cells = vec![
                row.label.clone(),
                row.kind.clone().unwrap_or_default(),
                published.to_string(),
                vector.name.clone(),
                vector.rate_hz.to_string(),
                cell(score.map(|s| s.convergence_db)),
                cell(score.map(|s| s.level_db)),
                cell(score.map(|s| s.ltas_rms_db)),
                score.map_or(0, |s| s.faults).to_string(),
                cell(row.latency_ms),
                row.offline.to_string(),
            ];
            cells.extend(row.lag_ms.values().flat_map(|lag| (0..3).map(|i| cell(lag.map(|l| l[i])))));
            cells.push(cell(row.us_a_frame.get(&vector.rate_hz).copied()));
            cells.extend(rhythm(row.rhythm).into_iter().chain(rhythm(outcome.noise)));
            cells.push(row.notes.join("; "));
            cells.push(row.reference.as_ref().map_or(String::new(), |cited| cited.text.clone()));
            // Nothing fails in memory.
            let _ = lines.write_record(cells);
        }
    }
    HEADER.to_owned() + &String::from_utf8_lossy(&lines.into_inner().unwrap_or_default())
}

/// The result as a picture, with published scores as ticks.
pub fn svg(set: &Set, outcome: &Outcome, published: &[Row]) -> String {
    let rows = outcome.rows.as_slice();
    let column = |name: &str, unit: &str, decimals, of: &dyn Fn(&Row) -> Vec<f64>| Column {
        name: name.into(),
        unit: unit.into(),
        decimals,
        logarithmic: false,
        values: rows.iter().map(of).collect(),
        others: Vec::new(),
    };
    let scored = |name, unit: &str, decimals, vector, of: fn(Score) -> Option<f64>| {
        let value = |row: &Row| row.score(vector).and_then(of);
        let others = published.iter().filter_map(|r| Some((r.label.clone(), value(r)?))).collect();
        Column { others, ..column(name, unit, decimals, &|row| Vec::from_iter(value(row))) }
    };
    let unit =
        |v: &Vector| if set.rates().len() == 1 { "dB".into() } else { format!("dB, {} Hz", v.rate_hz) };
    let convergence =
        set.vectors.iter().map(|v| scored(v.short_name(), &unit(v), 1, v, |s| Some(s.convergence_db)));
    let smooth = set.smoothest();
    let on = |unit: &str| format!("{unit} on {}", smooth.short_name());
    let lag = |row: &Row, name: &str| row.lag_ms.get(name).copied().flatten().map_or(Vec::new(), Vec::from);
    let mut cost = vec![
        scored("level error", &on("|dB|"), 2, smooth, |s| Some(s.heard()?.level_db.abs())),
        scored("LTAS error", &on("rms dB"), 2, smooth, |s| Some(s.heard()?.ltas_rms_db)),
        column("lag of a texture", "ms, 10 to 90 %", 1, &|row| lag(row, "texture")),
        column("lag of a tone", "ms, 10 to 90 %", 1, &|row| lag(row, "tone")),
        column("added latency", "ms", 1, &|row| Vec::from_iter(row.latency_ms)),
    ];
    cost.extend(set.rates().into_iter().map(|rate| {
        let us = |row: &Row| Vec::from_iter(row.us_a_frame.get(&rate).copied().filter(|us| *us > 0.0));
        Column { logarithmic: true, ..column("us a frame", &format!("median, N = {}", rate / 10), 1, &us) }
    }));
    let mut groups = vec![
        ("Spectral convergence, less is better".to_owned(), convergence.collect()),
        ("Level, response and cost".to_owned(), cost),
    ];
    if let Some(noise) = outcome.noise {
        let rhythm = |name, unit: &str, decimals, figure: fn(RhythmAgreement) -> f64| {
            let off = |row: &Row| Some(figure(agreement::compare(&row.rhythm?, &[noise]).ok()?));
            column(name, unit, decimals, &|row| Vec::from_iter(off(row)))
        };
        let rhythm = vec![
            rhythm("pulses", "15 to 25 Hz, |dB|", 1, |a| a.pulses_db.abs()),
            rhythm("repetition", "0 to 1", 2, |a| a.repetition),
            rhythm("kurtosis", "|dB|", 1, |a| a.kurtosis_db),
        ];
        groups.push(("Rhythm on steady magnitudes, off that of Gaussian noise".to_owned(), rhythm));
    }
    let subtitles = vec![
        format!("Vectors: {}. Methods by their mean rank in spectral convergence.", set.from),
        "Orange: least of its column. Level and LTAS on the vector smoothest over frequency, \
         where convergence says little."
            .into(),
    ];
    let labels = rows.iter().map(|r| r.label.clone()).collect();
    let title = "Phase retrieval compared".into();
    let notes = references(published).into_iter().map(|(number, text)| {
        let of = published.iter().filter(|row| row.reference.as_ref().is_some_and(|r| r.number == number));
        let names: Vec<&str> = of.filter_map(|row| row.label.split(' ').next()).collect();
        format!("[{number}] {}: {text}", names.join(", "))
    });
    let notes = (!published.is_empty()).then(|| "Published:".to_owned()).into_iter().chain(notes).collect();
    Dots { title, subtitles, rows: labels, others: "published".into(), groups, notes }.to_svg()
}
