//! Parses a datagram without trusting it, and matches its addresses.
//!
//! rosc decodes nested bundles and drops nested arrays by recursion. A datagram of 64 KiB can nest 3000
//! bundles or 60,000 arrays, which overflows the stack. So bundles are walked here to a limited depth, and
//! rosc gets single messages with few type tags, which bounds the arrays.
//!
//! Address patterns of OSC 1.0 become regular expressions, whose matching takes linear time. rosc's matcher
//! differs from the specification: it takes `[12]` for one or more characters (one), `*` at the end for at
//! least one (none or more), and only the first fit of `{a,ab}` (any).

use asperity_node::Diagnostic;
use regex::{Regex, escape};
use rosc::{OscMessage, OscPacket};

use crate::error;

/// Deepest nesting of bundles.
pub(super) const DEPTH: usize = 8;
/// Most arguments of a message.
const ARGUMENTS: usize = 256;
/// "Immediately" as a time tag (OSC 1.0).
const IMMEDIATELY: u64 = 1;

/// Calls `each` with every message of a datagram in order, and the time tag of its innermost bundle (NTP:
/// 32 bits of seconds, 32 of their fraction), unless that is "immediately".
///
/// # Errors
/// The fault in the datagram, for a person; messages before it were passed on.
pub fn walk(packet: &[u8], each: &mut impl FnMut(OscMessage, Option<u64>)) -> Result<(), String> {
    bundle_or_message(packet, None, 0, each)
}

fn bundle_or_message(
    packet: &[u8],
    tag: Option<u64>,
    depth: usize,
    each: &mut impl FnMut(OscMessage, Option<u64>),
) -> Result<(), String> {
    let Some(rest) = packet.strip_prefix(b"#bundle\0") else {
        each(message(packet)?, tag);
        return Ok(());
    };
    if depth == DEPTH {
        return Err(format!("bundles are nested more than {DEPTH} deep"));
    }
    let (time, mut rest) = rest.split_first_chunk::<8>().ok_or("a bundle ends before its time tag")?;
    let time = u64::from_be_bytes(*time);
    let tag = (time != IMMEDIATELY).then_some(time);
    while !rest.is_empty() {
        let (size, after) = rest.split_first_chunk::<4>().ok_or("a bundle ends in the size of an element")?;
        let size = u32::from_be_bytes(*size) as usize;
        let (element, after) = after
            .split_at_checked(size)
            .ok_or_else(|| format!("an element of {size} bytes in a bundle of fewer"))?;
        bundle_or_message(element, tag, depth + 1, each)?;
        rest = after;
    }
    Ok(())
}

fn message(packet: &[u8]) -> Result<OscMessage, String> {
    if packet.first() != Some(&b'/') {
        return Err("it is no OSC: it begins neither with an address nor as a bundle".to_owned());
    }
    let after = packet.iter().position(|b| *b == 0).ok_or("its address does not end")? / 4 * 4 + 4;
    let types = packet.get(after..).unwrap_or_default().split(|b| *b == 0).next().unwrap_or_default();
    if types.len() > ARGUMENTS + 1 {
        return Err(format!("it has more than {ARGUMENTS} arguments"));
    }
    if !types.is_empty() && types.first() != Some(&b',') {
        return Err("its types do not begin with a comma".to_owned());
    }
    match rosc::decoder::decode_udp(packet) {
        Ok((_, OscPacket::Message(message))) => Ok(message),
        Ok((_, OscPacket::Bundle(_))) => Err("it is no message".to_owned()),
        Err(e) => Err(format!("it is no OSC message: {e}")),
    }
}

/// Longest address that is matched.
const LONGEST: usize = 1024;

fn plain(c: char) -> bool {
    c.is_ascii_graphic() && !"#*,/?[]{}".contains(c)
}

/// Parses a plain address or a pattern. Error: the text is neither.
pub(super) fn pattern(text: &str) -> Result<Regex, Diagnostic> {
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
    use rosc::{OscBundle, OscTime, OscType, encoder};

    use super::*;

    type Got = (Vec<(OscMessage, Option<u64>)>, Result<(), String>);

    fn messages(packet: &[u8]) -> Got {
        let mut all = Vec::new();
        let end = walk(packet, &mut |m, t| all.push((m, t)));
        (all, end)
    }

    fn tag(seconds: u32, fractional: u32) -> OscTime {
        OscTime { seconds, fractional }
    }

    #[test]
    fn message_has_the_time_of_its_innermost_bundle() {
        let m = |a: &str| OscPacket::Message(OscMessage { addr: a.into(), args: vec![OscType::Int(1)] });
        let inner = OscPacket::Bundle(OscBundle { timetag: tag(7, 1 << 31), content: vec![m("/b")] });
        let now = OscPacket::Bundle(OscBundle { timetag: tag(0, 1), content: vec![m("/c")] });
        let outer =
            OscPacket::Bundle(OscBundle { timetag: tag(5, 0), content: vec![m("/a"), inner, now, m("/d")] });
        let (all, end) = messages(&encoder::encode(&outer).unwrap());
        end.unwrap();
        let got: Vec<_> = all.iter().map(|(m, t)| (m.addr.as_str(), *t)).collect();
        assert_eq!(
            got,
            [("/a", Some(5 << 32)), ("/b", Some((7 << 32) | (1 << 31))), ("/c", None), ("/d", Some(5 << 32))]
        );
    }

    #[test]
    fn deep_nesting_is_refused_without_recursion() {
        let mut packet = Vec::new();
        while packet.len() < 65_000 {
            let left = 65_000 - packet.len();
            packet.extend(b"#bundle\0\0\0\0\0\0\0\0\x01");
            packet.extend((left as u32).to_be_bytes());
        }
        assert!(messages(&packet).1.is_err());
        // Rightly sized, so that only the depth is wrong.
        let mut nested = b"/a\0\0,i\0\0\0\0\0\x01".to_vec();
        for _ in 0..1000 {
            let mut outer = b"#bundle\0\0\0\0\0\0\0\0\x01".to_vec();
            outer.extend((nested.len() as u32).to_be_bytes());
            outer.extend(&nested);
            nested = outer;
        }
        assert!(messages(&nested).1.unwrap_err().contains("nested more than 8"));
        let mut arrays = b"/a\0\0,".to_vec();
        arrays.resize(60_000, b'[');
        arrays.extend([0; 4]);
        assert!(messages(&arrays).1.unwrap_err().contains("more than 256 arguments"));
        arrays.truncate(200);
        arrays.extend([0; 4]);
        assert_eq!(messages(&arrays).0.len(), 1);
    }

    #[test]
    fn cut_or_altered_bundle_never_panics() {
        let m = OscMessage {
            addr: "/pen/1".into(),
            args: vec![
                OscType::Float(1.0),
                OscType::String("é".into()),
                OscType::Blob(vec![1, 2, 3]),
                OscType::Char('x'),
            ],
        };
        let content = vec![OscPacket::Message(m.clone()), OscPacket::Message(m)];
        let whole = encoder::encode(&OscPacket::Bundle(OscBundle { timetag: tag(1, 1), content })).unwrap();
        for end in 0..whole.len() {
            let _ = messages(&whole[..end]);
        }
        for place in 0..whole.len() {
            for value in [0u8, 1, b'/', b'#', b'[', b',', 0x7f, 0x80, 0xff] {
                let mut bent = whole.clone();
                bent[place] = value;
                let _ = messages(&bent);
            }
        }
    }

    #[test]
    fn pattern_matches_as_osc_1_0_says() {
        for (text, yes, no) in [
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
            let p = pattern(text).unwrap();
            yes.iter().for_each(|a| assert!(fits(&p, a), "{text} should fit {a}"));
            no.iter().for_each(|a| assert!(!fits(&p, a), "{text} should not fit {a}"));
        }
    }

    #[test]
    fn hostile_address_is_matched_fast() {
        let p = pattern("/*a*a*a*a*a*a*a*a*a*a*b").unwrap();
        assert!(!fits(&p, &format!("/{}", "a".repeat(1000))));
        assert!(!fits(&p, &format!("/{}b", "a".repeat(100_000))));
        assert!(!fits(&pattern("/*").unwrap(), "/é"));
        assert!(!fits(&pattern("/*").unwrap(), "/{a,b}"));
    }

    #[test]
    fn invalid_pattern_error_names_it() {
        for bad in [
            "", "pen", "/", "/pen/", "/p en", "/#", "/[", "/[]", "/{a", "/{}", "/{a,}", "/a//b", "/[!]",
            "/[b-a]", "/a]", "/é",
        ] {
            let e = pattern(bad).unwrap_err();
            assert!(e.message.contains(&format!("`{bad}`")), "{bad}");
        }
    }
}
