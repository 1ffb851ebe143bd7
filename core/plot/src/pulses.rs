//! Envelopes of vibrations over time, and their modulation depth over frequency.

use super::axis::{Axis, Panel};
use super::svg::Svg;

/// A vibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Pulsing {
    /// Its source.
    pub label: String,
    /// Time in s; envelope divided by its mean.
    pub envelope: Vec<(f64, f64)>,
    /// Frequency in Hz; modulation depth.
    pub depths: Vec<(f64, f64)>,
}

/// Vibrations of one material, at most four.
#[derive(Clone, Debug, PartialEq)]
pub struct PulsesRow {
    /// The material.
    pub label: String,
    /// Remark beside the label.
    pub remark: String,
    /// Its vibrations, each with a strip of its own.
    pub vibrations: Vec<Pulsing>,
}

/// Materials one below the other: envelopes at the left, modulation at the right.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pulses {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// Materials.
    pub rows: Vec<PulsesRow>,
}

const LEFT: f64 = 64.0;
const TOP: f64 = 104.0;
const STRIP: [f64; 2] = [620.0, 56.0];
/// Room above a strip, for its label.
const STRIPS: f64 = 18.0;
const RIGHT: f64 = LEFT + STRIP[0] + 84.0;
const DEPTHS: f64 = 340.0;
const BETWEEN: f64 = 72.0;
/// Largest envelope that is shown, divided by its mean. Larger values are drawn at the edge.
const MOST: f64 = 3.0;
const COLOURS: [&str; 4] = ["#d1602a", "#0a6fb0", "#6b7785", "#2a8f5a"];

impl Pulses {
    /// The picture as an SVG document.
    pub fn to_svg(&self) -> String {
        let height = TOP + self.rows.iter().map(|row| row.height() + BETWEEN).sum::<f64>();
        let mut svg = Svg::chart([RIGHT + DEPTHS + 40.0, height], LEFT, &self.title, &[&self.subtitle]);
        let mut top = TOP;
        for row in &self.rows {
            row.draw(&mut svg, top);
            top += row.height() + BETWEEN;
        }
        svg.finish()
    }
}

impl PulsesRow {
    fn height(&self) -> f64 {
        self.vibrations.len().max(1) as f64 * (STRIP[1] + STRIPS)
    }

    fn draw(&self, svg: &mut Svg, top: f64) {
        svg.heading([LEFT, top - 12.0], &self.label, &self.remark);
        svg.heading([RIGHT, top - 12.0], "Modulation depth", "over frequency, 2 Hz wide");
        let bottom = top + self.height();
        let seconds =
            self.vibrations.iter().flat_map(|v| v.envelope.last()).map(|p| p.0).fold(1e-3, f64::max);
        let depths = || self.vibrations.iter().flat_map(|v| &v.depths);
        let hz = depths().map(|p| p.0).fold(1.0, f64::max);
        let deepest = depths().map(|p| p.1).filter(|d| d.is_finite()).fold(0.01, f64::max);
        let envelopes = Panel {
            x: Axis::linear((0.0, seconds), [LEFT, LEFT + STRIP[0]]),
            y: Axis::linear((0.0, MOST), [bottom, top]),
        };
        let modulation = Panel {
            x: Axis::linear((0.0, hz), [RIGHT, RIGHT + DEPTHS]),
            y: Axis::linear((0.0, 1.05 * deepest), [bottom, top]),
        };
        for (panel, unit) in [(&envelopes, " s"), (&modulation, " Hz")] {
            panel.x_grid(svg, 80.0);
            panel.x_labels(svg, 80.0, unit);
        }
        modulation.y_grid(svg, &modulation.y.ticks(50.0));
        for ((i, vibration), colour) in self.vibrations.iter().enumerate().zip(COLOURS) {
            let above = top + STRIPS + i as f64 * (STRIP[1] + STRIPS);
            let strip = Panel { y: Axis { pixels: [above + STRIP[1], above], ..envelopes.y }, ..envelopes };
            let stroke =
                format!("stroke=\"{colour}\" stroke-width=\"1.3\" fill=\"none\" stroke-linejoin=\"round\"");
            svg.path(&strip.line(&vibration.envelope), &stroke);
            svg.path(&modulation.line(&vibration.depths), &stroke);
            svg.text([LEFT + 2.0, above - 4.0], "start", "wire", &vibration.label);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vibrations_have_envelope_and_modulation() {
        let vibration = |label: &str| Pulsing {
            label: label.into(),
            envelope: vec![(0.0, 1.0), (0.5, 9.0), (1.0, f64::NAN)],
            depths: vec![(2.0, 0.1), (20.0, 0.4)],
        };
        let vibrations = vec![vibration("before"), vibration("after")];
        let row = PulsesRow { label: "canvas".into(), remark: String::new(), vibrations };
        let picture = Pulses { title: "t".into(), subtitle: "s".into(), rows: vec![row] };
        let svg = picture.to_svg();
        for said in ["before", "after", "canvas", "20 Hz"] {
            assert!(svg.contains(said), "{said}");
        }
        assert!(!svg.contains("NaN") && svg.matches(COLOURS[0]).count() == 2);
        assert!(Pulses::default().to_svg().ends_with("</svg>\n"));
    }
}
