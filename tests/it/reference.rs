//! The pages in `docs/reference` are as the program is.

use std::sync::Arc;

use asperity_actuator::ActuatorProfile;
use asperity_autoregressive::TextureFile;
use asperity_data::recordings;
use asperity_diagnostics::{Diagnostic, Source};
use asperity_graph::GraphFile;
use asperity_motion::{ColumnMap, Trajectory, TrajectoryOptions};
use asperity_scene::Scene;
use asperity_texture::Library;
use asperity_tradeoff::Tradeoff;
use harness::{Room, root};

fn page(name: &str) -> String {
    std::fs::read_to_string(root().join("docs/reference").join(name)).expect(name)
}

#[test]
fn reference_pages_are_fresh() {
    let room = Room::new();
    let pages = ["nodes.md", "commands.md", "scene-file.md", "hard-cases.md"];
    for name in pages {
        room.write(name, page(name));
    }
    room.run("reference --out .").ok();
    for name in pages {
        assert!(room.text(name) == page(name), "docs/reference/{name} is stale: run `make reference`");
    }
}

type Read = fn(&Arc<Source>) -> Result<(), Diagnostic>;

/// The reader of an example, by its first word.
fn reader(example: &str) -> Option<Read> {
    let readers: [(&str, Read); 8] = [
        ("Graph(", |s| GraphFile::parse(s).map(drop)),
        ("Scene(", |s| Scene::parse(s).map(drop)),
        ("Library(", |s| Library::parse(s).map(drop)),
        ("ActuatorProfile(", |s| ActuatorProfile::parse(s).map(drop)),
        ("Autoregressive(", |s| TextureFile::parse(s).map(drop)),
        ("Tradeoff(", |s| Tradeoff::parse(s).map(drop)),
        ("t_s,x_mm", |s| Trajectory::parse(s, &TrajectoryOptions::default()).map(drop)),
        ("t_s,force_n", |s| recordings::parse(s, &ColumnMap::default()).map(drop)),
    ];
    readers.into_iter().find(|(word, _)| example.starts_with(word)).map(|(_, read)| read)
}

/// Whole files on a page, with their readers.
fn examples(page: &str) -> Vec<(String, Read)> {
    let blocks = page.split("```").skip(1).step_by(2).filter_map(|block| block.split_once('\n'));
    let numbers = "0.5, ".repeat(256);
    let rows = (3..600).map(|i| format!("{},0.5,80.0,0.{}\n", f64::from(i) / 1000.0, i % 7));
    let long = |text: String| {
        if text.starts_with("t_s,force_n") { text + &rows.clone().collect::<String>() } else { text }
    };
    let whole = blocks.map(|(_, text)| long(text.replace("/* 256 numbers */", &numbers)));
    whole.filter_map(|text| reader(&text).map(|read| (text, read))).collect()
}

fn rows(page: &str) -> impl Iterator<Item = &str> {
    page.lines().filter(|line| line.starts_with('|'))
}

/// An unknown field makes a reader list those that it knows: each must stand in a table of the page.
fn fields_are_described(page: &str, text: &str, read: Read) -> usize {
    let mut records = 0;
    for (at, _) in text.match_indices('(') {
        let probe = format!("{}zzzzzz: 0, {}", &text[..=at], &text[at + 1..]);
        let Err(refused) = read(&Source::new("example", probe)) else { continue };
        let help = refused.help.unwrap_or_default();
        if refused.message.contains("zzzzzz") && help.starts_with("there") {
            records += 1;
            for field in help.split('`').skip(1).step_by(2) {
                assert!(
                    rows(page).any(|row| row.contains(&format!("`{field}`"))),
                    "no table has `{field}`: {help}"
                );
            }
        }
    }
    records
}

/// A number out of range makes a reader tell the range: a row of the page must have it.
fn ranges_are_right(page: &str, text: &str, read: Read) -> usize {
    let mut ranges = 0;
    for (at, _) in text.match_indices(": ") {
        let (before, after) = (&text[..at], &text[at + 2..]);
        let name = before.rsplit(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or_default();
        let number = after.split(|c: char| !(c.is_ascii_digit() || ".-".contains(c))).next().unwrap_or("");
        let probe = format!("{before}: -8000000000000000{}", &after[number.len()..]);
        if number.is_empty() {
            continue;
        }
        let Err(refused) = read(&Source::new("example", probe)) else { continue };
        let Some(range) = refused.help.as_deref().and_then(|help| help.strip_prefix("from ")) else {
            continue;
        };
        ranges += 1;
        let bounds = range.split(' ').take(3).collect::<Vec<_>>().join(" ");
        let cells = |row: &str| row.split('|').any(|cell| cell.trim() == bounds);
        let said = |row: &str| row.contains(&format!("`{name}`")) && cells(row);
        assert!(rows(page).any(said), "no row has `{name}` with the range {bounds}");
    }
    ranges
}

#[test]
fn reference_examples_fields_and_ranges_are_those_of_readers() {
    for (name, whole, records, ranges) in
        [("graph-file.md", 1, 3, 4), ("scene-file.md", 1, 12, 12), ("files.md", 6, 20, 35)]
    {
        let page = page(name);
        let all = examples(&page);
        let mut found = [0; 2];
        for (text, read) in &all {
            if let Err(refused) = read(&Source::new(name, text.as_str())) {
                panic!("an example of {name} is refused: {refused}\n{text}");
            }
            found[0] += fields_are_described(&page, text, *read);
            found[1] += ranges_are_right(&page, text, *read);
        }
        let enough = all.len() >= whole && found[0] >= records && found[1] >= ranges;
        assert!(enough, "{name}: {} examples, {found:?} records and ranges", all.len());
    }
}

#[test]
fn reference_has_every_field_of_a_report() {
    let room = Room::new();
    let graph = harness::graphs("heravi2024.ron");
    room.run(&format!("render {} --seconds 0.1 --report r.json", graph.display())).ok();
    let report = room.json("r.json");
    let page = page("files.md");
    let node = report["nodes"][0].as_object().expect("a node");
    for field in report.as_object().expect("an object").keys().chain(node.keys()) {
        assert!(page.contains(&format!("| `{field}` |")), "files.md does not have the report's `{field}`");
    }
}
