//! Safe text for a terminal, and figures in few characters.

use unicode_width::{UnicodeWidthChar, UnicodeWidthStr};

/// Cuts `text` to `width` columns; `…` marks the cut. Control characters become `·`.
///
/// Characters without a width of their own (direction, joining, accents) are left out: terminals disagree
/// on them.
pub(crate) fn clean(text: &str, width: usize) -> String {
    // A name may be a megabyte long: only the part that can be shown is read.
    let read = text.chars().take(8 * width + 8).map(|c| if c.is_control() { '·' } else { c });
    let mut out: String = read.filter(|c| c.width().unwrap_or(0) > 0).collect();
    if out.width() > width {
        while !out.is_empty() && out.width() >= width {
            out.pop();
        }
        out.extend((width > 0).then_some('…'));
    }
    out
}

/// A figure to four digits without trailing zeros, such as `0.25`, `99999` or `1.235M`.
pub(crate) fn figure(x: f64) -> String {
    let size = x.abs();
    if size > 0.0 && !(9.5e-4..9.9995e17).contains(&size) {
        return if x.is_finite() { format!("{x:.1e}") } else { x.to_string() };
    }
    let (mut x, mut units) = (x, ["", "k", "M", "G", "T", "P"].into_iter());
    let mut unit = units.next();
    let mut most = 99_999.5;
    while x.abs() >= most {
        (x, unit, most) = (x / 1e3, units.next(), 999.95);
    }
    let decimals = 3.0 - x.abs().log10().floor();
    let decimals = if x == 0.0 { 0 } else { decimals.clamp(0.0, 4.0) as usize };
    let text = format!("{x:.decimals$}");
    let text = if decimals > 0 { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.to_owned() + unit.unwrap_or("P")
}

pub(crate) fn dbfs(peak: f32) -> f64 {
    20.0 * f64::from(peak).log10()
}

/// Seconds as h:mm:ss.s.
pub(crate) fn clock(seconds: f64) -> String {
    if !(0.0..3.6e9).contains(&seconds) {
        return figure(seconds);
    }
    let tenths = (seconds * 10.0).floor() as u64;
    let (h, m, s) = (tenths / 36_000, tenths / 600 % 60, tenths / 10 % 60);
    format!("{h}:{m:02}:{s:02}.{}", tenths % 10)
}

/// A bar that fills `share` of `width` columns, to half a column, over a line.
pub(crate) fn bar(share: f64, width: usize) -> String {
    let halves = (share.clamp(0.0, 1.0) * 2.0 * width as f64).round() as usize;
    let rest = width - halves.div_ceil(2);
    format!("{}{}{}", "━".repeat(halves / 2), "╸".repeat(halves % 2), "─".repeat(rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_keep_to_their_columns() {
        for exponent in -320..=308 {
            for digit in [1.0, 9.9994999, 9.9996, -4.9999] {
                let x: f64 = format!("{digit}e{exponent}").parse().unwrap();
                let most = if (9.5e-4..9.9e17).contains(&x.abs()) { 7 } else { 9 };
                assert!(figure(x).len() <= most, "{}", figure(x));
            }
        }
    }

    #[test]
    fn figures_read_as_a_person_writes_them() {
        let figures = [
            (0.0, "0"),
            (1.0, "1"),
            (12.345, "12.35"),
            (-0.25, "-0.25"),
            (1000.0, "1000"),
            (99_999.0, "99999"),
            (412_000.0, "412k"),
            (1_234_567.0, "1.235M"),
            (1e300, "1.0e300"),
            (f64::NAN, "NaN"),
        ];
        for (x, text) in figures {
            assert_eq!(figure(x), text);
        }
        assert_eq!(clock(3725.49), "1:02:05.4");
        assert_eq!([1.0, 0.0].map(dbfs), [0.0, f64::NEG_INFINITY]);
        assert_eq!([0.0, 0.25, 1.0].map(|share| bar(share, 2)), ["──", "╸─", "━━"]);
    }

    #[test]
    fn names_are_made_harmless_and_cut() {
        for (text, width, shown) in [
            ("a\u{1b}[2Jb\u{7}\u{9b}c\n", 80, "a·[2Jb··c·"),
            ("left\u{202e}right\u{200b}", 80, "leftright"),
            (&format!("e{}x", "\u{301}".repeat(500)), 600, "ex"),
            ("texture", 7, "texture"),
            ("textures", 7, "textur…"),
            ("触覚触覚", 5, "触覚…"),
            ("触覚触覚", 4, "触…"),
            ("触", 1, "…"),
            ("x", 0, ""),
        ] {
            assert_eq!(clean(text, width), shown);
        }
        assert_eq!(clean(&"n".repeat(300), 20).width(), 20);
    }
}
