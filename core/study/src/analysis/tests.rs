use asperity_psychometrics::{Axis, Function, Shape};
use asperity_statistics::{
    Alternative, Method, Zeros, binomial_test, common_language_effect, describe, friedman, skewness_test,
    wilcoxon, wilson_interval,
};

use super::*;
use crate::Person;
use crate::testing::{experiment, parse};

const TEXTURES: [&str; 12] = [
    "Carpet 2",
    "Carpet 3",
    "Frosted acrylic",
    "Polyethylene foam",
    "Rough plastic",
    "Sandpaper 220",
    "Sandpaper 320",
    "Scouring pad",
    "Velcro hooks",
    "Velcro loops",
    "Wax paper",
    "Whiteboard",
];

/// A study with the parts of Heravi and others 2024.
fn paper(person: &str) -> Experiment {
    let base = "\"Carpet 2\", \"Rough plastic\", \"Sandpaper 220\", \"Sandpaper 320\", \"Velcro loops\", \
                \"Whiteboard\"";
    let scale = |name: &str, low: &str, high: &str| {
        format!("scale(name: \"{name}\", text: \"How {low}?\", from: 1, to: 7, low: \"{low}\", high: \"{high}\")")
    };
    let similar = scale("similar", "not at all similar", "extremely similar");
    parse(&format!(
        "Experiment(version: 1, title: \"Textures of two models\", participants: 25, seed: 7, {person}
        factors: {{\"texture\": {TEXTURES:?}, \"novel\": [\"Felt\", \"Glass\", \"Cork\", \"Rug\"], \"base\": [{base}]}},
        stimuli: {{\"Real\": real(mount: \"{{texture}}\"), \"AR\": graph(file: \"ar.ron\"), \"NN\": graph(file: \"nn.ron\")}},
        parts: [
            (name: \"similarity\", over: [\"texture\"], show: [(\"AR\", \"Real\"), (\"NN\", \"Real\"), (\"NN\", \"AR\")],
             ask: [{similar}],
             tests: [friedman(of: \"similar\", each: [\"texture\"],
                 pairs: [(\"NN-Real\", \"AR-Real\"), (\"NN-Real\", \"NN-AR\")])]),
            (name: \"choice\", over: [\"texture\"], reference: \"Real\", show: [(\"AR\", \"NN\")],
             ask: [which(name: \"closer\", text: \"Which is closer to the reference?\")],
             tests: [binomial(of: \"closer\", chosen: \"NN\", each: [\"texture\"], alternative: greater),
                 bradley_terry(of: \"closer\")]),
            (name: \"adjectives\", over: {{\"texture\": [{base}]}}, show: [\"Real\", \"AR\", \"NN\"], sides: right,
             ask: [{}, {}],
             tests: [friedman(of: \"rough\", each: [\"texture\"], correction: holm),
                 wilcoxon(of: \"hard\", pairs: [(\"AR\", \"NN\")])]),
            (name: \"novel\", over: [\"novel\", \"base\"], show: [(\"NN\", \"AR\")], ask: [{similar}]),
        ],
        survey: [scale(name: \"difficulty\", text: \"How hard was part 1?\", from: 1, to: 5, low: \"easy\", high: \"hard\"),
            text(name: \"strategy\", text: \"How did you decide?\")],
        )",
        scale("rough", "rough", "smooth"),
        scale("hard", "hard", "soft"),
    ))
    .unwrap_or_else(|e| panic!("{e}"))
}

const RATED: &str = "person: (ratings: {\"similar\": {\"AR-Real\": 5.0, \"NN-Real\": 5.2, \"NN-AR\": 2.5}},
    preference: {\"NN\": 0.6}),";

fn simulated(study: &Experiment, people: u32, seed: u64) -> (Table, Vec<Session>) {
    let sessions: Vec<Session> = (1..=people).map(|n| study.person.session(study, n, seed)).collect();
    (Table::new(study, &sessions).unwrap(), sessions)
}

/// Vary parts.
fn varied(by: &str, question: &str) -> Experiment {
    let mut study = experiment(
        "factors: {\"speed\": [\"slow\", \"fast\"]},",
        &format!(
            "over: [\"speed\"], show: [(\"x\", \"z\")], ask: [{question}],
             vary: (stimulus: \"z\", set: \"strength.gain\", by: {by}),"
        ),
    );
    let (shape, axis) = (Shape::Weibull, Axis::Linear);
    study.person =
        Person { function: Some(Function { shape, axis, threshold: 1.0, slope: 3.5, guess: 0.5, lapse: 0.0 }), ..study.person };
    study
}

#[test]
fn write_out() {
    let dir = std::path::Path::new("/work/t/rv/out");
    std::fs::create_dir_all(dir).unwrap();
    let study = paper(RATED);
    let (mut table, sessions) = simulated(&study, 25, 1);
    table.excluded.push(("P03".into(), 4, "deadline misses".into()));
    let quest = "quest(levels: logarithmic(from: 0.1, to: 10.0, count: 25), threshold: logarithmic(from: 0.1,
        to: 10.0, count: 41), slope: linear(from: 1.0, to: 6.0, count: 6), trials: 40)";
    let stairs = "staircase(start: 4.0, floor: 0.01, ceiling: 10.0, steps: multiply([2.0, 1.4, 1.2]), down: 2, trials: 60, average: 8)";
    let constant = "constant(levels: [0.5, 0.7, 0.9, 1.1, 1.4, 2.0], each: 10, fit: (shape: weibull, axis: linear, guess: 0.5))";
    let which = "which(name: \"w\", text: \"Which side is stronger?\")";
    let mushra = experiment("factors: {\"speed\": [\"slow\", \"fast\"]},", "over: [\"speed\"], show: [(\"x\", \"y\", \"z\")], ask: [sliders(name: \"quality\", text: \"How good?\", low: \"bad\", high: \"excellent\"), same(name: \"s\", text: \"Alike?\"), text(name: \"why\", text: \"Why?\")],");
    let mut all = vec![("paper", study, table, sessions)];
    for (name, study) in [("quest", varied(quest, which)), ("stairs", varied(stairs, which)), ("constant", varied(constant, which)), ("mushra", mushra)] {
        let (table, sessions) = simulated(&study, 10, 3);
        all.push((name, study, table, sessions));
    }
    for (name, study, table, sessions) in all {
        let start = std::time::Instant::now();
        let analysis = Analysis::new(&study, &table, &sessions);
        println!("{name} {:?}", start.elapsed());
        std::fs::write(dir.join(format!("{name}.md")), analysis.report(&format!("{name}-"))).unwrap();
        std::fs::write(dir.join(format!("{name}.json")), serde_json::to_string_pretty(&analysis).unwrap()).unwrap();
        std::fs::write(dir.join(format!("{name}.csv")), table.csv()).unwrap();
        for (file, svg) in analysis.pictures() {
            std::fs::write(dir.join(format!("{name}-{file}")), svg).unwrap();
        }
    }
}
