//! A graph that is played, and files that change while it is.

use std::path::Path;

use harness::live::EARS;

/// Puts a file in its place at once, as editors do.
pub(crate) fn replace(dir: &Path, name: &str, content: impl AsRef<[u8]>) {
    std::fs::write(dir.join(".new"), content).expect("a file");
    std::fs::rename(dir.join(".new"), dir.join(name)).expect("a file");
}

/// Replaces the graph.
pub(crate) fn edit(dir: &Path, text: impl AsRef<[u8]>) {
    replace(dir, "g.ron", text);
}

/// A sine of 80 Hz that is played and recorded, with more beside it.
pub(crate) fn tone(nodes: &str, wires: &str) -> String {
    format!(
        r#"Graph(version: 1, nodes: {{"sine": (kind: "sine", params: (frequency_hz: 80.0)),
           "limiter": (kind: "limiter"),
           "out": (kind: "audio_out"), {}{nodes}}}, wires: [("sine", "limiter"), ("limiter", "out"),
           {}{wires}])"#,
        EARS[0], EARS[1]
    )
}
