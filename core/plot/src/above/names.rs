//! Names of surfaces: at the upper edge of what is seen of a surface, off each other.

use super::Seen;
use super::outline::{Bounds, Point};
use crate::svg::{Svg, fitting, text_width};

/// Font size, and height of a line.
const SIZE: f64 = 10.5;
const LINE: f64 = 14.0;
/// Least room for a name in pixels, where its surface is narrower.
const LEAST: f64 = 60.0;

/// Writes names within `frame`, off each other: at the upper edges of their areas, else some lines below or
/// above. Returns their number.
pub(super) fn draw_names(svg: &mut Svg, areas: &[(&Seen, Bounds)], frame: Bounds) -> usize {
    let mut taken: Vec<Bounds> = Vec::new();
    for (Seen { name, note, .. }, [low, high]) in areas {
        let room = (high[0] - low[0] - 6.0).max(LEAST);
        let both = format!("{name} \u{b7} {note}");
        let fits = !note.is_empty() && note != name && length(&both) <= room;
        let text = if fits { both } else { fitting(name, room, SIZE) };
        let size = [length(&text), LINE];
        let first = [0.5 * (low[0] + high[0] - size[0]), low[1] + 3.0];
        let first: Point = [0, 1].map(|k| first[k].min(frame[1][k] - size[k]).max(frame[0][k]));
        let at = [0.0, 1.0, 2.0, -1.0, -2.0].map(|lines| {
            let corner = [first[0], first[1] + lines * LINE];
            [corner, [corner[0] + size[0], corner[1] + size[1]]]
        });
        let inside = |at: &Bounds| (0..2).all(|k| at[0][k] >= frame[0][k] && at[1][k] <= frame[1][k]);
        if let Some(at) = at.into_iter().find(|at| inside(at) && !taken.iter().any(|t| overlap(*t, *at))) {
            svg.text([at[0][0] + 1.0, at[1][1] - 4.0], "start", "wire", &text);
            taken.push(at);
        }
    }
    taken.len()
}

/// Length of a line in pixels, on the large side.
fn length(line: &str) -> f64 {
    let wide = line.chars().filter(|c| *c >= '\u{1100}').count() as f64;
    1.05 * text_width(line, SIZE) + 0.5 * SIZE * wide + 2.0
}

fn overlap(a: Bounds, b: Bounds) -> bool {
    (0..2).all(|k| a[0][k] < b[1][k] && b[0][k] < a[1][k])
}
