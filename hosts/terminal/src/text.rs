//! Safe text for a terminal, and figures in few characters.

use unicode_width::UnicodeWidthChar;

/// Cuts `text` to `width` columns and removes control characters; `…` marks the cut.
///
/// Control characters become `·`. Characters for direction, joining and variants are left out, since
/// terminals disagree on their width. A character keeps at most two combining accents.
pub(crate) fn clean(text: &str, width: usize) -> String {
    let mut out = String::new();
    let mut used = 0;
    let mut accents = 0;
    // A name may be a megabyte long: only the part that can be shown is read.
    for c in text.chars().take(8 * width + 8) {
        let c = if c.is_control() { '·' } else { c };
        if is_format(c) {
            continue;
        }
        let wide = c.width().unwrap_or(0);
        accents = if wide == 0 { accents + 1 } else { 0 };
        if accents > 2 || (wide == 0 && out.is_empty()) {
            continue;
        }
        if used + wide > width {
            while used + 1 > width {
                match out.pop() {
                    Some(last) => used -= last.width().unwrap_or(0),
                    None => return out,
                }
            }
            out.push('…');
            return out;
        }
        used += wide;
        out.push(c);
    }
    out
}

fn is_format(c: char) -> bool {
    matches!(c as u32, 0xAD | 0x61C | 0x180E | 0x200B..=0x200F | 0x2028..=0x202E | 0x2060..=0x206F
        | 0xFE00..=0xFE0F | 0xFEFF | 0xFFF9..=0xFFFB | 0xE0000..=0xE0FFF)
}

/// Width of `text` in columns.
pub(crate) fn columns(text: &str) -> usize {
    text.chars().map(|c| c.width().unwrap_or(0)).sum()
}

/// A figure to four digits, in at most nine characters.
pub(crate) fn number(x: f64) -> String {
    let size = x.abs();
    if x.is_nan() {
        "NaN".into()
    } else if x.is_infinite() {
        if x > 0.0 { "inf".into() } else { "-inf".into() }
    } else if size == 0.0 {
        "0".into()
    } else if !(9.5e-4..999_999.5).contains(&size) {
        let far = !(1e-99..1e100).contains(&size);
        format!("{x:.*e}", if far { 1 } else { 2 })
    } else {
        let whole = size.log10().floor() as i32;
        format!("{x:.*}", (3 - whole).clamp(0, 4) as usize)
    }
}

/// A figure as [`number`] writes it, without trailing zeros: for ranges and scales.
pub(crate) fn short(x: f64) -> String {
    let text = number(x);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
}

/// Microseconds in at most seven characters; from 0.1 s on in ms or s.
pub(crate) fn micros(us: f64) -> String {
    match us {
        _ if !us.is_finite() => number(us),
        _ if us.abs() < 9.95 => format!("{us:.1}"),
        _ if us.abs() < 99_999.5 => format!("{us:.0}"),
        _ if us.abs() < 999_500.0 => format!("{:.0}ms", us / 1e3),
        _ if us.abs() < 9.995e8 => format!("{:.1}s", us / 1e6),
        _ => format!("{:.0e}s", us / 1e6),
    }
}

/// Milliseconds to a tenth, in at most seven characters.
pub(crate) fn millis(ms: f64) -> String {
    match ms {
        _ if !ms.is_finite() => number(ms),
        _ if ms.abs() < 9999.95 => format!("{ms:.1}"),
        _ => format!("{:.0e}", ms),
    }
}

/// A count in at most six characters.
pub(crate) fn count(n: u64) -> String {
    if n < 100_000 {
        return n.to_string();
    }
    let mut value = n as f64 / 1e3;
    let mut sign = 'k';
    for next in ['M', 'G', 'T', 'P', 'E'] {
        if value < 999.5 {
            break;
        }
        value /= 1e3;
        sign = next;
    }
    let digits = if value < 9.995 { 2 } else { usize::from(value < 99.95) };
    format!("{value:.digits$}{sign}")
}

/// A share of 1 in percent, in at most five characters.
pub(crate) fn percent(share: f64) -> String {
    match 100.0 * share {
        p if !p.is_finite() => "-".into(),
        0.0 => "0".into(),
        p if p < 0.095 => format!("{p:.3}"),
        p if p < 9.95 => format!("{p:.1}"),
        p if p < 9999.5 => format!("{p:.0}"),
        p => format!("{p:.0e}"),
    }
}

/// Decibels of full scale.
pub(crate) fn dbfs(peak: f32) -> String {
    if peak.is_nan() {
        "NaN".into()
    } else if peak <= 0.0 {
        "-inf".into()
    } else {
        format!("{:.1}", decibels(peak).clamp(-999.0, 999.0))
    }
}

pub(crate) fn decibels(peak: f32) -> f64 {
    20.0 * f64::from(peak).log10()
}

/// Seconds as h:mm:ss.s.
pub(crate) fn clock(seconds: f64) -> String {
    if !(0.0..3.6e9).contains(&seconds) {
        return number(seconds);
    }
    let tenths = (seconds * 10.0).floor() as u64;
    let (h, m, s) = (tenths / 36_000, tenths / 600 % 60, tenths / 10 % 60);
    format!("{h}:{m:02}:{s:02}.{}", tenths % 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_keep_to_their_columns() {
        for exponent in -320..=308 {
            for digit in [1.0, 9.9994999, 9.9996, -4.9999] {
                let x: f64 = format!("{digit}e{exponent}").parse().unwrap();
                assert!(number(x).len() <= 9, "{}", number(x));
                assert!(micros(x).len() <= 7, "{}", micros(x));
                assert!(millis(x).len() <= 7, "{}", millis(x));
                assert!(percent(x.abs()).len() <= 5, "{}", percent(x.abs()));
            }
        }
        for shift in 0..64 {
            assert!(count(u64::MAX >> shift).len() <= 6, "{}", count(u64::MAX >> shift));
        }
    }

    #[test]
    fn figures_read_as_a_person_writes_them() {
        assert_eq!(
            [0.0, 1.0, 12.345, 99_999.0, -0.25].map(number),
            ["0", "1.000", "12.35", "99999", "-0.2500"]
        );
        assert_eq!([2.0, 0.25, 1000.0].map(short), ["2", "0.25", "1000"]);
        assert_eq!([0, 99_999, 412_000, 1_234_567].map(count), ["0", "99999", "412k", "1.23M"]);
        assert_eq!([3.25, 2000.0, 150_000.0, 2.5e6].map(micros), ["3.2", "2000", "150ms", "2.5s"]);
        assert_eq!([1.0, 0.5, 0.0].map(dbfs), ["0.0", "-6.0", "-inf"]);
        assert_eq!(clock(3725.49), "1:02:05.4");
    }

    #[test]
    fn control_characters_are_replaced() {
        assert_eq!(clean("a\u{1b}[2Jb\u{7}\u{9b}c\n", 80), "a·[2Jb··c·");
        assert_eq!(clean("left\u{202e}right\u{200b}", 80), "leftright");
        assert_eq!(clean(&format!("e{}x", "\u{301}".repeat(500)), 80), "e\u{301}\u{301}x");
    }

    #[test]
    fn long_name_is_cut_with_an_ellipsis() {
        assert_eq!(clean("texture", 7), "texture");
        assert_eq!(clean("textures", 7), "textur…");
        assert_eq!(clean("触覚触覚", 5), "触覚…");
        assert_eq!(clean("触覚触覚", 4), "触…");
        assert_eq!(clean("触", 1), "…");
        assert_eq!(clean("x", 0), "");
        assert_eq!(columns(&clean(&"n".repeat(300), 20)), 20);
    }
}
