//! Names and reasons as Markdown, short enough for a table.

use crate::results::Row;

/// Most characters of a name in a table.
const NAME: usize = 72;
/// Most characters of a reason in a table: results.json has all of it.
const REASON: usize = 200;

/// Name of a setting in a table.
pub(crate) fn named(row: &Row) -> String {
    code(&cut(&row.name, NAME))
}

/// A table. Every line needs as many cells as there are titles.
pub(crate) fn table(titles: &[String], lines: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut out = format!("| {} |\n|{}\n", titles.join(" | "), "---|".repeat(titles.len()));
    for line in lines {
        out += &format!("| {} |\n", line.join(" | "));
    }
    out + "\n"
}

/// A text of at most so many characters; an ellipsis replaces the rest.
fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let mut short: String = text.chars().take(most.saturating_sub(1)).collect();
    short.truncate(short.trim_end().len());
    short + "…"
}

/// A reason in one line, without the list of names that an error may end with.
pub(crate) fn reason(text: &str) -> String {
    let text = text.replace(['\n', '\r'], " ");
    cut(text.split(" (there are `").next().unwrap_or_default(), REASON)
}

/// A name in backticks, or escaped where backticks cannot hold it.
pub(crate) fn code(name: &str) -> String {
    if name.is_empty() || name.contains(['`', '|', '\n', '\r']) { plain(name) } else { format!("`{name}`") }
}

/// A text in which nothing is markup.
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

/// A message whose backticks stay backticks.
pub(crate) fn message(text: &str) -> String {
    let parts: Vec<&str> = text.split('`').collect();
    if parts.len().is_multiple_of(2) {
        return plain(text);
    }
    parts.iter().enumerate().map(|(i, part)| if i % 2 == 1 { code(part) } else { plain(part) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_escaped_in_markdown() {
        for (escaped, want) in [
            (code("a_b*<c>"), "`a_b*<c>`"),
            (code("a|b`c\nd"), r"a\|b\`c d"),
            (plain(r"*a_ <b> [c](d) \#"), r"\*a\_ \<b\> \[c\](d) \\\#"),
            (message("no `a_b` in c_d"), r"no `a_b` in c\_d"),
            (message("no `a|b`, <c>"), r"no a\|b, \<c\>"),
            (message("no `a`b`"), r"no \`a\`b\`"),
        ] {
            assert_eq!(escaped, want);
        }
    }

    #[test]
    fn long_texts_are_cut_and_lists_of_names_dropped() {
        for (short, want) in [
            (cut("äöü", 3), "äöü"),
            (cut("äöü ß", 4), "äöü…"),
            (cut("a bcd", 3), "a…"),
            (reason("no material `x` in l.ron (there are `a`, `b`)"), "no material `x` in l.ron"),
            (reason("a\nb"), "a b"),
        ] {
            assert_eq!(short, want);
        }
        assert_eq!(reason(&"x".repeat(999)).chars().count(), REASON);
    }
}
