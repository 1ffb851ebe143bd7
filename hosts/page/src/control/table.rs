//! The table of all messages, and the commands in it.

use std::fmt::Write as _;

use asperity_diagnostics::one_of;

use super::{Answer, Value};

/// A command of a client.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Command {
    Hello { token: String, port: Option<u16> },
    Set { parameter: String, value: Value },
    Get(Option<String>),
    Material { name: String, node: Option<String> },
    Mute(bool),
    Gain(f64),
    Marker(String),
    Subscribe { topic: String, rate_hz: Option<f64> },
    Echo(f64),
    Stop,
}

/// Type of an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// OSC `s`.
    Text,
    /// OSC `f`; also `d`, `i` and `h` in commands.
    Number,
    /// OSC `i`.
    Whole,
    /// OSC `T` or `F`.
    Flag,
    /// Any of the others.
    Value,
    /// A JSON object; never in OSC.
    Object,
}

impl Kind {
    fn word(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Number => "number",
            Self::Whole => "whole number",
            Self::Flag => "flag",
            Self::Value => "value",
            Self::Object => "object",
        }
    }

    fn letter(self) -> &'static str {
        match self {
            Self::Text => "s",
            Self::Number => "f",
            Self::Whole => "i",
            Self::Flag => "T",
            Self::Value | Self::Object => "*",
        }
    }

    fn holds(self, value: &Value) -> bool {
        match self {
            Self::Text => matches!(value, Value::Text(_)),
            Self::Number => value.number().is_some_and(f64::is_finite),
            Self::Whole => matches!(value, Value::Whole(_)),
            Self::Flag => matches!(value, Value::Flag(_)),
            Self::Value => !matches!(value, Value::Number(x) if !x.is_finite()),
            Self::Object => false,
        }
    }
}

/// An argument of a message.
#[derive(Clone, Copy, Debug)]
pub struct Argument {
    /// Its name, with its unit.
    pub name: &'static str,
    /// Its type.
    pub kind: Kind,
    /// Whether it may be left out; only at the end.
    pub optional: bool,
}

/// Who sends a message, and when.
#[derive(Clone, Copy)]
pub enum Way {
    /// A client, as a command.
    #[allow(private_interfaces, reason = "nobody else makes commands")]
    Command(fn(&[Value]) -> Command),
    /// The program, as an answer.
    Answer,
    /// The program, to clients that subscribed to it.
    Topic,
    /// The program, to the live page.
    Page,
}

/// A message of the protocol.
#[derive(Clone, Copy)]
pub struct Message {
    /// Its name; in OSC with `/asperity/` before it.
    pub name: &'static str,
    /// Its arguments, in order.
    pub arguments: &'static [Argument],
    /// Who sends it.
    pub way: Way,
    /// Its meaning.
    pub doc: &'static str,
}

impl std::fmt::Debug for Message {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Message").field("name", &self.name).finish_non_exhaustive()
    }
}

const fn a(name: &'static str, kind: Kind) -> Argument {
    Argument { name, kind, optional: false }
}

const fn maybe(name: &'static str, kind: Kind) -> Argument {
    Argument { name, kind, optional: true }
}

fn text(values: &[Value], at: usize) -> String {
    values[at].text().to_owned()
}

fn some(values: &[Value], at: usize) -> Option<String> {
    values.get(at).map(|value| value.text().to_owned())
}

fn number(values: &[Value], at: usize) -> Option<f64> {
    values.get(at).and_then(Value::number)
}

use Kind::{Flag, Number, Object, Text, Whole};

const AT: Argument = a("at_s", Number);

/// All messages: commands, answers, topics, and those of the page alone.
pub const MESSAGES: &[Message] = &[
    Message {
        name: "hello",
        arguments: &[a("token", Text), maybe("port", Whole)],
        way: Way::Command(|v| Command::Hello {
            token: text(v, 0),
            port: number(v, 1).and_then(|port| u16::try_from(port as i64).ok()),
        }),
        doc: "Shows the token. OSC needs it first; answers go to `port` of the sender, or to its own port.",
    },
    Message {
        name: "set",
        arguments: &[a("parameter", Text), a("value", Kind::Value)],
        way: Way::Command(|v| Command::Set { parameter: text(v, 0), value: v[1].clone() }),
        doc: "Sets a live parameter, NODE.PARAM. A choice goes by its word or its number from 0.",
    },
    Message {
        name: "get",
        arguments: &[maybe("parameter", Text)],
        way: Way::Command(|v| Command::Get(some(v, 0))),
        doc: "Asks for the `value` of a parameter, of `mute` or `gain`; without one, for all.",
    },
    Message {
        name: "material",
        arguments: &[a("name", Text), maybe("node", Text)],
        way: Way::Command(|v| Command::Material { name: text(v, 0), node: some(v, 1) }),
        doc: "Plays another material. The node may be left out where only one has materials.",
    },
    Message {
        name: "mute",
        arguments: &[a("on", Flag)],
        way: Way::Command(|v| Command::Mute(v[0] == Value::Flag(true))),
        doc: "Silences the output within 15 ms, or ends the silence.",
    },
    Message {
        name: "gain",
        arguments: &[a("factor", Number)],
        way: Way::Command(|v| Command::Gain(number(v, 0).unwrap_or(0.0))),
        doc: "Sets the strength of the output, 0 to 1, before all limiters.",
    },
    Message {
        name: "marker",
        arguments: &[a("text", Text)],
        way: Way::Command(|v| Command::Marker(text(v, 0))),
        doc: "Writes a note into the report, with its tick and time.",
    },
    Message {
        name: "subscribe",
        arguments: &[a("topic", Text), maybe("rate_hz", Number)],
        way: Way::Command(|v| Command::Subscribe { topic: text(v, 0), rate_hz: number(v, 1) }),
        doc: "Asks for a topic, up to 60 times a second (10 if left out). 0 ends it.",
    },
    Message {
        name: "echo",
        arguments: &[a("number", Number)],
        way: Way::Command(|v| Command::Echo(number(v, 0).unwrap_or(0.0))),
        doc: "Asks for the same number back.",
    },
    Message {
        name: "stop",
        arguments: &[],
        way: Way::Command(|_| Command::Stop),
        doc: "Ramps the output down and ends the run.",
    },
    Message {
        name: "done",
        arguments: &[a("what", Text), AT],
        way: Way::Answer,
        doc: "A command was carried out; `what` is as in the report.",
    },
    Message {
        name: "error",
        arguments: &[a("command", Text), a("message", Text), a("help", Text)],
        way: Way::Answer,
        doc: "A command was not carried out, and why.",
    },
    Message {
        name: "value",
        arguments: &[a("parameter", Text), a("value", Kind::Value)],
        way: Way::Answer,
        doc: "The value of a parameter.",
    },
    Message {
        name: "echo",
        arguments: &[a("number", Number)],
        way: Way::Answer,
        doc: "The number of the `echo`.",
    },
    Message {
        name: "ended",
        arguments: &[],
        way: Way::Answer,
        doc: "The run has ended. OSC only; a WebSocket is closed.",
    },
    Message {
        name: "position",
        arguments: &[AT, a("x_mm", Number), a("y_mm", Number), a("z_mm", Number)],
        way: Way::Topic,
        doc: "Place of the stylus.",
    },
    Message {
        name: "force",
        arguments: &[AT, a("force_n", Number)],
        way: Way::Topic,
        doc: "The graph's first force.",
    },
    Message {
        name: "speed",
        arguments: &[AT, a("speed_mm_s", Number)],
        way: Way::Topic,
        doc: "The graph's first speed.",
    },
    Message {
        name: "drive",
        arguments: &[AT, a("peak", Number)],
        way: Way::Topic,
        doc: "Peak of the output since the last 1/60 s, of full scale.",
    },
    Message {
        name: "meters",
        arguments: &[
            AT,
            a("ticks", Whole),
            a("misses", Whole),
            a("skipped_ticks", Whole),
            a("underruns", Whole),
            a("xruns", Whole),
            a("late_p99_us", Number),
            a("tick_p99_us", Number),
        ],
        way: Way::Topic,
        doc: "Counts and times since the start.",
    },
    Message {
        name: "faults",
        arguments: &[AT, a("node", Text), a("count", Whole), a("fault", Text)],
        way: Way::Topic,
        doc: "A node failed; once for each new count.",
    },
    Message {
        name: "changes",
        arguments: &[AT, a("what", Text), a("by", Text)],
        way: Way::Topic,
        doc: "A change or marker of anybody, as in the report.",
    },
    Message {
        name: "layout",
        arguments: &[a("layout", Object), a("has_hand", Flag), a("map", Whole)],
        way: Way::Page,
        doc: "Another graph, or the same one with other values.",
    },
    Message {
        name: "hand",
        arguments: &[a("whose", Text)],
        way: Way::Page,
        doc: "Who has the hand: `yours`, `theirs` or `free`.",
    },
];

impl Message {
    /// The message in JSON, with the names of its arguments.
    fn json(&self) -> String {
        format!("{{\"{}\": [{}]}}", self.name, self.named(|a| a.name.to_owned()))
    }

    fn named(&self, one: impl Fn(&Argument) -> String) -> String {
        let all = self.arguments.iter().map(|a| if a.optional { format!("{}?", one(a)) } else { one(a) });
        all.collect::<Vec<_>>().join(", ")
    }
}

impl Command {
    /// Reads a command with these arguments, or answers why it is none.
    pub(crate) fn read(name: &str, values: &[Value]) -> Result<Self, Answer> {
        let commands = || MESSAGES.iter().filter(|m| matches!(m.way, Way::Command(_)));
        let Some((message, make)) = commands().find_map(|m| match m.way {
            Way::Command(make) if m.name == name => Some((m, make)),
            _ => None,
        }) else {
            let what = format!("there is no command `{name}`");
            return Err(Answer::error(name, &what, &one_of(name, commands().map(|m| m.name))));
        };
        let arguments = message.arguments;
        let what = if let Some(missing) = arguments.get(values.len()).filter(|a| !a.optional) {
            format!("`{}` is missing", missing.name)
        } else if values.len() > arguments.len() {
            match arguments.len() {
                0 => format!("`{name}` takes no arguments"),
                most => format!("`{name}` takes {most} arguments, {} came", values.len()),
            }
        } else if let Some((odd, _)) = arguments.iter().zip(values).find(|(a, v)| !a.kind.holds(v)) {
            format!("`{}` is no {}", odd.name, odd.kind.word())
        } else {
            return Ok(make(values));
        };
        let kinds = message.named(|a| format!("{}: {}", a.name, a.kind.word()));
        let kinds = if kinds.is_empty() { kinds } else { format!(" with {kinds}") };
        Err(Answer::error(name, &what, &format!("write {}{kinds}", message.json())))
    }
}

/// Whether the table has a message of the program with these arguments.
#[cfg(test)]
pub(super) fn fits(answer: &Answer) -> bool {
    MESSAGES.iter().any(|m| {
        let is_ours = matches!(m.way, Way::Answer | Way::Topic) && m.name == answer.name;
        let all = || m.arguments.iter().zip(&answer.values).all(|(a, v)| a.kind.holds(v));
        is_ours && m.arguments.len() == answer.values.len() && all()
    })
}

/// The whole table for docs/control.md, in Markdown.
#[must_use]
pub fn table() -> String {
    let mut out = String::new();
    for (title, of) in [
        ("To the program", &(|way| matches!(way, Way::Command(_))) as &dyn Fn(Way) -> bool),
        ("From the program, as an answer", &|way| matches!(way, Way::Answer)),
        ("From the program, by subscription", &|way| matches!(way, Way::Topic)),
        ("From the program, to the live page", &|way| matches!(way, Way::Page)),
    ] {
        let is_page = of(Way::Page);
        let _ = writeln!(out, "**{title}**\n");
        let _ = writeln!(out, "| JSON |{} meaning |", if is_page { "" } else { " OSC |" });
        let _ = writeln!(out, "|---|---|{}", if is_page { "" } else { "---|" });
        for message in MESSAGES.iter().filter(|m| of(m.way)) {
            let _ = write!(out, "| `{}` |", message.json());
            if !is_page {
                let letters: String = message.arguments.iter().map(|a| a.kind.letter()).collect();
                let _ = write!(out, " `/asperity/{} ,{letters}` |", message.name);
            }
            let _ = writeln!(out, " {} |", message.doc);
        }
        let _ = writeln!(out);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn docs_have_the_table_of_the_code() {
        let docs = include_str!("../../../../docs/control.md");
        assert!(docs.contains(&table()), "docs/control.md lacks the table, which is\n{}", table());
    }

    #[test]
    fn names_are_unique_and_only_last_arguments_are_optional() {
        for (i, m) in MESSAGES.iter().enumerate() {
            let is_command = |m: &Message| matches!(m.way, Way::Command(_));
            let twin = MESSAGES[..i].iter().any(|n| n.name == m.name && is_command(n) == is_command(m));
            assert!(!twin, "{}", m.name);
            assert!(m.arguments.is_sorted_by_key(|a| a.optional), "{}", m.name);
        }
    }
}
