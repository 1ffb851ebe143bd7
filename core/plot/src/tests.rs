//! Whole figures.

use super::figure::{Figure, Mark, Panel};
use super::*;

/// Counts opening tags of a document and checks that it is nested as XML must be.
pub(super) fn tags(svg: &str) -> std::collections::HashMap<String, usize> {
    let (mut open, mut count) = (Vec::new(), std::collections::HashMap::new());
    for part in svg.split('<').skip(1) {
        let (tag, _) = part.split_once('>').expect("every tag ends");
        let name =
            tag.split([' ', '/', '\n']).find(|s| !s.is_empty()).expect("every tag has a name").to_owned();
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name));
            continue;
        }
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        *count.entry(name.clone()).or_insert(0) += 1;
        if !tag.ends_with('/') {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "{open:?}");
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "no coordinate is out of numbers");
    count
}

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
    let svg = all.clone().into_figure().to_svg();
    assert_eq!(tags(&svg)["image"], 1);
    for text in [
        "Position",
        "Speed",
        "gate 5 mm/s",
        "Force",
        "Acceleration",
        "Spectrum of acceleration",
        ">mA</tspan>",
        "A &lt;title&gt; &amp; more",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    let broken = Series::sampled("Force", "N", 500.0, vec![f32::NAN; 9]);
    let some = Render { position: None, force: Some(broken), acceleration: None, ..all };
    let svg = some.into_figure().to_svg();
    assert!(!tags(&svg).contains_key("image"));
    assert!(
        svg.contains("Speed")
            && !svg.contains("Position")
            && !svg.contains("Force")
            && !svg.contains("Accel")
    );
}

#[test]
fn a_figure_without_data_says_so() {
    let svg = Render::default().into_figure().to_svg();
    tags(&svg);
    assert!(svg.contains("no data"));
}

#[test]
fn one_row_and_odd_clocks_are_drawn_without_a_fault() {
    for series in [
        Series::sampled("s", "N", 500.0, vec![1.0]),
        Series::sampled("s", "N", f64::INFINITY, vec![1.0, 2.0, f32::INFINITY]),
        Series::sampled("s", "N", f64::NAN, vec![1.0; 5]),
        Series::sampled("s", "N", 0.0, vec![1.0; 5]),
        Series::sampled("s", "N", 500.0, vec![1.0; 5]).with_columns(&["a", "b", "c"]),
        Series::sampled("s", "N", 500.0, vec![f32::MAX, -f32::MAX]),
    ] {
        let figure = Figure {
            panels: vec![Panel::Lines { series, marks: vec![Mark { value: f64::NAN, label: "m".into() }] }],
            ..Figure::default()
        };
        tags(&figure.to_svg());
    }
}

/// A hundred times the length, the same picture but for its time axis.
#[test]
fn the_size_of_the_file_does_not_grow_with_the_signal() {
    let (short, long) = (render(2500.0, 8.0), render(48_000.0, 60.0));
    let (short, long) = (short.into_figure().to_svg().len(), long.into_figure().to_svg().len());
    assert!(long < 1_500_000 && long < 2 * short, "{short} {long}");
}
