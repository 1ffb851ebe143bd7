//! Names and reasons, short enough for a table.

use std::collections::BTreeSet;

use crate::result::{Results, Row};

/// Letters of a name in a table.
const NAME: usize = 72;
/// Letters of a reason in a table: what is named at length is in results.json.
const REASON: usize = 200;

impl Results {
    /// A setting's name in a table: knobs without their nodes where no other node's knob of that name is turned.
    pub(crate) fn named(&self, row: &Row) -> String {
        let knobs: BTreeSet<&str> =
            self.rows.iter().flat_map(|r| &r.turned).map(|(k, _)| k.as_str()).collect();
        let param = |knob: &str| knob.split_once('.').map(|(_, param)| param.to_owned());
        let mut name = row.name.clone();
        for (knob, value) in &row.turned {
            let Some(short) = param(knob).filter(|_| !knob.starts_with("*.")) else { continue };
            let alike = knobs
                .iter()
                .filter(|k| !k.starts_with("*.") && param(k).as_deref().unwrap_or(k) == short.as_str());
            if alike.count() == 1 {
                name = name.replacen(&format!("{knob}={value}"), &format!("{short}={value}"), 1);
            }
        }
        code(&cut(&name, NAME))
    }
}

/// A text of at most so many letters, the last of which is an ellipsis where it was longer.
pub(crate) fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let mut short: String = text.chars().take(most.saturating_sub(1)).collect();
    short.truncate(short.trim_end().len());
    short + "…"
}

/// A reason without the lists of names that an error may come with.
pub(crate) fn reason(text: &str) -> String {
    let text = text.replace(['\n', '\r'], " ");
    let list = text.find(" (there are `");
    let told = list.map_or_else(|| text.clone(), |at| text[..at].to_owned());
    cut(&told, REASON)
}

/// A name as Markdown: in backticks where all of it can stand there, also in a table.
pub(crate) fn code(name: &str) -> String {
    if name.is_empty() || name.contains(['`', '|', '\n', '\r']) { plain(name) } else { format!("`{name}`") }
}

/// A name or text as Markdown in which nothing is markup.
pub(crate) fn plain(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '\n' | '\r' => out.push(' '),
            '\\' | '`' | '*' | '_' | '<' | '>' | '[' | ']' | '|' | '#' | '~' | '&' => out.extend(['\\', c]),
            c => out.push(c),
        }
    }
    out
}

/// A message as Markdown: what it has between backticks stays there.
pub(crate) fn message(text: &str) -> String {
    let parts: Vec<&str> = text.split('`').collect();
    if parts.len().is_multiple_of(2) {
        return plain(text);
    }
    parts.iter().enumerate().map(|(i, part)| if i % 2 == 1 { code(part) } else { plain(part) }).collect()
}

/// Neighbouring budgets in words.
pub(crate) fn range(budgets: &[Option<f64>]) -> String {
    match (budgets.first().copied().flatten(), budgets.last().copied().flatten()) {
        (None, _) => "any".into(),
        (Some(first), None) => format!("{first} and more"),
        (Some(first), Some(last)) if first == last => format!("{first}"),
        (Some(first), Some(last)) => format!("{first} to {last}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{results, row};

    #[test]
    fn knobs_lose_their_nodes_where_no_other_has_one_of_that_name() {
        let turned = |name: &str, knobs: &[(&str, &str)]| {
            let turned = knobs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
            Row { turned, ..row(name) }
        };
        let all = results(vec![
            turned(
                "g.ron: texture.precision=f16 phase.frames=2",
                &[("texture.precision", "f16"), ("phase.frames", "2")],
            ),
            turned("*.precision=f64", &[("*.precision", "f64")]),
            turned("a.gain=1 b.gain=2", &[("a.gain", "1"), ("b.gain", "2")]),
            turned("phase=spsi", &[("phase", "spsi")]),
            // A node of that name is turned, too.
            turned("rate.phase=minimum", &[("rate.phase", "minimum")]),
        ]);
        let names: Vec<String> = all.rows.iter().map(|r| all.named(r)).collect();
        let want = [
            "`g.ron: precision=f16 frames=2`",
            "`*.precision=f64`",
            "`a.gain=1 b.gain=2`",
            "`phase=spsi`",
            "`rate.phase=minimum`",
        ];
        assert_eq!(names, want);
    }

    #[test]
    fn names_are_escaped_in_markdown() {
        assert_eq!(code("a_b*<c>"), "`a_b*<c>`");
        assert_eq!(code("a|b`c\nd"), r"a\|b\`c d");
        assert_eq!(plain(r"*a_ <b> [c](d) \#"), r"\*a\_ \<b\> \[c\](d) \\\#");
        assert_eq!(message("no `a_b` in c_d"), r"no `a_b` in c\_d");
        assert_eq!(message("no `a|b`, <c>"), r"no a\|b, \<c\>");
        assert_eq!(message("no `a`b`"), r"no \`a\`b\`");
    }

    #[test]
    fn what_is_too_long_ends_in_an_ellipsis_and_no_list_of_names_is_told() {
        assert_eq!(cut("äöü", 3), "äöü");
        assert_eq!(cut("äöü ß", 4), "äöü…");
        assert_eq!(cut("a bcd", 3), "a…");
        let listed = "no material `x` in l.ron (there are `a`, `b`)";
        assert_eq!(reason(listed), "no material `x` in l.ron");
        assert_eq!(reason("a\nb"), "a b");
        assert_eq!(reason(&"x".repeat(999)).chars().count(), REASON);
    }
}
