//! Signals to draw, and their columns as SVG path data, no finer than the pixels they cover.

use std::fmt::Write as _;

use super::axis::Axis;
use super::svg::num;

/// A signal with one column or several.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name, the heading of its panel.
    pub name: String,
    /// Unit as printed, such as `mm/s`.
    pub unit: String,
    /// Rows a second, in Hz; the first row is at 0 s.
    pub hz: f64,
    /// Values row by row. Values that are not finite are left out.
    pub data: Vec<f32>,
    /// A label for each column. That of a single column may be empty.
    pub labels: Vec<String>,
}

impl Series {
    /// One column with `hz` rows a second.
    pub fn sampled(name: &str, unit: &str, hz: f64, data: Vec<f32>) -> Self {
        Self { name: name.into(), unit: unit.into(), hz, data, labels: vec![String::new()] }
    }

    /// The same data read as rows of several columns with these labels.
    #[must_use]
    pub fn with_columns(mut self, labels: &[&str]) -> Self {
        self.labels = labels.iter().map(|&l| l.into()).collect();
        self
    }

    /// Columns of a row, 1 or more.
    pub fn columns(&self) -> usize {
        self.labels.len().max(1)
    }

    /// Number of complete rows.
    pub fn rows(&self) -> usize {
        self.data.len() / self.columns()
    }

    /// Time of a row in seconds.
    pub fn time(&self, row: usize) -> f64 {
        row as f64 / self.hz
    }

    /// A value; NaN where there is none.
    pub fn value(&self, row: usize, column: usize) -> f64 {
        self.data.get(row * self.columns() + column).map_or(f64::NAN, |v| f64::from(*v))
    }

    /// First and last time in seconds. `None` without rows, or where the rate gives no times.
    pub(super) fn time_range(&self) -> Option<(f64, f64)> {
        let last = self.rows().checked_sub(1)?;
        let (a, b) = (self.time(0), self.time(last));
        (a.is_finite() && b.is_finite() && b >= a).then_some((a, b))
    }

    pub(super) fn has_data(&self) -> bool {
        self.time_range().is_some() && self.data.iter().any(|v| v.is_finite())
    }

    /// The same series in mV or mA if its volts or amperes stay below 0.5.
    pub(super) fn in_readable_unit(&self) -> Self {
        let mut series = self.clone();
        let peak = self.data.iter().filter(|v| v.is_finite()).fold(0.0f32, |a, v| a.max(v.abs()));
        if matches!(self.unit.as_str(), "A" | "V") && peak > 0.0 && peak < 0.5 {
            series.data.iter_mut().for_each(|v| *v *= 1000.0);
            series.unit.insert(0, 'm');
        }
        series
    }
}

/// Path data, and whether it encloses an area to fill.
pub(super) struct Trace {
    pub(super) d: String,
    pub(super) filled: bool,
}

/// Least and greatest value within a column of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Band {
    /// Column of pixels from the left end of the axis.
    pub(super) column: usize,
    pub(super) low: f64,
    pub(super) high: f64,
}

/// Draws one column of `series`. Few rows are joined by straight lines. Many become a band between the
/// least and the greatest value in each column of pixels: no peak is lost, and the file stays small.
pub(super) fn trace(series: &Series, column: usize, x: &Axis, y: &Axis) -> Trace {
    let width = (x.pixels[1] - x.pixels[0]).max(1.0);
    let covered = series.time_range().map_or(0.0, |(a, b)| (x.at(b) - x.at(a)).clamp(1.0, width));
    let mut d = String::new();
    if series.rows() as f64 <= 2.0 * covered {
        let mut pen = Pen::default();
        for row in 0..series.rows() {
            let (t, v) = (series.time(row), series.value(row, column));
            if t.is_finite() && v.is_finite() {
                pen.to(&mut d, x.at(t), y.at(v));
            } else {
                pen = Pen::default();
            }
        }
        return Trace { d, filled: false };
    }
    let bands = bands(series, column, x);
    let mut rest = bands.as_slice();
    while let Some(first) = rest.first() {
        let run = rest.iter().zip(first.column..).take_while(|(b, c)| b.column == *c).count();
        let (band, after) = rest.split_at(run);
        let centre = |b: &Band| x.pixels[0] + b.column as f64 + 0.5;
        let mut pen = Pen::default();
        for b in band {
            pen.to(&mut d, centre(b), y.at(b.high));
        }
        for b in band.iter().rev() {
            pen.to(&mut d, centre(b), y.at(b.low));
        }
        d.push('z');
        rest = after;
    }
    Trace { d, filled: true }
}

/// The bands of a column of `series`, in order. Each reaches to the last value before it, so that
/// neighbours touch.
pub(super) fn bands(series: &Series, column: usize, x: &Axis) -> Vec<Band> {
    let columns = (x.pixels[1] - x.pixels[0]).max(1.0) as usize;
    let mut bands: Vec<Band> = Vec::with_capacity(columns);
    let mut before = None;
    for row in 0..series.rows() {
        let (t, v) = (series.time(row), series.value(row, column));
        if !(t.is_finite() && v.is_finite()) {
            before = None;
            continue;
        }
        let at = ((x.at(t) - x.pixels[0]).max(0.0) as usize).min(columns.saturating_sub(1));
        match bands.last_mut() {
            Some(b) if b.column >= at => {
                b.low = b.low.min(v);
                b.high = b.high.max(v);
            }
            _ => {
                let joined = before.unwrap_or(v);
                bands.push(Band { column: at, low: v.min(joined), high: v.max(joined) });
            }
        }
        before = Some(v);
    }
    bands
}

/// Writes path data as relative steps in tenths of a pixel. Points that do not move are left out.
#[derive(Default)]
pub(super) struct Pen {
    last: Option<(i64, i64)>,
    moved: bool,
}

impl Pen {
    pub(super) fn to(&mut self, d: &mut String, x: f64, y: f64) {
        let point = ((x * 10.0).round() as i64, (y * 10.0).round() as i64);
        let tenths = |v: i64| num(v as f64 / 10.0);
        // Writing to a String cannot fail.
        let _ = match self.last {
            None => write!(d, "M{} {}", tenths(point.0), tenths(point.1)),
            Some(last) if last == point => return,
            Some((px, py)) => {
                let before = if std::mem::replace(&mut self.moved, true) { " " } else { "l" };
                write!(d, "{before}{} {}", tenths(point.0 - px), tenths(point.1 - py))
            }
        };
        self.last = Some(point);
    }

    /// Ends a line, so that the next point begins another. A single point becomes a dot under round caps.
    pub(super) fn end(&mut self, d: &mut String) {
        if self.last.is_some() && !self.moved {
            d.push('z');
        }
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes(end: f64) -> (Axis, Axis) {
        (Axis::linear((0.0, end), [60.0, 160.0]), Axis::linear((-1.0, 1.0), [100.0, 0.0]))
    }

    #[test]
    fn few_rows_are_joined_and_gaps_stay_open() {
        let s = Series::sampled("s", "", 2.0, vec![0.0, 1.0, f32::NAN, -1.0, 0.0]);
        let (x, y) = axes(2.0);
        let t = trace(&s, 0, &x, &y);
        assert!(!t.filled);
        assert_eq!(t.d, "M60 50l25 -50M135 100l25 -50");
    }

    #[test]
    fn one_sample_among_a_million_is_not_lost() {
        let mut data = vec![0.0f32; 1_000_000];
        data[123_456] = 1.0;
        let s = Series::sampled("s", "", 1e6, data);
        let (x, y) = axes(1.0);
        let t = trace(&s, 0, &x, &y);
        assert!(t.filled && t.d.len() < 2_000, "{}", t.d.len());
        let all = bands(&s, 0, &x);
        assert_eq!(all.len(), 100);
        let peaks: Vec<_> = all.iter().filter(|b| b.high == 1.0).map(|b| b.column).collect();
        assert_eq!(peaks, [12]);
    }

    /// Compared with the least and greatest values of the data, cut by hand.
    #[test]
    fn bands_are_least_and_greatest_and_touch() {
        let data: Vec<f32> = (0..5000).map(|i| (f64::from(i) * 0.7).sin() as f32 * (i % 13) as f32).collect();
        let s = Series::sampled("s", "", 5000.0, data.clone());
        let (x, _) = axes(1.0);
        for b in bands(&s, 0, &x) {
            let cut = &data[(b.column * 50).max(1) - 1..(b.column + 1) * 50];
            assert_eq!(b.low, f64::from(cut.iter().copied().fold(f32::MAX, f32::min)), "{}", b.column);
            assert_eq!(b.high, f64::from(cut.iter().copied().fold(f32::MIN, f32::max)));
        }
    }
}
