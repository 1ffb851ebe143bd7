//! Writing SVG.

use std::fmt::{Display, Write as _};

/// Styles of all pictures: system sans-serif typefaces on a light ground.
const STYLE: &str = "\
text{font-family:Inter,'Segoe UI','Helvetica Neue',Arial,'DejaVu Sans',sans-serif;\
font-size:12px;fill:#52606d}\
.title{font-size:19px;font-weight:600;fill:#1f2933}\
.head{font-size:13px;font-weight:600;fill:#323f4b}\
.small{font-size:11px}\
.ink{fill:#323f4b}\
.light{fill:#fff}\
.port{font-size:10.5px;fill:#6b7f90}\
.wire{font-size:10.5px;fill:#44566a;paint-order:stroke;stroke:#fff;stroke-width:3px;stroke-linejoin:round}";

/// Blue, vermilion, green and purple: distinct also with red-green colour blindness (after Okabe and Ito).
pub(super) const COLOURS: [&str; 4] = ["#0a6fb0", "#d1602a", "#2f9268", "#8a4f9e"];

pub(super) struct Svg {
    out: String,
}

impl Svg {
    /// An empty document, `width` by `height` pixels, on a light ground. Screen readers say `title`.
    pub(super) fn new(width: f64, height: f64, title: &str) -> Self {
        let mut svg = Self { out: String::new() };
        svg.raw(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" \
             role=\"img\">\n\
             <title>{}</title>\n<style>{STYLE}</style>\n\
             <rect width=\"{w}\" height=\"{h}\" rx=\"8\" fill=\"#fff\"/>\n",
            escape(title),
            w = num(width),
            h = num(height),
        ));
        svg
    }

    /// A document with its title and subtitles written from `left` on; subtitles are 18 pixels apart.
    pub(super) fn chart(size: [f64; 2], left: f64, title: &str, subtitles: &[impl AsRef<str>]) -> Self {
        let mut svg = Self::new(size[0], size[1], title);
        svg.text([left, 36.0], "start", "title", title);
        for (i, line) in subtitles.iter().enumerate() {
            svg.text([left, 57.0 + 18.0 * i as f64], "start", "", line.as_ref());
        }
        svg
    }

    /// Writes text that is SVG already.
    pub(super) fn raw(&mut self, what: impl Display) {
        // Writing to a String cannot fail.
        let _ = write!(self.out, "{what}");
    }

    pub(super) fn rect(&mut self, at: [f64; 2], size: [f64; 2], attributes: &str) {
        let [x, y, width, height] = [at[0], at[1], size[0], size[1]].map(num);
        self.raw(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" {attributes}/>\n"
        ));
    }

    pub(super) fn circle(&mut self, at: [f64; 2], radius: f64, attributes: &str) {
        let [x, y, r] = [at[0], at[1], radius].map(num);
        self.raw(format_args!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" {attributes}/>\n"));
    }

    pub(super) fn path(&mut self, d: &str, attributes: &str) {
        if !d.is_empty() {
            self.raw(format_args!("<path d=\"{d}\" {attributes}/>\n"));
        }
    }

    pub(super) fn titled_path(&mut self, d: &str, attributes: &str, title: &str) {
        if !d.is_empty() {
            self.raw(format_args!("<path d=\"{d}\" {attributes}><title>{}</title></path>\n", escape(title)));
        }
    }

    /// Text at a baseline point; `anchor` is start, middle or end.
    pub(super) fn text(&mut self, at: [f64; 2], anchor: &str, class: &str, text: &str) {
        if !text.is_empty() {
            let ([x, y], text) = (at.map(num), escape(text));
            self.raw(format_args!(
                "<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\" class=\"{class}\">{text}</text>\n"
            ));
        }
    }

    /// Text turned to read from the bottom up.
    pub(super) fn upright_text(&mut self, at: [f64; 2], anchor: &str, class: &str, text: &str) {
        let ([x, y], text) = (at.map(num), escape(text));
        self.raw(format_args!(
            "<text transform=\"translate({x} {y})rotate(-90)\" text-anchor=\"{anchor}\" \
             class=\"{class}\">{text}</text>\n"
        ));
    }

    /// A bold heading, then plainer text. One element, so that they follow each other in any typeface.
    pub(super) fn heading(&mut self, at: [f64; 2], head: &str, after: &str) {
        let ([x, y], head, after) = (at.map(num), escape(head), escape(after));
        self.raw(format_args!(
            "<text x=\"{x}\" y=\"{y}\"><tspan class=\"head\">{head}</tspan>\
             <tspan dx=\"9\">{after}</tspan></text>\n"
        ));
    }

    pub(super) fn finish(mut self) -> String {
        self.out.push_str("</svg>\n");
        self.out
    }
}

/// Names with their colours in a line that ends at a point; empty ones are left out.
pub(super) fn legend<'a>(svg: &mut Svg, [mut right, y]: [f64; 2], names: impl Iterator<Item = &'a str>) {
    // Written from the right, so the last comes first.
    let all: Vec<_> = names.zip(COLOURS.iter().cycle()).filter(|(name, _)| !name.is_empty()).collect();
    for (name, colour) in all.into_iter().rev() {
        svg.text([right, y], "end", "ink", name);
        right -= text_width(name, 12.0) + 6.0;
        let line = format!("M{} {}h-16", num(right), num(y - 4.0));
        svg.path(&line, &format!("stroke=\"{colour}\" stroke-width=\"2.5\""));
        right -= 16.0 + 16.0;
    }
}

/// Path data of straight lines through points; empty for no points.
pub(super) fn polyline(points: impl IntoIterator<Item = [f64; 2]>) -> String {
    let points: Vec<String> = points.into_iter().map(|[x, y]| format!("{} {}", num(x), num(y))).collect();
    if points.is_empty() { String::new() } else { format!("M{}", points.join("L")) }
}

/// A coordinate to a tenth of a pixel, without trailing zeros. NaN and infinity become 0.
pub(super) fn num(v: f64) -> String {
    let v = if v.is_finite() { v } else { 0.0 };
    let text = format!("{v:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".into() } else { text.into() }
}

/// Escapes the characters that XML reserves; a space replaces those it cannot hold.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// Estimated width of a text in pixels at a font size, in a common sans-serif typeface.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let em = |c: char| match c {
        'i' | 'j' | 'l' | '.' | ',' | ':' | '\'' | '|' | '!' => 0.29,
        'f' | 't' | 'r' | ' ' | '(' | ')' | '[' | ']' | '/' | '-' => 0.38,
        'm' | 'w' | 'M' | 'W' => 0.88,
        'A'..='Z' => 0.69,
        _ => 0.59,
    };
    text.chars().map(em).sum::<f64>() * size
}

/// Cuts a text to a width in pixels at a font size; an ellipsis marks the cut.
pub(super) fn fitting(text: &str, width: f64, size: f64) -> String {
    if text_width(text, size) <= width {
        return text.to_owned();
    }
    let mut left = width - text_width("…", size);
    let kept: String = text
        .chars()
        .take_while(|c| {
            left -= text_width(c.encode_utf8(&mut [0; 4]), size);
            left >= 0.0
        })
        .collect();
    kept.trim_end().to_owned() + "…"
}

/// Lines of whole words that fit a width in pixels at a font size. The last takes the rest, cut to the
/// width.
pub(super) fn wrapped(text: &str, width: f64, size: f64, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let full = |line: &str, word: &str| text_width(&format!("{line} {word}"), size) > width;
    for word in text.split_whitespace() {
        let count = lines.len();
        match lines.last_mut() {
            Some(line) if count >= most.max(1) || !full(line, word) => *line += &format!(" {word}"),
            _ => lines.push(word.to_owned()),
        }
    }
    lines.iter().map(|line| fitting(line, width, size)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_wrap_and_the_last_line_is_cut() {
        assert_eq!(wrapped("Polyethylene foam", 90.0, 11.0, 3), ["Polyethylene", "foam"]);
        assert_eq!(wrapped("", 90.0, 11.0, 3), [""; 0]);
        let lines = wrapped("one two three four", 30.0, 11.0, 2);
        assert_eq!((lines.len(), lines[0].as_str()), (2, "one"));
        assert!(lines[1].starts_with("two") || lines[1].ends_with('…'), "{lines:?}");
    }

    #[test]
    fn numbers_are_short_and_always_valid() {
        for (v, want) in
            [(1.0, "1"), (-0.04, "0"), (0.25, "0.2"), (12.36, "12.4"), (f64::NAN, "0"), (f64::INFINITY, "0")]
        {
            assert_eq!(num(v), want);
        }
    }

    #[test]
    fn long_text_is_cut_to_its_width() {
        assert_eq!(fitting("spsi", 100.0, 12.0), "spsi");
        let shown = fitting(&"sample_commit:frames=10,".repeat(4), 200.0, 12.0);
        assert!(shown.ends_with('…') && text_width(&shown, 12.0) <= 200.0, "{shown}");
    }

    #[test]
    fn reserved_and_impossible_characters_are_replaced() {
        assert_eq!(escape("a<b & \"c\">\u{0}\n"), "a&lt;b &amp; &quot;c&quot;&gt;  ");
    }
}
