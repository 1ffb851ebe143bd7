//! Strokes from files, as other programs write them.

use harness::{Room, graphs};

/// The moments of a stroke: time in s, place in mm, force in N, speed in mm/s.
fn moments() -> impl Iterator<Item = [f64; 6]> {
    (0..=400).map(|k| {
        let t = f64::from(k) / 200.0;
        [t, 40.0 * t, 0.0, -2.0, 1.0, 40.0]
    })
}

/// A table of some of a moment's numbers.
fn table(header: &str, cells: impl Fn([f64; 6]) -> String) -> String {
    moments().fold(format!("{header}\n"), |text, moment| text + &cells(moment) + "\n")
}

fn is_like(dir: &Room, args: &str, plain: &[f32]) -> bool {
    rendered(dir, args);
    let found = dir.wav("o.wav").0;
    found.len() == plain.len() && found.iter().zip(plain).all(|(a, b)| (a - b).abs() < 1e-5)
}

fn rendered(dir: &Room, args: &str) -> Vec<u8> {
    dir.run(&format!("render graphs/fitted.ron --out o.wav {args}")).ok();
    dir.bytes("o.wav")
}

#[test]
fn stroke_of_numpy_excel_or_other_order_is_read() {
    let dir = Room::new();
    dir.write("plain.csv", table("t_s,x_mm,y_mm,z_mm", |[t, x, y, z, ..]| format!("{t},{x},{y},{z}")));
    let plain = rendered(&dir, "--input plain.csv");
    let german = |[t, x, y, z, ..]: [f64; 6]| format!("{z};{x};{y};{t};").replace('.', ",");
    for (name, text) in [
        ("numpy", table("# t_s,x_mm,y_mm,z_mm", |[t, x, y, z, ..]| format!("{t:.18e} {x:.18e} {y} {z}"))),
        ("numpy_commas", table("# t_s x_mm y_mm z_mm", |[t, x, y, z, ..]| format!("{t:e},{x:e},{y},{z}"))),
        ("tabs", table("x_mm\tz_mm\ty_mm\tt_s", |[t, x, y, z, ..]| format!("{x}\t{z}\t{y}\t{t}"))),
        ("blanks", table("  t_s   x_mm y_mm z_mm", |[t, x, y, z, ..]| format!("  {t}  {x} {y}   {z} "))),
        ("excel", format!("\u{feff}{}", table("z_mm;x_mm;y_mm;t_s;", german).replace('\n', "\r\n"))),
    ] {
        dir.write("s.csv", text);
        assert!(rendered(&dir, "--input s.csv") == plain, "{name}");
    }
    let mixed = "t_s;x_mm;y_mm;z_mm\n0,5;0;0;0\n1.5;0;0;0\n";
    dir.write("s.csv", mixed);
    dir.run("render graphs/fitted.ron --input s.csv --out o.wav")
        .refused("s.csv:3:1: error: both `0,5` and `1.5` as numbers");
}

#[test]
fn stroke_without_z_or_place_plays() {
    let dir = Room::new();
    dir.write("plain.csv", table("t_s,x_mm,y_mm,z_mm", |[t, x, y, z, ..]| format!("{t},{x},{y},{z}")));
    let plain = rendered(&dir, "--input plain.csv");
    // 1 N is 2 mm deep in a floor of 0.5 N/mm.
    dir.write("force.csv", table("t_s,x_mm,y_mm,force_n", |[t, x, y, _, f, _]| format!("{t},{x},{y},{f}")));
    assert!(rendered(&dir, "--input force.csv") == plain);
    dir.write("speed.csv", table("t_s,speed_mm_s,force_n", |[t, .., f, v]| format!("{t},{v},{f}")));
    let probe = "--input speed.csv --probe stylus.position=p.npy";
    dir.run(&format!("render graphs/fitted.ron {probe}")).ok();
    let places = dir.npy("p.npy");
    for (tick, place) in places.chunks_exact(3).enumerate() {
        let want = [40.0 * tick as f32 / 500.0, 0.0, -2.0];
        assert!(place.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-3), "{tick}: {place:?}, not {want:?}");
    }
    assert_eq!(places.len(), 3 * 1000);
}

#[test]
fn map_names_columns_and_converts_units() {
    let dir = Room::new();
    dir.write("plain.csv", table("t_s,x_mm,y_mm,force_n", |[t, x, y, _, f, _]| format!("{t},{x},{y},{f}")));
    rendered(&dir, "--input plain.csv");
    let plain = dir.wav("o.wav").0;
    assert!(plain.iter().any(|x| x.abs() > 0.01));
    let other = |[t, x, y, _, f, _]: [f64; 6]| {
        format!("{:.0}\tnote\t{}\t{}\t{:.0}", 1000.0 * t, x / 1000.0, y, -1000.0 * f)
    };
    dir.write("other.csv", table("Time_ms\tcomment\tPX\ty_mm\tFz", other));
    let map = "--map t_s=Time_ms:ms --map x_mm=PX:m --map force_n=-Fz:mN";
    assert!(is_like(&dir, &format!("--input other.csv {map}"), &plain));
    let ran = dir.run(&format!("render graphs/fitted.ron --input other.csv {map} --out o.wav")).ok();
    assert_eq!(ran.err.matches("ignores these columns of its file: comment").count(), 1, "{}", ran.err);
    // As a parameter of the node.
    let graph = std::fs::read_to_string(graphs("fitted.ron")).expect("the shipped graph");
    let model = graphs("models/made_ar/rough.ron").display().to_string();
    let graph = graph.replace("models/made_ar/rough.ron", &model).replace(
        "file: \"trajectories/zigzag.csv\"",
        "file: \"other.csv\", map: [\"t_s=Time_ms:ms\", \"x_mm=PX:m\", \"force_n=-Fz:mN\"]",
    );
    dir.write("g.ron", graph);
    dir.run("render g.ron --out g.wav").ok();
    assert!(dir.bytes("g.wav") == dir.bytes("o.wav"));
    // The error has the options that help.
    let render = "render graphs/fitted.ron --out o.wav";
    let err =
        dir.run(&format!("{render} --input other.csv")).refused("other.csv:1:28: error: the columns").err;
    for said in ["`t_s`", "`x_mm`", "`force_n` may stand for `z_mm`", "`Time_ms`", "`Fz`"] {
        assert!(err.contains(said), "{said}: {err}");
    }
    assert!(err.contains("--map t_s=Time_ms:ms"), "{err}");
    for (args, said) in [
        ("--input other.csv --map t_s=Time_ms:N", "`t_s` cannot be in `N` (its units are s, ms, us, ns)"),
        (
            "--input other.csv --map force_n=Fx:N",
            "`force_n` is mapped to `Fx`, and the file has no such column",
        ),
        ("--input other.csv --map force=Fz:N", "no column is called `force` here"),
        ("--input other.csv --map force_n", "`force_n` names no column"),
        ("--hand pointer --map force_n=Fz:N", "no file is played whose columns could be mapped"),
    ] {
        let ran = dir.run(&format!("{render} {args}"));
        let err = ran.err.replace("\n  help: ", " (");
        assert!(ran.code == 2 && err.contains(said.trim_end_matches(')')), "{args}: {err}");
    }
    // Files without names go by numbers.
    dir.write("bare.txt", table("", |[t, x, y, _, f, _]| format!("{t} {x} {y} {f}")));
    let numbers = "--map t_s=1 --map x_mm=2 --map y_mm=3 --map force_n=4";
    assert!(is_like(&dir, &format!("--input bare.txt {numbers}"), &plain));
}
