//! Reports of simulated studies, and figures compared with direct calls of the statistics.

use asperity_psychometrics::{Axis, FitSettings, Function, Row as Count, Shape, Staircase, fit};
use asperity_statistics::{
    Correction, Method, Zeros, adjust, binomial_test, common_language_effect, friedman, wilcoxon,
};

use super::*;
use crate::testing::{experiment, parse};
use crate::{Person, Progress, Trial};

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
        format!(
            "scale(name: \"{name}\", text: \"How {low}?\", from: 1, to: 7, low: \"{low}\", high: \"{high}\")"
        )
    };
    let similar = scale("similar", "not at all similar", "extremely similar");
    parse(&format!(
        "Experiment(version: 1, title: \"Textures of two models\", participants: 25, seed: 7, {person}
        factors: {{\"texture\": {TEXTURES:?}, \"base\": [{base}],
            \"novel\": [\"Felt\", \"Glass\", \"Cork\", \"Rug\"]}},
        stimuli: {{\"Real\": real(mount: \"{{texture}}\"), \"AR\": graph(file: \"ar.ron\"),
            \"NN\": graph(file: \"nn.ron\")}},
        parts: [
            (name: \"similarity\", over: [\"texture\"],
             show: [(\"AR\", \"Real\"), (\"NN\", \"Real\"), (\"NN\", \"AR\")],
             ask: [{similar}],
             tests: [friedman(of: \"similar\", each: [\"texture\"],
                 pairs: [(\"NN-Real\", \"AR-Real\"), (\"NN-Real\", \"NN-AR\")])]),
            (name: \"choice\", over: [\"texture\"], reference: \"Real\", show: [(\"AR\", \"NN\")],
             ask: [which(name: \"closer\", text: \"Which is closer to the reference?\")],
             tests: [binomial(of: \"closer\", chosen: \"NN\", each: [\"texture\"], alternative: greater),
                 bradley_terry(of: \"closer\")]),
            (name: \"adjectives\", over: {{\"texture\": [{base}]}},
             show: [\"Real\", \"AR\", \"NN\"], sides: right,
             ask: [{}, {}],
             tests: [friedman(of: \"rough\", each: [\"texture\"], correction: holm),
                 wilcoxon(of: \"hard\", pairs: [(\"AR\", \"NN\")])]),
            (name: \"novel\", over: [\"novel\", \"base\"], show: [(\"NN\", \"AR\")], ask: [{similar}]),
        ],
        survey: [scale(name: \"difficulty\", text: \"How hard was part 1?\", from: 1, to: 5,
                low: \"easy\", high: \"hard\"),
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

/// Sessions of people who answer each trial's only question. A trial without an answer is marked.
fn answered(
    study: &Experiment,
    people: u32,
    answer: impl Fn(u32, &Trial, &str) -> Option<Answer>,
) -> (Table, Vec<Session>) {
    let session = |number: u32| {
        let mut progress = Progress::new(study, number);
        let mut events = Vec::new();
        while let Some(step) = progress.step() {
            let trial = progress.trials()[step.number].clone();
            let part = &study.parts[trial.part];
            let kind = part.label(trial.kind, &study.stimuli);
            match answer(number, &trial, &kind) {
                Some(answer) => {
                    let answers = vec![(part.ask[0].name.clone(), answer)];
                    progress.answer(&answers);
                    events.push(Event::Answered { trial: step.number, answers, seconds: 2.0 });
                }
                None => {
                    progress.mark();
                    events.push(Event::Marked {
                        trial: step.number,
                        why: "a knock".into(),
                        answers: Vec::new(),
                    });
                }
            }
        }
        Session { participant: format!("P{number:02}"), number, events }
    };
    let sessions: Vec<Session> = (1..=people).map(session).collect();
    (Table::new(study, &sessions).unwrap(), sessions)
}

/// A rating of three kinds of trials from 0 to 99.
fn rated(fields: &str, tests: &str) -> Experiment {
    let ask = "scale(name: \"r\", text: \"How?\", from: 0, to: 99, low: \"a\", high: \"b\")";
    experiment(fields, &format!("show: [\"x\", \"y\", \"z\"], ask: [{ask}], tests: [{tests}],"))
}

/// A study that varies a parameter at two speeds, with a person of threshold 1.
fn varied(by: &str) -> Experiment {
    let question = "which(name: \"w\", text: \"Which side is stronger?\")";
    let mut study = experiment(
        "factors: {\"speed\": [\"slow\", \"fast\"]},",
        &format!(
            "over: [\"speed\"], show: [(\"x\", \"z\")], reference: \"x\", ask: [{question}],
             vary: (stimulus: \"z\", set: \"strength.gain\", by: {by}),"
        ),
    );
    let (shape, axis) = (Shape::Weibull, Axis::Linear);
    study.person = Person {
        function: Some(Function { shape, axis, threshold: 1.0, slope: 3.5, guess: 0.5, lapse: 0.0 }),
        ..study.person
    };
    study
}

#[test]
fn figures_equal_direct_calls_of_the_statistics() {
    let study = rated("", "friedman(of: \"r\", correction: holm)");
    let number = |who: u32, kind: &str| match kind {
        "x" => i64::from(who * 7 % 11),
        "y" => i64::from(who * 7 % 11 + 12 + who * 5 % 7),
        _ => i64::from(who * 3 % 10 + 2),
    };
    let (table, sessions) = answered(&study, 10, |who, _, kind| Some(Answer::Number(number(who, kind))));
    let analysis = Analysis::new(&study, &table, &sessions);
    let columns =
        ["x", "y", "z"].map(|kind| (1..=10).map(|who| number(who, kind) as f64).collect::<Vec<_>>());
    let rows: Vec<[f64; 3]> = (0..10).map(|i| [0, 1, 2].map(|kind| columns[kind][i])).collect();
    let test = &analysis.parts[0].tests[0];
    let direct = friedman(&rows).unwrap();
    let found = &test.findings[0];
    assert_eq!(found.p, Some(direct.chi_square.p));
    assert_eq!((found.statistic, found.effect), (Some(direct.chi_square.statistic), Some(direct.w)));
    assert!(found.is_significant);
    let mut p = Vec::new();
    for ([a, b], found) in [[0, 1], [0, 2], [1, 2]].into_iter().zip(&test.post_hoc) {
        let d: Vec<f64> = columns[a].iter().zip(&columns[b]).map(|(a, b)| a - b).collect();
        let direct = wilcoxon(&d, Alternative::TwoSided, Zeros::Drop, Method::ExactWithTies).unwrap();
        assert_eq!((found.p, found.statistic), (Some(direct.p), Some(direct.statistic)));
        assert_eq!((found.n, found.zeros), (direct.n, direct.excluded));
        let effect = common_language_effect(&columns[a], &columns[b]).unwrap();
        assert_eq!(found.effect, Some(effect.size));
        p.push(direct.p);
    }
    let adjusted: Vec<_> = test.post_hoc.iter().map(|found| found.adjusted).collect();
    assert_eq!(adjusted, adjust(&p, Correction::Holm).p);
    assert_eq!((test.made, test.correction, test.cut_off), (3, Some("Holm"), None));
    let Figures::Numbers { cells, .. } = &analysis.parts[0].asked[0].figures else { panic!() };
    for (cell, x) in cells.iter().zip(&columns) {
        let (direct, own) = (describe(x).unwrap(), cell.summary.as_ref().unwrap());
        assert_eq!((own.median, own.quartiles, own.mean), (direct.median, direct.quartiles, direct.mean));
        let skew = skewness_test(x, Alternative::TwoSided).unwrap();
        assert_eq!(cell.skewness, Some([skew.statistic, skew.p]));
    }
}

#[test]
fn part_1_of_the_paper_finds_the_right_pairs() {
    let study = paper(RATED);
    let (table, sessions) = simulated(&study, 25, 1);
    let analysis = Analysis::new(&study, &table, &sessions);
    let test = &analysis.parts[0].tests[0];
    assert_eq!((test.findings.len(), test.post_hoc.len(), test.made), (12, 24, 24));
    assert!(test.findings.iter().all(|found| found.is_significant && found.n == 25));
    for found in &test.post_hoc {
        assert_eq!(found.is_significant, found.of == "NN-Real against NN-AR", "{found:?}");
    }
    assert_eq!(test.cut_off, Some(0.05 / 24.0));
    let report = analysis.report("pictures/");
    for text in [
        "Correction: Bonferroni. Cut-off: 0.00208.",
        "Variant: Wilcoxon signed-rank, two-sided, exact with ties, zeros dropped.",
        "Variant: Friedman, chi-square(2).",
        "## Part 4: novel",
        "Medians of NN-AR. Columns: base.",
        "| difficulty |  25 |       0 |",
    ] {
        assert!(report.contains(text), "{text}");
    }
    // Every table is even, and every picture exists.
    let mut tables = report.split("\n\n").filter(|block| block.starts_with('|'));
    assert!(
        tables.all(|t| t.lines().all(|l| l.chars().count() == t.lines().next().unwrap().chars().count()))
    );
    let pictures = analysis.pictures();
    assert_eq!(pictures.len(), 5);
    assert_eq!(report.matches("![").count(), 5);
    for (name, svg) in &pictures {
        assert!(report.contains(&format!("](pictures/{name})")) && svg.ends_with("</svg>\n"), "{name}");
    }
    assert!(serde_json::to_string(&analysis).unwrap().contains("\"made\":24"));
}

#[test]
fn binomial_p_values_of_the_paper_are_printed() {
    let study = experiment(
        "participants: 25, factors: {\"texture\": [\"plastic\", \"paper\"]},",
        "over: [\"texture\"], show: [(\"x\", \"y\")], ask: [which(name: \"w\", text: \"?\")],
         tests: [binomial(of: \"w\", chosen: \"x\", each: [\"texture\"], alternative: greater),
             bradley_terry(of: \"w\", each: [\"texture\"])],",
    );
    let (table, sessions) = answered(&study, 25, |who, trial, _| {
        let most = if trial.cell[0].1 == 0 { 19 } else { 20 };
        Some(Answer::Stimulus(if who <= most { "x" } else { "y" }.into()))
    });
    let analysis = Analysis::new(&study, &table, &sessions);
    let direct = binomial_test(19, 25, 0.5, Alternative::Greater).unwrap();
    let found = &analysis.parts[0].tests[0].findings[0];
    assert_eq!((found.p, found.n, found.people, found.is_significant), (Some(direct.p), 25, 25, true));
    let report = analysis.report("");
    assert!(report.contains("|  19 |  25 |     25 |        0 | 0.760 | 0.00732 | yes"), "{report}");
    assert!(report.contains("|  20 |  25 |     25 |        0 | 0.800 | 0.00204 | yes"), "{report}");
    // Wilson's interval of 19 of 25, and the log odds of the ability's halves.
    assert!(report.contains("0.566 to 0.885"), "{report}");
    let ability = analysis.parts[0].tests[1].abilities[0].ability[0];
    assert!((2.0 * ability - (19.0_f64 / 6.0).ln()).abs() < 1e-9, "{ability}");
}

#[test]
fn all_25_people_differing_one_way_give_6e_8() {
    let study = rated("participants: 25,", "wilcoxon(of: \"r\", pairs: [(\"y\", \"x\"), (\"z\", \"x\")])");
    let (table, sessions) = answered(&study, 25, |who, _, kind| {
        Some(Answer::Number(match kind {
            "x" => 10,
            "y" => 10 + i64::from(who),
            _ => 20,
        }))
    });
    let analysis = Analysis::new(&study, &table, &sessions);
    for found in &analysis.parts[0].tests[0].findings {
        assert!((found.p.unwrap() / (2.0 / 2.0_f64.powi(25)) - 1.0).abs() < 1e-12, "{found:?}");
        assert_eq!((found.effect, found.n), (Some(1.0), 25));
    }
    assert!(analysis.report("").contains("| 6.0e-8 |"));
}

#[test]
fn people_who_feel_no_difference_give_alpha_errors() {
    let study = rated("person: (spread: 20.0, between: 10.0),", "friedman(of: \"r\")");
    let runs = 400;
    let (mut overall, mut any_pair) = (0, 0);
    for seed in 0..runs {
        let (table, _) = simulated(&study, 15, seed);
        let found = Analysis::new(&study, &table, &[]).p_values();
        assert_eq!(found.len(), 4, "pairs are listed even where they are not made");
        overall += usize::from(found[0].is_significant);
        any_pair += usize::from(found[1..].iter().any(|pair| pair.is_significant));
    }
    // Three standard deviations of 400 tests at 5 % are 13.
    assert!((7..=33).contains(&overall), "{overall} of {runs}");
    assert!(any_pair <= overall, "{any_pair}");
}

#[test]
fn missing_answers_leave_people_out_and_are_counted() {
    let tests = "friedman(of: \"r\"), wilcoxon(of: \"r\", pairs: [(\"x\", \"y\"), (\"x\", \"z\")])";
    let study = rated("repeat_marked: false,", tests);
    let (table, sessions) = answered(&study, 10, |who, _, kind| {
        (who > 2 || kind != "y").then_some(Answer::Number(i64::from(who) + i64::from(kind == "z")))
    });
    let analysis = Analysis::new(&study, &table, &sessions);
    assert_eq!(analysis.participants[0].excluded, 1);
    assert_eq!((analysis.excluded.len(), analysis.excluded[0].part.as_str()), (2, "one"));
    let [friedman, wilcoxon] = analysis.parts[0].tests.as_slice() else { panic!() };
    assert_eq!((friedman.findings[0].n, friedman.findings[0].left_out), (8, 2));
    let [flat, full] = wilcoxon.findings.as_slice() else { panic!() };
    assert_eq!((flat.people, flat.left_out, flat.zeros, flat.p), (8, 2, 8, None));
    assert_eq!(flat.why.as_deref(), Some("all differences are zero"));
    assert_eq!((full.people, full.left_out, full.n), (10, 0, 10));
    assert_eq!(wilcoxon.made, 1, "a test that cannot be made is outside the family");
    let report = analysis.report("");
    assert!(report.contains("- x against y: not tested, all differences are zero"), "{report}");
    assert!(report.contains("a knock"), "{report}");
}

#[test]
fn repeats_are_averaged_and_equal_means_tie() {
    let ask = "scale(name: \"r\", text: \"?\", from: 0, to: 9, low: \"a\", high: \"b\")";
    let tests = "wilcoxon(of: \"r\")";
    let part = format!("show: [\"x\", \"y\"], repeats: 3, order: fixed, ask: [{ask}], tests: [{tests}],");
    let study = experiment("", &part);
    // Means of 4/3 against 1, and of 7/3 against 8/3. Both differ by 1/3, but for rounding.
    let times = std::cell::RefCell::new(BTreeMap::new());
    let (table, _) = answered(&study, 8, |who, _, kind| {
        let mut times = times.borrow_mut();
        let time = times.entry((who, kind.to_owned())).and_modify(|n| *n += 1).or_insert(0);
        Some(Answer::Number(
            match (who % 2, kind) {
                (0, "x") => [1, 1, 2],
                (0, _) => [1, 1, 1],
                (_, "x") => [2, 2, 3],
                (_, _) => [3, 2, 3],
            }[*time],
        ))
    });
    let found = &Analysis::new(&study, &table, &[]).parts[0].tests[0].findings[0];
    assert_eq!((found.n, found.statistic, found.p), (8, Some(18.0), Some(1.0)));
}

#[test]
fn poor_data_give_reasons_and_no_panic() {
    let none = "person: (spread: 0.0, between: 0.0),";
    let stairs =
        "staircase(start: 4.0, floor: 0.01, ceiling: 10.0, steps: add(by: [0.5]), down: 1, trials: 11)";
    let which = "show: [(\"x\", \"y\")], ask: [which(name: \"w\", text: \"?\")],
        tests: [binomial(of: \"w\", chosen: \"x\"), bradley_terry(of: \"w\")],";
    let studies = [
        paper(none),
        rated(none, "friedman(of: \"r\"), wilcoxon(of: \"r\"), wilcoxon(of: \"r\", alternative: greater)"),
        experiment("", which),
        varied(stairs),
        varied("constant(levels: [1.0, 2.0], each: 1)"),
    ];
    for study in &studies {
        for people in 0..3 {
            let (table, sessions) = simulated(study, people, 4);
            let analysis = Analysis::new(study, &table, &sessions);
            let report = analysis.report("pictures/");
            assert!(!report.contains("NaN") && !report.contains("inf "), "{report}");
            let found = analysis.p_values();
            assert!(found.iter().all(|found| found.p.is_some() || !found.is_significant));
            let names: BTreeSet<&str> = found.iter().map(|found| found.name.as_str()).collect();
            assert_eq!(names.len(), found.len());
            assert!(people > 0 || analysis.pictures().is_empty());
            serde_json::to_string(&analysis).unwrap();
        }
    }
    let (table, _) = simulated(&studies[1], 12, 4);
    let report = Analysis::new(&studies[1], &table, &[]).report("");
    assert!(report.contains("- All answers: not tested, each person's answers are equal"), "{report}");
    assert!(report.contains("Not tested: 3, since the data do not vary."), "{report}");
}

#[test]
fn stimulus_that_always_wins_has_a_penalised_ability() {
    let study = experiment(
        "",
        "show: [pairs(of: [\"x\", \"y\", \"z\"])], ask: [which(name: \"w\", text: \"?\")],
         tests: [bradley_terry(of: \"w\")],",
    );
    let (table, _) = answered(&study, 6, |_, _, kind| Some(Answer::Stimulus(kind[..1].into())));
    let test = &Analysis::new(&study, &table, &[]).parts[0].tests[0];
    assert!(test.findings[0].variant.contains("penalised"), "{test:?}");
    assert!(test.abilities.windows(2).all(|two| two[0].ability[0] > two[1].ability[0]), "{test:?}");
    assert_eq!((test.abilities[0].wins, test.abilities[0].comparisons), (12.0, 12.0));
}

#[test]
fn staircases_turn_and_end_where_direct_ones_do() {
    let study = varied(
        "staircase(start: 4.0, floor: 0.01, ceiling: 10.0, steps: multiply(by: [2.0, 1.4, 1.2]), down: 2,
         trials: 60, average: 8)",
    );
    let (table, sessions) = simulated(&study, 6, 3);
    let analysis = Analysis::new(&study, &table, &sessions);
    let Figures::Thresholds(of) = &analysis.parts[0].asked[0].figures else { panic!() };
    let Some(crate::Method::Staircase(settings)) = study.parts[0].vary.as_ref().map(|v| &v.method) else {
        panic!()
    };
    assert_eq!((of.conditions.len(), of.target), (2, Some(settings.target())));
    for one in of.conditions.iter().flat_map(|condition| &condition.people) {
        let mut direct = Staircase::new(settings.clone()).unwrap();
        for (level, hit) in &one.trials {
            assert_eq!(direct.next_level(), Some(*level));
            direct.answer(*hit);
        }
        assert_eq!(one.threshold, direct.estimate().map(|e| e.level));
        let turns: Vec<f64> = one.reversals.iter().map(|at| one.trials[*at].0).collect();
        assert_eq!(turns, direct.reversals());
    }
    let found: Vec<f64> = of.conditions[0].people.iter().filter_map(|one| one.threshold).collect();
    assert_eq!(of.conditions[0].summary, summary(&found));
    assert_eq!(analysis.pictures().len(), 2);
    assert!(analysis.report("").contains("Method: staircase. The threshold has 70.7 % hits."));
}

#[test]
fn quest_and_constant_stimuli_find_the_threshold() {
    let quest = "quest(levels: logarithmic(from: 0.1, to: 10.0, count: 25), threshold: logarithmic(from: 0.1,
        to: 10.0, count: 41), slope: linear(from: 1.0, to: 6.0, count: 6), trials: 40)";
    let constant = "constant(levels: [0.5, 0.7, 0.9, 1.1, 1.4, 2.0], each: 10)";
    for (by, method) in [(quest, "QUEST+"), (constant, "constant stimuli")] {
        let study = varied(by);
        let (table, sessions) = simulated(&study, 8, 3);
        let analysis = Analysis::new(&study, &table, &sessions);
        let Figures::Thresholds(of) = &analysis.parts[0].asked[0].figures else { panic!() };
        assert_eq!(of.method, method);
        for condition in &of.conditions {
            let median = condition.summary.as_ref().unwrap().median;
            assert!((median - 1.0).abs() < 0.15, "{method}: {median}");
            let Some(pooled) = &condition.pooled else { continue };
            let (shape, axis) = (Shape::Weibull, Axis::Linear);
            let settings = FitSettings { shape, axis, guess: 0.5, lapse: 0.02, ..FitSettings::default() };
            assert_eq!(pooled.fit, Some(fit(&pooled.counts, &settings).unwrap()));
            assert!(pooled.counts.iter().all(|Count { total, .. }| *total == 80));
        }
        let report = analysis.report("");
        assert!(report.contains(&format!("Method: {method}. The threshold has 80.3 % hits.")), "{report}");
        assert!(!report.contains("PSE") && report.contains("slope"), "{report}");
    }
}

#[test]
fn sessions_that_differ_are_told() {
    let study = rated("", "");
    let begin = |version: &str, hash: &str| Event::Begin {
        study: "Test".into(),
        participant: "P01".into(),
        number: 1,
        version: version.into(),
        files: vec![("study.ron".into(), hash.into())],
        at: String::new(),
        options: Default::default(),
    };
    let note = Event::Note { text: "slept | badly".into(), trial: Some(3) };
    let session = |events| Session { participant: "P01".into(), number: 1, events };
    let sessions = [session(vec![begin("1", "a"), note]), session(vec![begin("2", "b")])];
    let report = Analysis::new(&study, &Table::default(), &sessions).report("");
    assert!(report.contains("several versions of the program: 1, 2."), "{report}");
    assert!(report.contains("The file study.ron changed between sessions."), "{report}");
    assert!(report.contains("| slept \\| badly |"), "{report}");
}

#[test]
fn rater_who_misses_the_hidden_reference_is_left_out() {
    let ask = "sliders(name: \"s\", text: \"How close?\", low: \"far\", high: \"close\")";
    let part = |reference: &str| {
        format!("show: [(\"x\", \"w\", \"z\")], {reference} repeats: 20, sides: random, ask: [{ask}],")
    };
    // P03 rates it below 90 in 4 of 20 trials. P02 does so in 3, which is 15 %.
    let rate = |who: u32, trial: &Trial, at: &mut [usize; 9]| {
        at[who as usize] += 1;
        let low = at[who as usize]
            <= match who {
                3 => 4,
                2 => 3,
                _ => 0,
            };
        let known = if low { 89.0 } else { 100.0 };
        let number = |s: &usize| match s {
            0 => ("x", known),
            1 => ("w", 20.0 + f64::from(who)),
            _ => ("z", 60.0),
        };
        let all = trial.places.iter().map(number).map(|(name, x)| (name.to_owned(), x));
        Some(Answer::Numbers(all.collect()))
    };
    let analysed = |reference: &str| {
        let study = experiment("", &part(reference));
        let seen = std::cell::Cell::new([0; 9]);
        let (table, sessions) = answered(&study, 8, |who, trial, _| {
            let mut at = seen.get();
            let answer = rate(who, trial, &mut at);
            seen.set(at);
            answer
        });
        Analysis::new(&study, &table, &sessions)
    };
    let figures = |analysis: &Analysis| match &analysis.parts[0].asked[0].figures {
        Figures::Numbers { cells, screening, .. } => (cells.clone(), screening.clone()),
        other => panic!("{other:?}"),
    };
    let known = analysed("reference: \"x\",");
    let (cells, screening) = figures(&known);
    let left_out = vec![("P03".to_owned(), 4, 20)];
    assert_eq!(screening, Some(Screening { reference: "x".into(), left_out }));
    let of = |cells: &[Cell], kind: &str| {
        let cell = cells.iter().find(|cell| cell.kind == kind).unwrap();
        (cell.missing, cell.summary.clone().unwrap())
    };
    let (missing, w) = of(&cells, "w");
    assert_eq!((missing, w.n, w.median, w.median_95), (0, 7, 25.0, Some([21.0, 28.0])));
    assert!((w.mean - (20.0 + 33.0 / 7.0)).abs() < 1e-12);
    let [low, high] = w.mean_95.unwrap();
    assert!(low < w.mean && w.mean < high && (w.mean - low - (high - w.mean)).abs() < 1e-9);
    let report = known.report("pictures/");
    assert!(report.contains("BS.1534-3") && report.contains("| P03 "), "{report}");
    assert!(known.pictures().iter().any(|(name, _)| name.ends_with("boxes.svg")));
    // Without a reference nobody is screened.
    let (cells, screening) = figures(&analysed(""));
    assert_eq!((screening, of(&cells, "w").1.n), (None, 8));
}
