//! Small training runs from data to files, like a user's.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

use asperity_diagnostics::Source;
use asperity_texture::{Choice, Library, LibraryMaterial, Model, Precision, Target};

/// An empty folder of this name, for one test or for all.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("whole").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn command(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_asperity-train"));
    command.args(arguments.split_whitespace()).current_dir(folder);
    command
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Messages of a run that succeeds.
fn done(folder: &Path, arguments: &str) -> String {
    let output = command(folder, arguments).output().expect("the program starts");
    assert!(output.status.success(), "{arguments}: {}", said(&output));
    said(&output)
}

/// Asserts that the arguments or the files are refused for a reason.
fn refused(folder: &Path, arguments: &str, why: &str) {
    let output = command(folder, arguments).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(2), "{arguments}: {}", said(&output));
    assert!(said(&output).contains(why), "{arguments}: {}", said(&output));
}

fn bytes(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn text(folder: &Path, name: &str) -> String {
    String::from_utf8(bytes(folder, name)).expect("text")
}

fn model(folder: &Path, name: &str) -> Model {
    Model::load(folder.join(name)).expect("a network")
}

fn picture(size: [u32; 2], path: PathBuf, colour: impl Fn(u32, u32) -> [u8; 3]) {
    let [width, height] = size;
    let picture = image::RgbImage::from_fn(width, height, |x, y| image::Rgb(colour(x, y)));
    picture.save(path).expect("a picture");
}

/// A material's folder of recordings: pictures, and a stroke of some seconds at 2 kHz with a hum in noise.
/// (Without noise, most bins are 0, and a short training ends with 0 everywhere.)
fn record(folder: &Path, name: &str, (hz, seconds, pictures): (f64, f64, u32)) {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).expect("a folder");
    for number in 0..pictures {
        let shade = |x: u32| (128.0 + 100.0 * (f64::from(x) * hz / 800.0 + f64::from(number)).sin()) as u8;
        let size = if number == 0 { [200, 150] } else { [320, 240] };
        picture(size, folder.join(format!("{number}.png")), |x, _| [shade(x), 128, shade(x + 9)]);
    }
    let mut csv = String::from("time_s,force_n,speed_mm_s,acceleration_m_s2\n");
    let mut random = 1_u32;
    for n in 0..(2000.0 * seconds) as u32 {
        let t = f64::from(n) / 2000.0;
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(random) / 2.0_f64.powi(31) - 1.0;
        let a = 2.0 * (std::f64::consts::TAU * hz * t).sin() + noise;
        csv.push_str(&format!("{t:.4},1.0,{:.2},{a:.4}\n", 80.0 + 20.0 * t.sin()));
    }
    std::fs::write(folder.join("stroke.csv"), csv).expect("a stroke");
}

/// Recordings of a small run. With one picture, none is held out.
fn record_small(folder: &Path) {
    record(&folder.join("mine"), "felt", (80.0, 3.0, 2));
    record(&folder.join("mine"), "slate", (430.0, 3.0, 1));
}

const SMALL: &str = "train --data recordings:mine --naming-steps 5 --naming-batch 4 --feeling-steps 150 \
                     --feeling-groups 8 --settling-steps 40 --out";

/// Folder of a small run with the model `a`, which no test changes.
static RUN: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = folder("run");
    record_small(&folder);
    done(&folder, &format!("{SMALL} a"));
    folder
});

/// A copy of that folder, to change.
fn copied(name: &str) -> PathBuf {
    fn copy(from: &Path, to: &Path) {
        std::fs::create_dir_all(to).expect("a folder");
        for entry in std::fs::read_dir(from).expect("a folder").map(|entry| entry.expect("an entry")) {
            let (from, to) = (entry.path(), to.join(entry.file_name()));
            if from.is_dir() {
                copy(&from, &to);
            } else {
                std::fs::copy(from, to).expect("a copy");
            }
        }
    }
    let folder = folder(name);
    copy(&RUN, &folder);
    folder
}

#[test]
fn run_over_made_surfaces_writes_a_model_and_its_card() {
    let folder = folder("made");
    let progress = done(
        &folder,
        "train --every 16 --pieces 1 --naming-steps 8 --naming-batch 4 --feeling-steps 40 --feeling-groups 8 \
         --settling-steps 10 --out a",
    );
    // A line of progress has loss, rate and time left.
    let line = progress.lines().find(|line| line.starts_with("feeling: ")).expect("progress");
    assert!(line.contains(", loss ") && line.contains(" steps/s, ") && line.ends_with(" s left"), "{line}");
    let folder = folder.join("a");
    // Largest size of image and texture encoder.
    assert!(bytes(&folder, "encoder.onnx").len() < 12_000_000);
    let library = Library::read(folder.join("materials.ron")).expect("a library");
    assert_eq!(library.materials().len(), 6);
    assert_eq!(library.encoder().as_deref(), Some(folder.join("encoder.onnx").as_path()));
    for material in library.materials() {
        assert!(material.family.is_some() && material.vector.iter().all(|x| x.is_finite()));
        let picture =
            asperity_texture::picture::read(&library.beside(&material.images[0])).expect("a picture");
        assert_eq!(picture.image.size, [192, 256]);
    }
    let card = text(&folder, "MODEL_CARD.md");
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
    let svg = text(&folder, "curves.svg");
    assert!(svg.contains("naming") && svg.contains("feeling") && svg.contains("settling"));
}

#[test]
fn card_and_figures_of_the_classifier_can_be_rewritten() {
    let folder = copied("evaluate");
    let (model, card) = (folder.join("a"), text(&folder, "a/MODEL_CARD.md"));
    // Without held-out pictures, no material is called wrongly named.
    let names = card.split("## Vibration").next().expect("a part");
    assert!(names.contains("## Names") && !names.contains("slate"), "{names}");

    // The card does not depend on its time of writing. A later material is not judged and does no harm.
    std::fs::remove_file(model.join("MODEL_CARD.md")).expect("removed");
    let more = Library::read(model.join("materials.ron")).expect("a library").materials()[0].clone();
    let more = LibraryMaterial { name: "added".into(), ..more };
    let source = Source::new("materials.ron", text(&model, "materials.ron"));
    let library = Library::insert(&source, &more).expect("one more");
    std::fs::write(model.join("materials.ron"), &library).expect("written");
    done(&folder, "evaluate a");
    assert_eq!(text(&model, "MODEL_CARD.md"), card);

    // The classifier's figures outlive its file, as long as all else about names is the same.
    std::fs::create_dir(folder.join("empty")).expect("a folder");
    assert!(done(&folder, "evaluate a --run empty").contains("no classifier"));
    let again = text(&model, "MODEL_CARD.md");
    let row = "| classifier of stage one, as judged earlier on the same images and vectors |";
    assert!(again.replace(row, "| classifier of stage one |") == card && again != card, "{again}");

    // It works from any folder and any spelling of it, and needs the data.
    let from = folder.join("elsewhere");
    std::fs::create_dir(&from).expect("a folder");
    refused(&from, "evaluate ../a/", "--data says where");
    let told = done(&from, "evaluate ../a/ --data recordings:../mine");
    assert!(!told.contains("no classifier") && text(&model, "MODEL_CARD.md") == card, "{told}");
    refused(&from, "evaluate ../a/ --run nowhere", "no such folder");

    // Training again would lose the added material.
    refused(&folder, &format!("{SMALL} a"), "`added` was added");
    assert_eq!(text(&model, "materials.ron"), library);
}

#[test]
fn network_alone_can_be_retrained() {
    let folder = copied("network");
    let model_of = folder.join("a");
    let kept = ["encoder.onnx", "materials.ron", "texture_mean.onnx"];
    let (before, network) = (kept.map(|name| bytes(&model_of, name)), bytes(&model_of, "texture.onnx"));
    done(&folder, "network a --steps 30");
    assert!(kept.map(|name| bytes(&model_of, name)) == before);
    assert!(bytes(&model_of, "texture.onnx") != network);
    let written = model(&model_of, "texture.onnx");
    assert!(written.answers_scatter() && written.target() == Target::RootMeanSquare);
    let card = text(&model_of, "MODEL_CARD.md");
    assert!(card.contains("trained anew on vectors of the finished encoder: 30 steps, and 40"), "{card}");
    let losses = text(&model_of, "losses.csv");
    assert!(losses.contains("\nnetwork,30,") && losses.contains("\nsettling_other,"), "{losses}");
    assert!(!losses.contains("\nsettling,"), "{losses}");
}

#[test]
fn other_settings_or_data_are_refused() {
    let folder = copied("other");
    refused(&folder, &format!("{SMALL} a --seed 2"), "a model with other settings");
    refused(&folder, &format!("{SMALL} b --run a.run --seed 2"), "begun with other settings");
    record(&folder.join("mine"), "felt", (90.0, 3.0, 2));
    for arguments in [&format!("{SMALL} a"), "network a", "evaluate a"] {
        refused(&folder, arguments, "the data have changed");
    }
}

#[cfg(unix)]
#[test]
fn stopped_run_ends_at_the_same_bits_as_an_unbroken_one() {
    use std::io::{BufRead as _, BufReader};
    let folder = folder("stopped");
    record_small(&folder);
    let train = format!("{SMALL} b");
    let mut stopped =
        command(&folder, &train).stderr(std::process::Stdio::piped()).spawn().expect("the program starts");
    let mut lines = BufReader::new(stopped.stderr.take().expect("piped")).lines().map_while(Result::ok);
    assert!(lines.any(|line| line.starts_with("feeling: ")), "it ended early");
    // No other run can train there meanwhile.
    refused(&folder, &train, "another training");
    let signal = Command::new("kill").args(["-INT", &stopped.id().to_string()]).status().expect("kill");
    assert!(signal.success());
    assert!(lines.any(|line| line.contains("the same command goes on")), "in the middle of a stage");
    assert_eq!(stopped.wait().expect("an end").code(), Some(130));
    assert!(folder.join("b.run/feeling.checkpoint").exists() && !folder.join("b/texture.onnx").exists());
    done(&folder, &train);
    for name in
        ["encoder.onnx", "texture.onnx", "texture_mean.onnx", "materials.ron", "losses.csv", "MODEL_CARD.md"]
    {
        assert!(bytes(&RUN.join("a"), name) == bytes(&folder.join("b"), name), "{name}");
    }
}

#[test]
fn what_cannot_be_trained_on_is_refused_by_name() {
    let folder = folder("refused");
    for (out, arguments, wanted) in [
        ("a", "--data hatt:no/such/folder", "no/such/folder"),
        ("b", "--data recordings:no/such/folder", "no/such/folder"),
        ("c", "--data penn", "hatt:FOLDER"),
        ("d", "--naming-rate 0", "above 0"),
    ] {
        refused(&folder, &format!("train --out {out} {arguments}"), wanted);
        // It leaves nothing in the way of another try.
        assert!(std::fs::read_dir(&folder).expect("a folder").next().is_none(), "{out}");
    }
}

#[test]
fn papers_losses_train_and_unjudged_losses_have_no_figure() {
    let folder = folder("paper");
    for (name, hz) in [("felt", 80.0), ("slate", 430.0), ("mesh", 240.0)] {
        // Too short to hold out a part.
        record(&folder.join("mine"), name, (hz, 0.55, 2));
    }
    done(
        &folder,
        "train --data recordings:mine --out m --target mean --error euclidean --naming-weight 0 --unseen 1 \
         --naming-steps 3 --naming-batch 4 --feeling-steps 20 --feeling-groups 4 --settling-steps 3",
    );
    let card = text(&folder, "m/MODEL_CARD.md");
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
    let [mean, rms] = ["m/texture.onnx", "m/texture_rms.onnx"].map(|name| model(&folder, name));
    assert_eq!(mean.target(), Target::Mean);
    assert!(!mean.answers_scatter() && rms.answers_scatter());
    // Single frames tell nothing of others' scatter.
    assert!(!card.contains("## Mean over root"), "{card}");
}

/// Frequency of the largest answer at 80 mm/s and 1 N.
fn loudest_hz(model: &Model, material: &LibraryMaterial) -> f64 {
    let vectors = [material.vector.to_vec()];
    let runner = model.runner(&vectors, Precision::F32, Choice::Auto);
    let mut magnitudes = [0.0; 100];
    let mut velocity = [0.0; 20];
    velocity[..10].fill(80.0);
    runner.expect("a runner").run(0, &[1.0; 10], &velocity, &mut magnitudes).expect("an answer");
    assert!(magnitudes.iter().all(|m| m.is_finite() && *m >= 0.0), "{}", material.name);
    let loudest = (0..100).max_by(|a, b| f32::total_cmp(&magnitudes[*a], &magnitudes[*b])).expect("a bin");
    10.0 * (loudest + 1) as f64
}

#[test]
fn a_folder_of_recordings_becomes_a_model() {
    let folder = folder("recordings");
    let hums = [("felt", 80.0), ("slate", 430.0), ("wire mesh", 240.0), ("wire_mesh", 150.0)];
    for (name, hz) in hums {
        record(&folder.join("mine"), name, (hz, 3.0, 2));
    }
    let told = done(
        &folder,
        "train --data recordings:mine --out m --naming-steps 5 --naming-batch 4 --feeling-steps 500 \
         --feeling-rate 1e-3 --feeling-groups 8 --feeling-each 4 --settling-steps 200 --unseen 1",
    );
    assert!(told.contains("slate/0.png: enlarged"), "{told}");
    let library = Library::read(folder.join("m/materials.ron")).expect("a library");
    assert_eq!(library.materials().len(), 3);
    // Names that a file system may confuse have separate pictures.
    assert_eq!(std::fs::read_dir(folder.join("m/pictures")).expect("pictures").count(), 4);
    // Its range is the trained one and no more.
    let model = model(&folder, "m/texture.onnx");
    let reach = model.trained();
    assert_eq!(reach.force_max_n, Some(1.0));
    assert!(reach.speed_max_mm_s.is_some_and(|v| (90.0..110.0).contains(&v)), "{reach:?}");
    // The card has no unknown facts: behaviour beyond the range, a second signal, families.
    let card = text(&folder, "m/MODEL_CARD.md");
    assert!(card.contains("| (c) two signals of the same touch | - | - |"), "{card}");
    assert!(!card.contains("family for") && !card.contains("Beyond") && !card.contains("physics"), "{card}");
    // It has no user's folder.
    assert!(!String::from_utf8_lossy(&bytes(&folder, "m/texture.onnx")).contains("mine"));
    // Its answer for each material is the material's hum.
    for material in library.materials() {
        let (_, hz) = hums.into_iter().find(|(name, _)| *name == material.name).expect("one of them");
        assert_eq!(loudest_hz(&model, material), hz, "{}", material.name);
    }
}

#[test]
fn a_folder_of_the_toolkits_models_becomes_a_model() {
    let folder = folder("toolkit");
    let penn = folder.join("penn");
    std::fs::create_dir_all(&penn).expect("a folder");
    let rings = [("Cork", 120.0), ("Brick 2", 220.0), ("Wire Mesh", 350.0)];
    for (name, hz) in rings {
        // All invented: a resonance, louder with speed and force.
        let angle = std::f64::consts::TAU * hz / 1000.0;
        let ar = format!("{} {}", -2.0 * 0.96 * angle.cos(), 0.96_f64.powi(2));
        let models = [(20.0, 0.5, 0.01), (200.0, 0.5, 0.04), (20.0, 2.0, 0.02), (200.0, 2.0, 0.08)];
        let models = models.map(|(speed, force, var)| {
            format!(
                "<model><ARcoeff>{ar}</ARcoeff><var>{var}</var><gain>1.2</gain>\
                 <speedMod>{speed}</speedMod><forceMod>{force}</forceMod></model>\n"
            )
        });
        let head = "<SampleRate>1000</SampleRate><numMod>4</numMod><tri>1 2 3 2 3 4</tri>";
        let set = format!("<modelSet>{head}\n{}</modelSet>\n", models.concat());
        std::fs::write(penn.join(format!("Models_{name}.xml")), set).expect("a model");
        let shade = |x: u32| (128.0 + 100.0 * (f64::from(x) * hz / 800.0).sin()) as u8;
        picture([320, 240], penn.join(format!("{name}_square.bmp")), |x, y| [shade(x), shade(y), 90]);
    }
    done(
        &folder,
        "train --data hatt:penn --out m --naming-steps 5 --naming-batch 4 --feeling-steps 500 \
         --feeling-rate 1e-3 --feeling-groups 8 --feeling-each 4 --settling-steps 200",
    );
    let library = Library::read(folder.join("m/materials.ron")).expect("a library");
    assert_eq!(library.materials().len(), 3);
    let model = model(&folder, "m/texture.onnx");
    for material in library.materials() {
        let (_, hz) = rings.into_iter().find(|(name, _)| *name == material.name).expect("one of them");
        let found = loudest_hz(&model, material);
        assert!((found - hz).abs() <= 20.0, "{}: {found} Hz", material.name);
    }
    let card = text(&folder, "m/MODEL_CARD.md");
    // Spectra in closed form are of noise.
    assert!(card.contains("## Mean over root") && card.contains("| all | 0.886 | 0.8"), "{card}");
    assert!(card.contains("Data: `hatt`") && card.contains("Cork") && !card.contains("NaN"), "{card}");
}
