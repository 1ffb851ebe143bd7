//! Writing SVG.

use std::fmt::{Display, Write as _};

/// Common to all pictures: a quiet light ground, system sans-serif faces.
const STYLE: &str = "text{font-family:Inter,'Segoe UI','Helvetica Neue',Arial,'DejaVu Sans',sans-serif;font-size:12px;fill:#52606d}\
.title{font-size:19px;font-weight:600;fill:#1f2933}\
.head{font-size:13px;font-weight:600;fill:#323f4b}\
.small{font-size:11px}\
.ink{fill:#323f4b}\
.port{font-size:10.5px;fill:#6b7f90}\
.wire{font-size:10.5px;fill:#44566a;paint-order:stroke;stroke:#fff;stroke-width:3px;stroke-linejoin:round}";

/// An SVG document being written.
pub(super) struct Svg {
    out: String,
}

impl Svg {
    /// A document of `width` by `height` pixels on a light ground; `title` is what a screen reader says.
    pub(super) fn new(width: f64, height: f64, title: &str) -> Self {
        let mut svg = Self { out: String::new() };
        svg.raw(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" role=\"img\">\n\
             <title>{}</title>\n<style>{STYLE}</style>\n\
             <rect width=\"{w}\" height=\"{h}\" rx=\"8\" fill=\"#fff\"/>\n",
            escape(title),
            w = num(width),
            h = num(height),
        ));
        svg
    }

    /// Text that is SVG already.
    pub(super) fn raw(&mut self, what: impl Display) {
        // Writing to a String cannot fail.
        let _ = write!(self.out, "{what}");
    }

    pub(super) fn rect(&mut self, at: [f64; 2], size: [f64; 2], attributes: &str) {
        self.raw(format_args!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" {attributes}/>\n",
            num(at[0]),
            num(at[1]),
            num(size[0]),
            num(size[1])
        ));
    }

    pub(super) fn path(&mut self, d: &str, attributes: &str) {
        if !d.is_empty() {
            self.raw(format_args!("<path d=\"{d}\" {attributes}/>\n"));
        }
    }

    /// A path that says what it is where a pointer rests on it.
    pub(super) fn titled_path(&mut self, d: &str, attributes: &str, title: &str) {
        if !d.is_empty() {
            self.raw(format_args!("<path d=\"{d}\" {attributes}><title>{}</title></path>\n", escape(title)));
        }
    }

    /// Text at a baseline point; `anchor` is start, middle or end.
    pub(super) fn text(&mut self, at: [f64; 2], anchor: &str, class: &str, text: &str) {
        if !text.is_empty() {
            self.raw(format_args!(
                "<text x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\" class=\"{class}\">{}</text>\n",
                num(at[0]),
                num(at[1]),
                escape(text)
            ));
        }
    }

    /// A heading with something quieter after it; one element, so that it fits whatever the face.
    pub(super) fn heading(&mut self, at: [f64; 2], head: &str, after: &str) {
        self.raw(format_args!(
            "<text x=\"{}\" y=\"{}\"><tspan class=\"head\">{}</tspan><tspan dx=\"9\">{}</tspan></text>\n",
            num(at[0]),
            num(at[1]),
            escape(head),
            escape(after)
        ));
    }

    pub(super) fn finish(mut self) -> String {
        self.out.push_str("</svg>\n");
        self.out
    }
}

/// A coordinate to a tenth of a pixel, as short as it can be written. What is not finite is 0.
pub(super) fn num(v: f64) -> String {
    let v = if v.is_finite() { v } else { 0.0 };
    let text = format!("{v:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".into() } else { text.into() }
}

/// Text with the characters XML reserves, and those it cannot hold, replaced.
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

/// About how wide a text is in pixels at a font size, in a common sans-serif face.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_always_valid() {
        for (v, want) in
            [(1.0, "1"), (-0.04, "0"), (0.25, "0.2"), (12.36, "12.4"), (f64::NAN, "0"), (f64::INFINITY, "0")]
        {
            assert_eq!(num(v), want);
        }
    }

    #[test]
    fn reserved_and_impossible_characters_are_replaced() {
        assert_eq!(escape("a<b & \"c\">\u{0}\n"), "a&lt;b &amp; &quot;c&quot;&gt;  ");
    }
}
