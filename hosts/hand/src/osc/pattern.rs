//! Address patterns of OSC 1.0, as regular expressions, whose matching takes linear time.
//!
//! rosc's matcher differs from the specification: it takes `[12]` for one or more characters (one), `*` at
//! the end for at least one (none or more), and only the first fit of `{a,ab}` (any).

use asperity_node::Diagnostic;
use regex::{Regex, escape};

use crate::error;

/// Longest address that is matched.
const LONGEST: usize = 1024;

fn plain(c: char) -> bool {
    c.is_ascii_graphic() && !"#*,/?[]{}".contains(c)
}

/// Parses a plain address or a pattern. Error: the text is neither.
pub(super) fn parse(text: &str) -> Result<Regex, Diagnostic> {
    regex(text).ok_or_else(|| {
        error(
            format!("`{text}` is no OSC address or address pattern"),
            "write one such as `/pen`, `/pen/*`, `/pen/{left,right}/[0-9]?`: \
             parts after slashes, without spaces or `#`",
        )
    })
}

/// Whether a message's address matches. An address that is itself a pattern does not.
pub(super) fn fits(pattern: &Regex, address: &str) -> bool {
    address.len() <= LONGEST && address.chars().all(|c| c == '/' || plain(c)) && pattern.is_match(address)
}

fn regex(text: &str) -> Option<Regex> {
    if !text.starts_with('/') || text.ends_with('/') || text.contains("//") {
        return None;
    }
    let (mut out, mut rest) = (String::from("^"), text);
    while let Some(first) = rest.chars().next() {
        rest = &rest[first.len_utf8()..];
        let mut until = |close: char| {
            let (inner, after) = rest.split_once(close)?;
            rest = after;
            Some(inner)
        };
        match first {
            '*' => out += "[^/]*",
            '?' => out += "[^/]",
            '[' => out += &class(until(']')?)?,
            '{' => {
                let words: Vec<&str> = until('}')?.split(',').collect();
                if !words.iter().all(|w| !w.is_empty() && w.chars().all(plain)) {
                    return None;
                }
                out += &format!("(?:{})", words.iter().map(|w| escape(w)).collect::<Vec<_>>().join("|"));
            }
            c if c == '/' || plain(c) => out += &escape(&c.to_string()),
            _ => return None,
        }
    }
    Regex::new(&(out + "$")).ok()
}

/// A set of characters and ranges; a minus at the end stands for itself.
fn class(inner: &str) -> Option<String> {
    let (not, inner) = inner.strip_prefix('!').map_or(("", inner), |rest| ("^/", rest));
    if inner.is_empty() || !inner.chars().all(plain) {
        return None;
    }
    let mut out = format!("[{not}");
    let mut rest = inner;
    while let Some(first) = rest.get(..1) {
        let range = rest[1..].starts_with('-') && rest.len() > 2;
        out += &escape(first);
        if range {
            out += &format!("-{}", escape(&rest[2..3]));
        }
        rest = &rest[if range { 3 } else { 1 }..];
    }
    Some(out + "]")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pattern_matches_as_osc_1_0_says() {
        for (pattern, yes, no) in [
            ("/pen", &["/pen"][..], &["/pen/1", "/Pen", "/pe", "/penn", ""][..]),
            ("/pen*", &["/pen", "/pencil"], &["/pen/1", "/apen"]),
            ("/*/x", &["/a/x", "/abc/x"], &["/x", "/a/b/x", "/a/xx"]),
            ("/pen[12]", &["/pen1", "/pen2"], &["/pen", "/pen12", "/pen3"]),
            ("/p[!a-c-]", &["/pd", "/pZ"], &["/pa", "/pb", "/p-", "/p"]),
            ("/p?n", &["/pen", "/p-n"], &["/pn", "/p/n", "/peen"]),
            ("/{a,ab}c", &["/ac", "/abc"], &["/bc", "/abbc"]),
            ("/a*b*c", &["/abc", "/abbbcc", "/axxbyyc"], &["/ac", "/abcd", "/a/b/c"]),
            ("/*a?", &["/aab", "/ba-"], &["/a", "/ba"]),
            ("/{b,ba,a}[ab]*", &["/ba", "/bab", "/baa", "/aa"], &["/b", "/c", "/a/a"]),
            ("/x.y+(z)|^$", &["/x.y+(z)|^$"], &["/xay+(z)|^$", "/x.y"]),
            ("/[.^&&~]", &["/.", "/^", "/&", "/~"], &["/a", "/\\"]),
        ] {
            let p = parse(pattern).unwrap();
            yes.iter().for_each(|a| assert!(fits(&p, a), "{pattern} should fit {a}"));
            no.iter().for_each(|a| assert!(!fits(&p, a), "{pattern} should not fit {a}"));
        }
    }

    #[test]
    fn hostile_address_is_matched_fast() {
        let p = parse("/*a*a*a*a*a*a*a*a*a*a*b").unwrap();
        assert!(!fits(&p, &format!("/{}", "a".repeat(1000))));
        assert!(!fits(&p, &format!("/{}b", "a".repeat(100_000))));
        assert!(!fits(&parse("/*").unwrap(), "/é"));
        assert!(!fits(&parse("/*").unwrap(), "/{a,b}"));
    }

    #[test]
    fn invalid_pattern_error_names_it() {
        for bad in [
            "", "pen", "/", "/pen/", "/p en", "/#", "/[", "/[]", "/{a", "/{}", "/{a,}", "/a//b", "/[!]",
            "/[b-a]", "/a]", "/é",
        ] {
            let e = parse(bad).unwrap_err();
            assert!(e.message.contains(&format!("`{bad}`")), "{bad}");
        }
    }
}
