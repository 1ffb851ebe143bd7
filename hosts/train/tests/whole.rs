//! A small training run from data to files, like a user's.

use std::path::Path;

use asperity_diagnostics::Source;
use asperity_texture::{Library, LibraryMaterial};
use std::process::{Command, Output};

fn train(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_asperity-train"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the program starts")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

const SMALL: [&str; 13] = [
    "train",
    "--every",
    "12",
    "--pieces",
    "1",
    "--naming-steps",
    "30",
    "--naming-batch",
    "8",
    "--feeling-steps",
    "90",
    "--settling-steps",
    "60",
];

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn small_run_writes_a_model_and_its_card_can_be_rewritten() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = train(&[&SMALL[..], &["--out", "a"]].concat(), folder.path());
    assert!(output.status.success(), "{}", said(&output));
    let model = folder.path().join("a");
    // A line of progress has loss, rate and time left.
    let progress = said(&output);
    let line = progress.lines().find(|line| line.starts_with("feeling: ")).expect("progress");
    assert!(line.contains(", loss ") && line.contains(" steps/s, ") && line.ends_with(" s left"), "{line}");
    // Largest size of image and texture encoder.
    assert!(read(&model, "encoder.onnx").len() < 12_000_000);
    let library = Library::read(model.join("materials.ron")).expect("a library");
    assert_eq!(library.materials().len(), 8);
    assert_eq!(library.encoder().as_deref(), Some(model.join("encoder.onnx").as_path()));
    for material in library.materials() {
        assert!(material.family.is_some() && material.vector.iter().all(|x| x.is_finite()));
        let picture =
            asperity_texture::picture::read(&library.beside(&material.images[0])).expect("a picture");
        assert_eq!(picture.image.size, [192, 256]);
    }
    let card = String::from_utf8(read(&model, "MODEL_CARD.md")).expect("text");
    for heading in [
        "## Goals",
        "## Names",
        "## Vibration",
        "## Mean or root mean square",
        "## Mean over root mean square",
        "## Surfaces that were never seen",
    ] {
        assert!(card.contains(heading), "{card}");
    }
    assert!(!card.contains("NaN") && !card.contains("inf"), "{card}");
    let svg = String::from_utf8(read(&model, "curves.svg")).expect("text");
    assert!(svg.contains("naming") && svg.contains("feeling") && svg.contains("settling"));

    // The card does not depend on its time of writing. A later material is not judged and does no harm.
    std::fs::remove_file(model.join("MODEL_CARD.md")).expect("removed");
    let more = library.materials()[0].clone();
    let more = LibraryMaterial { name: "mine".into(), ..more };
    let text = String::from_utf8(read(&model, "materials.ron")).expect("text");
    let text = Library::insert(&Source::new("materials.ron", text), &more).expect("one more");
    std::fs::write(model.join("materials.ron"), text).expect("written");
    let output = train(&["evaluate", "a"], folder.path());
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(String::from_utf8(read(&model, "MODEL_CARD.md")).expect("text"), card);

    // The classifier's figures outlive its file, as long as all else about names is the same.
    std::fs::create_dir(folder.path().join("empty")).expect("a folder");
    let output = train(&["evaluate", "a", "--run", "empty"], folder.path());
    assert!(output.status.success(), "{}", said(&output));
    let again = String::from_utf8(read(&model, "MODEL_CARD.md")).expect("text");
    let row = "| classifier of stage one, as judged earlier on the same images and vectors |";
    assert!(again.replace(row, "| classifier of stage one |") == card && again != card, "{again}");

    // The network alone can be retrained.
    let kept = ["encoder.onnx", "materials.ron", "texture_mean.onnx"];
    let (before, network) = (kept.map(|name| read(&model, name)), read(&model, "texture.onnx"));
    let output = train(&["network", "a"], folder.path());
    assert!(output.status.success(), "{}", said(&output));
    assert!(kept.map(|name| read(&model, name)) == before);
    assert!(read(&model, "texture.onnx") != network);
    let written = asperity_texture::Model::load(model.join("texture.onnx")).expect("a network");
    assert!(written.answers_scatter() && written.target() == asperity_texture::Target::RootMeanSquare);
    let card = String::from_utf8(read(&model, "MODEL_CARD.md")).expect("text");
    assert!(card.contains("trained anew on vectors of the finished encoder: 90 steps, and 60"), "{card}");
    let losses = String::from_utf8(read(&model, "losses.csv")).expect("text");
    assert!(losses.contains("\nnetwork,90,") && losses.contains("\nsettling_other,"), "{losses}");
    assert!(!losses.contains("\nsettling,"), "{losses}");

    // Training again would lose it.
    let library = read(&model, "materials.ron");
    let output = train(&[&SMALL[..], &["--out", "a"]].concat(), folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("`mine` was added"), "{}", said(&output));
    assert!(library == read(&model, "materials.ron"));

    // Other settings are refused for a run's folder and for a model's folder.
    let output =
        train(&[&SMALL[..], &["--out", "a", "--run", "b.run", "--seed", "2"]].concat(), folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("a model with other settings"), "{}", said(&output));
    let output = train(&[&SMALL[..], &["--out", "a", "--seed", "2"]].concat(), folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("begun with other settings"), "{}", said(&output));
    std::fs::remove_file(folder.path().join("a.run/settings.json")).expect("removed");
    let output = train(&[&SMALL[..], &["--out", "a"]].concat(), folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("what this checkpoint was made with"), "{}", said(&output));
}

#[cfg(unix)]
#[test]
fn stopped_run_ends_at_the_same_bits_as_an_unbroken_one() {
    use std::io::{BufRead as _, BufReader};
    use std::process::Stdio;
    let folder = tempfile::tempdir().expect("a folder");
    for (name, hz) in [("felt", 80.0), ("slate", 430.0)] {
        record(&folder.path().join("mine"), name, hz);
    }
    // With one picture, none is held out.
    std::fs::remove_file(folder.path().join("mine/slate/1.png")).expect("removed");
    let settings = [
        "--data",
        "recordings:mine",
        "--naming-steps",
        "5",
        "--naming-batch",
        "4",
        "--feeling-steps",
        "400",
        "--settling-steps",
        "130",
    ];
    let arguments = |out| [&["train"], &settings[..], &["--out", out]].concat();
    let mut stopped = Command::new(env!("CARGO_BIN_EXE_asperity-train"))
        .args(arguments("b"))
        .current_dir(folder.path())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut lines = BufReader::new(stopped.stderr.take().expect("piped")).lines().map_while(Result::ok);
    assert!(lines.any(|line| line.starts_with("feeling: ")), "it ended early");
    // No other run can train there meanwhile.
    let output = train(&arguments("b"), folder.path());
    assert!(
        output.status.code() == Some(2) && said(&output).contains("another training"),
        "{}",
        said(&output)
    );
    let signal = Command::new("kill").args(["-INT", &stopped.id().to_string()]).status().expect("kill");
    assert!(signal.success());
    assert!(lines.any(|line| line.contains("the same command goes on")), "in the middle of a stage");
    assert_eq!(stopped.wait().expect("an end").code(), Some(130));
    assert!(folder.path().join("b.run/feeling.checkpoint").exists());
    assert!(!folder.path().join("b/texture.onnx").exists());
    for out in ["a", "b"] {
        let output = train(&arguments(out), folder.path());
        assert!(output.status.success(), "{}", said(&output));
    }
    for name in
        ["encoder.onnx", "texture.onnx", "texture_mean.onnx", "materials.ron", "losses.csv", "MODEL_CARD.md"]
    {
        assert!(read(&folder.path().join("a"), name) == read(&folder.path().join("b"), name), "{name}");
    }

    // Without held-out pictures, no material is called wrongly named.
    let card = String::from_utf8(read(&folder.path().join("a"), "MODEL_CARD.md")).expect("text");
    let names = card.split("## Vibration").next().expect("a part");
    assert!(names.contains("## Names") && !names.contains("slate"), "{names}");

    // A run does not continue with changed data.
    record(&folder.path().join("mine"), "felt", 90.0);
    let output = train(&arguments("a"), folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("the data have changed"), "{}", said(&output));
}

#[test]
fn what_cannot_be_trained_on_is_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let cases = [
        (["--data", "hatt:no/such/folder"], "no/such/folder"),
        (["--data", "recordings:no/such/folder"], "no/such/folder"),
        (["--data", "penn"], "hatt:FOLDER"),
        (["--naming-rate", "0"], "above 0"),
    ];
    for (out, (arguments, wanted)) in ["a", "b", "c", "d"].into_iter().zip(cases) {
        let output = train(&[&["train", "--out", out], &arguments[..]].concat(), folder.path());
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(said(&output).contains(wanted), "{}", said(&output));
        // It leaves nothing in the way of another try.
        assert!(std::fs::read_dir(folder.path()).expect("a folder").next().is_none(), "{out}");
    }
}

/// A material's folder: two pictures and a humming stroke of 3 s at 2 kHz.
fn record(folder: &Path, name: &str, hz: f64) {
    record_for(3.0, folder, name, hz);
}

/// A material's folder with a stroke of another duration.
fn record_for(duration_s: f64, folder: &Path, name: &str, hz: f64) {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).expect("a folder");
    for number in 0..2 {
        let shade = |x: u32| (128.0 + 100.0 * (f64::from(x) * hz / 800.0 + f64::from(number)).sin()) as u8;
        let [width, height] = if number == 0 { [200, 150] } else { [320, 240] };
        let picture =
            image::RgbImage::from_fn(width, height, |x, _| image::Rgb([shade(x), 128, shade(x + 9)]));
        picture.save(folder.join(format!("{number}.png"))).expect("a picture");
    }
    let mut csv = String::from("time_s,force_n,speed_mm_s,acceleration_m_s2\n");
    for n in 0..(2000.0 * duration_s) as u32 {
        let t = f64::from(n) / 2000.0;
        let a = 2.0 * (std::f64::consts::TAU * hz * t).sin();
        csv.push_str(&format!("{t:.4},1.0,{:.2},{a:.4}\n", 80.0 + 20.0 * t.sin()));
    }
    std::fs::write(folder.join("stroke.csv"), csv).expect("a stroke");
}

#[test]
fn papers_losses_train_and_unjudged_losses_have_no_figure() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, hz) in [("felt", 80.0), ("slate", 430.0), ("mesh", 240.0)] {
        // Too short to hold out a part.
        record_for(0.55, &folder.path().join("mine"), name, hz);
    }
    let settings = "train --data recordings:mine --out m --target mean --error euclidean --naming-weight 0 \
                    --unseen 1 --naming-steps 3 \
                    --naming-batch 4 --feeling-steps 20 --feeling-groups 4 --settling-steps 3";
    let output = train(&settings.split_whitespace().collect::<Vec<_>>(), folder.path());
    assert!(output.status.success(), "{}", said(&output));
    let card = String::from_utf8(read(&folder.path().join("m"), "MODEL_CARD.md")).expect("text");
    for wanted in [
        "aims at mean magnitudes, as in the paper,",
        "errors are weighed in m/s^2",
        "a weight of 0 on naming",
        "| model | - | - |",
        "| all | - | - | - | - | - |",
        "neighbour's vector -, with the image's own -",
    ] {
        assert!(card.contains(wanted), "{wanted}: {card}");
    }
    let load = |name| asperity_texture::Model::load(folder.path().join(name)).expect("a network");
    let [mean, rms] = [load("m/texture.onnx"), load("m/texture_rms.onnx")];
    assert_eq!(mean.target(), asperity_texture::Target::Mean);
    assert!(!mean.answers_scatter() && rms.answers_scatter());
    // Single frames tell nothing of others' scatter.
    assert!(!card.contains("## Mean over root"), "{card}");
}

#[test]
fn a_folder_of_recordings_becomes_a_model() {
    let folder = tempfile::tempdir().expect("a folder");
    let hums = [("felt", 80.0), ("slate", 430.0), ("wire mesh", 240.0), ("wire_mesh", 150.0)];
    for (name, hz) in hums {
        record(&folder.path().join("mine"), name, hz);
    }
    let settings = [
        "train",
        "--data",
        "recordings:mine",
        "--out",
        "m",
        "--naming-steps",
        "5",
        "--naming-batch",
        "4",
        "--feeling-steps",
        "3000",
        "--settling-steps",
        "400",
        "--feeling-groups",
        "8",
        "--unseen",
        "1",
    ];
    let output = train(&settings, folder.path());
    assert!(output.status.success(), "{}", said(&output));
    assert!(said(&output).contains("slate/0.png: enlarged"), "{}", said(&output));
    let library = Library::read(folder.path().join("m/materials.ron")).expect("a library");
    assert_eq!(library.materials().len(), 3);
    // Names that a file system may confuse have separate pictures.
    assert_eq!(std::fs::read_dir(folder.path().join("m/pictures")).expect("pictures").count(), 4);
    // Its answer for each material is the material's hum.
    let model = asperity_texture::Model::load(folder.path().join("m/texture.onnx")).expect("a network");
    // Its range is the trained one and no more.
    let reach = model.trained();
    assert_eq!(reach.force_max_n, Some(1.0));
    assert!(reach.speed_max_mm_s.is_some_and(|v| (90.0..110.0).contains(&v)), "{reach:?}");
    // It works from any folder and any spelling of it, and the run's classifier is needed.
    let from = folder.path().join("elsewhere");
    std::fs::create_dir(&from).expect("a folder");
    let output = train(&["evaluate", "../m/"], &from);
    assert!(
        output.status.code() == Some(2) && said(&output).contains("--data says where"),
        "{}",
        said(&output)
    );
    let before = read(&folder.path().join("m"), "MODEL_CARD.md");
    let output = train(&["evaluate", "../m/", "--data", "recordings:../mine"], &from);
    assert!(output.status.success() && !said(&output).contains("no classifier"), "{}", said(&output));
    assert!(read(&folder.path().join("m"), "MODEL_CARD.md") == before);
    let output = train(&["evaluate", "../m/", "--run", "nowhere"], &from);
    assert!(output.status.code() == Some(2) && said(&output).contains("no such folder"), "{}", said(&output));

    // The card has no unknown facts: behaviour beyond the range, a second signal, families.
    let card = String::from_utf8(read(&folder.path().join("m"), "MODEL_CARD.md")).expect("text");
    assert!(card.contains("| (c) two signals of the same touch | - | - |"), "{card}");
    assert!(!card.contains("family for") && !card.contains("Beyond") && !card.contains("physics"), "{card}");
    // It has no user's folder.
    assert!(!String::from_utf8_lossy(&read(&folder.path().join("m"), "texture.onnx")).contains("mine"));
    for material in library.materials() {
        let (_, hz) = hums.into_iter().find(|(name, _)| *name == material.name).expect("one of them");
        assert_eq!(loudest_hz(&model, material), hz, "{}", material.name);
    }
}

/// Frequency of the largest answer at 80 mm/s and 1 N.
fn loudest_hz(model: &asperity_texture::Model, material: &LibraryMaterial) -> f64 {
    let vectors = [material.vector.to_vec()];
    let runner = model.runner(&vectors, asperity_texture::Precision::F32, asperity_texture::Choice::Auto);
    let mut magnitudes = [0.0; 100];
    let mut velocity = [0.0; 20];
    velocity[..10].fill(80.0);
    runner.expect("a runner").run(0, &[1.0; 10], &velocity, &mut magnitudes).expect("an answer");
    assert!(magnitudes.iter().all(|m| m.is_finite() && *m >= 0.0), "{}", material.name);
    let loudest = (0..100).max_by(|a, b| f32::total_cmp(&magnitudes[*a], &magnitudes[*b])).expect("a bin");
    10.0 * (loudest + 1) as f64
}

#[test]
fn a_folder_of_the_toolkits_models_becomes_a_model() {
    let folder = tempfile::tempdir().expect("a folder");
    let penn = folder.path().join("penn");
    let rings = [("Cork", 120.0), ("Brick 2", 220.0), ("Wire Mesh", 350.0)];
    for (name, hz) in rings {
        // All invented: a resonance, louder with speed and force.
        let angle = std::f64::consts::TAU * hz / 1000.0;
        let models: String = [(20.0, 0.5, 0.01), (200.0, 0.5, 0.04), (20.0, 2.0, 0.02), (200.0, 2.0, 0.08)]
            .map(|(speed, force, var)| {
                format!(
                    "<model><ARcoeff>{} \
                     {}</ARcoeff><var>{var}</var><gain>1.2</gain>\
                     <speedMod>{speed}</speedMod><forceMod>{force}</forceMod></model>\n",
                    -2.0 * 0.96 * angle.cos(),
                    0.96_f64.powi(2)
                )
            })
            .concat();
        let set = format!(
            "<modelSet><SampleRate>1000</SampleRate><numMod>4</numMod><tri>1 2 3 2 3 \
             4</tri>\n{models}</modelSet>\n"
        );
        std::fs::create_dir_all(&penn).expect("a folder");
        std::fs::write(penn.join(format!("Models_{name}.xml")), set).expect("a model");
        let shade = |x: u32| (128.0 + 100.0 * (f64::from(x) * hz / 800.0).sin()) as u8;
        let picture = image::RgbImage::from_fn(320, 240, |x, y| image::Rgb([shade(x), shade(y), 90]));
        picture.save(penn.join(format!("{name}_square.bmp"))).expect("a picture");
    }
    let settings = "train --data hatt:penn --out m --naming-steps 5 --naming-batch 4 --feeling-steps 1500 \
                    --settling-steps 800 --feeling-groups 8";
    let output = train(&settings.split(' ').collect::<Vec<_>>(), folder.path());
    assert!(output.status.success(), "{}", said(&output));
    let library = Library::read(folder.path().join("m/materials.ron")).expect("a library");
    assert_eq!(library.materials().len(), 3);
    let model = asperity_texture::Model::load(folder.path().join("m/texture.onnx")).expect("a network");
    for material in library.materials() {
        let (_, hz) = rings.into_iter().find(|(name, _)| *name == material.name).expect("one of them");
        let found = loudest_hz(&model, material);
        assert!((found - hz).abs() <= 20.0, "{}: {found} Hz", material.name);
    }
    let card = String::from_utf8(read(&folder.path().join("m"), "MODEL_CARD.md")).expect("text");
    // Spectra in closed form are of noise.
    assert!(card.contains("## Mean over root") && card.contains("| all | 0.886 | 0.8"), "{card}");
    assert!(card.contains("Data: `hatt`") && card.contains("Cork") && !card.contains("NaN"), "{card}");
}
