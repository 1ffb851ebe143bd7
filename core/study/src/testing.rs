//! Experiments for tests.

use asperity_diagnostics::Source;

use crate::Experiment;

/// An experiment of ten participants with three stimuli and one part.
pub(crate) fn experiment(fields: &str, part: &str) -> Experiment {
    parse(&text(fields, part)).unwrap_or_else(|e| panic!("{e}"))
}

pub(crate) fn text(fields: &str, part: &str) -> String {
    let people = if fields.contains("participants") { "" } else { "participants: 10," };
    format!(
        "Experiment(version: 1, title: \"Test\", {people} {fields}
            stimuli: {{\"x\": silence, \"w\": clip(file: \"w.wav\"), 
                \"y\": real(mount: \"felt\"), \"z\": graph(file: \"z.ron\")}},
            parts: [(name: \"one\", {part})],
        )"
    )
}

pub(crate) fn parse(text: &str) -> Result<Experiment, asperity_diagnostics::Diagnostic> {
    Experiment::parse(&Source::new("study.ron", text))
}
