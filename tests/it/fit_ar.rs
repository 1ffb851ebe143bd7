//! From a recording to a texture of autoregressive models, as a user does it: `asperity fit-ar`.

mod stroke;

use std::f64::consts::TAU;

use asperity_autoregressive::{Filter, Model, TextureFile};
use harness::{Ran, Room, graphs};
use serde_json::Value;
use stroke::{COLUMNS, row, stroke, table, table_of, write_npy};

/// A folder with the stroke as a table.
fn folder() -> Room {
    let dir = Room::new();
    dir.write("s.csv", table(COLUMNS, row));
    dir
}

fn fit(dir: &Room, line: &str) -> Ran {
    dir.run(&format!("fit-ar {line}"))
}

fn read(dir: &Room, name: &str) -> TextureFile {
    TextureFile::read(dir.join(name)).unwrap_or_else(|e| panic!("{e}"))
}

/// JSON that a command prints.
fn told(dir: &Room, line: &str) -> Value {
    fit(dir, &format!("{line} --json")).json()
}

/// `var gain^2 |B / A|^2` at a frequency, as it is written down.
fn closed_form(m: &Model, hz: f64) -> f64 {
    let square = |coefficients: &[f64]| {
        let w = TAU * hz / 1000.0;
        let (mut re, mut im) = (1.0, 0.0);
        for (i, c) in coefficients.iter().enumerate() {
            let angle = w * (i + 1) as f64;
            re += c * angle.cos();
            im -= c * angle.sin();
        }
        re * re + im * im
    };
    m.variance * m.gain * m.gain * square(&m.ma) / square(&m.ar)
}

/// The largest difference in dB between a fitted filter and a model in thirds of an octave from 25 to 400 Hz
/// that hold a thousandth of the power.
fn worst_band(found: &Filter, want: &Model) -> f64 {
    let fitted = Model {
        ar: found.ar().to_vec(),
        ma: found.ma().to_vec(),
        variance: found.deviation.powi(2),
        gain: found.gain,
        ..want.clone()
    };
    let bands: Vec<[f64; 2]> = (14..=26)
        .map(|band| {
            let centre = 10f64.powf(f64::from(band) / 10.0);
            let hz = |i: i32| centre * 10f64.powf((f64::from(i) + 0.5) / 1000.0 - 0.05);
            [&fitted, want].map(|m| (0..100).map(|i| closed_form(m, hz(i)) * hz(i)).sum::<f64>())
        })
        .collect();
    let whole: f64 = bands.iter().map(|b| b[1]).sum();
    let held = bands.iter().filter(|b| b[1] > 1e-3 * whole);
    held.map(|[x, y]| (10.0 * (x / y).log10()).abs()).fold(0.0, f64::max)
}

/// Checks that a texture has the models that were rendered.
#[track_caller]
fn same_models(file: &TextureFile) {
    for m in &stroke().models {
        let off = worst_band(&file.texture.at(m.speed_mm_s, m.force_n), m);
        assert!(off < WITHIN_DB, "{} mm/s, {} N: {off} dB", m.speed_mm_s, m.force_n);
    }
}

/// Of six seconds of noise the band of 25 Hz has a deviation of 0.74 dB by itself, that of 100 Hz of 0.37.
const WITHIN_DB: f64 = 1.5;

#[test]
fn the_models_that_were_rendered_are_found_again() {
    let dir = folder();
    let about = "s.csv --out m.ron --description 'Ribs \"of\" cloth.'";
    let ran = fit(&dir, &format!("{about} --plot m.svg")).ok();
    assert_eq!(dir.files(), ["m.ron", "m.svg", "s.csv"]);
    let file = read(&dir, "m.ron");
    assert_eq!(file.description, "Ribs \"of\" cloth.");
    let origin = file.origin.strip_prefix("Fitted by `asperity fit-ar` to ");
    let seconds = origin.and_then(|o| o.strip_suffix(" s of s.csv.")).and_then(|s| s.parse::<f64>().ok());
    // All but what is on the way.
    assert!(seconds.is_some_and(|s| (54.0..63.0).contains(&s)), "{}", file.origin);
    assert_eq!((file.texture.models().len(), file.texture.rate_hz()), (9, 1000.0), "{}", ran.out);
    // Five of the nine are on the hull, which makes eleven triangles; the one below the three of the least
    // force is a sliver.
    assert_eq!(file.texture.triangles().corners().len(), 10);
    same_models(&file);
    let ran = ran.says(&[
        "s.csv: 63.00 s at 1000 Hz, one axis of acceleration",
        "with speed or force changing",
        "of least AICc from 1 to 24: ",
        "9 models at 1000 Hz, 10 triangles",
        "   31.5 ",
        "/m.ron\n",
        "/m.svg\n",
    ]);
    assert_eq!(ran.err, "", "nothing to warn of");
    let svg = dir.text("m.svg");
    assert!(svg.starts_with("<svg") && svg.contains("A texture fitted to s.csv") && svg.contains("within "));

    // The same recording gives the same bytes, in the place of what was there.
    let before = dir.bytes("m.ron");
    dir.write("m.ron", "old");
    fit(&dir, about).ok();
    assert_eq!(dir.bytes("m.ron"), before);
}

/// With `ASPERITY_PICTURES=FOLDER` it draws the picture of that folder anew.
#[test]
fn picture_of_a_fit_in_the_docs_is_fresh() {
    let dir = Room::new();
    dir.write("rough.csv", table(COLUMNS, row));
    fit(&dir, "rough.csv --out m.ron --plot autoregressive.svg").ok();
    crate::pictures::is_fresh(&dir, "autoregressive.svg");
}

#[test]
fn what_is_printed_as_json_is_what_was_found() {
    let dir = folder();
    let told = told(&dir, "s.csv --out m.ron --by bic --max-order 12");
    let file = read(&dir, "m.ron");
    assert_eq!(told["models"].as_array().map(Vec::len), Some(9));
    assert!(told["criterion"] == "BIC" && told["model_hz"] == 1000.0 && told["axes"] == 1, "{told}");
    assert_eq!(told["order"], file.texture.models()[0].ar.len());
    let curve = told["criterion_by_order"].as_array().expect("a curve");
    let least =
        curve.iter().min_by(|a, b| a[1].as_f64().unwrap().total_cmp(&b[1].as_f64().unwrap())).unwrap();
    assert_eq!((curve.len(), &least[0], &least[1]), (12, &told["order"], &0.0.into()));
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{value}"));
    for (m, told) in file.texture.models().iter().zip(told["models"].as_array().expect("models")) {
        // JSON is read to all but the last bit.
        let same = |name: &str, value: f64| (number(&told[name]) / value - 1.0).abs() < 1e-12;
        assert!(same("speed_mm_s", m.speed_mm_s) && same("force_n", m.force_n), "{told} of {m:?}");
        // Of 117 bands with deviations of up to 0.74 dB each, the recording's own chance.
        assert!(number(&told["seconds"]) > 5.0 && number(&told["worst_off_db"]).abs() < 3.0, "{told}");
    }
    // Every 10 ms is in a segment or was dropped.
    let sum =
        |list: &Value| list.as_array().expect("a list").iter().map(|s| number(&s["length_s"])).sum::<f64>();
    assert!((sum(&told["segments"]) + sum(&told["dropped"]) - number(&told["seconds"])).abs() < 1e-6);
    assert!(told["segments"].as_array().expect("a list").iter().all(|s| number(&s["model"]) < 9.0));
    let hull = &told["hull"];
    assert!(number(&hull["speed_mm_s"][0]) < 65.0 && number(&hull["speed_mm_s"][1]) > 195.0, "{hull}");
    assert!(hull["corners"].as_array().expect("corners").len() >= 4);
    // What is rendered at the recording's speeds and forces has the recording's bands.
    let bands = told["all"]["bands"].as_array().expect("bands");
    assert_eq!(bands.len(), 13);
    let power = |which: &str| -> f64 { bands.iter().map(|b| number(&b[which]).powi(2)).sum() };
    let recorded = power("recorded_m_s2");
    for band in bands.iter().filter(|b| number(&b["recorded_m_s2"]).powi(2) > 1e-3 * recorded) {
        assert!(number(&band["off_db"]).abs() < 1.0, "{band}");
    }
    let level = 10.0 * (power("rendered_m_s2") / recorded).log10();
    assert!((number(&told["all"]["level_off_db"]) - level).abs() < 1e-6 && level.abs() < 0.3, "{level} dB");
    let written = dir.canonicalize().expect("a folder").join("m.ron");
    assert_eq!(told["written"], serde_json::json!([written]));
    // A file as well as a terminal can hold it.
    dir.write("t.json", told.to_string());
    assert_eq!(dir.json("t.json"), told);
}

#[test]
fn options_are_taken_to_the_fit() {
    let dir = folder();
    let of = |more: &str| told(&dir, &format!("s.csv --out m.ron {more}"));
    let given = of("--order 5 --most-models 3 --high-pass-hz 20");
    assert!(given["order"] == 5 && given["criterion"].is_null() && given["high_pass_hz"] == 20.0, "{given}");
    assert!(read(&dir, "m.ron").texture.models().len() <= 3);
    fit(&dir, "s.csv --out m.ron --order 5").ok().says(&["order         5, as asked for"]);
    // Faster than 150 mm/s, and pressed harder than 2 N: one model of the nine.
    let some = of("--least-speed-mm-s 150 --least-force-n 2");
    assert_eq!(some["models"].as_array().map(Vec::len), Some(1), "{some:#}");
    assert!(some["dropped"].as_array().expect("a list").iter().any(|d| d["why"] == "slow"));
    assert_eq!(some["triangles"], serde_json::json!([]));
    // Wide tolerances join all that there is.
    let wide = of("--speed-tolerance-mm-s 500 --force-tolerance-n 9");
    assert_eq!(wide["models"].as_array().map(Vec::len), Some(1));
    let slow = of("--model-hz 500 --shortest-s 1 --tolerance-percent 10");
    assert_eq!(read(&dir, "m.ron").texture.rate_hz(), 500.0);
    assert_eq!(slow["all"]["bands"].as_array().map(Vec::len), Some(10));
    assert!(slow["segments"].as_array().expect("a list").iter().all(|s| s["length_s"].as_f64() >= Some(1.0)));
}

#[test]
fn arrays_and_wav_files_are_fitted_as_tables_are() {
    let dir = folder();
    fit(&dir, "s.csv --out a.ron").ok();
    write_npy(&dir.join("s.npy"));
    let columns = "--columns speed_mm_s,none,force_n,acceleration_m_s2";
    fit(&dir, &format!("s.npy --out b.ron {columns} --rate-hz 1000")).ok();
    let (table, array) = (read(&dir, "a.ron"), read(&dir, "b.ron"));
    assert_eq!(table.texture, array.texture);
    let spec = hound::WavSpec {
        channels: 3,
        sample_rate: 1000,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(dir.join("s.wav"), spec).expect("a file");
    for n in 0..stroke().force.len() {
        for (x, full) in row(n).into_iter().zip([10.0, 500.0, 50.0]) {
            writer.write_sample((x / full) as f32).expect("a sample");
        }
    }
    writer.finalize().expect("a file");
    let channel = |(name, full): (&str, f64)| format!("(quantity: \"{name}\", full_scale: {full:?}),");
    let names = [("force_n", 10.0), ("speed_mm_s", 500.0), ("acceleration_m_s2", 50.0)].map(channel).concat();
    dir.write("recording.ron", format!("Recording(channels: [{names}])"));
    fit(&dir, "s.wav --out c.ron").ok();
    same_models(&read(&dir, "c.ron"));
    // The file that names the channels is not to be lost.
    fit(&dir, "s.wav --out recording.ron").refused("RECORDING reads this file");
}

#[test]
fn a_tool_that_shakes_askew_is_as_loud() {
    let dir = folder();
    // 2-3-6-7, with gravity on one axis, and places for speeds.
    let places = stroke().speed.iter().scan(0.0, |place, v| {
        *place += v / 1000.0;
        Some(*place)
    });
    let places: Vec<f64> = places.collect();
    let text = table("force_n,x_mm,y_mm,ax_m_s2,ay_m_s2,az_m_s2", |n| {
        let a = stroke().acceleration[n] / 7.0;
        vec![stroke().force[n], 0.6 * places[n], -0.8 * places[n], 2.0 * a, -3.0 * a, 6.0 * a + 9.81]
    });
    dir.write("axes.csv", text);
    fit(&dir, "axes.csv --out m.ron").ok().says(&["3 axes of acceleration"]);
    same_models(&read(&dir, "m.ron"));
}

/// Samples of a scene whose surface has the texture `m.ron`, with these settings.
fn rendered(dir: &Room, settings: &str) -> Vec<f32> {
    let stroke = graphs("trajectories/zigzag.csv").display().to_string();
    let scene = format!(
        "Scene(version: 1, input: trajectory(file: {stroke:?}), \
         output: audio_out(volts_at_full_scale: 1.0, amps_per_volt: 1.0), \
         surfaces: {{\"cloth\": (shape: plane, effects: (stiffness: (stiffness_n_per_mm: 0.5), \
         texture: autoregressive(model: \"m.ron\"{settings})))}})"
    );
    dir.write("scene.ron", scene);
    dir.run("render scene.ron --seconds 3 --out o.wav").ok();
    dir.wav("o.wav").0
}

#[test]
fn a_scene_renders_what_was_fitted() {
    let dir = folder();
    fit(&dir, "s.csv --out m.ron").ok();
    let [twice, once] = ["0.2", "0.1"].map(|gain| {
        let samples = rendered(&dir, &format!(", gain: {gain}"));
        samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / samples.len() as f64
    });
    assert!(once > 0.0 && (twice / once / 4.0 - 1.0).abs() < 0.1, "{twice} and {once}");
}

#[test]
fn a_band_that_is_far_off_is_warned_of() {
    let dir = folder();
    let ran = fit(&dir, "s.csv --out m.ron --order 1").ok();
    let said = ran.err.strip_prefix("warning: the band at ").unwrap_or_else(|| panic!("{}", ran.err));
    let (hz, rest) = said.split_once(" Hz is rendered ").unwrap_or_else(|| panic!("{said}"));
    let (db, rest) = rest.split_once(" dB off").unwrap_or_else(|| panic!("{rest}"));
    assert_eq!(rest.trim_end(), " the recording");
    let [hz, db] = [hz, db].map(|x| x.parse::<f64>().unwrap_or_else(|e| panic!("{x}: {e}")));
    assert!((24.0..=401.0).contains(&hz) && db.abs() > 3.0, "{said}");
    let told = ran.out.split_once("dB, at most ").and_then(|(_, rest)| rest.split_once(" dB"));
    let told = told.and_then(|(db, _)| db.parse::<f64>().ok());
    assert!(told.is_some_and(|told| (told - db).abs() < 0.051), "{said}{}", ran.out);
    assert!(dir.files() == ["m.ron", "s.csv"]);
    assert_eq!(read(&dir, "m.ron").texture.models()[0].ar.len(), 1);
}

/// Three corners at which nothing sounds, around all that the stroke does, and a loud one beyond.
#[test]
fn scene_between_models_without_variance_is_silent() {
    let dir = Room::new();
    let peak = |silent: f64| {
        let corner = |(speed, force, variance): (f64, f64, f64)| {
            format!(
                "(speed_mm_s: {speed:?}, force_n: {force:?}, variance: {variance:?}, ar: [-1.2, 0.9], \
                 ma: [0.3]),"
            )
        };
        let corners = [(1.0, 0.01, silent), (2000.0, 0.01, silent), (1.0, 20.0, silent), (2000.0, 20.0, 0.5)];
        let models = corners.map(corner).concat();
        let text = format!(
            "Autoregressive(version: 1, description: \"d\", origin: \"o\", rate_hz: 1000, \
             models: [{models}], triangles: [[0, 1, 2], [1, 2, 3]])"
        );
        dir.write("m.ron", text);
        rendered(&dir, "").iter().fold(0.0f32, |m, x| m.max(x.abs()))
    };
    assert_eq!(peak(0.0), 0.0);
    assert!(peak(1e-6) > 0.0);
}

#[test]
fn what_is_wrong_is_said_where_it_is_and_nothing_is_written() {
    let dir = Room::new();
    let at = |name: &str| dir.join(name);
    // Three seconds will do.
    let good = table(COLUMNS, row).lines().take(3002).collect::<Vec<_>>().join("\n") + "\n";
    let write = |name: &str, text: &str| dir.write(name, text);
    let changed = |name: &str, line: usize, by: &dyn Fn(&str) -> String| {
        let lines = good.lines().enumerate();
        let changed = lines.map(|(i, l)| if i + 1 == line { by(l) } else { l.to_owned() } + "\n");
        write(name, &changed.collect::<String>());
    };
    write("s.csv", &good);
    changed("cell.csv", 12, &|l| l.replacen("0.009,", "0.009,x", 1));
    changed("short.csv", 12, &|l| l.rsplit_once(',').expect("cells").0.to_owned());
    changed("name.csv", 2, &|l| l.replace("force_n", "forc_n"));
    changed("none.csv", 2, &|l| l.replace("acceleration_m_s2", "vx_mm_s"));
    changed("clock.csv", 12, &|l| l.replacen("0.009", "0.0099", 1));
    write("still.csv", &table_of(3000, |_| vec![1.0, 0.0, 0.5]));
    write("quiet.csv", &table_of(3000, |n| vec![0.0, 50.0, (n as f64).sin()]));
    changed("nan.csv", 12, &|l| {
        let (time, rest) = l.split_once(',').expect("cells");
        let (_, rest) = rest.split_once(',').expect("cells");
        format!("{time},nan,{rest}")
    });
    let first = |count: usize| table_of(count, |n| vec![1.0, 50.0, (n as f64).sin()]);
    write("header.csv", &first(0));
    write("one.csv", &first(1));
    write("brief.csv", &first(100));
    dir.write("s.mat", b"MATLAB 5.0 \xff\xfe\x00");
    write("empty.csv", "");
    write("bad.npy", "no array");
    write("alone.wav", "RIFF");
    write_npy(&at("s.npy"));
    write("mine.ron", "mine");
    std::fs::create_dir(at("folder")).expect("a folder");
    let before: Vec<(String, Option<Vec<u8>>)> =
        dir.files().into_iter().map(|f| (f.clone(), std::fs::read(at(&f)).ok())).collect();
    for (args, said) in [
        ("nothing.csv", "nothing.csv: error: cannot read"),
        ("folder", "folder: error: "),
        ("s.mat", "a recording is a table (.csv), a WAV file (.wav) or an array (.npy)"),
        ("header.csv", "header.csv:2:1: error: a stroke of no rows or one"),
        ("one.csv", "a stroke of no rows or one"),
        ("brief.csv", "a stroke of 0.100 s"),
        ("nan.csv", "nan.csv:12:7: error: `force_n` is `nan`, which is not finite"),
        ("empty.csv", "empty.csv:1:1: error: no header line"),
        ("cell.csv", "cell.csv:12:7: error: `force_n` is `x"),
        ("short.csv", "error: a row of "),
        ("name.csv", "name.csv:2:40: error: no force"),
        ("none.csv", "none.csv:2:31: error: no acceleration"),
        ("clock.csv", "clock.csv:12:1: error: the clock is not steady"),
        (
            "still.csv",
            "still.csv: error: no stretch of 0.2 s to fit: 3.00 s without a change of acceleration",
        ),
        ("quiet.csv", "is it in N, and counted positive into the surface?"),
        ("alone.wav", "the channels of this file have no names"),
        ("s.npy", "the columns of this array have no names"),
        ("bad.npy --columns force_n --rate-hz 1000", "bad.npy: error: "),
        ("s.npy --columns force_n,speed_mm_s --rate-hz 1000", "s.npy: error: 4 columns, and 2 are named"),
        ("s.npy --columns speed_mm_s,none,force_n,ax --rate-hz 1000", "s.npy: error: unknown column `ax`"),
        ("s.npy --columns speed_mm_s,x_mm,force_n,ax_m_s2 --rate-hz 1000", "`x_mm` is NaN in row 0"),
        ("s.npy --columns speed_mm_s,none,none,ax_m_s2 --rate-hz 1000", "s.npy: error: no force"),
        ("s.npy --columns force_n", "--rate-hz"),
        ("s.csv --columns force_n --rate-hz 1000", "--columns: error: a table names its own columns"),
        ("s.csv --rate-hz 500", "--rate-hz"),
        ("s.csv --order 0", "a whole number from 1 to 64"),
        ("s.csv --order 65", "--order"),
        ("s.csv --order 64", "models of order 64 of pieces of 0.2 s"),
        ("s.csv --max-order nope", "--max-order"),
        ("s.csv --order 9 --max-order 9", "--max-order"),
        ("s.csv --by aic", "--by"),
        ("s.csv --model-hz 2000", "models at 2000 Hz of a recording at 1000 Hz"),
        ("s.csv --model-hz 499", "--model-hz"),
        ("s.csv --high-pass-hz -1", "a number from 0 to 1000 Hz"),
        ("s.csv --high-pass-hz 101", "a corner of the high-pass of 101 Hz"),
        ("s.csv --shortest-s nan", "--shortest-s"),
        ("s.csv --shortest-s 5", "a recording of 3.000 s"),
        ("s.csv --most-models 0", "--most-models"),
        ("s.csv --speed-tolerance-mm-s 0", "--speed-tolerance-mm-s"),
        ("s.csv --tolerance-percent 101", "--tolerance-percent"),
        ("s.csv --plot s.csv", "would be overwritten by --plot"),
        ("s.csv --plot mine.ron", "--out would write the same file as --plot"),
        ("s.csv --plot no/p.svg", "--plot names this file"),
        ("", "RECORDING"),
    ] {
        let ran = fit(&dir, &format!("{args} --out mine.ron")).refused(said);
        assert!(ran.out.is_empty(), "{args}: {}", ran.out);
        for (name, bytes) in &before {
            assert_eq!(&std::fs::read(at(name)).ok(), bytes, "{args} changed {name}");
        }
        assert_eq!(dir.files().len(), before.len(), "{args}: {:?}", dir.files());
    }
    for (out, said) in [
        ("s.csv", "would be overwritten by --out"),
        ("./folder/../s.csv", "would be overwritten by --out"),
        ("m.txt", "--out: error: m.txt would not be found as a texture"),
        ("no/m.ron", "--out names this file"),
        ("folder", "--out"),
    ] {
        fit(&dir, &format!("s.csv --out {out}")).refused(said);
        assert_eq!(dir.files().len(), before.len());
    }
    fit(&dir, "s.csv --out mine.ron").ok();
    assert_eq!(read(&dir, "mine.ron").texture.models().len(), 1);
}

/// Ticks in which the node of a kind was called, and slept.
fn ticks_of(report: &Value, kind: &str) -> [u64; 2] {
    let nodes = report["nodes"].as_array().expect("nodes");
    let node =
        nodes.iter().find(|node| node["kind"] == kind).unwrap_or_else(|| panic!("no {kind}: {report}"));
    ["calls", "slept"].map(|count| node[count].as_u64().expect("a count"))
}

/// 2 s of motion, then 2 s of rest under the same force, then 1 s of motion above the surface.
fn resting() -> String {
    harness::csv(5.0, |t| {
        [60.0 * t.min(2.0) + 60.0 * (t - 4.0).max(0.0), 0.0, if t < 4.0 { -2.0 } else { 3.0 }]
    })
}

#[test]
fn fitted_texture_is_named_by_its_path_and_sleeps() {
    let dir = Room::new();
    for folder in ["models", "graphs_of_mine"] {
        std::fs::create_dir(dir.join(folder)).expect("a folder");
    }
    dir.write("s.csv", table(COLUMNS, row));
    dir.write("rest.csv", resting());
    let ran = fit(&dir, "s.csv --out models/m.ron").ok();
    // What the command says is run as it stands.
    let command =
        ran.out.lines().find_map(|line| line.strip_prefix("render it:  asperity ")).expect("a command");
    dir.run(&format!("{} --input rest.csv --report r.json", command.replace('\'', ""))).ok();
    let told = dir.wav("fitted.wav").0;
    assert!(told.iter().any(|x| x.abs() > 0.01));
    let [calls, slept] = ticks_of(&dir.json("r.json"), "autoregressive");
    // The gate closes within some ticks of its fade, and opens as late.
    assert!((950..1100).contains(&calls) && calls + slept == 2500, "{calls} {slept}");
    // In a graph and a scene of another folder, by a path from there, it is the same as in the long form.
    let graph = std::fs::read_to_string(graphs("fitted.ron")).expect("the shipped graph");
    let scene = "Scene(version: 1, seed: 5, input: trajectory(file: \"../rest.csv\"), \
        output: audio_out(volts_at_full_scale: 1.0, amps_per_volt: 1.0), surfaces: {\"cloth\": ( \
        shape: plane, effects: (stiffness: (stiffness_n_per_mm: 0.5), texture: MODEL))})";
    let long = "autoregressive(model: \"../models/m.ron\")";
    let short = "\"../models/m.ron\"";
    let rendered = |name: &str, text: String| {
        dir.write(format!("graphs_of_mine/{name}"), text);
        dir.run(&format!("render graphs_of_mine/{name} --out o.wav --report r.json")).ok();
        let ticks = ticks_of(&dir.json("r.json"), "autoregressive");
        (dir.wav("o.wav").0, ticks)
    };
    let graph = graph.replace("\"trajectories/zigzag.csv\"", "\"../rest.csv\"");
    let graph = |model: &str| graph.replace("\"models/made_ar/rough.ron\"", model);
    let (by_path, ticks) = rendered("g.ron", graph(short));
    assert!(by_path == told && ticks == [calls, slept], "{ticks:?}");
    assert!(rendered("g.ron", graph(&format!("r#\"{long}\"#"))).0 == told);
    assert!(rendered("g.ron", graph("r#\"[\"../models/m.ron\"]\"#")).0 == told);
    let (by_path, ticks) = rendered("s.ron", scene.replace("MODEL", short));
    assert!(by_path.iter().any(|x| x.abs() > 0.01) && ticks[0] < 1100 && ticks[1] > 1400, "{ticks:?}");
    assert!(rendered("s.ron", scene.replace("MODEL", long)).0 == by_path);
    assert!(rendered("s.ron", scene.replace("MODEL", &format!("[{short}]"))).0 == by_path);
    // A path that leads nowhere is told with the place that names it.
    for (name, text) in [("g.ron", graph("\"m.ron\"")), ("s.ron", scene.replace("MODEL", "\"m.ron\""))] {
        dir.write(format!("graphs_of_mine/{name}"), text);
        dir.run(&format!("check graphs_of_mine/{name}")).refused("m.ron").says(&[&format!("{name}:")]);
    }
}

#[test]
fn dead_stretches_are_left_out_and_their_seconds_told() {
    let dir = folder();
    let clean = told(&dir, "s.csv --out clean.ron");
    let no_signal = |told: &Value| -> Vec<[f64; 2]> {
        let all = told["dropped"].as_array().expect("a list").iter();
        let dead = all.filter(|d| ["still", "clipped", "dead"].iter().any(|why| d["why"] == *why));
        let span = |d: &Value| ["start_s", "length_s"].map(|name| d[name].as_f64().expect("seconds"));
        dead.map(span).map(|[start, length]| [start, start + length]).collect()
    };
    assert!(no_signal(&clean).is_empty(), "{clean}");
    // Half of a stay of six seconds and a bit of another: noise of the sensor.
    let mut random = asperity_numbers::Random::new(1);
    let noise: Vec<f64> = (0..stroke().force.len()).map(|_| 1e-3 * random.normal()).collect();
    let dead = [20_000..20_800, 37_000..40_000];
    dir.write(
        "dead.csv",
        table(COLUMNS, |n| {
            let is_dead = dead.iter().any(|range| range.contains(&n));
            let acceleration = if is_dead { noise[n] } else { stroke().acceleration[n] + noise[n] };
            vec![stroke().force[n], stroke().speed[n], acceleration]
        }),
    );
    let ran = fit(&dir, "dead.csv --out m.ron").ok();
    ran.says(&["s: silent at a speed and force that sound elsewhere"]);
    let mended = told(&dir, "dead.csv --out m.ron");
    let found = no_signal(&mended);
    assert_eq!(found.len(), 2, "{found:?}");
    for ([from, to], want) in found.into_iter().zip(dead) {
        let want = [want.start, want.end].map(|n| n as f64 / 1000.0);
        assert!(
            (from - want[0]).abs() < 0.031 && (to - want[1]).abs() < 0.031,
            "{from} to {to}, not {want:?}"
        );
    }
    // All nine models are as loud as from the whole recording.
    let levels = |told: &Value| -> Vec<f64> {
        let models = told["models"].as_array().expect("models").iter();
        models.map(|model| model["rms_m_s2"].as_f64().expect("a level")).collect()
    };
    let (clean, mended) = (levels(&clean), levels(&mended));
    assert_eq!((clean.len(), mended.len()), (9, 9));
    let off = clean.iter().zip(&mended).map(|(a, b)| (20.0 * (a / b).log10()).abs()).fold(0.0, f64::max);
    assert!(off < 0.7, "{off} dB");
}

#[test]
fn power_above_half_the_rate_is_warned_of() {
    let dir = folder();
    let mut random = asperity_numbers::Random::new(3);
    let rows: String =
        (0..15_000).map(|n| format!("{},1.0,50.0,{}\n", n as f64 / 5000.0, random.normal())).collect();
    dir.write("fast.csv", format!("t_s,force_n,speed_mm_s,ax_m_s2\n{rows}"));
    let ran = fit(&dir, "fast.csv --out m.ron").ok();
    ran.says(&["% of the vibration's power is above 500 Hz", "--model-hz 2000 keeps more"]);
    let ran = fit(&dir, "fast.csv --out m.ron --model-hz 5000").ok();
    assert!(!ran.err.contains("power is above"), "{}", ran.err);
    // Bands reach as far as the models: by their nominal names.
    assert!(ran.out.contains("\n   1600 "), "{}", ran.out);
}
