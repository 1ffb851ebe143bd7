//! `asperity compare` as a user runs it.

use std::path::Path;
use std::sync::OnceLock;

use asperity_accuracy::{npy, phase};
use harness::retrieval::file;
use harness::{Room, root, run};
use serde_json::Value;

/// Output of a run without arguments.
struct Compared {
    _dir: Room,
    text: String,
    svg: String,
    csv: String,
}

fn compared() -> &'static Compared {
    static ONCE: OnceLock<Compared> = OnceLock::new();
    ONCE.get_or_init(|| {
        let dir = Room::new();
        let ran = dir.run("compare --svg a.svg --csv a.csv").ok();
        let read = |name: &str| dir.text(name);
        let (svg, csv) = (read("a.svg"), read("a.csv"));
        Compared { _dir: dir, text: ran.out, svg, csv }
    })
}

/// Kinds that retrieve phase, by what `asperity nodes` says of them.
fn kinds() -> Vec<String> {
    let ran = run(&root(), &["nodes", "--json"]).ok();
    let all: Value = serde_json::from_str(&ran.out).unwrap();
    let is = |port: &Value, kind: &str| port["type"].as_str().unwrap().starts_with(kind);
    let retrieves = |node: &&Value| {
        let inputs = node["inputs"].as_array().unwrap().iter().filter(|p| p["optional"] == false);
        let outputs = node["outputs"].as_array().unwrap();
        let [input, output] = [inputs.collect::<Vec<_>>(), outputs.iter().collect()];
        let ([input], [output]) = (&input[..], &output[..]) else { return false };
        is(input, "Magnitude") && (is(output, "Spectrum") || is(output, "Audio"))
    };
    let found = all.as_array().unwrap().iter().filter(retrieves);
    let kinds: Vec<String> = found.map(|n| n["kind"].as_str().unwrap().to_owned()).collect();
    assert!(kinds.iter().any(|k| k == "spsi"), "{kinds:?}");
    kinds
}

#[test]
fn every_retrieval_kind_is_in_table_picture_and_file() {
    let Compared { text, svg, csv, .. } = compared();
    for kind in kinds() {
        let lines = text.lines().filter(|l| l.split_whitespace().next() == Some(&kind)).count();
        assert!(lines >= 3, "{kind} stands in the tables of accuracy, rhythm and cost:\n{text}");
        assert!(svg.contains(&format!(">{kind}</text>")), "{kind} is in the picture");
        let rows = csv.lines().filter(|l| l.starts_with(&format!("{kind},{kind},false,"))).count();
        assert_eq!(rows, 7, "{kind} has a line for each vector");
    }
    assert!(text.lines().all(|l| l.chars().count() <= 110), "{text}");
    assert!(text.contains("published") && text.contains("fgla100 [2], offline"), "{text}");
}

/// A row `rtpghi` of the plugin stood beside one of the paper, and no row said where it was from.
#[test]
fn published_rows_carry_references_and_names_of_their_own() {
    let Compared { text, svg, csv, .. } = compared();
    let paper = "Real-time Spectrogram Inversion Using Phase Gradient Heap Integration";
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words(text).contains(&format!("[4] Z. Prusa, P. L. Sondergaard, {paper}, DAFx, 2016")), "{text}");
    assert!(
        svg.contains(&format!("[4] rtpghi0, rtpghi1: Z. Prusa, P. L. Sondergaard, {paper}, DAFx, 2016<"))
    );
    let mut rows = csv::Reader::from_reader(csv.as_bytes());
    let head = rows.headers().unwrap().clone();
    let at = |name: &str| head.iter().position(|h| h == name).unwrap();
    let (mut nodes, mut published) = (0, 0);
    for row in rows.records().map(Result::unwrap) {
        let (name, cited) = (&row[at("method")], &row[at("reference")]);
        let of_paper = &row[at("published")] == "true";
        assert_eq!((of_paper, of_paper), (name.contains(" ["), !cited.is_empty()), "{row:?}");
        *(if of_paper { &mut published } else { &mut nodes }) += 1;
    }
    assert!(nodes > 0 && published == 24 * 7, "{nodes} {published}");
}

#[test]
fn the_picture_is_well_formed() {
    let mut open = Vec::new();
    for part in compared().svg.split('<').skip(1) {
        let (tag, _) = part.split_once('>').expect("every tag ends");
        let name = tag.split([' ', '/', '\n']).find(|s| !s.is_empty()).expect("every tag has a name");
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') {
            open.push(name);
        }
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
    }
    assert!(open.is_empty(), "{open:?}");
    assert!(!compared().svg.contains("NaN") && !compared().svg.contains("inf"));
}

/// Rows are sorted by their results, so that a result that changes shows, too.
#[test]
fn picture_in_the_docs_has_the_methods_of_today() {
    let picture = std::fs::read_to_string(root().join("docs/compare.svg")).unwrap();
    let rows = |svg: &str| -> Vec<String> {
        let (_, first) = svg.split_once(">Spectral convergence, less is better</text>").expect("a heading");
        let labels =
            first.split("</text>").map(|text| text.rsplit('>').next().unwrap_or_default().to_owned());
        labels.take_while(|label| label != "published").collect()
    };
    let (today, shown) = (rows(&compared().svg), rows(&picture));
    let plugins = ["rtpghi", "gsrtisi_la", "sample_commit:emission=0"];
    let built_in: Vec<String> =
        shown.iter().filter(|row| !plugins.contains(&row.as_str())).cloned().collect();
    assert_eq!((built_in, shown.len()), (today.clone(), today.len() + 3), "run `make pictures`");
    let cited = compared().svg.lines().filter(|line| line.contains(">["));
    let cited = cited.filter_map(|line| line.split('>').nth(1));
    for text in harness::words_of(&compared().svg).chain(cited) {
        assert!(picture.contains(&format!(">{text}")), "no {text}: run `make pictures`");
    }
}

/// Steady magnitudes: right is what Gaussian noise of the same spectrum has.
#[test]
fn rhythm_stands_beside_that_of_gaussian_noise() {
    let Compared { text, csv, .. } = compared();
    assert!(text.contains("Rhythm on the mean spectrum of nnsmooth, held still"), "{text}");
    let of = |column: &str| figure(csv, "spsi", "nnsmooth_2500", column);
    assert!((0.09..0.13).contains(&of("noise_pulses")) && of("noise_repetition") < 0.1, "{csv}");
    assert!((of("noise_kurtosis") - 3.0).abs() < 0.1);
    for kind in kinds() {
        for column in ["pulses", "repetition", "kurtosis"] {
            let [one, other] = ["nnsmooth_2500", "taps_2500"].map(|v| figure(csv, &kind, v, column));
            assert!(one == other && one.is_finite() && one >= 0.0, "{kind}, {column}: {one}");
        }
    }
    // Its phases stand still against each other, and so it repeats itself.
    assert!(of("repetition") > 0.9, "{}", of("repetition"));
}

/// Numbers of a line of the CSV, by the names in its header.
fn figure(csv: &str, method: &str, vector: &str, column: &str) -> f64 {
    let mut lines = csv.lines();
    let at = lines.next().unwrap().split(',').position(|c| c == column).unwrap();
    let line = lines.map(|l| l.split(',').collect::<Vec<_>>()).find(|l| l[0] == method && l[3] == vector);
    let line = line.unwrap_or_else(|| panic!("no line for {method} on {vector}"));
    line[at].parse().unwrap_or_else(|_| panic!("{method}, {vector}, {column}: `{}`", line[at]))
}

#[test]
fn figures_are_those_of_the_signal_that_invert_writes() {
    let dir = Room::new();
    for name in ["texture_2500", "nnsmooth_2500"] {
        let mags = file(&format!("{name}.mag.npy"));
        let args = [
            "invert",
            "--phase",
            "spsi",
            "--rate",
            "2500",
            "--scale",
            "dft",
            "--out",
            "y.npy",
            "--magnitudes",
        ];
        run(&dir, &[&args[..], &[mags.to_str().unwrap()]].concat()).ok();
        let signal = npy::read(dir.join("y.npy")).unwrap().values.into_f64();
        let array = npy::read(&mags).unwrap();
        let framing = phase::framing(2500, array.shape[1]);
        let want = phase::score(&array.values.into_f32(), &framing, &signal).unwrap();
        for (column, want, within) in [
            ("convergence_db", want.convergence_db, 0.1),
            ("level_db", want.gain_db, 0.02),
            // Bins that the signal leaves empty count by their rounding errors.
            ("ltas_rms_db", want.ltas_rms_db, 3.0),
        ] {
            let have = figure(&compared().csv, "spsi", name, column);
            assert!((have - want).abs() < within, "{name}, {column}: {have}, by hand {want}");
        }
    }
}

/// No method answers before its input.
#[test]
fn spsi_follows_a_tone_half_a_window_late() {
    let csv = &compared().csv;
    let lag = figure(csv, "spsi", "texture_2500", "lag_tone_50_ms");
    assert!((lag - 49.0).abs() < 1.0, "{lag} ms");
    assert_eq!(figure(csv, "spsi", "texture_2500", "latency_ms"), 0.0);
    assert!(figure(csv, "spsi", "texture_2500", "us_a_frame") > 0.0);
    for kind in kinds() {
        for column in ["lag_texture_10_ms", "lag_tone_10_ms"] {
            let ms = figure(csv, &kind, "texture_2500", column);
            assert!(ms >= 0.0, "{kind}: {ms} ms");
        }
    }
}

/// A signal of two sines long enough to be scored.
fn write_signal(path: &Path, rate: u32) {
    let sine = |hz: f64, i: u32| (std::f64::consts::TAU * hz * f64::from(i) / f64::from(rate)).sin();
    let signal: Vec<f32> = (0..rate / 2).map(|i| (sine(150.0, i) + sine(310.0, i)) as f32).collect();
    npy::write_f32(std::fs::File::create(path).unwrap(), &[signal.len()], &signal).unwrap();
}

#[test]
fn folder_of_vectors_is_compared_with_published_scores() {
    let dir = Room::new();
    let folder = dir.join("mine");
    std::fs::create_dir(&folder).unwrap();
    std::fs::copy(file("taps_2500.sig.npy"), folder.join("taps_2500.sig.npy")).unwrap();
    write_signal(&folder.join("two.sig.npy"), 4000);
    dir.write("mine/index.json", r#"{"two": {"fs": 4000}, "gone": {"fs": 1}}"#);
    let scores = r#"{"sc": {"two": {"theirs": {"SC_dB": -12.5, "gain_dB": 0.25, "LTAS_rms_dB": 1.5}},
        "other": {"elsewhere": {"SC_dB": -1, "gain_dB": 0, "LTAS_rms_dB": 0}}},
        "latency_frames": {"theirs": -25}}"#;
    dir.write("mine/sc.json", scores);
    let args = ["compare", "--vectors", "mine", "--phase", "spsi:seed=5", "--phase", "spsi", "--json"];
    let ran = run(&dir, &args).ok();
    let json: Value = serde_json::from_str(&ran.out).unwrap();
    assert!(json["vectors"][0]["name"] == "taps_2500" && json["vectors"][1]["name"] == "two", "{json}");
    assert_eq!(json["vectors"][1]["rate_hz"], 4000);
    let methods = json["methods"].as_array().unwrap();
    let named = |label: &str| methods.iter().filter(|m| m["label"] == label).collect::<Vec<_>>();
    // What is there already is not run twice.
    assert_eq!((named("spsi:seed=5").len(), named("spsi").len()), (1, 1));
    let taps = named("spsi")[0]["scores"]["taps_2500"]["convergence_db"].as_f64().unwrap();
    assert!((taps + 6.5).abs() < 0.3, "{taps}");
    assert_ne!(named("spsi")[0]["scores"], named("spsi:seed=5")[0]["scores"], "the setting arrives");
    assert!(named("spsi")[0]["us_a_frame"]["4000"].as_f64().unwrap() > 0.0);
    let published = json["published"].as_array().unwrap();
    assert_eq!(published.len(), 1, "{published:?}");
    assert_eq!(published[0]["scores"]["two"]["convergence_db"], -12.5);
    assert!(published[0]["latency_ms"] == -50.0 && published[0]["scores"]["taps_2500"].is_null());
}

/// Makes the plugin that `asperity plugin new` writes in C, with other words in place of some of its own,
/// and builds it.
fn plugin(dir: &Room, name: &str, change: &[(&str, &str)]) -> String {
    dir.run(&format!("plugin new {name} --lang c")).ok();
    let path = dir.join(name).join(format!("{name}.c"));
    let mut source = std::fs::read_to_string(&path).unwrap();
    for (from, to) in change {
        assert!(source.contains(from), "{from}");
        source = source.replace(from, to);
    }
    std::fs::write(&path, source).unwrap();
    let built = std::process::Command::new("make").current_dir(dir.join(name)).output().expect("make");
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    format!("{name}/lib{name}.so")
}

#[test]
fn plugins_take_part_and_one_that_fails_is_a_row_that_says_so() {
    let dir = Room::new();
    let mine = plugin(&dir, "mine", &[]);
    let bad = plugin(&dir, "bad", &[("return ASPERITY_CONTINUE;", "return ASPERITY_FAILED;")]);
    std::fs::create_dir(dir.join("v")).unwrap();
    write_signal(&dir.join("v/two_2500.sig.npy"), 2500);
    let args = ["compare", "--vectors", "v", "--plugin", &mine, "--plugin", &bad, "--phase", "mine:spread=0"];
    let text = run(&dir, &args).ok().out;
    let line = |label: &str| {
        let line = text.lines().find(|l| l.split_whitespace().next() == Some(label));
        line.unwrap_or_else(|| panic!("{label}: {text}")).split_whitespace().nth(1).unwrap().to_owned()
    };
    for label in ["mine", "mine:spread=0"] {
        assert!(line(label).parse::<f64>().unwrap() < -3.0, "{text}");
    }
    assert_eq!(line("bad"), "!0.0", "{text}");
    assert!(text.contains("  bad: it failed 8 times, the last time it failed with code"), "{text}");
}

#[test]
fn what_is_wrong_is_told_before_anything_is_written() {
    let dir = Room::new();
    let at = |name: &str| dir.join(name);
    for (name, file, shape, value) in [
        ("flat", "x_2500.mag.npy", &[2000][..], 1.0),
        ("deep", "x_2500.sig.npy", &[200, 101], 1.0),
        ("bins", "x_2500.mag.npy", &[200, 127], 1.0),
        ("short", "x_2500.mag.npy", &[100, 101], 1.0),
        ("rateless", "x.mag.npy", &[200, 101], 1.0),
        ("odd", "x_2503.mag.npy", &[200, 101], 1.0),
        ("index", "x_2500.mag.npy", &[200, 101], 1.0),
        ("scores", "x_2500.mag.npy", &[200, 101], 1.0),
        ("silent", "x_2500.mag.npy", &[200, 101], 0.0),
    ] {
        std::fs::create_dir(at(name)).unwrap();
        let values = vec![value; shape.iter().product()];
        npy::write_f32(std::fs::File::create(at(name).join(file)).unwrap(), shape, &values).unwrap();
    }
    std::fs::create_dir(at("empty")).unwrap();
    dir.write("index/index.json", "{");
    dir.write("scores/sc.json", r#"{"sc": {"x_2500": {"a": {"SC_dB": "low"}}}}"#);
    let before = dir.files();
    for (args, says) in [
        ("--vectors gone", "cannot read this folder"),
        ("--vectors empty", "there are no vectors in this folder"),
        ("--vectors flat", "[2000] does not fit"),
        ("--vectors deep", "[200, 101] does not fit"),
        ("--vectors bins", "1 to 126 bins at 2500 Hz"),
        ("--vectors short", "100 frames are too few"),
        ("--vectors rateless", "the rate of this vector is unknown"),
        ("--vectors odd", "a multiple of 10"),
        ("--vectors index", "EOF while parsing an object"),
        ("--vectors scores", "invalid type: string \"low\", expected f64 at line 1 column 39"),
        ("--vectors silent", "all magnitudes are 0"),
        ("--phase spsy", "did you mean `spsi`?"),
        ("--phase gain", "`gain` is not a phase-retrieval node"),
        ("--phase spsi:sed=1", "did you mean `seed`?"),
        ("--phase spsi:seed", "no `=`"),
        ("--svg gone/a.svg", "the folder gone does not exist"),
        ("--svg a.svg --csv ./a.svg", "would write the same file as --csv"),
        ("--csv a.csv --json", "cannot be used with"),
        ("--plugin gone.so", "gone.so"),
    ] {
        let args: Vec<&str> = ["compare", "-q"].into_iter().chain(args.split(' ')).collect();
        run(&dir, &args).refused(says);
        assert_eq!(dir.files(), before, "{args:?}");
    }
}
