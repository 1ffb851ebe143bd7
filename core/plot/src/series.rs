//! Signals to draw.

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
