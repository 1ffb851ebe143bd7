//! Panels over one time axis.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::above::Above;
use super::axis::{Axis, padded_range};
use super::lines::trace;
use super::series::Series;
use super::spectrogram::{RANGE_DB, Spectrogram, colour};
use super::svg::{Svg, num, text_width};

/// A dashed level across a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Where, in the panel's unit.
    pub value: f64,
    /// What it says.
    pub label: String,
}

/// One strip of a figure. A panel without finite data is left out.
#[derive(Clone, Debug, PartialEq)]
pub enum Panel {
    /// Lines over time, one for each column.
    Lines {
        /// What is drawn.
        series: Series,
        /// Levels to mark.
        marks: Vec<Mark>,
    },
    /// The spectrum over time of the first column in dB re 1 of its unit.
    Spectrogram {
        /// What is analysed.
        series: Series,
        /// Upper edge in Hz.
        max_hz: f64,
    },
}

/// A stack of panels that share their time axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// Over all panels: a scene, with an axis of its own.
    pub above: Option<Above>,
    /// From top to bottom.
    pub panels: Vec<Panel>,
    /// Times, in seconds from and to, to tint in all panels, such as those with the gate open.
    pub tinted: Vec<(f64, f64)>,
    /// What the tint means; nothing is tinted where it is empty.
    pub tint_label: String,
}

/// The signals of a render, each where there is one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Render {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// The scene that was touched.
    pub above: Option<Above>,
    /// Position, mm; columns x, y, z.
    pub position: Option<Series>,
    /// Planar speed, mm/s.
    pub speed: Option<Series>,
    /// Speed under which the texture is silent, mm/s.
    pub gate_mm_s: Option<f64>,
    /// Normal force, N.
    pub force: Option<Series>,
    /// Acceleration, m/s^2; also shown as a spectrogram.
    pub acceleration: Option<Series>,
    /// Coil current in A, or voltage in V.
    pub drive: Option<Series>,
    /// Times, in seconds from and to, with texture.
    pub active: Vec<(f64, f64)>,
}

impl Render {
    /// The figure of these signals: the scene from above, position, speed, force, acceleration and its spectrum to 1000 Hz, drive.
    pub fn into_figure(self) -> Figure {
        let lines =
            |series: Option<Series>, marks: Vec<Mark>| series.map(|series| Panel::Lines { series, marks });
        let gate = self.gate_mm_s.map(|value| Mark { value, label: format!("gate {value} mm/s") });
        let spectrum = self.acceleration.clone().map(|series| Panel::Spectrogram { series, max_hz: 1000.0 });
        let panels = [
            lines(self.position, Vec::new()),
            lines(self.speed, gate.into_iter().collect()),
            lines(self.force, Vec::new()),
            lines(self.acceleration, Vec::new()),
            spectrum,
            lines(self.drive, Vec::new()),
        ];
        Figure {
            title: self.title,
            subtitle: self.subtitle,
            above: self.above,
            panels: panels.into_iter().flatten().collect(),
            tinted: self.active,
            tint_label: "texture active".into(),
        }
    }
}

const WIDTH: f64 = 1200.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = 1100.0;
const TOP: f64 = 74.0;
const HEADING: f64 = 30.0;
const LINES_HEIGHT: f64 = 100.0;
const SPECTROGRAM_HEIGHT: f64 = 170.0;
const BOTTOM: f64 = 52.0;
const GRID: &str = "stroke=\"#e4e9ee\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
const FRAME: &str = "stroke=\"#b8c2cc\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
const TINT: &str = "fill=\"#f0f6fa\"";
/// Blue, vermilion, green, purple: told apart also by those who do not see red or green (after Okabe and Ito).
const COLOURS: [&str; 4] = ["#0a6fb0", "#d1602a", "#2f9268", "#8a4f9e"];

/// A panel that has something to show.
enum Ready {
    Lines(Series, Vec<Mark>),
    Spectrogram(Series, Spectrogram),
}

impl Ready {
    fn of(panel: &Panel) -> Option<Self> {
        match panel {
            Panel::Lines { series, marks } => {
                let shown = series.in_readable_unit();
                let scale = if shown.unit == series.unit { 1.0 } else { 1000.0 };
                let marks = marks.iter().map(|m| Mark { value: m.value * scale, label: m.label.clone() });
                series.has_data().then(|| Self::Lines(shown, marks.collect()))
            }
            Panel::Spectrogram { series, max_hz } => {
                Spectrogram::of(series, *max_hz).map(|s| Self::Spectrogram(series.clone(), s))
            }
        }
    }

    fn series(&self) -> &Series {
        match self {
            Self::Lines(series, _) | Self::Spectrogram(series, _) => series,
        }
    }

    fn height(&self) -> f64 {
        match self {
            Self::Lines(..) => LINES_HEIGHT,
            Self::Spectrogram(..) => SPECTROGRAM_HEIGHT,
        }
    }
}

impl Figure {
    /// The figure as an SVG document, 1200 pixels wide. Its size does not grow with the length of the
    /// signals.
    pub fn to_svg(&self) -> String {
        let panels: Vec<Ready> = self.panels.iter().filter_map(Ready::of).collect();
        let above = self.above.as_ref().map(|above| above.laid(TOP));
        let first = above.as_ref().map_or(TOP, |above| above.bottom());
        let strip = self.above.as_ref().map_or(0.0, Above::strip_height);
        let strip = if strip > 0.0 { HEADING + strip } else { 0.0 };
        let height = first + strip + panels.iter().map(|p| HEADING + p.height()).sum::<f64>() + BOTTOM;
        let mut svg = Svg::new(WIDTH, height, &self.title);
        svg.text([LEFT, 36.0], "start", "title", &self.title);
        svg.text([LEFT, 57.0], "start", "", &self.subtitle);
        if let Some(above) = &above {
            above.draw(&mut svg);
        }

        let ranges = || panels.iter().filter_map(|p| p.series().time_range());
        let low = ranges().map(|r| r.0).fold(f64::MAX, f64::min);
        let high = ranges().map(|r| r.1).fold(f64::MIN, f64::max);
        if low > high {
            svg.text([LEFT, first + 24.0], "start", "", "no data");
            return svg.finish();
        }
        let high = if high > low { high } else { low + 1.0 };
        let x = Axis { low, high, pixels: [LEFT, RIGHT] };
        let tinted: Vec<(f64, f64)> =
            if self.tint_label.is_empty() { Vec::new() } else { self.tint_spans(&x) };
        if !tinted.is_empty() {
            let left = RIGHT - text_width(&self.tint_label, 11.0) - 20.0;
            svg.rect([left, 46.0], [13.0, 12.0], "fill=\"#e3eef5\" stroke=\"#c8d9e4\"");
            svg.text([RIGHT, 56.0], "end", "small", &self.tint_label);
        }
        let mut top = first + strip;
        if let Some(above) = self.above.as_ref().filter(|_| strip > 0.0) {
            let y = Axis { low: 0.0, high: 1.0, pixels: [top, first + HEADING] };
            let [bottom, top] = y.pixels.map(num);
            let grid = x.ticks(110.0).into_iter().map(|(t, _)| format!("M{} {bottom}V{top}", num(x.at(t))));
            svg.path(&grid.collect::<String>(), GRID);
            svg.heading([LEFT, y.pixels[1] - 9.0], "Effects", "active in these ticks");
            above.draw_strip(&mut svg, &x, y.pixels[1]);
            draw_frame(&mut svg, &y);
        }
        for panel in &panels {
            top += HEADING;
            let y = [top + panel.height(), top];
            for (from, to) in &tinted {
                svg.rect([*from, top], [to - from, panel.height()], TINT);
            }
            match panel {
                Ready::Lines(series, marks) => draw_lines(&mut svg, series, marks, &x, y),
                Ready::Spectrogram(series, spectrogram) => {
                    draw_spectrogram(&mut svg, series, spectrogram, &x, y)
                }
            }
            top += panel.height();
        }
        for (t, label) in x.ticks(110.0) {
            svg.text([x.at(t), top + 18.0], "middle", "", &label);
        }
        svg.text([(LEFT + RIGHT) / 2.0, top + 38.0], "middle", "ink", "Time, s");
        svg.finish()
    }

    /// The tinted times in pixels, cut to the axis, with at least a pixel between them.
    fn tint_spans(&self, x: &Axis) -> Vec<(f64, f64)> {
        let finite = self.tinted.iter().filter(|(a, b)| a.is_finite() && b.is_finite());
        let cut = finite.map(|(a, b)| (x.at(*a).max(LEFT), x.at(*b).min(RIGHT)));
        let mut all: Vec<(f64, f64)> = cut.filter(|(a, b)| b > a).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all.dedup_by(|next, last| {
            let joins = next.0 - last.1 < 1.0;
            if joins {
                last.1 = last.1.max(next.1);
            }
            joins
        });
        all
    }
}

/// Grid, frame and labels of a panel; `y.pixels` is bottom, top.
fn draw_axes(svg: &mut Svg, x: &Axis, y: &Axis, spacing: f64) {
    let [bottom, top] = y.pixels;
    let mut grid = String::new();
    for (t, _) in x.ticks(110.0) {
        grid += &format!("M{} {}V{}", num(x.at(t)), num(bottom), num(top));
    }
    for (v, label) in y.ticks(spacing) {
        grid += &format!("M{} {}H{}", num(LEFT), num(y.at(v)), num(RIGHT));
        svg.text([LEFT - 8.0, y.at(v) + 4.0], "end", "small", &label);
    }
    svg.path(&grid, GRID);
}

fn draw_frame(svg: &mut Svg, y: &Axis) {
    svg.path(&format!("M{} {}V{}H{}", num(LEFT), num(y.pixels[1]), num(y.pixels[0]), num(RIGHT)), FRAME);
}

fn draw_lines(svg: &mut Svg, series: &Series, marks: &[Mark], x: &Axis, pixels: [f64; 2]) {
    let values = series.data.iter().map(|v| f64::from(*v)).chain(marks.iter().map(|m| m.value));
    let Some((low, high)) = padded_range(values) else { return };
    let y = Axis { low, high, pixels };
    draw_axes(svg, x, &y, 26.0);
    svg.heading([LEFT, pixels[1] - 9.0], &sentence(&series.name), &series.unit);
    for mark in marks.iter().filter(|m| m.value.is_finite()) {
        let at = y.at(mark.value);
        svg.path(
            &format!("M{} {}H{}", num(LEFT), num(at), num(RIGHT)),
            "stroke=\"#c2410c\" stroke-width=\"1.2\" stroke-dasharray=\"5 4\" fill=\"none\"",
        );
        svg.text([RIGHT + 6.0, at + 4.0], "start", "small", &mark.label);
    }
    for (column, colour) in (0..series.columns()).zip(COLOURS.iter().cycle()) {
        let line = trace(series, column, x, &y);
        // A band covers what lies under it; where there are several, each lets the others through.
        let opacity = if line.filled && series.columns() > 1 { " opacity=\"0.8\"" } else { "" };
        let fill = if line.filled { colour } else { "none" };
        let width = if line.filled { "1.1" } else { "1.5" };
        svg.path(
            &line.d,
            &format!("fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"{opacity}"),
        );
    }
    // Set from the right, so the last comes first; a lone column without a label has no entry.
    let mut right = RIGHT;
    let legend: Vec<_> =
        series.labels.iter().zip(COLOURS.iter().cycle()).filter(|(l, _)| !l.is_empty()).collect();
    for (label, colour) in legend.into_iter().rev() {
        svg.text([right, pixels[1] - 9.0], "end", "ink", label);
        right -= text_width(label, 12.0) + 6.0;
        svg.path(
            &format!("M{} {}h-16", num(right), num(pixels[1] - 13.0)),
            &format!("stroke=\"{colour}\" stroke-width=\"2.5\""),
        );
        right -= 16.0 + 16.0;
    }
    draw_frame(svg, &y);
}

fn draw_spectrogram(svg: &mut Svg, series: &Series, spectrogram: &Spectrogram, x: &Axis, pixels: [f64; 2]) {
    let [bottom, top] = pixels;
    let y = Axis { low: 0.0, high: spectrogram.max_hz, pixels };
    let about = format!("Hz, amplitude in dB re 1 {}", series.unit);
    svg.heading([LEFT, top - 9.0], &format!("Spectrum of {}", lower_first(&series.name)), &about);
    if let (Some(png), Some((from, to))) = (spectrogram.png(), series.time_range()) {
        svg.raw(format_args!(
            "<image x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"/>\n",
            num(x.at(from)),
            num(top),
            num(x.at(to) - x.at(from)),
            num(bottom - top),
            STANDARD.encode(png)
        ));
    }
    for (hz, label) in y.ticks(40.0) {
        svg.path(
            &format!("M{} {}H{}", num(LEFT), num(y.at(hz)), num(RIGHT)),
            "stroke=\"#1f2933\" stroke-opacity=\"0.1\" fill=\"none\" shape-rendering=\"crispEdges\"",
        );
        svg.text([LEFT - 8.0, y.at(hz) + 4.0], "end", "small", &label);
    }
    draw_frame(svg, &y);

    let scale = Axis { low: spectrogram.top_db - RANGE_DB, high: spectrogram.top_db, pixels };
    svg.raw("<linearGradient id=\"level\" x1=\"0\" y1=\"1\" x2=\"0\" y2=\"0\">");
    for i in 0..=5 {
        let [r, g, b] = colour(f64::from(i) / 5.0).map(|v| v.round() as u8);
        svg.raw(format_args!(
            "<stop offset=\"{}\" stop-color=\"#{r:02x}{g:02x}{b:02x}\"/>",
            f64::from(i) / 5.0
        ));
    }
    svg.raw("</linearGradient>\n");
    svg.rect([RIGHT + 14.0, top], [12.0, bottom - top], "fill=\"url(#level)\" stroke=\"#b8c2cc\"");
    for (db, label) in scale.ticks(26.0) {
        let end = if (db - spectrogram.top_db).abs() < 1e-9 { " dB" } else { "" };
        svg.text([RIGHT + 32.0, scale.at(db) + 4.0], "start", "small", &format!("{label}{end}"));
    }
}

fn sentence(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}

fn lower_first(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_lowercase().chain(chars).collect())
}
