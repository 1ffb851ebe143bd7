//! The pictures of the documentation, and the demo, are as the program draws them today.

use harness::{Room, files, root, run};

/// Pictures that `make` does not draw.
const BY_HAND: &[&str] = &["wiring.svg"];
/// Pictures that no two runs draw alike: they show times, or noise of a card.
const MEASURED: &[&str] = &["calibrate.svg", "compare.svg"];

fn makefile() -> String {
    std::fs::read_to_string(root().join("Makefile")).expect("the Makefile")
}

/// The program's arguments in a target of the Makefile, one command each.
fn commands(target: &str) -> Vec<String> {
    let text = makefile().replace("\\\n", " ");
    let mut lines = text.lines().skip_while(|line| !line.starts_with(&format!("{target}: ")));
    lines.next().unwrap_or_else(|| panic!("no target {target}"));
    let recipe = lines.take_while(|line| line.starts_with('\t'));
    recipe.filter_map(|line| line.split_once("/asperity ").map(|(_, args)| args.to_owned())).collect()
}

/// Compares a picture with that of the documentation; with `ASPERITY_PICTURES=FOLDER` keeps it there instead.
#[track_caller]
pub fn is_fresh(dir: &Room, name: &str) {
    if let Some(folder) = std::env::var_os("ASPERITY_PICTURES") {
        std::fs::copy(dir.join(name), std::path::Path::new(&folder).join(name)).expect("a picture");
        return;
    }
    let shown = std::fs::read(root().join("docs").join(name)).expect(name);
    assert!(dir.bytes(name) == shown, "docs/{name} is stale: run `make pictures`");
}

#[test]
fn pictures_in_the_docs_are_fresh() {
    let dir = Room::new();
    let mut drawn = Vec::new();
    for line in commands("pictures") {
        let name = line.split_whitespace().find_map(|word| word.strip_prefix("docs/")).expect("a picture");
        if !MEASURED.contains(&name) {
            let out = dir.join(name).display().to_string();
            let words: Vec<&str> = line.split_whitespace().collect();
            let words = words.iter().map(|word| if word.ends_with(name) { out.as_str() } else { word });
            run(&root(), &words.collect::<Vec<_>>()).ok();
            is_fresh(&dir, name);
            drawn.push(name.to_owned());
        }
    }
    assert_eq!(drawn, ["graph.svg", "render.svg", "scene.svg"]);
}

/// A picture that nobody draws anew shows materials and options that no longer exist.
#[test]
fn every_picture_in_the_docs_is_drawn_by_make() {
    let text = makefile() + &std::fs::read_to_string(root().join("tests/live/pictures.rs")).unwrap();
    let is_picture = |name: &String| name.ends_with(".svg") || name.ends_with(".png");
    let all: Vec<String> = files(&root().join("docs")).into_iter().filter(is_picture).collect();
    assert!(all.len() > 8, "{all:?}");
    for name in all.iter().filter(|name| !BY_HAND.contains(&name.as_str())) {
        let drawn = text.contains(name.as_str()) || is_drawn_by_a_test(name);
        assert!(drawn, "no target of the Makefile draws docs/{name}");
    }
    assert!(text.contains("$(OUT)/tradeoff/*.svg"), "`make tradeoff` draws those of docs/tradeoff");
}

fn is_drawn_by_a_test(name: &str) -> bool {
    let drawn_by = if name.starts_with("studies_") { "study_of_the_docs" } else { "picture_of_a_fit" };
    (name.starts_with("studies_") || name == "autoregressive.svg") && makefile().contains(drawn_by)
}

/// `make demo` and the README's picture once showed the paper's chain, which is the comparison.
#[test]
fn demo_opens_with_the_recommended_graph() {
    let dir = Room::new();
    let demo = commands("demo");
    let graphs: Vec<&str> = demo.iter().filter_map(|line| line.split_whitespace().nth(1)).collect();
    assert_eq!(graphs, ["graphs/texture.ron", "graphs/heravi2024.ron"]);
    for line in &demo {
        dir.run(&format!("{} --seconds 1", line.replace("$(OUT)/", ""))).ok();
    }
    assert_eq!(dir.files(), ["demo.json", "demo.svg", "demo.wav", "paper.wav"]);
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let pictures: Vec<&str> =
        readme.split("](docs/").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    let first = pictures.iter().find(|name| name.ends_with(".svg")).expect("a picture");
    let drawn = commands("pictures").into_iter().find(|line| line.ends_with(&format!("docs/{first}")));
    assert!(drawn.is_some_and(|line| line.starts_with("render graphs/texture.ron ")), "{first}");
}
