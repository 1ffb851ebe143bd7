//! A small training run, from data to files, as a user would start it.

use std::path::Path;
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

const SMALL: [&str; 11] = [
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
];

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn a_small_run_writes_a_whole_model_and_its_card_can_be_written_anew() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = train(&[&SMALL[..], &["--out", "a"]].concat(), folder.path());
    assert!(output.status.success(), "{}", said(&output));
    let model = folder.path().join("a");
    // both files that are shipped, and as many bytes as may be shipped
    assert!(read(&model, "encoder.onnx").len() + read(&model, "texture.onnx").len() < 12_000_000);
    let library = asperity_world::material::Library::read(model.join("materials.ron")).expect("a library");
    assert_eq!(library.materials().len(), 8);
    assert_eq!(library.encoder().as_deref(), Some(model.join("encoder.onnx").as_path()));
    for material in library.materials() {
        assert!(material.family.is_some() && material.vector.iter().all(|x| x.is_finite()));
        let picture = asperity_world::tactile::read(&library.beside(&material.images[0])).expect("a picture");
        assert_eq!(picture.image.size, [192, 256]);
    }
    let card = String::from_utf8(read(&model, "MODEL_CARD.md")).expect("text");
    for heading in
        ["## Names", "## Vibration", "## Mean or root mean square", "## Surfaces that were never seen"]
    {
        assert!(card.contains(heading), "{card}");
    }
    assert!(!card.contains("NaN") && !card.contains("inf"), "{card}");
    let svg = String::from_utf8(read(&model, "curves.svg")).expect("text");
    assert!(svg.contains("naming") && svg.contains("feeling") && svg.contains("settling"));

    // a second start finds all stages done, and the card does not depend on when it is written
    std::fs::remove_file(model.join("MODEL_CARD.md")).expect("removed");
    let output = train(&["evaluate", "a"], folder.path());
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(String::from_utf8(read(&model, "MODEL_CARD.md")).expect("text"), card);

    // other settings are not mixed into a run
    let output = train(&[&SMALL[..], &["--out", "a", "--seed", "2"]].concat(), folder.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("begun with other settings"), "{}", said(&output));
}

#[test]
fn what_cannot_be_trained_on_is_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    for (arguments, wanted) in [
        (["--data", "hatt:no/such/folder"], "no/such/folder"),
        (["--data", "recordings:no/such/folder"], "no/such/folder"),
        (["--data", "penn"], "hatt:FOLDER"),
        (["--naming-rate", "0"], "above 0"),
    ] {
        let output = train(&[&["train", "--out", "b"], &arguments[..]].concat(), folder.path());
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(said(&output).contains(wanted), "{}", said(&output));
    }
}
