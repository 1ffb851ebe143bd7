//! Every bad file is refused at its cell.

use super::super::table::MOST_CELLS;
use super::*;
use proptest::prelude::*;

fn parse(text: &str) -> Result<Trajectory, Diagnostic> {
    Trajectory::parse(&Source::new("t.csv", text), &TrajectoryOptions::default())
}

const H: &str = "t_s,x_mm,y_mm,z_mm\n";

#[test]
fn columns_in_any_order_comments_blanks_quotes_and_line_ends() {
    let text = "# from a device\r\n\r\n z_mm ,\"t_s\",force_n,y_mm,x_mm\r\n#c,1,2\r\n3,0,0.5,2,1\r\n\
                \x20 \r\n\n\x20-1 , \"0.01\" ,1.5,5,4\r\n  # tail";
    let t = parse(text).unwrap();
    assert_eq!((t.rows(), t.duration_s()), (2, 0.01));
    let s = t.sample(0.0);
    assert_eq!((s.position, s.force, s.speed), ([1.0, 2.0, 3.0], Some(0.5), None));
    assert_eq!(t.sample(1.0).position, [4.0, 5.0, -1.0]);
}

fn mapped(text: &str, map: &[&str]) -> Result<Trajectory, Diagnostic> {
    let options = TrajectoryOptions { columns: ColumnMap::parse(map)?, ..Default::default() };
    Trajectory::parse(&Source::new("t.csv", text), &options)
}

/// The same stroke in every way that it may be written.
#[test]
fn separators_marks_and_headers_are_found_out() {
    for text in [
        "t_s,x_mm,y_mm,z_mm\n0,1.5,0,-1\n0.01,2.5,0,-2\n",
        // NumPy: savetxt(header="t_s,x_mm,y_mm,z_mm"), with and without delimiter=",".
        "# made by NumPy, as it is\n# t_s,x_mm,y_mm,z_mm\n0.000000000000000000e+00 1.5e+00 0e+00 -1e+00\n\
         1e-02 2.5e+00 0e+00 -2e+00\n",
        "#t_s x_mm y_mm z_mm\n0.0,1.5,0.0,-1.0\n0.01,2.5,0.0,-2.0\n# a tail\n",
        "% t_s\tx_mm\ty_mm\tz_mm\n0 1.5 0 -1\n0.01 2.5 0 -2\n",
        "\ty_mm\tx_mm\tz_mm\tt_s\tnote\r\n0\t0\t1.5\t-1\t0\ta, b; c\r\n1\t0\t2.5\t-2\t0.01\t\r\n",
        "t_s;x_mm;y_mm;z_mm\n0;1,5;0;-1\n0,01;2,5;0;-2\n",
        "\"t_s\"; \"x_mm\"; \"y_mm\"; \"z_mm\"\n0; 1.5; 0; -1\n0.01; 2.5; 0; -2",
        "t_s\tx_mm\ty_mm\tz_mm\n0,000\t1,500\t0,000\t-1,000\n0,010\t2,500\t0,000\t-2,000\n",
        "  t_s   x_mm y_mm z_mm\n0    1,5 0 -1\n0,01 2,5 0 -2\n",
        "t_s x_mm y_mm z_mm\n0, 1.5, 0, -1\n0.01, 2.5, 0, -2\n",
        "t_s;x_mm;y_mm;z_mm;\n0;1.5;0;-1;\n0.01;2.5;0;-2\n",
    ] {
        let t = parse(text).unwrap_or_else(|e| panic!("{text}: {e}"));
        let ends = [0.0, 1.0].map(|at| t.sample(at).position);
        assert_eq!((ends, t.duration_s()), ([[1.5, 0.0, -1.0], [2.5, 0.0, -2.0]], 0.01), "{text}");
    }
    let t = parse("t_s,x_mm,y_mm,z_mm,,Fx\n0,0,0,0,a,b\n1,0,0,0,,\n").unwrap();
    assert_eq!(t.ignored(), ["Fx"]);
}

#[test]
fn map_finds_columns_and_converts_their_units() {
    let text = "Time (ms);x_mm;X;Fz:raw\n0;9;0,1;-500\n10;9;0,2;-1500\n";
    let t = mapped(text, &["t_s=Time (ms):ms", "x_mm = X : m", "y_mm=x_mm", "force_n=-Fz:raw:mN"]).unwrap();
    let ends = [0.0, 1.0].map(|at| (t.sample(at).position, t.sample(at).force));
    assert_eq!(ends, [([100.0, 9.0, -1.0], Some(0.5)), ([200.0, 9.0, -3.0], Some(1.5))]);
    assert_eq!((t.duration_s(), t.ignored()), (0.01, &[][..]));
    // A file without names.
    let t = mapped("0 5 1\n1000 6 2\n", &["t_s=1:\u{b5}s", "speed_mm_s=2:cm/s", "force_n=3:kgf"]).unwrap();
    assert_eq!((t.sample(0.0).speed, t.duration_s()), (Some(50.0), 1e-3));
    assert_eq!(t.sample(0.0).force, Some(9.80665));
    for (map, want) in [
        (&["force_n"][..], "`force_n` names no column (force_n=Fz:N)"),
        (&["forc=Fz"], "no column is called `forc` here"),
        (&["t_s=a", "time_s=b"], "`time_s` is mapped twice"),
        (
            &["force_n=Fy:N"],
            "t.csv:1:24: `force_n` is mapped to `Fy`, and the file has no such column (there",
        ),
        (&["x_mm=X:N"], "t.csv:1:24: `x_mm` cannot be in `N` (its units are mm, m, cm, um)"),
        (
            &["x_mm=x_mm:m", "y_mm=X", "t_s=Time (ms)", "force_n=Fz:raw:kN"],
            "t.csv:2:9: `Fz:raw` (`force_n`) is",
        ),
    ] {
        let e = mapped(text, map).unwrap_err().to_string();
        assert!(e.starts_with(want), "{e}\n  want {want}");
    }
}

#[test]
fn force_stands_for_depth_and_speed_for_the_way() {
    let t = parse("t_s,speed_mm_s,force_n\n5,100,1\n5.1,200,2\n5.2,0,-1\n").unwrap();
    let found = [0.0, 0.1, 0.2].map(|at| t.sample(at).position);
    for (found, want) in found.into_iter().zip([[0.0, 0.0, -2.0], [15.0, 0.0, -4.0], [25.0, 0.0, 0.0]]) {
        assert!(found.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}, not {want:?}");
    }
    assert!(t.has_force() && t.has_speed());
    let t = parse("t_s,x_mm,y_mm,force_n,speed_mm_s\n0,1,2,0.5,9\n1,3,4,0.5,9\n").unwrap();
    assert_eq!(t.sample(1.0).position, [3.0, 4.0, -1.0]);
}

#[test]
fn the_axis_map_turns_positions() {
    let options = TrajectoryOptions { axes: AxisMap::parse("x,-z,y").unwrap(), ..Default::default() };
    let t = Trajectory::parse(&Source::new("t.csv", format!("{H}0,1,2,3\n0.01,4,5,6\n")), &options).unwrap();
    assert_eq!(t.sample(0.0).position, [1.0, -3.0, 2.0]);
    assert_eq!(t.sample(1.0).position, [4.0, -6.0, 5.0]);
}

#[test]
fn bad_files_are_refused_at_the_cell() {
    let two = "0,0,0,0\n0.01,0,0,0\n";
    let cases: &[(String, &str)] = &[
        (String::new(), "t.csv:1:1: no header line"),
        ("# only this\n\n".into(), "t.csv:3:1: no header line"),
        (format!("t_s,x_mm,z_mm\n{two}"), "t.csv:1:14: the column `y_mm` is missing"),
        (
            format!("#c\nt_s,x_mm,y_mm,z_m\n{two}"),
            "t.csv:2:18: the column `z_mm` is missing (`force_n` may stand for `z_mm`; the file has `t_s`, \
             `x_mm`, `y_mm`, `z_m`; name the right ones, such as --map z_mm=z_m:m)",
        ),
        (
            "time_ms;Pos X [m];y_mm;Fz [mN]\n0;0;0;0\n1;0;0;0\n".into(),
            "t.csv:1:31: the columns `t_s`, `x_mm` and `z_mm` are missing (`force_n` may stand for `z_mm`; \
             the file has `time_ms`, `Pos X [m]`, `y_mm`, `Fz [mN]`; name the right ones, such as \
             --map t_s=time_ms:ms --map \"x_mm=Pos X [m]:m\" --map \"z_mm=Fz [mN]:mm\")",
        ),
        (
            "t_s,speed_mm_s\n0,0\n".into(),
            "t.csv:1:15: the column `z_mm` is missing (`force_n` may stand for `z_mm`; the file has `t_s`, \
             `speed_mm_s`)",
        ),
        (
            format!("0,0,0,0\n{two}"),
            "t.csv:1:8: the columns `t_s`, `x_mm`, `y_mm` and `z_mm` are missing (`speed_mm_s` alone is a \
             straight line; `force_n` may stand for `z_mm`; the file has `1`, `2`, `3`, `4`; name the right \
             ones, such as --map t_s=1:s --map x_mm=2:mm --map y_mm=3:mm --map z_mm=4:mm)",
        ),
        ("t_s;x_mm;y_mm;z_mm\n0;0;0;0\n0,1;0;1.5;0\n".into(), "t.csv:3:7: both `0,1` and `1.5` as numbers"),
        ("t_s;x_mm;y_mm;z_mm\n0;0;0;1.234,5\n".into(), "t.csv:2:7: `1.234,5` has a comma and a point"),
        ("t_s;x_mm;y_mm;z_mm\n1;0;0;0\n2;1,234;0;0\n".into(), "t.csv:3:3: `1,234` may be 1234 or 1.234"),
        ("t_s,x_mm,y_mm,z_mm\n0,0 1,5 0 0\n".into(), "t.csv:2:12: a row of 3 cells under a header of 4"),
        (format!("t_s,x_mm,y_mm,z_mm,x_mm\n{two}"), "t.csv:1:20: the column `x_mm` is there twice"),
        (H.into(), "t.csv:2:1: a trajectory with no rows"),
        (format!("{H}0,0,0,0\n"), "t.csv:3:1: a trajectory with only one row"),
        (format!("{H}0,0,0\n"), "t.csv:2:6: a row of 3 cells under a header of 4"),
        (format!("{H}0,0,0,0,7\n"), "t.csv:2:9: a row of 5 cells under a header of 4"),
        (format!("{H}0,0,0,0\n0.01,0,abc,0\n"), "t.csv:3:8: `y_mm` is `abc`, which is not a number"),
        (format!("{H}0,0,0,0\n0.01,0,1e,0\n"), "t.csv:3:8: `y_mm` is `1e`, which is not a number"),
        (format!("{H}0,0,0,0\n0.01, ,0,0\n"), "t.csv:3:7: `x_mm` is empty"),
        (format!("{H}0,0,NaN,0\n"), "t.csv:2:5: `y_mm` is `NaN`, which is not finite"),
        (format!("{H}0,0,0,-inf\n"), "t.csv:2:7: `z_mm` is `-inf`, which is not finite"),
        (
            format!("{H}0,0, 1e50,0\n"),
            "t.csv:2:6: `y_mm` is `1e50`, out of range (`y_mm` is a number from -100000 to",
        ),
        (format!("{H}0,0,0,1e999\n"), "t.csv:2:7: `z_mm` is `1e999`, out of range"),
        (format!("{H}1e50,0,0,0\n"), "t.csv:2:1: `t_s` is `1e50`, out of range"),
        (format!("{H}1700000000000,0,0,0\n"), "t.csv:2:1: `t_s` is `1700000000000`, out of range"),
        ("t_s,x_mm,y_mm,z_mm,force_n\n0,0,0,0,2000\n".into(), "t.csv:2:9: `force_n` is `2000`, out of range"),
        (
            "t_s,x_mm,y_mm,z_mm,speed_mm_s\n0,0,0,0,-1\n".into(),
            "t.csv:2:9: `speed_mm_s` is `-1`, out of range (`speed_mm_s` is a number from 0 to",
        ),
        (
            format!("{H}0,0,0,0\n\n# c\n0.01,0,0,0\n0.005,1,0,0\n"),
            "t.csv:6:1: the clock goes back: 0.005 s after 0.01 s",
        ),
        (format!("{H}0,0,0,0\n0.01,0,0,0\n0.01,1,0,0\n"), "t.csv:4:1: the clock stands still"),
        ("x_mm,t_s,y_mm,z_mm\n1,0,0,0\n1,0,0,0\n".into(), "t.csv:3:3: the clock stands still"),
        (
            format!("{H}0,0,0,0\n0.002,0,0,0\n0.004,0,0,0\n0.2,0,0,0\n"),
            "t.csv:5:1: a gap of 0.1960 s after 0.004 s (rows may lie 0.1000 s apart",
        ),
        (format!("{H}0,0,0,0\n0.002,0,0,0\n1,0,0,0\n"), "t.csv:4:1: a gap of 0.9980 s after 0.002 s"),
    ];
    for (text, want) in cases {
        let e = parse(text).unwrap_err();
        assert!(e.to_string().starts_with(want), "{text:?}\n  gave {e}\n  want {want}");
        assert!(e.help.is_some() || !e.related.is_empty(), "{e}");
    }
}

#[test]
fn columns_are_counted_in_characters_after_other_text() {
    let e = parse("# µ é\nt_s,x_mm,y_mm,z_mm\n0,0,µ,é\n").unwrap_err();
    assert!(e.to_string().starts_with("t.csv:3:5: `y_mm` is `µ`"), "{e}");
}

#[test]
fn slow_and_irregular_rows_are_no_gap() {
    // 20 Hz with a quarter of a second missing is five steps. A longer gap is refused.
    let rows = |gap: f64| {
        let mut text = String::from(H);
        for i in 0..10 {
            text += &format!("{},0,0,0\n", f64::from(i) * 0.05 + if i > 4 { gap - 0.05 } else { 0.0 });
        }
        text
    };
    assert!(parse(&rows(0.2499)).is_ok());
    let e = parse(&rows(0.26)).unwrap_err();
    assert!(e.to_string().starts_with("t.csv:7:1: a gap of 0.2600 s after 0.2 s"), "{e}");
    let options = TrajectoryOptions { max_gap_s: Some(0.3), ..Default::default() };
    assert!(Trajectory::parse(&Source::new("t.csv", rows(0.26)), &options).is_ok());
    let options = TrajectoryOptions { max_gap_s: Some(0.04), ..Default::default() };
    let e = Trajectory::parse(&Source::new("t.csv", rows(0.05)), &options).unwrap_err();
    assert!(e.to_string().starts_with("t.csv:3:1: a gap"), "{e}");
    // Two rows a second apart are a recording at 1 Hz.
    assert!(parse(&format!("{H}0,0,0,0\n1,1,1,1\n2,0,0,0\n")).is_ok());
}

#[test]
fn a_missing_file_is_an_error() {
    assert!(Trajectory::read("no/such.csv", &TrajectoryOptions::default()).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_text_panics(text in "\\PC*") {
        let _ = parse(&text);
    }

    #[test]
    fn nearly_right_text_never_panics_and_reads_finite(
        text in "(t_s|\"t_s\"|#|\r|\n){0,3},?x_mm,y_mm,z_mm(,force_n|,speed_mm_s|,é)?\r?\n\
                 ([0-3]\\.[0-9]{1,3},[-0-9.e\"# ,;\t\n\r]{0,12},[0-9],[0-9]\r?\n){0,6}",
        at in -1.0..5.0f64,
    ) {
        if let Ok(t) = parse(&text) {
            prop_assert!(t.sample(at).position.iter().all(|v| v.is_finite()));
            prop_assert!(t.duration_s() > 0.0);
        }
    }

    /// Cells have their places, wherever comments and blank lines stand.
    #[test]
    fn every_bad_cell_is_found_where_it_was_put(
        before in proptest::collection::vec("(|#[ -~]{0,9}| {0,3})(\n|\r\n)", 0..5),
        rows in 1..6usize, row in 0..6usize, cell in 0..4usize,
    ) {
        let row = row.min(rows - 1);
        let mut text = before.concat();
        text += "t_s,x_mm,y_mm,z_mm\n";
        for i in 0..rows {
            text += before.get(i).map_or("", String::as_str);
            let mut cells = [format!("0.0{i}"), "1".into(), "2".into(), "3".into()];
            if i == row {
                cells[cell] = "bäd".into();
            }
            text += &(cells.join(",") + "\r\n");
        }
        let place = parse(&text).unwrap_err().place.unwrap();
        prop_assert_eq!(place.span.start, text.rfind("bäd").unwrap());
        prop_assert_eq!(&text[place.span.start..place.span.end], "bäd");
    }
}

#[test]
fn line_of_too_many_cells_is_refused_early() {
    let text = format!("# a comment\n{}\n", "1,".repeat(MOST_CELLS));
    let source = Source::new("t.csv", text);
    let e = Trajectory::parse(&source, &TrajectoryOptions::default()).unwrap_err().to_string();
    assert!(e.contains("t.csv:2:1") && e.contains("a line of more than 10000 cells"), "{e}");
}
