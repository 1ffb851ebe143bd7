//! Names of surfaces: at the upper edge of what is seen of a surface, off each other.

use super::outline::{Bounds, Point, bounds};
use crate::svg::{Svg, fitting, text_width};

/// Font size, and height of a line.
const SIZE: f64 = 10.5;
const LINE: f64 = 14.0;
/// Least room for a name in pixels, where its surface is narrower.
const LEAST: f64 = 60.0;

/// A name to be written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Name {
    pub(super) name: String,
    /// Written after the name where there is room.
    pub(super) note: String,
    /// The visible part of the surface in pixels.
    pub(super) area: Vec<Point>,
}

/// A name in its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Label {
    text: String,
    at: Bounds,
}

impl Label {
    pub(super) fn draw(&self, svg: &mut Svg) {
        let [[left, _], [_, bottom]] = self.at;
        svg.text([left + 1.0, bottom - 4.0], "start", "wire", &self.text);
    }
}

/// Places names within `frame`, off each other: at the upper edges of their areas, else some lines below or
/// above. Returns the labels and the number of names without room.
pub(super) fn place(names: &[Name], frame: Bounds) -> (Vec<Label>, usize) {
    let mut labels: Vec<Label> = Vec::new();
    for Name { name, note, area } in names {
        let Some([low, high]) = bounds(area.iter().copied()) else { continue };
        let room = (high[0] - low[0] - 6.0).max(LEAST);
        let both = format!("{name} \u{b7} {note}");
        let fits = !note.is_empty() && note != name && length(&both) <= room;
        let text = if fits { both } else { fitting(name, room, SIZE) };
        let size = [length(&text), LINE];
        let first = [0.5 * (low[0] + high[0] - size[0]), low[1] + 3.0];
        let first: Point = [0, 1].map(|k| first[k].min(frame[1][k] - size[k]).max(frame[0][k]));
        let at = [0.0, 1.0, 2.0, -1.0, -2.0].into_iter().map(|lines| {
            let corner = [first[0], first[1] + lines * LINE];
            [corner, [corner[0] + size[0], corner[1] + size[1]]]
        });
        let free = |at: &Bounds| inside(*at, frame) && !labels.iter().any(|label| overlap(label.at, *at));
        if let Some(at) = at.into_iter().find(free) {
            labels.push(Label { text, at });
        }
    }
    let left_out = names.len() - labels.len();
    (labels, left_out)
}

/// Length of a line in pixels, on the large side.
fn length(line: &str) -> f64 {
    let wide = line.chars().filter(|c| *c >= '\u{1100}').count() as f64;
    1.05 * text_width(line, SIZE) + 0.5 * SIZE * wide + 2.0
}

fn inside(a: Bounds, b: Bounds) -> bool {
    (0..2).all(|k| a[0][k] >= b[0][k] && a[1][k] <= b[1][k])
}

fn overlap(a: Bounds, b: Bounds) -> bool {
    (0..2).all(|k| a[0][k] < b[1][k] && b[0][k] < a[1][k])
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Bounds = [[0.0; 2], [1000.0; 2]];

    fn name(name: &str, note: &str, [x, y, w, h]: [f64; 4]) -> Name {
        let area = vec![[x, y], [x + w, y], [x + w, y + h], [x, y + h]];
        Name { name: name.into(), note: note.into(), area }
    }

    #[test]
    fn names_are_on_their_areas_and_off_each_other() {
        let long = "a name of many words that nobody would ever give to a surface";
        let names = [
            name("honey", "", [0.0, 0.0, 80.0, 60.0]),
            name("floor", "", [0.0, 0.0, 80.0, 60.0]),
            name("1", "sandpaper P36", [100.0, 0.0, 240.0, 200.0]),
            name("2", "sandpaper P36", [350.0, 0.0, 40.0, 40.0]),
            name(long, "leather", [500.0, 0.0, 190.0, 60.0]),
            name("a wall", "", [1000.0, 300.0, 0.0, 100.0]),
        ];
        let (labels, left_out) = place(&names, FRAME);
        assert_eq!((labels.len(), left_out), (6, 0), "{labels:?}");
        let texts: Vec<&str> = labels.iter().map(|label| label.text.as_str()).collect();
        assert_eq!(
            [&texts[..4], &texts[5..]].concat(),
            ["honey", "floor", "1 \u{b7} sandpaper P36", "2", "a wall"]
        );
        assert!(texts[4].ends_with('\u{2026}') && length(texts[4]) < 200.0, "{texts:?}");
        for (i, label) in labels.iter().enumerate() {
            let area = bounds(names[i].area.iter().copied()).unwrap();
            assert!(inside(label.at, FRAME) && (i == 5 || overlap(label.at, area)), "{label:?}");
            assert!(labels[..i].iter().all(|other| !overlap(label.at, other.at)), "{label:?}");
        }
    }

    #[test]
    fn names_without_room_are_counted() {
        let names: Vec<Name> =
            (0..16).map(|i| name("here", "", [500.0 + f64::from(i % 4) * 20.0, 500.0, 20.0, 20.0])).collect();
        let (labels, left_out) = place(&names, FRAME);
        assert!(left_out > 0 && labels.len() + left_out == 16, "{} {left_out}", labels.len());
        assert_eq!(place(&[Name { area: Vec::new(), ..names[0].clone() }], FRAME).1, 1);
    }
}
