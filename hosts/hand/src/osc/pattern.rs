//! Address patterns of OSC 1.0.
//!
//! rosc's matcher differs from the specification: it takes `[12]` for one or more characters (one), `*` at
//! the end for at least one (none or more), and only the first fit of `{a,ab}` (any). So this is our own.
//! It follows all ways through the pattern at once, so its time is at most pattern times address.

use crate::HandError;

/// Longest address that is matched.
const LONGEST: usize = 1024;

/// A piece of a pattern. Only `Plain` matches a slash.
#[derive(Clone, Debug, PartialEq)]
enum Piece {
    Plain(u8),
    Any,
    One,
    Class { not: bool, ranges: Vec<(u8, u8)> },
    Choice(Vec<Vec<u8>>),
}

/// A pattern, ready to match.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pattern(Vec<Piece>);

fn plain(c: u8) -> bool {
    c.is_ascii_graphic() && !b"#*,/?[]{}".contains(&c)
}

impl Pattern {
    /// Parses a plain address or a pattern. Error: the text is neither.
    pub(super) fn parse(text: &str) -> Result<Self, HandError> {
        Self::pieces(text.as_bytes()).map(Self).ok_or_else(|| {
            HandError::option(
                format!("`{text}` is no OSC address or address pattern"),
                "write one such as `/pen`, `/pen/*`, `/pen/{left,right}/[0-9]?`: \
                 parts after slashes, without spaces or `#`",
            )
        })
    }

    fn pieces(mut rest: &[u8]) -> Option<Vec<Piece>> {
        let mut pieces = Vec::new();
        if rest.first() != Some(&b'/') || rest.last() == Some(&b'/') || rest.windows(2).any(|w| w == b"//") {
            return None;
        }
        while let Some((first, after)) = rest.split_first() {
            rest = after;
            pieces.push(match first {
                b'*' => Piece::Any,
                b'?' => Piece::One,
                b'[' => class(until(&mut rest, b']')?)?,
                b'{' => choice(until(&mut rest, b'}')?)?,
                b'/' => Piece::Plain(b'/'),
                c if plain(*c) => Piece::Plain(*c),
                _ => return None,
            });
        }
        Some(pieces)
    }

    /// Whether a message's address matches. An address that is itself a pattern does not.
    pub(super) fn fits(&self, address: &str) -> bool {
        let address = address.as_bytes();
        if address.len() > LONGEST || !address.iter().all(|c| *c == b'/' || plain(*c)) {
            return false;
        }
        // Possible ends of the pieces so far in the address.
        let mut ends = vec![false; address.len() + 1];
        ends[0] = true;
        for piece in &self.0 {
            let mut next = vec![false; address.len() + 1];
            for start in (0..=address.len()).filter(|s| ends[*s]) {
                piece.from(&address[start..], &mut next[start..]);
            }
            ends = next;
        }
        ends[address.len()]
    }
}

impl Piece {
    /// Marks the possible ends of this piece in `rest`.
    fn from(&self, rest: &[u8], ends: &mut [bool]) {
        let one = |fits: &dyn Fn(u8) -> bool, ends: &mut [bool]| {
            if rest.first().is_some_and(|c| fits(*c)) {
                ends[1] = true;
            }
        };
        match self {
            Self::Plain(p) => one(&|c| c == *p, ends),
            Self::One => one(&|c| c != b'/', ends),
            Self::Class { not, ranges } => {
                one(&|c| c != b'/' && ranges.iter().any(|(a, b)| (*a..=*b).contains(&c)) != *not, ends);
            }
            Self::Any => {
                let part = rest.iter().position(|c| *c == b'/').unwrap_or(rest.len());
                // A marked end was reached from further left, which marked the rest of the part too.
                for end in ends.iter_mut().take(part + 1) {
                    if std::mem::replace(end, true) {
                        break;
                    }
                }
            }
            Self::Choice(words) => {
                words.iter().filter(|w| rest.starts_with(w)).for_each(|w| ends[w.len()] = true);
            }
        }
    }
}

/// Text before the closing sign, which is removed too.
fn until<'a>(rest: &mut &'a [u8], close: u8) -> Option<&'a [u8]> {
    let end = rest.iter().position(|c| *c == close)?;
    let (inner, after) = rest.split_at(end);
    *rest = &after[1..];
    Some(inner)
}

fn class(inner: &[u8]) -> Option<Piece> {
    let (not, mut rest) = inner.strip_prefix(b"!").map_or((false, inner), |rest| (true, rest));
    let mut ranges = Vec::new();
    if rest.is_empty() || !rest.iter().all(|c| plain(*c)) {
        return None;
    }
    while let Some((first, after)) = rest.split_first() {
        // A minus at the end stands for itself.
        if let [b'-', last, after @ ..] = after {
            if last < first {
                return None;
            }
            ranges.push((*first, *last));
            rest = after;
        } else {
            ranges.push((*first, *first));
            rest = after;
        }
    }
    Some(Piece::Class { not, ranges })
}

fn choice(inner: &[u8]) -> Option<Piece> {
    let words: Vec<_> = inner.split(|c| *c == b',').map(<[u8]>::to_vec).collect();
    let sound = words.iter().all(|w| !w.is_empty() && w.iter().all(|c| plain(*c)));
    sound.then_some(Piece::Choice(words))
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
        ] {
            let p = Pattern::parse(pattern).unwrap();
            yes.iter().for_each(|a| assert!(p.fits(a), "{pattern} should fit {a}"));
            no.iter().for_each(|a| assert!(!p.fits(a), "{pattern} should not fit {a}"));
        }
    }

    /// The definition, read straight off: tries every way.
    fn slow(pieces: &[Piece], address: &[u8]) -> bool {
        let Some((piece, rest)) = pieces.split_first() else { return address.is_empty() };
        (0..=address.len()).any(|n| {
            let (head, tail) = address.split_at(n);
            let slash = head.contains(&b'/');
            (match piece {
                Piece::Plain(c) => head == [*c],
                Piece::Any => !slash,
                Piece::One => n == 1 && !slash,
                Piece::Class { not, ranges } => {
                    n == 1 && !slash && ranges.iter().any(|(a, b)| (*a..=*b).contains(&head[0])) != *not
                }
                Piece::Choice(words) => words.iter().any(|w| w == head),
            }) && slow(rest, tail)
        })
    }

    #[test]
    fn pattern_match_agrees_with_exhaustive_search() {
        let mut state = 3u64;
        let mut random = |n: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % n) as usize
        };
        let bits = ["a", "b", "*", "?", "[ab]", "[!a]", "{a,ab}", "{b,ba,a}", "/a", "*"];
        let mut hits = 0;
        for _ in 0..3000 {
            let pattern: String =
                std::iter::once("/a").chain((0..random(6)).map(|_| bits[random(10)])).collect();
            let address: String =
                std::iter::once("/a").chain((0..random(6)).map(|_| ["a", "b", "/b"][random(3)])).collect();
            let p = Pattern::parse(&pattern).unwrap();
            hits += usize::from(p.fits(&address));
            assert_eq!(p.fits(&address), slow(&p.0, address.as_bytes()), "{pattern} {address}");
        }
        assert!(hits > 200, "{hits}");
    }

    #[test]
    fn hostile_address_is_matched_fast() {
        let p = Pattern::parse("/*a*a*a*a*a*a*a*a*a*a*b").unwrap();
        assert!(!p.fits(&format!("/{}", "a".repeat(1000))));
        assert!(!p.fits(&format!("/{}b", "a".repeat(100_000))));
        assert!(!Pattern::parse("/*").unwrap().fits("/é"));
        assert!(!Pattern::parse("/*").unwrap().fits("/{a,b}"));
    }

    #[test]
    fn invalid_pattern_error_names_it() {
        for bad in [
            "", "pen", "/", "/pen/", "/p en", "/#", "/[", "/[]", "/{a", "/{}", "/{a,}", "/a//b", "/[!]",
            "/[b-a]", "/a]", "/é",
        ] {
            let e = Pattern::parse(bad).unwrap_err();
            assert!(e.message.contains(&format!("`{bad}`")), "{bad}");
        }
    }
}
