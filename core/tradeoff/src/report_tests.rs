use super::*;
use crate::testing::{default_row, measured, results, row};

fn in_grid(row: Row, grid: &str) -> Row {
    Row { grids: vec![grid.into()], ..row }
}

/// The report. Every line of a table has as many cells as the one before.
fn report_of(all: &Results) -> String {
    let report = all.report();
    let cells = |line: &str| line.replace("\\|", "").matches('|').count();
    let lines: Vec<&str> = report.lines().collect();
    for pair in lines.windows(2).filter(|p| p.iter().all(|l| l.starts_with('|'))) {
        assert_eq!(cells(pair[0]), cells(pair[1]), "{}\n{}", pair[0], pair[1]);
    }
    report
}

#[test]
fn report_names_choices_ties_and_failures() {
    let mut broken = row("broken");
    broken.error = Some("no such thing | as this".into());
    let report = report_of(&results(vec![
        in_grid(default_row(4.0, 1.0, 20.0), "g"),
        in_grid(measured("near", 4.04, 1.05, 20.5), "g"),
        in_grid(measured("better", 8.0, 0.5, 60.0), "g"),
        broken,
    ]));
    let line = |start: &str| report.lines().find(|l| l.starts_with(start)).unwrap_or("").to_owned();
    assert_eq!(line("| `better`"), "| `better` | 2.00 | 60.0 | 0.50 |");
    assert_eq!(line("| `near`"), "| `near` | = | = | = |");
    for (start, want) in [
        ("| `broken`", "no such thing \\| as this"),
        // 80 us and 120 us at the 99.9th percentile for the default, 160 and 240 for the better one.
        ("| 200 | any", "`default`"),
        ("| 500 | any | `better` | 8.00 | 160.0 / 240.0 | 0.0 | 60.0 |", ""),
        ("| 200 | 30 | `default`", ""),
        ("| level", "0.30 | 1.00 | 0.50 (`better`) | 0.20"),
    ] {
        assert!(line(start).contains(want), "{start}: {report}");
    }
}

#[test]
fn report_without_figures_has_whole_tables() {
    let mut all = results(vec![default_row(4.0, 1.0, 20.0)]);
    all.rows[0].figures.clear();
    let report = report_of(&all);
    assert!(report.contains("No figure is known: the setting with the lowest load."), "{report}");
    assert!(
        report.contains("| 200 | any | `default` |") && report.contains("| any | 30 | `default` |"),
        "{report}"
    );
    assert!(!report.contains("Where the model"), "{report}");
}

#[test]
fn only_drawn_pictures_are_linked() {
    let mut all = results(vec![default_row(4.0, 1.0, 20.0)]);
    all.rows[0].lag_ms = None;
    assert!(all.over_lag(Figure::Level).is_none() && all.over_time(Figure::Level).is_some());
    let report = report_of(&all);
    assert!(report.contains("(level_time.svg)") && !report.contains("_lag.svg"), "{report}");
}

#[test]
fn passed_reference_leaves_nothing_to_gain() {
    let mut all = results(vec![default_row(4.0, 0.2, 20.0)]);
    assert!(report_of(&all).contains("| level | 0.30 | 0.20 | 0.20 (`default`) | nothing |"));
    all.rows[0].figures.insert(Figure::Level, 0.35);
    assert!(report_of(&all).contains("(`default`) | nothing beyond noise |"));
}

#[test]
fn same_failure_of_many_settings_is_one_line() {
    let mut all = results(vec![default_row(4.0, 1.0, 20.0)]);
    for n in 0..20 {
        let error = Some("no material `canvsa` in l.ron (there are `a`, `b`, `c`)".into());
        all.rows.push(in_grid(Row { error, ..row(&format!("r{n}")) }, "g"));
    }
    all.notes = vec!["`rtpghi` is left out: no such kind".into()];
    let report = report_of(&all);
    assert_eq!(report.matches("canvsa").count(), 1, "{report}");
    assert!(!report.contains("there are `a`") && report.contains("and 12 more"), "{report}");
    assert!(report.contains("- `rtpghi` is left out: no such kind"), "{report}");
    assert!(!all.csv().contains("there are `a`"));
}

#[test]
fn differing_settings_of_a_grid_come_first_and_eight_are_shown() {
    let mut all = results(vec![default_row(100.0, 50.0, 20.0)]);
    all.rows.push(in_grid(measured("same", 100.0, 50.0, 20.0), "g"));
    for n in 0..30 {
        let x = f64::from(n + 1);
        all.rows.push(in_grid(measured(&format!("r{n}"), x, 40.0 - x, 20.0), "g"));
    }
    let report = report_of(&all);
    let knobs = report.split("### g").nth(1).unwrap();
    assert_eq!(knobs.lines().filter(|l| l.starts_with("| `r")).count(), MOST_LINES, "{report}");
    assert!(knobs.contains("23 more") && !knobs.contains("`same`"), "{report}");
}

/// Once, a `|` in a name split its cell, and `*` or `<b>` in one changed how the report looked.
#[test]
fn names_in_the_report_are_no_markup() {
    let mut all = results(vec![
        Row { name: "a|b`c*d".into(), ..default_row(4.0, 1.0, 20.0) },
        in_grid(measured("better", 8.0, 0.5, 60.0), "g *1* <b>"),
    ]);
    all.materials = vec!["felt_<i>|*x*".into()];
    all.tradeoff = "my|file`.ron".into();
    let report = report_of(&all);
    for want in
        ["a\\|b\\`c\\*d", "my\\|file\\`.ron", "### g \\*1\\* \\<b\\>", "materials: felt\\_\\<i\\>\\|\\*x\\*"]
    {
        assert!(report.contains(want), "{want}: {report}");
    }
}

#[test]
fn names_are_escaped_in_markdown() {
    for (escaped, want) in [
        (code("a_b*<c>"), "`a_b*<c>`"),
        (code("a|b`c\nd"), r"a\|b\`c d"),
        (plain(r"*a_ <b> [c](d) \#"), r"\*a\_ \<b\> \[c\](d) \\\#"),
        (message("no `a_b` in c_d"), r"no `a_b` in c\_d"),
        (message("no `a|b`, <c>"), r"no a\|b, \<c\>"),
        (message("no `a`b`"), r"no \`a\`b\`"),
        (cut("äöü", 3), "äöü"),
        (cut("äöü ß", 4), "äöü…"),
        (cut("a bcd", 3), "a…"),
        (reason("no material `x` in l.ron (there are `a`, `b`)"), "no material `x` in l.ron"),
        (reason("a\nb"), "a b"),
    ] {
        assert_eq!(escaped, want);
    }
    assert_eq!(reason(&"x".repeat(999)).chars().count(), REASON);
}

#[test]
fn csv_has_as_many_fields_a_line_and_quoted_texts() {
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
        (1, "ticks", "1000"),
        (2, "setting", "a, \"b\""),
        (2, "error", "line 1 line 2"),
    ] {
        assert_eq!(&lines[line][at(column)], want);
    }
}
