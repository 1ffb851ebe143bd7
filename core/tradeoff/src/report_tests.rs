use crate::figure::Figure;
use crate::result::Row;
use crate::testing::{measured, results, row};

#[test]
fn the_report_says_what_to_take_and_what_cannot_be_told_apart() {
    let mut default = measured("default", 4.0, 1.0, 20.0);
    default.default = true;
    default.grids = vec!["g".into()];
    let mut near = measured("near", 4.04, 1.05, 20.5);
    near.grids = vec!["g".into()];
    let mut better = measured("better", 8.0, 0.5, 60.0);
    better.grids = vec!["g".into()];
    let mut broken = row("broken");
    broken.error = Some("no such thing | as this".into());
    let report = results(vec![default, near, better, broken]).report();
    let line = |start: &str| report.lines().find(|l| l.starts_with(start)).unwrap_or("").to_owned();
    assert_eq!(line("| `better`"), "| `better` | 2.00 | 60.0 | 0.50 |");
    assert_eq!(line("Not told apart from it"), "Not told apart from it: `near`.");
    assert!(line("| `broken`").contains("no such thing \\| as this"), "{report}");
    // 80 us and 120 us at the 99.9th percentile for the default, 160 and 240 for the better one.
    assert!(line("| 200 | any").contains("`default`"), "{report}");
    assert!(line("| 500 and more | any").contains("`better`"), "{report}");
    assert!(line("| 200 and more | 30").contains("`default`"), "{report}");
    assert!(line("| level").contains("0.30 | 1.00 | 0.50 (`better`) | 0.20"), "{report}");
}

/// Every line of a table has as many cells as the one before.
fn whole(report: &str) {
    let cells = |line: &str| line.replace("\\|", "").matches('|').count();
    let lines: Vec<&str> = report.lines().collect();
    for pair in lines.windows(2).filter(|p| p.iter().all(|l| l.starts_with('|'))) {
        assert_eq!(cells(pair[0]), cells(pair[1]), "{}\n{}", pair[0], pair[1]);
    }
}

#[test]
fn of_no_figures_tables_are_whole_and_nothing_is_said_of_an_order() {
    let mut all = results(vec![Row { default: true, ..measured("default", 4.0, 1.0, 20.0) }]);
    all.rows[0].figures.clear();
    let report = all.report();
    whole(&report);
    assert!(report.contains("No figure is known: the cheapest."), "{report}");
    assert!(report.contains("| 200 and more | any, 30 | `default` |"), "{report}");
    assert!(!report.contains("Where the model"), "{report}");
}

#[test]
fn budgets_are_one_line_where_they_are_neighbours_and_buy_the_same() {
    // 24 us at the 99.9th percentile, and 120 us, of which 2 are the machine's own.
    let mut all = results(vec![
        Row { default: true, ..measured("dear", 4.0, 0.5, 20.0) },
        measured("cheap", 0.8, 1.0, 60.0),
    ]);
    all.rows[1].time = all.rows[1].time.map(|t| crate::Time { stall_us: 2.0, ..t });
    let report = all.report();
    whole(&report);
    let starts = |text: &str| report.lines().filter(|l| l.starts_with(text)).count();
    assert_eq!(starts("| 50 to 100 | any | `cheap` |"), 1, "{report}");
    // What of the 99.9th percentile the machine stalled stands beside it.
    assert_eq!(starts("| 50 to 100 | any | `cheap` | 0.80 | 16.0 / 24.0 | 2.0 | 60.0 |"), 1, "{report}");
    // It is soon enough for the shorter lag, too.
    assert_eq!(starts("| 200 and more | any, 30 | `dear` |"), 1, "{report}");
    assert_eq!(super::range(&[None]), "any");
}

#[test]
fn only_pictures_that_there_are_are_linked() {
    let mut all = results(vec![Row { default: true, ..measured("default", 4.0, 1.0, 20.0) }]);
    all.rows[0].lag_ms = None;
    assert!(all.against_lag(Figure::Level).is_none() && all.against_time(Figure::Level).is_some());
    let report = all.report();
    assert!(report.contains("(level_time.svg)") && !report.contains("_lag.svg"), "{report}");
}

#[test]
fn where_the_reference_is_passed_nothing_is_left_to_win() {
    let mut all = results(vec![Row { default: true, ..measured("default", 4.0, 0.2, 20.0) }]);
    assert!(all.report().contains("| level | 0.30 | 0.20 | 0.20 (`default`) | nothing left to win |"));
    all.rows[0].figures.insert(Figure::Level, 0.35);
    assert!(all.report().contains("(`default`) | nothing that is told apart |"));
}

#[test]
fn what_many_fail_alike_is_said_once_without_its_list_of_names_and_notes_are_told() {
    let mut all = results(vec![Row { default: true, ..measured("default", 4.0, 1.0, 20.0) }]);
    for n in 0..20 {
        let error = Some("no material `canvsa` in l.ron (there are `a`, `b`, `c`)".into());
        all.rows.push(Row { error, grids: vec!["g".into()], ..row(&format!("r{n}")) });
    }
    all.notes = vec!["`rtpghi` is left out: no such kind".into()];
    let report = all.report();
    whole(&report);
    assert_eq!(report.matches("canvsa").count(), 1, "{report}");
    assert!(!report.contains("there are `a`") && report.contains("and 12 more"), "{report}");
    assert!(report.contains("- `rtpghi` is left out: no such kind"), "{report}");
    assert!(!all.csv().contains("there are `a`"));
}

#[test]
fn no_table_has_more_than_eight_lines() {
    let mut all = results(vec![Row { default: true, ..measured("default", 100.0, 50.0, 20.0) }]);
    for n in 0..30 {
        let x = f64::from(n + 1);
        all.rows.push(Row { grids: vec!["g".into()], ..measured(&format!("r{n}"), x, 40.0 - x, 20.0) });
    }
    all.floor.insert(Figure::Level, 0.01);
    let report = all.report();
    whole(&report);
    let mut length = 0;
    for line in report.lines() {
        length = if line.starts_with('|') { length + 1 } else { 0 };
        // A head, what is below it, and budgets: two lags.
        assert!(length <= 2 + 14, "{report}");
    }
    let knobs = report.split("### g").nth(1).unwrap();
    assert_eq!(knobs.lines().filter(|l| l.starts_with("| `r")).count(), super::MOST_LINES, "{report}");
    assert!(knobs.contains("22 more"), "{report}");
}

/// Once, a `|` in a name split its cell, and `*` or `<b>` in one changed how the report looked.
#[test]
fn names_in_the_report_are_no_markup() {
    let mut default = measured("a|b`c*d", 4.0, 1.0, 20.0);
    default.default = true;
    let mut other = measured("better", 8.0, 0.5, 60.0);
    other.grids = vec!["g *1* <b>".into()];
    let mut all = results(vec![default, other]);
    all.materials = vec!["felt_<i>|*x*".into()];
    all.study = "my|study`.ron".into();
    let report = all.report();
    whole(&report);
    assert!(report.contains("a\\|b\\`c\\*d") && report.contains("my\\|study\\`.ron"), "{report}");
    assert!(report.contains("### g \\*1\\* \\<b\\>"), "{report}");
    assert!(report.contains("materials: felt\\_\\<i\\>\\|\\*x\\*"), "{report}");
}
