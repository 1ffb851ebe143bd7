//! Training curves: the loss of each stage over its steps.

use super::chart::{Chart, Plot, Scale, Trace};

/// One stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// Remark beside the name, such as the last loss.
    pub remark: String,
    /// Step and loss, in the order of steps.
    pub points: Vec<(f64, f64)>,
}

/// Stages side by side, each with its own axes. Losses are logarithmic where all are above 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// The stages.
    pub curves: Vec<Curve>,
}

impl Curves {
    /// The curves as an SVG document.
    pub fn to_svg(&self) -> String {
        let plot = |curve: &Curve| Plot {
            heading: (curve.name.clone(), curve.remark.clone()),
            x_name: "Step".into(),
            y: Scale { logarithmic: curve.points.iter().all(|p| p.1 > 0.0 || p.1.is_nan()), range: None },
            traces: vec![Trace { lines: vec![curve.points.clone()], ..Trace::default() }],
            ..Plot::default()
        };
        let (title, subtitle, columns) = (self.title.clone(), self.subtitle.clone(), self.curves.len());
        let plots = self.curves.iter().map(plot).collect();
        Chart { title, subtitle, columns, size: [300.0, 240.0], plots, aside: Vec::new() }.to_svg()
    }
}
