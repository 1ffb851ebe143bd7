//! Box plots, or bars with intervals, side by side in groups.

use super::axis::{Axis, Panel};
use super::svg::{COLOURS, Svg, fitting, num, text_width, wrapped};

/// A sample as it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Spread {
    /// A box plot.
    Box {
        /// Ends of the whiskers.
        whiskers: [f64; 2],
        /// Ends of the box.
        quartiles: [f64; 2],
        /// Thick line in the box.
        median: f64,
        /// Dots outside the whiskers.
        outliers: Vec<f64>,
    },
    /// A bar from the axis with an interval around its end.
    Bar {
        /// End of the bar.
        value: f64,
        /// Ends of the interval.
        interval: [f64; 2],
    },
}

/// Samples in groups, such as kinds of trials for each texture. Many groups continue below.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Boxes {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading, a line each.
    pub subtitles: Vec<String>,
    /// Name of the y axis.
    pub y: String,
    /// Ends of the y axis.
    pub range: (f64, f64),
    /// A level of y to compare with, and its name.
    pub reference: Option<(f64, String)>,
    /// Names of the samples of each group, in the order of their colours. One alone has no legend.
    pub kinds: Vec<String>,
    /// Groups with a label and one sample for each kind; `None` leaves a gap.
    pub groups: Vec<(String, Vec<Option<Spread>>)>,
}

const LEFT: f64 = 64.0;
const RIGHT: f64 = 24.0;
const MOST_WIDTH: f64 = 1112.0;
const HEIGHT: f64 = 250.0;
const LINE: f64 = 14.0;
/// Most lines of a group's label, and their font size.
const LINES: usize = 3;
const LETTERS: f64 = 11.0;
/// Least and greatest room of a sample, and least room of a group.
const SLOT: [f64; 2] = [20.0, 56.0];
const GROUP: f64 = 78.0;
const MARGIN: f64 = 14.0;
/// Room between the labels of two groups.
const GAP: f64 = 12.0;

impl Boxes {
    /// The picture as an SVG document, about 1200 pixels wide at most.
    pub fn to_svg(&self) -> String {
        let kinds = self.kinds.len().max(1) as f64;
        let least = (kinds * SLOT[0] + MARGIN).max(GROUP);
        let bands = self.groups.len().max(1).div_ceil(((MOST_WIDTH / least) as usize).max(1));
        let columns = self.groups.len().max(1).div_ceil(bands);
        let group = (MOST_WIDTH / columns as f64).min((kinds * SLOT[1] + MARGIN).max(110.0)).max(least);
        let legend_width = self.kinds.iter().map(|k| text_width(k, 12.0) + 38.0).sum::<f64>();
        let inner = (group * columns as f64).max(legend_width);
        let name = self.reference.as_ref().map_or(0.0, |(_, name)| text_width(name, LETTERS));
        let texts = self.subtitles.iter().map(|s| text_width(s, 12.0)).chain([text_width(&self.title, 19.0)]);
        let room = texts.fold(400.0, f64::max).min(MOST_WIDTH).max(inner + name);
        let lines = self.groups.iter().map(|(label, _)| wrapped(label, group - GAP, LETTERS, LINES).len());
        let pitch = HEIGHT + 40.0 + LINE * lines.max().unwrap_or(1) as f64;
        let top = if self.kinds.len() > 1 { 92.0 } else { 68.0 } + 18.0 * self.subtitles.len() as f64;
        let subtitles: Vec<String> = self.subtitles.iter().map(|s| fitting(s, room, 12.0)).collect();
        let size = [LEFT + room + RIGHT, top + pitch * bands as f64];
        let mut svg = Svg::chart(size, LEFT, &self.title, &subtitles);
        if self.kinds.len() > 1 {
            self.legend(&mut svg, [LEFT + inner, top - 12.0]);
        }
        let (low, high) = self.range;
        if self.groups.is_empty() || !(low < high && (high - low).is_finite()) {
            svg.text([LEFT, top + 24.0], "start", "", "no data");
            return svg.finish();
        }
        for (band, groups) in self.groups.chunks(columns).enumerate() {
            let top = top + pitch * band as f64;
            self.band(&mut svg, groups, group, [top + HEIGHT, top]);
        }
        svg.finish()
    }

    /// Names with their fills, in a line that ends at a point.
    fn legend(&self, svg: &mut Svg, [mut right, y]: [f64; 2]) {
        for (kind, name) in self.kinds.iter().enumerate().rev() {
            svg.text([right, y], "end", "ink", name);
            right -= text_width(name, 12.0) + 20.0;
            svg.rect([right, y - 10.0], [14.0, 11.0], &filled(kind));
            right -= 18.0;
        }
    }

    fn band(&self, svg: &mut Svg, groups: &[(String, Vec<Option<Spread>>)], width: f64, upward: [f64; 2]) {
        let [bottom, top] = upward;
        let right = LEFT + width * groups.len() as f64;
        for i in (1..groups.len()).step_by(2) {
            svg.rect([LEFT + width * i as f64, top], [width, bottom - top], "fill=\"#f5f7f9\"");
        }
        let y = Axis::linear(self.range, upward);
        // Groups are counted along the other axis.
        let panel = Panel { x: Axis::linear((0.0, groups.len() as f64), [LEFT, right]), y };
        panel.y_grid(svg, &y.ticks(36.0));
        svg.upright_text([20.0, 0.5 * (bottom + top)], "middle", "ink", &fitting(&self.y, HEIGHT, 12.0));
        let slot = (width - MARGIN) / self.kinds.len().max(1) as f64;
        for (i, (label, samples)) in groups.iter().enumerate() {
            let left = LEFT + width * i as f64;
            for (kind, sample) in samples.iter().enumerate() {
                let middle = left + MARGIN / 2.0 + slot * (kind as f64 + 0.5);
                if let Some(sample) = sample {
                    sample.draw(svg, &y, middle, (0.64 * slot).min(34.0), kind);
                }
            }
            for (line, text) in wrapped(label, width - GAP, LETTERS, LINES).iter().enumerate() {
                let at = [left + width / 2.0, bottom + 18.0 + LINE * line as f64];
                svg.text(at, "middle", "small", text);
            }
        }
        panel.frame(svg);
        if let Some((level, name)) = &self.reference {
            let line = format!("M{} {}H{}", num(LEFT), num(y.at(*level)), num(right));
            svg.path(&line, "stroke=\"#323f4b\" stroke-width=\"1.2\" stroke-dasharray=\"6 4\" fill=\"none\"");
            svg.text([right + 4.0, y.at(*level) + 4.0], "start", "small", name);
        }
    }
}

/// Colour of a kind. Fills differ in lightness, too, for prints in grey.
fn filled(kind: usize) -> String {
    let colour = COLOURS[kind % COLOURS.len()];
    let shade = [0.08, 0.55, 0.28, 0.8][kind % COLOURS.len()];
    format!("fill=\"{colour}\" fill-opacity=\"{shade}\" stroke=\"{colour}\"")
}

impl Spread {
    fn draw(&self, svg: &mut Svg, y: &Axis, middle: f64, width: f64, kind: usize) {
        let colour = COLOURS[kind % COLOURS.len()];
        let stroke = format!("stroke=\"{colour}\" stroke-width=\"1.4\" fill=\"none\"");
        let fill = filled(kind);
        let (left, cap) = (middle - width / 2.0, width / 4.0);
        let tee = |inner: f64, outer: f64| {
            let [inner, outer] = [inner, outer].map(|v| num(y.at(v)));
            format!("M{} {inner}V{outer}M{} {outer}h{}", num(middle), num(middle - cap), num(2.0 * cap))
        };
        let block = |svg: &mut Svg, a: f64, b: f64| {
            let (a, b) = (y.at(a), y.at(b));
            svg.rect([left, a.min(b)], [width, (b - a).abs()], &fill);
        };
        match self {
            Self::Box { whiskers, quartiles, median, outliers } => {
                if [whiskers, quartiles].into_iter().flatten().chain([median]).any(|v| !v.is_finite()) {
                    return;
                }
                let ends = tee(quartiles[0], whiskers[0]) + &tee(quartiles[1], whiskers[1]);
                svg.path(&ends, &stroke);
                block(svg, quartiles[0], quartiles[1]);
                let line = format!("M{} {}h{}", num(left), num(y.at(*median)), num(width));
                svg.path(&line, &format!("stroke=\"{colour}\" stroke-width=\"3\""));
                for v in outliers.iter().filter(|v| v.is_finite()) {
                    svg.circle([middle, y.at(*v)], 2.4, &format!("fill=\"{colour}\" fill-opacity=\"0.6\""));
                }
            }
            Self::Bar { value, interval: [low, high] } => {
                if [value, low, high].iter().any(|v| !v.is_finite()) {
                    return;
                }
                block(svg, y.low, *value);
                svg.path(&(tee(*value, *low) + &tee(*value, *high)), &stroke.replace(colour, "#1f2933"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    fn sample(median: f64) -> Option<Spread> {
        let outliers = vec![median - 3.0, f64::NAN];
        Some(Spread::Box {
            whiskers: [median - 2.0, median + 1.5],
            quartiles: [median - 1.0, median + 1.0],
            median,
            outliers,
        })
    }

    #[test]
    fn samples_are_drawn_and_gaps_stay_empty() {
        let boxes = Boxes {
            title: "A <title>".into(),
            range: (1.0, 7.0),
            reference: Some((4.0, "chance".into())),
            kinds: vec!["one".into(), "two & three".into()],
            groups: vec![
                ("Polyethylene foam".into(), vec![sample(4.0), None]),
                ("b".into(), vec![sample(f64::NAN), Some(Spread::Bar { value: 5.0, interval: [4.0, 6.0] })]),
            ],
            ..Boxes::default()
        };
        let svg = boxes.to_svg();
        assert_eq!(tags(&svg)["circle"], 1);
        for text in ["A &lt;title&gt;", "two &amp; three", ">chance<", ">Polyethylene foam<"] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        for empty in [Boxes::default(), Boxes { range: (f64::NAN, 1.0), ..boxes.clone() }] {
            tags(&empty.to_svg());
            assert!(empty.to_svg().contains("no data"));
        }
    }

    #[test]
    fn many_groups_continue_in_equal_bands() {
        let groups = (0..30).map(|i| (format!("texture {i}"), vec![sample(4.0)])).collect();
        let svg = Boxes { range: (1.0, 7.0), kinds: vec!["x".into()], groups, ..Boxes::default() }.to_svg();
        tags(&svg);
        // Three bands, each with a frame.
        assert_eq!(svg.matches(crate::axis::FRAME).count(), 3);
    }
}
