//! Parses a datagram without trusting it.
//!
//! rosc decodes nested bundles and drops nested arrays by recursion. A datagram of 64 KiB can nest 3000
//! bundles or 60,000 arrays, which overflows the stack. So bundles are walked here to a limited depth, and
//! rosc gets single messages with few type tags, which bounds the arrays.

use rosc::{OscMessage, OscPacket};

/// Deepest nesting of bundles.
pub(super) const DEPTH: usize = 8;
/// Most arguments of a message.
const ARGUMENTS: usize = 256;
/// "Immediately" as a time tag (OSC 1.0).
const IMMEDIATELY: u64 = 1;

/// Calls `each` with every message of a datagram in order, and the time tag of its innermost bundle (NTP:
/// 32 bits of seconds, 32 of their fraction), unless that is "immediately". Error: the fault in the
/// datagram, for a person; messages before it were passed on.
pub(super) fn walk(packet: &[u8], each: &mut impl FnMut(OscMessage, Option<u64>)) -> Result<(), String> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use rosc::{OscBundle, OscTime, OscType, encoder};

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
}
