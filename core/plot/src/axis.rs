//! Axes, round numbers to mark on them, and panels of two axes.

use super::svg::{Svg, num, polyline};

const GRID: &str = "stroke=\"#e4e9ee\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
/// Style of the edges of a panel.
pub(super) const FRAME: &str =
    "stroke=\"#b8c2cc\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";

/// A range of values laid over a range of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    /// Ends of the range; on a logarithmic axis their decimal logarithms.
    pub(super) low: f64,
    pub(super) high: f64,
    /// Pixels of the two ends.
    pub(super) pixels: [f64; 2],
    pub(super) logarithmic: bool,
}

impl Axis {
    pub(super) fn linear((low, high): (f64, f64), pixels: [f64; 2]) -> Self {
        Self { low, high, pixels, logarithmic: false }
    }

    /// An axis around the finite values, with a little room at both ends. `None` where there are none.
    pub(super) fn around(
        values: impl Iterator<Item = f64>,
        logarithmic: bool,
        pixels: [f64; 2],
    ) -> Option<Self> {
        let empty = Self { low: 0.0, high: 1.0, pixels, logarithmic };
        let (low, high) = padded_range(values.map(|v| empty.scaled(v)))?;
        Some(Self { low, high, ..empty })
    }

    /// Widens a logarithmic axis to a decade at least, so that small differences do not look large.
    pub(super) fn at_least_a_decade(mut self) -> Self {
        if self.logarithmic {
            let more = (1.0 - (self.high - self.low)).max(0.0) / 2.0;
            (self.low, self.high) = (self.low - more, self.high + more);
        }
        self
    }

    /// The value itself, or its logarithm.
    fn scaled(&self, value: f64) -> f64 {
        match self.logarithmic {
            true if value < 1e-12 => -12.0,
            true => value.log10(),
            false => value,
        }
    }

    pub(super) fn at(&self, value: f64) -> f64 {
        let [a, b] = self.pixels;
        a + (self.scaled(value) - self.low) / (self.high - self.low) * (b - a)
    }

    /// Round values in the range with their labels. On a linear axis they are at least 0.7 `spacing` pixels
    /// apart. On a logarithmic axis they are 1, 2 and 5 of every power of ten, or the powers alone.
    pub(super) fn ticks(&self, spacing: f64) -> Vec<(f64, String)> {
        if self.logarithmic {
            return self.powers();
        }
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

    fn powers(&self) -> Vec<(f64, String)> {
        let wanted = (self.pixels[1] - self.pixels[0]).abs() / 40.0;
        let factors: &[i32] = if (self.high - self.low) * 3.0 <= wanted { &[1, 2, 5] } else { &[1] };
        let exponents = self.low.floor() as i32..=self.high.ceil() as i32;
        exponents
            .flat_map(|e| factors.iter().map(move |f| (f64::from(*f) * 10f64.powi(e), e)))
            .filter(|(value, _)| (self.low..=self.high).contains(&value.log10()))
            .map(|(value, e)| (value, format!("{value:.*}", (-e).max(0) as usize)))
            .collect()
    }
}

/// A number with a true minus sign.
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

/// A rectangle between two axes; `y.pixels` is bottom, top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Panel {
    pub(super) x: Axis,
    pub(super) y: Axis,
}

impl Panel {
    pub(super) fn x_grid(&self, svg: &mut Svg, spacing: f64) {
        let [bottom, top] = self.y.pixels.map(num);
        let ticks = self.x.ticks(spacing).into_iter();
        let lines: String = ticks.map(|(v, _)| format!("M{} {bottom}V{top}", num(self.x.at(v)))).collect();
        svg.path(&lines, GRID);
    }

    /// Labels of the upright lines, below the panel; `unit` follows each number.
    pub(super) fn x_labels(&self, svg: &mut Svg, spacing: f64, unit: &str) {
        for (v, label) in self.x.ticks(spacing) {
            let at = [self.x.at(v), self.y.pixels[0] + 18.0];
            svg.text(at, "middle", "small", &format!("{label}{unit}"));
        }
    }

    /// Level grid lines at `ticks`, with their labels at the left.
    pub(super) fn y_grid(&self, svg: &mut Svg, ticks: &[(f64, String)]) {
        let [left, right] = self.x.pixels;
        let mut lines = String::new();
        for (v, label) in ticks {
            lines += &format!("M{} {}H{}", num(left), num(self.y.at(*v)), num(right));
            svg.text([left - 8.0, self.y.at(*v) + 4.0], "end", "small", label);
        }
        svg.path(&lines, GRID);
    }

    pub(super) fn frame(&self, svg: &mut Svg) {
        let ([left, right], [bottom, top]) = (self.x.pixels.map(num), self.y.pixels.map(num));
        svg.path(&format!("M{left} {top}V{bottom}H{right}"), FRAME);
    }

    pub(super) fn at(&self, (x, y): (f64, f64)) -> [f64; 2] {
        [self.x.at(x), self.y.at(y)]
    }

    /// Path data of the finite points, held within the range of the y axis.
    pub(super) fn line(&self, points: &[(f64, f64)]) -> String {
        let [bottom, top] = self.y.pixels;
        let finite = points.iter().map(|p| self.at(*p)).filter(|p| p.iter().all(|v| v.is_finite()));
        polyline(finite.map(|[x, y]| [x, y.clamp(top, bottom)]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, length: f64, spacing: f64) -> Vec<String> {
        Axis::linear((low, high), [length, 0.0]).ticks(spacing).into_iter().map(|t| t.1).collect()
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

    #[test]
    fn logarithms_are_marked_at_round_values() {
        for (length, wanted) in [(120.0, &["1", "10"][..]), (400.0, &["1", "2", "5", "10", "20"])] {
            let axis = Axis { low: -0.2, high: 1.4, pixels: [0.0, length], logarithmic: true };
            let labels: Vec<String> = axis.ticks(0.0).into_iter().map(|t| t.1).collect();
            assert_eq!(labels, wanted);
        }
    }
}
