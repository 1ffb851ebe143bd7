//! The protocol by which programs and pages control a run.
//!
//! [`MESSAGES`] lists all messages with their names and arguments. There are two ways to write one:
//! - JSON over WebSocket: `{"set": ["strength.gain", 0.5]}`. A single argument needs no list, and a command
//!   without arguments may be a text: `{"mute": true}`, `"stop"`.
//! - OSC over UDP: the address `/asperity/set` with the arguments `"strength.gain"`, `0.5`; see [`osc`].
//!
//! Commands that fit the running graph go to its [`RunControl`](asperity_live::RunControl). Each is answered
//! by `done` or `error`, some by values.

pub(crate) mod osc;
mod table;
mod topics;

use asperity_diagnostics::{Diagnostic, one_of};
use asperity_live::view::{By, LiveLayout, Request};
use parking_lot::Mutex;
use serde::Serialize;

use crate::server::Shared;
pub(crate) use table::Command;
pub use table::{Argument, Kind, MESSAGES, Message, Way, table};
pub(crate) use topics::{Figures, Subscriptions};

/// Most views, and so most messages of a topic, a second.
pub(crate) const RATE_HZ: f64 = 60.0;
/// Messages a second of a topic, where a client asks for no rate.
const USUAL_HZ: f64 = 10.0;
/// Longest text of a marker in characters.
const MARKER: usize = 256;

/// An argument of a message.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum Value {
    Flag(bool),
    Whole(i64),
    Number(f64),
    Text(String),
}

impl Value {
    /// A number of any kind.
    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Self::Whole(x) => Some(*x as f64),
            Self::Number(x) => Some(*x),
            _ => None,
        }
    }

    /// A number of single precision, as the shortest decimal that it is written as: 0.1 stays 0.1.
    pub(crate) fn single(x: f32) -> Self {
        Self::Number(x.to_string().parse().unwrap_or(f64::from(x)))
    }

    pub(crate) fn text(&self) -> &str {
        if let Self::Text(text) = self { text } else { "" }
    }

    fn of(value: &serde_json::Value) -> Option<Self> {
        Some(match value {
            serde_json::Value::Bool(on) => Self::Flag(*on),
            serde_json::Value::Number(x) => x.as_i64().map(Self::Whole).or(x.as_f64().map(Self::Number))?,
            serde_json::Value::String(text) => Self::Text(text.clone()),
            _ => return None,
        })
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Flag(on) => on.fmt(f),
            Self::Whole(x) => x.fmt(f),
            Self::Number(x) => x.fmt(f),
            Self::Text(text) => text.fmt(f),
        }
    }
}

/// A message to a client.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Answer {
    pub(crate) name: &'static str,
    pub(crate) values: Vec<Value>,
}

impl Answer {
    /// A command was carried out at this time of the run \[s\].
    pub(crate) fn done(what: &str, at_s: f64) -> Self {
        Self { name: "done", values: vec![Value::Text(what.into()), Value::Number(at_s)] }
    }

    /// A command was not carried out.
    pub(crate) fn error(command: &str, message: &str, help: &str) -> Self {
        let values = [command, message, help].map(|text| Value::Text(text.into()));
        Self { name: "error", values: values.to_vec() }
    }

    fn wrong(command: &str, why: &Diagnostic) -> Self {
        Self::error(command, &why.message, why.help.as_deref().unwrap_or_default())
    }

    fn value(parameter: &str, value: Value) -> Self {
        Self { name: "value", values: vec![Value::Text(parameter.into()), value] }
    }

    fn echo(value: f64) -> Self {
        Self { name: "echo", values: vec![Value::Number(value)] }
    }

    fn ended() -> Self {
        Self { name: "ended", values: Vec::new() }
    }

    pub(crate) fn json(&self) -> String {
        serde_json::json!({ self.name: self.values }).to_string()
    }
}

/// Reads a command of a JSON text, or answers why it is none.
pub(crate) fn read(text: &str) -> Result<Command, Answer> {
    const FORM: &str = "a command is an object with its name and its arguments: {\"mute\": [true]}";
    let json = serde_json::from_str::<serde_json::Value>(text).unwrap_or_default();
    let (name, values) = match &json {
        serde_json::Value::String(name) => (name.as_str(), Some(Vec::new())),
        json => match json.as_object().and_then(only) {
            Some((name, serde_json::Value::Array(all))) => {
                (name.as_str(), all.iter().map(Value::of).collect())
            }
            Some((name, single)) => (name.as_str(), Value::of(single).map(|value| vec![value])),
            None => return Err(Answer::error("", "this is no command", FORM)),
        },
    };
    let Some(values) = values else {
        return Err(Answer::error(name, "an argument is a text, a number, true or false", FORM));
    };
    Command::read(name, &values)
}

/// The only field of an object.
fn only(fields: &serde_json::Map<String, serde_json::Value>) -> Option<(&String, &serde_json::Value)> {
    fields.iter().next().filter(|_| fields.len() == 1)
}

/// Carries a command out, or passes it on if it fits the graph. Those that are passed on are answered later.
pub(crate) fn obey(
    command: Command,
    by: &By,
    shared: &Shared,
    subscriptions: &Mutex<Subscriptions>,
) -> Vec<Answer> {
    let now_s = || shared.feed.figures().at_s;
    let request = match command {
        Command::Hello { .. } => return vec![Answer::done("hello", now_s())],
        Command::Echo(value) => return vec![Answer::echo(value)],
        Command::Get(parameter) => return get(parameter.as_deref(), shared),
        Command::Subscribe { topic, rate_hz } => {
            let rate_hz = rate_hz.unwrap_or(USUAL_HZ);
            let known = shared.run_control.changes(0).len();
            let subscribed = subscriptions.lock().subscribe(&topic, rate_hz, known, &shared.feed.figures());
            return vec![match subscribed {
                Ok(()) => Answer::done(&format!("subscribe {topic} {rate_hz}"), now_s()),
                Err(why) => Answer::wrong("subscribe", &why),
            }];
        }
        Command::Set { parameter, value } => set(&parameter, &value, shared).map_err(|why| ("set", why)),
        Command::Material { name, node } => {
            material(node.as_deref(), name, shared).map_err(|why| ("material", why))
        }
        Command::Gain(gain) if !(0.0..=1.0).contains(&gain) => {
            let what = format!("a gain of {gain} is out of range");
            Err(("gain", Diagnostic::new(what).help("a gain is from 0 to 1")))
        }
        Command::Gain(gain) => Ok(Request::Strength(gain as f32)),
        Command::Mute(mute) => Ok(Request::Mute(mute)),
        Command::Marker(text) if text.chars().count() > MARKER => {
            let what = format!("a marker of {} characters is too long", text.chars().count());
            Err(("marker", Diagnostic::new(what).help(format!("it has at most {MARKER}"))))
        }
        Command::Marker(text) => Ok(Request::Marker(text)),
        Command::Stop => Ok(Request::Stop),
    };
    let name = match &request {
        Ok(request) => name_of(request),
        Err((name, _)) => *name,
    };
    match request.map(|request| shared.run_control.ask(request, by)) {
        Ok(Ok(Some(change))) => vec![Answer::done(&change.what, change.at_s)],
        Ok(Ok(None)) => Vec::new(),
        Ok(Err(unheard)) => vec![Answer::error(name, &unheard.to_string(), "")],
        Err((name, why)) => vec![Answer::wrong(name, &why)],
    }
}

/// The command behind a request.
pub(crate) fn name_of(request: &Request) -> &'static str {
    match request {
        Request::Set { .. } => "set",
        Request::Material { .. } => "material",
        Request::Mute(_) => "mute",
        Request::Strength(_) => "gain",
        Request::Marker(_) => "marker",
        Request::Stop => "stop",
    }
}

/// Whether a parameter is a flag: its words are `off` and `on`.
fn is_flag(live: &LiveLayout) -> bool {
    live.words == ["off", "on"]
}

fn set(parameter: &str, value: &Value, shared: &Shared) -> Result<Request, Diagnostic> {
    let layout = shared.feed.layout();
    let Some((node, param)) = parameter.rsplit_once('.') else {
        let what = format!("`{parameter}` is no parameter");
        return Err(Diagnostic::new(what).help("write NODE.PARAM, such as strength.gain"));
    };
    if param == "material" && layout.materials.iter().any(|m| m.node == node) {
        return material(Some(node), value.text().to_owned(), shared);
    }
    let live = layout.nodes.iter().find(|x| x.id == node).map_or(&[][..], |x| &x.live);
    let Some(live) = live.iter().find(|x| x.name == param) else {
        let what = format!("{node} has no parameter {param} that can change while it runs");
        let live = layout.nodes.iter().flat_map(|n| n.live.iter().map(|l| format!("{}.{}", n.id, l.name)));
        let names: Vec<String> = live.collect();
        return Err(Diagnostic::new(what).help(one_of(parameter, names.iter().map(String::as_str))));
    };
    let number = match value {
        Value::Flag(on) if is_flag(live) => Some(f64::from(u8::from(*on))),
        Value::Text(word) => live.words.iter().position(|w| w == word).map(|at| at as f64),
        value => value.number(),
    };
    let fits = |x: &f64| (live.least..=live.most).contains(x) && !(live.whole && x.fract() != 0.0);
    let Some(value) = number.filter(fits) else {
        let what = format!("{param} of {node} cannot be {value}");
        let help = match live.words.as_slice() {
            [] => format!("it takes {} to {} {}", live.least, live.most, live.unit).trim_end().to_owned(),
            _ if is_flag(live) => "it takes true or false".to_owned(),
            words => format!("it takes one of {}", words.join(", ")),
        };
        return Err(Diagnostic::new(what).help(help));
    };
    Ok(Request::Set { node: node.into(), param: param.into(), value })
}

/// The material of a node; of the only node that has any, where none is named.
fn material(node: Option<&str>, name: String, shared: &Shared) -> Result<Request, Diagnostic> {
    let layout = shared.feed.layout();
    let of = |m: &&asperity_live::view::Materials| node.is_none_or(|node| m.node == node);
    let mut fitting = layout.materials.iter().filter(of);
    let (Some(materials), None) = (fitting.next(), fitting.next()) else {
        let what = match node {
            Some(node) => format!("{node} has no materials"),
            None if layout.materials.is_empty() => "the graph has no materials to choose from".to_owned(),
            None => "several nodes have materials: name one".to_owned(),
        };
        let nodes = layout.materials.iter().map(|m| m.node.as_str());
        return Err(Diagnostic::new(what).help(one_of(node.unwrap_or_default(), nodes)));
    };
    if !materials.names.contains(&name) {
        let what = format!("{} has no material {name}", materials.node);
        return Err(Diagnostic::new(what).help(one_of(&name, materials.names.iter().map(String::as_str))));
    }
    Ok(Request::Material { node: materials.node.clone(), name })
}

/// The value of a parameter, or those of all.
fn get(parameter: Option<&str>, shared: &Shared) -> Vec<Answer> {
    let layout = shared.feed.layout();
    let mut all: Vec<(String, Value)> = Vec::new();
    for node in &layout.nodes {
        for live in &node.live {
            let value = match live.words.get(live.value as usize) {
                Some(_) if is_flag(live) => Value::Flag(live.value != 0.0),
                Some(word) => Value::Text(word.clone()),
                None if live.whole => Value::Whole(live.value as i64),
                None => Value::Number(live.value),
            };
            all.push((format!("{}.{}", node.id, live.name), value));
        }
    }
    let chosen = layout.materials.iter();
    all.extend(chosen.map(|m| (format!("{}.material", m.node), Value::Text(m.chosen.clone()))));
    all.push(("mute".into(), Value::Flag(shared.run_control.muted())));
    all.push(("gain".into(), Value::single(shared.run_control.strength())));
    let Some(parameter) = parameter else {
        return all.into_iter().map(|(name, value)| Answer::value(&name, value)).collect();
    };
    match all.iter().find(|(name, _)| name == parameter) {
        Some((name, value)) => vec![Answer::value(name, value.clone())],
        None => {
            let what = format!("there is no value {parameter} that can change while it runs");
            let help = one_of(parameter, all.iter().map(|(name, _)| name.as_str()));
            vec![Answer::error("get", &what, &help)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_is_read_with_and_without_list() {
        let mute = || Ok(Command::Mute(true));
        assert_eq!(read(r#"{"mute": true}"#), mute());
        assert_eq!(read(r#"{"mute": [true]}"#), mute());
        assert_eq!(read("\"stop\""), Ok(Command::Stop));
        assert_eq!(read(r#"{"stop": []}"#), Ok(Command::Stop));
        let set = Command::Set { parameter: "a b.c".into(), value: Value::Number(0.5) };
        assert_eq!(read(r#"{"set": ["a b.c", 0.5]}"#), Ok(set));
        let topic = |rate_hz| Command::Subscribe { topic: "force".into(), rate_hz };
        assert_eq!(read(r#"{"subscribe": "force"}"#), Ok(topic(None)));
        assert_eq!(read(r#"{"subscribe": ["force", 25]}"#), Ok(topic(Some(25.0))));
    }

    #[test]
    fn wrong_command_error_names_the_fault_and_the_help() {
        for (text, command, what, help) in [
            ("garbage", "", "no command", "{\"mute\": [true]}"),
            ("[]", "", "no command", "an object"),
            ("{}", "", "no command", "an object"),
            (r#"{"mute": true, "more": 1}"#, "", "no command", "an object"),
            (&"[".repeat(16_000), "", "no command", "an object"),
            (r#"{"mut": true}"#, "mut", "there is no command `mut`", "did you mean `mute`"),
            (r#"{"done": ["x", 1]}"#, "done", "there is no command `done`", "`marker`"),
            (r#"{"mute": 1}"#, "mute", "`on` is no flag", "{\"mute\": [on]}"),
            (r#"{"mute": []}"#, "mute", "`on` is missing", "on: flag"),
            (r#"{"stop": 1}"#, "stop", "takes no arguments", "{\"stop\": []}"),
            (r#"{"set": ["a.b", {"c": 1}]}"#, "set", "an argument is a text", ""),
            (r#"{"set": ["a.b"]}"#, "set", "`value` is missing", "{\"set\": [parameter, value]}"),
            (r#"{"set": ["a.b", 1, 2]}"#, "set", "takes 2 arguments, 3 came", "parameter"),
            (r#"{"marker": 3}"#, "marker", "`text` is no text", ""),
        ] {
            let answer = read(text).expect_err(text);
            let told: Vec<&str> = answer.values.iter().map(Value::text).collect();
            let fits = told[0] == command && told[1].contains(what) && told[2].contains(help);
            assert!(answer.name == "error" && fits, "{text:.30}: {told:?}");
        }
    }

    /// Every answer that is made has the arguments that the table lists.
    #[test]
    fn answers_are_as_the_table_lists_them() {
        for answer in [
            Answer::done("x", 1.0),
            Answer::error("set", "x", ""),
            Answer::value("a.b", Value::Flag(true)),
            Answer::echo(1.0),
            Answer::ended(),
        ] {
            assert!(table::fits(&answer), "{answer:?}");
        }
        assert!(!table::fits(&Answer { name: "done", values: vec![Value::Flag(true)] }));
    }
}
