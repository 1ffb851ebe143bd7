//! Files that are built to take memory or time.

use harness::{Room, asperity, root};

use super::judge::{Tally, two_at_a_time};

/// The maker of a file, and the command that reads it.
type Built = (&'static str, fn() -> String, &'static str);

fn nodes(count: usize, node: impl Fn(usize) -> String) -> String {
    let nodes: Vec<String> = (0..count).map(node).collect();
    format!("Graph(version: 1, audio_hz: 192000, nodes: {{{}}}, wires: [])", nodes.join(", "))
}

const BUILT: [Built; 12] = [
    ("20,000 unknown kinds", || nodes(20_000, |n| format!("\"n{n}\": (kind: \"gane\")")), "check f.ron"),
    ("50,000 nodes", || nodes(50_000, |n| format!("\"n{n}\": (kind: \"sine\")")), "check f.ron"),
    (
        "5,000 delays of 10 s",
        || nodes(5000, |n| format!("\"n{n}\": (kind: \"delay\", params: (seconds: 10))")),
        "render f.ron --no-prune --seconds 0.1",
    ),
    (
        "a name of 20 MB",
        || nodes(1, |_| format!("\"{}\": (kind: \"sine\")", "n".repeat(20 << 20))),
        "check f.ron",
    ),
    (
        "a kind of 20 MB",
        || nodes(1, |_| format!("\"n\": (kind: \"{}\")", "k".repeat(20 << 20))),
        "check f.ron",
    ),
    ("a million brackets", || "(".repeat(1_000_000), "check f.ron"),
    ("a million lists", || format!("Graph(version: 1, nodes: {})", "[".repeat(1_000_000)), "check f.ron"),
    ("50 MB of spaces", || " ".repeat(50 << 20), "check f.ron"),
    ("50 MB of comment", || format!("// {}", "x".repeat(50 << 20)), "check f.ron"),
    (
        "200,000 wires",
        || {
            let wires: Vec<String> = (0..200_000).map(|n| format!("(\"a\", \"b{n}\")")).collect();
            format!("Graph(version: 1, nodes: {{\"a\": (kind: \"sine\")}}, wires: [{}])", wires.join(", "))
        },
        "check f.ron",
    ),
    (
        "a stroke of a million rows",
        || {
            let rows: Vec<String> = (0..1_000_000).map(|n| format!("{}e-3,0,0,0", n)).collect();
            format!("t_s,x_mm,y_mm,z_mm\n{}\n", rows.join("\n"))
        },
        "render GRAPH --input f.ron --seconds 0.05",
    ),
    ("a table of one line of 50 MB", || "1,".repeat(25 << 20), "render GRAPH --input f.ron --seconds 0.05"),
];

#[test]
fn file_that_is_built_to_take_memory_or_time_takes_neither() {
    let tally = Tally::new("budgets");
    let graph = root().join("tests/data/small.ron").display().to_string();
    two_at_a_time(BUILT.len() as u64, |number| {
        let (what, make, command) = BUILT[number as usize];
        let dir = Room::new();
        dir.write("f.ron", make());
        let mut program = asperity(&dir);
        program.args(command.replace("GRAPH", &graph).split(' '));
        tally.case(what, dir, program, &[]);
    });
    tally.done();
}
