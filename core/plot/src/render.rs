//! The signals of a render as panels over one time axis.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::above::SceneMap;
use super::axis::{Axis, Panel};
use super::lines::{Series, trace};
use super::spectrogram::{RANGE_DB, Spectrogram, colour};
use super::svg::{COLOURS, Svg, legend, num, text_width};

/// The signals of a render, each where there is one. A signal without finite values has no panel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Render {
    /// Heading.
    pub title: String,
    /// Smaller, under the heading.
    pub subtitle: String,
    /// The scene that was touched.
    pub above: Option<SceneMap>,
    /// Position, mm; columns x, y, z.
    pub position: Option<Series>,
    /// Planar speed, mm/s.
    pub speed: Option<Series>,
    /// Speed below which the texture is silent, mm/s.
    pub gate_mm_s: Option<f64>,
    /// Normal force, N.
    pub force: Option<Series>,
    /// Acceleration, m/s^2; also shown as a spectrogram.
    pub acceleration: Option<Series>,
    /// Coil current in A, or voltage in V.
    pub drive: Option<Series>,
    /// Times, in seconds from and to, with texture: tinted in all panels.
    pub active: Vec<(f64, f64)>,
}

const WIDTH: f64 = 1200.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = 1100.0;
const TOP: f64 = 74.0;
const HEADING: f64 = 30.0;
const LINES_HEIGHT: f64 = 100.0;
const SPECTROGRAM_HEIGHT: f64 = 170.0;
const BOTTOM: f64 = 52.0;
/// Distance of marks on the time axis in pixels.
const TIME_SPACING: f64 = 110.0;
/// Upper edge of the spectrogram, Hz.
const SPECTROGRAM_HZ: f64 = 1000.0;
const TINT: &str = "fill=\"#f0f6fa\"";
const TINT_LABEL: &str = "texture active";

/// A signal that has something to show, and how it is shown.
struct Signal {
    series: Series,
    /// A marked level, in the unit of the series, and its label.
    mark: Option<(f64, String)>,
    spectrogram: Option<Spectrogram>,
}

impl Signal {
    fn lines(series: &Option<Series>, mark: Option<(f64, String)>) -> Option<Self> {
        let series = series.as_ref().filter(|series| series.has_data())?;
        Some(Self { series: series.in_readable_unit(), mark, spectrogram: None })
    }

    fn spectrogram(series: &Option<Series>) -> Option<Self> {
        let spectrogram = Some(Spectrogram::of(series.as_ref()?, SPECTROGRAM_HZ)?);
        Some(Self { series: series.clone()?, mark: None, spectrogram })
    }

    fn height(&self) -> f64 {
        if self.spectrogram.is_some() { SPECTROGRAM_HEIGHT } else { LINES_HEIGHT }
    }
}

impl Render {
    fn signals(&self) -> Vec<Signal> {
        let gate = self.gate_mm_s.map(|value| (value, format!("gate {value} mm/s")));
        let all = [
            Signal::lines(&self.position, None),
            Signal::lines(&self.speed, gate),
            Signal::lines(&self.force, None),
            Signal::lines(&self.acceleration, None),
            Signal::spectrogram(&self.acceleration),
            Signal::lines(&self.drive, None),
        ];
        all.into_iter().flatten().collect()
    }

    /// The picture as an SVG document, 1200 pixels wide. Longer signals do not make a larger file.
    pub fn to_svg(&self) -> String {
        let signals = self.signals();
        let map = self.above.as_ref().map(|above| above.laid(TOP));
        let first = map.as_ref().map_or(TOP, |map| map.bottom());
        let strip = self.above.as_ref().map(SceneMap::strip_height).filter(|height| *height > 0.0);
        let heights = strip.into_iter().chain(signals.iter().map(Signal::height));
        let height = first + heights.map(|height| HEADING + height).sum::<f64>() + BOTTOM;
        let mut svg = Svg::chart([WIDTH, height], LEFT, &self.title, &[&self.subtitle]);
        if let Some(map) = &map {
            map.draw(&mut svg);
        }

        let ranges = || signals.iter().filter_map(|signal| signal.series.time_range());
        let low = ranges().map(|r| r.0).fold(f64::MAX, f64::min);
        let high = ranges().map(|r| r.1).fold(f64::MIN, f64::max);
        if low > high {
            svg.text([LEFT, first + 24.0], "start", "", "no data");
            return svg.finish();
        }
        let x = Axis::linear((low, if high > low { high } else { low + 1.0 }), [LEFT, RIGHT]);
        let tinted = self.tinted(&x);
        if !tinted.is_empty() {
            let left = RIGHT - text_width(TINT_LABEL, 11.0) - 20.0;
            svg.rect([left, 46.0], [13.0, 12.0], "fill=\"#e3eef5\" stroke=\"#c8d9e4\"");
            svg.text([RIGHT, 56.0], "end", "small", TINT_LABEL);
        }
        let mut bottom = first;
        let mut below = |height: f64| {
            let top = bottom + HEADING;
            bottom = top + height;
            Panel { x, y: Axis::linear((0.0, 1.0), [bottom, top]) }
        };
        if let (Some(above), Some(height)) = (&self.above, strip) {
            let panel = below(height);
            panel.x_grid(&mut svg, TIME_SPACING);
            svg.heading([LEFT, panel.y.pixels[1] - 9.0], "Effects", "active in these ticks");
            above.draw_strip(&mut svg, &panel);
            panel.frame(&mut svg);
        }
        for signal in &signals {
            let panel = below(signal.height());
            for (from, to) in &tinted {
                svg.rect([*from, panel.y.pixels[1]], [to - from, signal.height()], TINT);
            }
            match &signal.spectrogram {
                Some(spectrogram) => draw_spectrogram(&mut svg, &signal.series, spectrogram, panel),
                None => draw_lines(&mut svg, signal, panel),
            }
        }
        for (t, label) in x.ticks(TIME_SPACING) {
            svg.text([x.at(t), bottom + 18.0], "middle", "", &label);
        }
        svg.text([(LEFT + RIGHT) / 2.0, bottom + 38.0], "middle", "ink", "Time, s");
        svg.finish()
    }

    /// The tinted times in pixels, cut to the axis, with at least a pixel between them.
    fn tinted(&self, x: &Axis) -> Vec<(f64, f64)> {
        let finite = self.active.iter().filter(|(a, b)| a.is_finite() && b.is_finite());
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

/// Draws every column of a signal over `panel`, whose y axis is not yet scaled.
fn draw_lines(svg: &mut Svg, Signal { series, mark, .. }: &Signal, panel: Panel) {
    let top = panel.y.pixels[1];
    let mark = mark.as_ref().filter(|(value, _)| value.is_finite());
    let values = series.data.iter().map(|v| f64::from(*v)).chain(mark.map(|(value, _)| *value));
    let Some(y) = Axis::around(values, false, panel.y.pixels) else { return };
    let panel = Panel { y, ..panel };
    panel.x_grid(svg, TIME_SPACING);
    panel.y_grid(svg, &y.ticks(26.0));
    svg.heading([LEFT, top - 9.0], &sentence(&series.name), &series.unit);
    if let Some((value, label)) = mark {
        let line = format!("M{} {}H{}", num(LEFT), num(y.at(*value)), num(RIGHT));
        svg.path(&line, "stroke=\"#c2410c\" stroke-width=\"1.2\" stroke-dasharray=\"5 4\" fill=\"none\"");
        svg.text([RIGHT + 6.0, y.at(*value) + 4.0], "start", "small", label);
    }
    for (column, colour) in (0..series.columns()).zip(COLOURS.iter().cycle()) {
        let line = trace(series, column, &panel.x, &y);
        // A band covers what lies under it; several let each other through.
        let opacity = if line.filled && series.columns() > 1 { " opacity=\"0.8\"" } else { "" };
        let (fill, width) = if line.filled { (*colour, "1.1") } else { ("none", "1.5") };
        let stroke =
            format!("stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"{opacity}");
        svg.path(&line.d, &format!("fill=\"{fill}\" {stroke}"));
    }
    legend(svg, [RIGHT, top - 9.0], series.labels.iter().map(String::as_str));
    panel.frame(svg);
}

fn draw_spectrogram(svg: &mut Svg, series: &Series, spectrogram: &Spectrogram, panel: Panel) {
    let (x, pixels) = (panel.x, panel.y.pixels);
    let [bottom, top] = pixels;
    let y = Axis::linear((0.0, spectrogram.max_hz), pixels);
    let about = format!("Hz, amplitude in dB re 1 {}", series.unit);
    svg.heading([LEFT, top - 9.0], &format!("Spectrum of {}", series.name.to_lowercase()), &about);
    if let (Some(png), Some((from, to))) = (spectrogram.png(), series.time_range()) {
        let [left, width, height] = [x.at(from), x.at(to) - x.at(from), bottom - top].map(num);
        svg.raw(format_args!(
            "<image x=\"{left}\" y=\"{}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
             href=\"data:image/png;base64,{}\"/>\n",
            num(top),
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
    panel.frame(svg);

    svg.raw("<linearGradient id=\"level\" x1=\"0\" y1=\"1\" x2=\"0\" y2=\"0\">");
    for part in (0..=5).map(|i| f64::from(i) / 5.0) {
        let [r, g, b] = colour(part).map(|v| v.round() as u8);
        svg.raw(format_args!("<stop offset=\"{part}\" stop-color=\"#{r:02x}{g:02x}{b:02x}\"/>"));
    }
    svg.raw("</linearGradient>\n");
    svg.rect([RIGHT + 14.0, top], [12.0, bottom - top], "fill=\"url(#level)\" stroke=\"#b8c2cc\"");
    let scale = Axis::linear((spectrogram.top_db - RANGE_DB, spectrogram.top_db), pixels);
    for (db, label) in scale.ticks(26.0) {
        let end = if (db - spectrogram.top_db).abs() < 1e-9 { " dB" } else { "" };
        svg.text([RIGHT + 32.0, scale.at(db) + 4.0], "start", "small", &format!("{label}{end}"));
    }
}

fn sentence(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::tags;

    fn render(rate: f64, seconds: f64) -> Render {
        let n = (rate * seconds) as usize;
        let wave = |hz: f64, a: f64| -> Vec<f32> {
            (0..n).map(|i| (a * (std::f64::consts::TAU * hz * i as f64 / rate).sin()) as f32).collect()
        };
        let ticks = (500.0 * seconds) as usize;
        Render {
            title: "A <title> & more".into(),
            position: Some(
                Series::sampled("Position", "mm", 500.0, vec![1.0; 3 * ticks]).with_columns(&["x", "y", "z"]),
            ),
            speed: Some(Series::sampled("Speed", "mm/s", 500.0, vec![50.0; ticks])),
            gate_mm_s: Some(5.0),
            force: Some(Series::sampled("Force", "N", 500.0, vec![1.0; ticks])),
            acceleration: Some(Series::sampled("Acceleration", "m/s\u{b2}", rate, wave(180.0, 2.0))),
            drive: Some(Series::sampled("Current", "A", rate, wave(180.0, 0.04))),
            active: vec![(0.5, 1.0), (f64::NAN, 2.0), (-3.0, 99.0)],
            ..Render::default()
        }
    }

    #[test]
    fn every_panel_with_data_is_drawn_and_no_other() {
        let all = render(2500.0, 2.0);
        let svg = all.to_svg();
        assert_eq!(tags(&svg)["image"], 1);
        let texts = ["Position", "Speed", "gate 5 mm/s", "Force", "Acceleration", "Spectrum of acceleration"];
        for text in texts.iter().chain(&[">mA</tspan>", "A &lt;title&gt; &amp; more"]) {
            assert!(svg.contains(text), "{text}");
        }
        let broken = Series::sampled("Force", "N", 500.0, vec![f32::NAN; 9]);
        let some = Render { position: None, force: Some(broken), acceleration: None, ..all };
        let svg = some.to_svg();
        assert!(!tags(&svg).contains_key("image"));
        assert!(svg.contains("Speed"));
        assert!(["Position", "Force", "Accel"].iter().all(|text| !svg.contains(text)));
    }

    #[test]
    fn one_row_and_odd_rates_are_drawn() {
        for series in [
            Series::sampled("s", "N", 500.0, vec![1.0]),
            Series::sampled("s", "N", f64::INFINITY, vec![1.0, 2.0, f32::INFINITY]),
            Series::sampled("s", "N", f64::NAN, vec![1.0; 5]),
            Series::sampled("s", "N", 0.0, vec![1.0; 5]),
            Series::sampled("s", "N", 500.0, vec![1.0; 5]).with_columns(&["a", "b", "c"]),
            Series::sampled("s", "N", 500.0, vec![f32::MAX, -f32::MAX]),
        ] {
            let speed = Some(series);
            tags(&Render { speed, gate_mm_s: Some(f64::NAN), ..Render::default() }.to_svg());
        }
        let svg = Render::default().to_svg();
        tags(&svg);
        assert!(svg.contains("no data"));
    }

    /// A hundred times the length, the same picture but for its time axis.
    #[test]
    fn file_size_does_not_grow_with_the_signal() {
        let (short, long) = (render(2500.0, 8.0), render(48_000.0, 60.0));
        let (short, long) = (short.to_svg().len(), long.to_svg().len());
        assert!(long < 1_500_000 && long < 2 * short, "{short} {long}");
    }

    #[test]
    fn many_tinted_times_are_merged() {
        let position = Series::sampled("position", "mm", 100.0, vec![1.0; 2000]);
        // Out of order; ten times of half a tick a pixel, but for a gap.
        let active = (0..20_000)
            .rev()
            .filter(|k| !(9000..10_000).contains(k))
            .map(|k| (f64::from(k) * 1e-3, f64::from(k) * 1e-3 + 5e-4));
        let render = Render { position: Some(position), active: active.collect(), ..Render::default() };
        assert_eq!(render.to_svg().matches("fill=\"#f0f6fa\"").count(), 2);
    }
}
