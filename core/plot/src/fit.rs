//! A texture fitted to a recording: models over speed and force, and their spectra beside the recorded ones.

use super::chart::{Chart, Plot, Scale, Trace};

/// Spectra of a model: recorded and fitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectrum {
    /// Label of the model.
    pub label: String,
    /// Remark beside the label, such as its error.
    pub remark: String,
    /// Recorded: frequency in Hz and level in dB.
    pub measured: Vec<(f64, f64)>,
    /// The same of the model.
    pub model: Vec<(f64, f64)>,
}

/// A fitted texture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fit {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// Speed in mm/s and force in N of each model.
    pub corners: Vec<[f64; 2]>,
    /// Triangles between them, by index.
    pub triangles: Vec<[usize; 3]>,
    /// Speed and force of each fitted piece of the recording.
    pub pieces: Vec<[f64; 2]>,
    /// Unit of the levels.
    pub unit: String,
    /// Spectra, two in a row.
    pub spectra: Vec<Spectrum>,
}

/// Levels are shown down to this far below the greatest of all.
const RANGE_DB: f64 = 60.0;

impl Fit {
    /// The texture as an SVG document: the plane of its models, then their spectra.
    pub fn to_svg(&self) -> String {
        let edges = |corners: &[usize; 3]| {
            let closed = corners.iter().chain(&corners[..1]).filter_map(|i| self.corners.get(*i));
            closed.map(|c| (c[0], c[1])).collect()
        };
        let dots = |all: &[[f64; 2]]| all.iter().map(|[speed, force]| (*speed, *force)).collect();
        let models = Trace {
            name: "models".into(),
            dots: dots(&self.corners),
            numbered: true,
            lines: self.triangles.iter().map(edges).collect(),
        };
        let pieces = Trace { name: "fitted pieces".into(), dots: dots(&self.pieces), ..Trace::default() };
        let plane = Plot {
            heading: ("Normal force".into(), "N".into()),
            x_name: "Speed, mm/s".into(),
            traces: vec![models, pieces],
            ..Plot::default()
        };
        let range = self.levels();
        let spectra = self.spectra.iter().map(|spectrum| spectrum.plot(range));
        Chart {
            title: self.title.clone(),
            subtitle: format!("{}; dots are recorded, lines are models, {}", self.subtitle, self.unit),
            columns: 3,
            size: [320.0, 200.0],
            plots: [plane].into_iter().chain(spectra).collect(),
            aside: Vec::new(),
        }
        .to_svg()
    }

    /// Range of the levels of all spectra.
    fn levels(&self) -> Option<(f64, f64)> {
        let all = self.spectra.iter().flat_map(|s| s.measured.iter().chain(&s.model));
        let shown = all.filter(|(hz, db)| *hz > 0.0 && hz.is_finite() && db.is_finite()).map(|p| p.1);
        let (low, high) = shown.fold((f64::MAX, f64::MIN), |(low, high), db| (low.min(db), high.max(db)));
        (low < high).then_some((low.max(high - RANGE_DB), high))
    }
}

impl Spectrum {
    fn plot(&self, range: Option<(f64, f64)>) -> Plot {
        let measured = Trace { dots: self.measured.clone(), ..Trace::default() };
        let model = Trace { lines: vec![self.model.clone()], ..Trace::default() };
        Plot {
            heading: (self.label.clone(), self.remark.clone()),
            x_name: "Frequency, Hz".into(),
            x: Scale { logarithmic: true, range: None },
            y: Scale { logarithmic: false, range },
            traces: vec![measured, model],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    fn spectrum(level: f64) -> Spectrum {
        let at = |i: i32| (10.0 * f64::from(i), level - f64::from(i));
        Spectrum {
            label: "1 <one>".into(),
            remark: "0.3 dB & less".into(),
            measured: (0..=40).map(at).collect(),
            model: (1..=40).map(at).collect(),
        }
    }

    #[test]
    fn models_pieces_and_spectra_are_drawn() {
        let fit = Fit {
            title: "A <title>".into(),
            corners: vec![[50.0, 0.5], [250.0, 0.5], [250.0, 2.5], [50.0, 2.5]],
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 9, 1]],
            pieces: vec![[48.0, 0.5], [251.0, 2.4]],
            spectra: vec![spectrum(-10.0), spectrum(f64::NAN), spectrum(-20.0)],
            ..Fit::default()
        };
        let svg = fit.to_svg();
        // A unit stands behind its quantity: "Models N" was a riddle.
        let (_, force) = svg.split_once(">Normal force<").expect("the quantity");
        assert!(force.split("</text>").next().is_some_and(|unit| unit.contains(">N<")));
        // Without 0 Hz, which has no logarithm.
        assert_eq!(tags(&svg)["circle"], 4 + 2 + 2 * 40);
        // Three triangles, of which one lacks a corner, and two models.
        assert_eq!(svg.matches("stroke-linejoin=\"round\"").count(), 3 + 2);
        assert!(
            svg.contains("1 &lt;one&gt;") && svg.contains("0.3 dB &amp; less") && svg.contains(">3</text>")
        );
    }

    #[test]
    fn levels_far_below_the_loudest_are_left_out() {
        let loud = Spectrum {
            measured: vec![(10.0, 50.0), (20.0, -90.0)],
            model: vec![(10.0, 50.0), (20.0, -90.0)],
            ..Spectrum::default()
        };
        let svg = Fit { spectra: vec![loud], ..Fit::default() }.to_svg();
        assert_eq!(tags(&svg)["circle"], 1);
    }

    #[test]
    fn empty_single_and_odd_models_are_drawn() {
        assert!(Fit::default().to_svg().contains("no data"));
        let one = Fit { corners: vec![[50.0, 1.0]], spectra: vec![Spectrum::default()], ..Fit::default() };
        assert_eq!(tags(&one.to_svg())["circle"], 1);
        let odd = Fit { corners: vec![[f64::NAN, 1.0], [f64::INFINITY, 1.0]], ..Fit::default() };
        tags(&odd.to_svg());
    }
}
