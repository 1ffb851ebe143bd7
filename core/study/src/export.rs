//! Answers as files: CSV, and TSV with a description in JSON.

use csv::{Terminator, WriterBuilder};
use serde_json::{Map, Value, json};

use crate::file::Experiment;
use crate::question::{Answer, QuestionKind};
use crate::table::{Row, Table};

/// Columns before the factors, and after the places.
const FIRST: [&str; 4] = ["participant", "part", "trial", "shown"];
const LAST: [&str; 6] = ["level", "question", "about", "answer", "hit", "seconds"];
/// Missing value of a BIDS table.
const MISSING: &str = "n/a";

impl Table {
    /// The answers as CSV, one row an answer. Missing values are empty.
    ///
    /// Columns are participant, part, trial, shown, one for each factor, kind, `place_1` and on from left to
    /// right, level, question, about, answer, hit, seconds. A factor with the name of another column gets the
    /// prefix `factor_`. Answers of the survey have no part.
    pub fn csv(&self) -> String {
        self.written(b',', "", |text| text)
    }

    /// The answers as TSV with the columns of [`csv`](Self::csv), as BIDS has behavioural data.
    ///
    /// A missing value is `n/a`. A tab or a line break in a text becomes a space.
    pub fn tsv(&self) -> String {
        self.written(b'\t', MISSING, |text| text.replace(char::is_control, " "))
    }

    fn written(&self, delimiter: u8, missing: &str, clean: impl Fn(String) -> String) -> String {
        let mut factors: Vec<&str> = Vec::new();
        for (name, _) in self.rows.iter().flat_map(|row| &row.levels) {
            if !factors.contains(&name.as_str()) {
                factors.push(name);
            }
        }
        let places = self.rows.iter().map(|row| row.places.len()).max().unwrap_or(0);
        let end = Terminator::Any(b'\n');
        let mut writer = WriterBuilder::new().delimiter(delimiter).terminator(end).from_writer(Vec::new());
        let mut write = |fields: Vec<String>| {
            let filled = |text: String| if text.is_empty() { missing.to_owned() } else { clean(text) };
            // Writing to memory cannot fail, and all rows have the same length.
            let _ = writer.write_record(fields.into_iter().map(filled));
        };
        let kind = ["kind".to_owned()];
        let head = FIRST.map(str::to_owned).into_iter().chain(factors.iter().map(|name| column(name)));
        let head = head.chain(kind).chain((1..=places).map(place)).chain(LAST.map(str::to_owned));
        write(head.collect());
        self.rows.iter().for_each(|row| write(fields(row, &factors, places)));
        String::from_utf8(writer.into_inner().unwrap_or_default()).unwrap_or_default()
    }
}

fn fields(row: &Row, factors: &[&str], places: usize) -> Vec<String> {
    let in_part = |text: String| if row.part.is_empty() { String::new() } else { text };
    let answer = match &row.answer {
        Answer::Number(n) => n.to_string(),
        Answer::Stimulus(name) => name.clone(),
        Answer::Same(same) => if *same { "same" } else { "different" }.to_owned(),
        Answer::Numbers(_) => row.answer.number().map_or_else(String::new, |x| x.to_string()),
        Answer::Text(text) => text.clone(),
    };
    let first = [row.participant.clone(), row.part.clone()];
    let numbers = [row.trial, row.shown].map(|n| in_part(n.to_string()));
    let levels = factors.iter().map(|name| row.level_of(name).unwrap_or_default().to_owned());
    let shown = (0..places).map(|i| row.places.get(i).cloned().unwrap_or_default());
    let last = [
        row.level.map_or_else(String::new, |level| level.to_string()),
        row.question.clone(),
        row.about.clone().unwrap_or_default(),
        answer,
        row.hit.map_or_else(String::new, |hit| hit.to_string()),
        in_part(format!("{:.3}", row.seconds)),
    ];
    let all = first.into_iter().chain(numbers).chain(levels).chain([row.kind.clone()]);
    all.chain(shown).chain(last).collect()
}

/// Column of a factor.
fn column(factor: &str) -> String {
    let taken = FIRST.contains(&factor) || LAST.contains(&factor) || factor == "kind";
    if taken || factor.starts_with("place_") { format!("factor_{factor}") } else { factor.to_owned() }
}

fn place(number: usize) -> String {
    format!("place_{number}")
}

/// Describes each column of [`Table::tsv`], as the JSON file beside a BIDS table does.
///
/// A column has a `LongName` and a `Description`, and `Levels` or `Units` where they apply.
pub fn sidecar(experiment: &Experiment) -> Value {
    let mut out = Map::new();
    let about = |name: &str, text: &str| json!({ "LongName": name, "Description": text });
    let with = |mut about: Value, key: &str, value: Value| {
        about[key] = value;
        about
    };
    let stimuli = || -> Map<String, Value> {
        let one = |(name, from): (&String, String)| (name.clone(), Value::from(from));
        experiment.stimuli.iter().map(|s| one((&s.name, format!("The stimulus {}", s.name)))).collect()
    };
    let parts =
        experiment.parts.iter().map(|p| (p.name.clone(), Value::from(p.instructions.clone()))).collect();
    let mut questions = Map::new();
    for question in experiment.parts.iter().flat_map(|part| &part.ask).chain(&experiment.survey) {
        let kind = match &question.kind {
            QuestionKind::Scale { from, to, low, high } => format!(" From {from} ({low}) to {to} ({high})."),
            QuestionKind::Sliders { low, high } => format!(" From 0 ({low}) to 100 ({high})."),
            _ => String::new(),
        };
        questions.entry(question.name.clone()).or_insert_with(|| format!("{}{kind}", question.text).into());
    }
    let sets: Vec<&str> =
        experiment.parts.iter().filter_map(|part| Some(part.vary.as_ref()?.set.as_str())).collect();
    let mut add = |name: &str, value: Value| _ = out.insert(name.to_owned(), value);
    add("participant", about("Participant", "Code of the participant"));
    let part = about("Part", "Name of the part; missing in the survey");
    add("part", with(part, "Levels", Value::Object(parts)));
    add("trial", about("Trial", "Number of the trial in the plan, from 0"));
    add("shown", about("Order", "Number of the trial in the order of time, from 0"));
    for factor in &experiment.factors {
        let levels: Map<String, Value> =
            factor.levels.iter().map(|l| (l.clone(), format!("{} {l}", factor.name).into())).collect();
        let described = about(&factor.name, "Level of this factor; missing where it does not vary");
        add(&column(&factor.name), with(described, "Levels", Value::Object(levels)));
    }
    add("kind", about("Kind of trial", "Names of the trial's stimuli, in the order of the file"));
    let most = experiment.parts.iter().flat_map(|part| &part.show).map(Vec::len).max().unwrap_or(0);
    for number in 1..=most {
        let described = about(&format!("Place {number}"), "Stimulus at this place, counted from the left");
        add(&place(number), with(described, "Levels", Value::Object(stimuli())));
    }
    let level = about("Level", "Level of the varied parameter");
    let unit = if sets.is_empty() { "none".to_owned() } else { format!("that of {}", sets.join(", ")) };
    add("level", with(level, "Units", unit.into()));
    add("question", with(about("Question", "Name of the question"), "Levels", Value::Object(questions)));
    add("about", about("Stimulus of the slider", "Stimulus that the slider is about"));
    let answer = "A number, the name of a stimulus, `same` or `different`, or a text, by the question";
    add("answer", about("Answer", answer));
    let hit = about("Hit", "Whether the answer names the varied stimulus, or a difference");
    let levels = json!({ "true": "It does", "false": "It does not" });
    add("hit", with(hit, "Levels", levels));
    let seconds = about("Duration", "Time from the trial's begin to the last answer");
    add("seconds", with(seconds, "Units", "s".into()));
    Value::Object(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::experiment;

    fn table() -> Table {
        let row = |answer: Answer| Row {
            participant: "Doe, \"J\"".into(),
            part: "one".into(),
            trial: 3,
            shown: 4,
            levels: vec![("level".into(), "a,b".into())],
            kind: "x-y".into(),
            places: vec!["y".into(), "x".into()],
            level: Some(0.5),
            question: "q".into(),
            about: None,
            answer,
            hit: Some(true),
            seconds: 2.0,
        };
        let told = Row { part: String::new(), ..row(Answer::Text("one\ntwo\tthree".into())) };
        let slider = row(Answer::Numbers(vec![("x".into(), 12.5)]));
        let rows = vec![row(Answer::Same(false)), slider, Row { hit: None, level: None, ..told }];
        Table { rows, ..Table::default() }
    }

    #[test]
    fn csv_with_commas_quotes_and_lines_reads_back() {
        let text = table().csv();
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let head: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
        assert_eq!(head[4..8], ["factor_level", "kind", "place_1", "place_2"]);
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!([&rows[0][0], &rows[0][4], &rows[0][11]], ["Doe, \"J\"", "a,b", "different"]);
        assert_eq!((&rows[1][11], &rows[0][13]), ("12.5", "2.000"));
        // The survey has no trial and no time.
        assert_eq!([&rows[2][2], &rows[2][11], &rows[2][13]], ["", "one\ntwo\tthree", ""]);
        assert_eq!(Table::default().csv().lines().count(), 1);
    }

    #[test]
    fn tsv_has_one_line_an_answer_and_its_columns_described() {
        let text = table().tsv();
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split('\t').collect()).collect();
        assert_eq!(lines.len(), 4);
        assert!(lines.iter().all(|line| line.len() == lines[0].len()));
        assert_eq!((lines[3][1], lines[3][11]), ("n/a", "one two three"));
        let study = experiment(
            "factors: {\"level\": [\"a,b\", \"c\"]},",
            "over: [\"level\"], show: [(\"x\", \"y\")], ask: [same(name: \"q\", text: \"Alike?\")],",
        );
        let described = sidecar(&study);
        for column in &lines[0] {
            let about = &described[column];
            assert!(about["LongName"].is_string() && about["Description"].is_string(), "{column}");
        }
        assert_eq!(described["seconds"]["Units"], "s");
        assert_eq!(described["question"]["Levels"]["q"], "Alike?");
        assert_eq!(described["factor_level"]["Levels"]["a,b"], "level a,b");
    }
}
