//! Ranges, and round numbers to mark on them.

/// A range of values laid over a range of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    /// Pixel of `low` and of `high`.
    pub(super) pixels: [f64; 2],
}

impl Axis {
    /// Where a value lies, in pixels.
    pub(super) fn at(&self, value: f64) -> f64 {
        let [a, b] = self.pixels;
        a + (value - self.low) / (self.high - self.low) * (b - a)
    }

    /// Round values in the range, at least 0.7 `spacing` pixels apart, each with its label.
    pub(super) fn ticks(&self, spacing: f64) -> Vec<(f64, String)> {
        let span = self.high - self.low;
        let wanted = ((self.pixels[1] - self.pixels[0]).abs() / spacing).max(1.0);
        let raw = span / wanted;
        if !(raw.is_finite() && raw > 0.0) {
            return Vec::new();
        }
        let decade = 10f64.powf(raw.log10().floor());
        let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|f| f * decade >= raw * 0.7).unwrap_or(10.0);
        let step = factor * decade;
        let decimals = (-(step * 1.0001).log10().floor()).max(0.0) as usize;
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        (first..=last.min(first.saturating_add(100)))
            .map(|i| (i as f64 * step, label(i as f64 * step, decimals)))
            .collect()
    }
}

/// A number with a proper minus sign.
fn label(v: f64, decimals: usize) -> String {
    if v.abs() >= 1e6 || (v != 0.0 && decimals > 5) {
        return format!("{v:.0e}").replace('-', "\u{2212}");
    }
    let text = format!("{:.decimals$}", v + 0.0);
    if v == 0.0 { "0".into() } else { text.replace('-', "\u{2212}") }
}

/// Least and greatest of the finite values, widened a little; never empty.
pub(super) fn padded_range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let (low, high) =
        values.filter(|v| v.is_finite()).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        return None;
    }
    let pad = if high > low { 0.06 * (high - low) } else { 0.5 * high.abs().max(1.0) };
    Some((low - pad, high + pad))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, length: f64, spacing: f64) -> Vec<String> {
        Axis { low, high, pixels: [length, 0.0] }.ticks(spacing).into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(labels(0.0, 8.0, 1000.0, 120.0), ["0", "1", "2", "3", "4", "5", "6", "7", "8"]);
        assert_eq!(labels(-42.0, 42.0, 96.0, 24.0), ["\u{2212}40", "\u{2212}20", "0", "20", "40"]);
        assert_eq!(labels(0.0, 0.3, 100.0, 33.0), ["0", "0.1", "0.2", "0.3"]);
        assert!(labels(f64::NAN, 1.0, 100.0, 30.0).is_empty());
        assert!(labels(1.0, 1.0, 100.0, 30.0).is_empty());
        assert_eq!(labels(0.0, 3e7, 90.0, 30.0)[1], "1e7");
    }

    #[test]
    fn ranges_hold_their_values_and_are_never_empty() {
        let (low, high) = padded_range([1.0, f64::NAN, 3.0].into_iter()).unwrap();
        assert!(low < 1.0 && high > 3.0 && high < 3.5);
        let (low, high) = padded_range([0.0, 0.0].into_iter()).unwrap();
        assert!(low < 0.0 && high > 0.0);
        assert_eq!(padded_range([f64::NAN].into_iter()), None);
    }
}
