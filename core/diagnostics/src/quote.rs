//! Cuts long quotations in errors.

/// Longest quotation in characters.
const MOST: usize = 80;

/// Cuts every text in `` ` `` or `"` to 80 characters, with `…` for the rest.
///
/// Every part of a [`Diagnostic`](crate::Diagnostic) goes through here, so that a long name does not
/// hide the rest.
pub(crate) fn cut(text: String) -> String {
    if text.len() <= MOST {
        return text;
    }
    let mut out = String::with_capacity(text.len());
    let mut rest = text.as_str();
    while let Some(open) = rest.find(['`', '"']) {
        let (before, quoted) = rest.split_at(open + 1);
        out.push_str(before);
        rest = quoted;
        let mark = if before.ends_with('`') { '`' } else { '"' };
        if let Some(close) = quoted.find(mark) {
            match quoted[..close].char_indices().nth(MOST) {
                Some((most, _)) => out.extend([&quoted[..most], "…"]),
                None => out.push_str(&quoted[..close]),
            }
            out.push(mark);
            rest = &quoted[close + 1..];
        }
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quoted_text_is_cut_at_80_characters() {
        let (whole, long) = ("é".repeat(80), "é".repeat(81));
        let cut_text = format!("`a` and `{whole}…` and \"{whole}…\" and `{whole}`, an odd `");
        assert_eq!(cut(format!("`a` and `{long}` and \"{long}\" and `{whole}`, an odd `")), cut_text);
        assert_eq!(cut(long.clone()), long);
    }
}
