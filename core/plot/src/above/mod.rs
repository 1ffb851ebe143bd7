//! A scene from above, with the path of the stylus over it.
//!
//! x points right and y up, on one scale in millimetres. Beside the path, on its right in the direction of
//! motion, run lanes: one for each effect that is active there. The view holds the path and its
//! surroundings.

mod outline;
mod way;

use asperity_scene::space::Surface;

use super::axis::{Axis, FRAME, Panel};
use super::lines::Pen;
use super::svg::{Svg, fitting, num, text_width};
use outline::{Bounds, Point, bounds, clipped, meet, outline};
use way::{LANE, Piece, lanes, line, pieces};

/// A scene from above.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneMap {
    /// The surfaces of the scene.
    pub surfaces: Vec<Seen>,
    /// Names of the effects, at most 11, in the order of the bits of [`Moment::effects`] and of the lanes.
    pub effects: Vec<String>,
    /// The path of the stylus, tick by tick.
    pub moments: Vec<Moment>,
    /// Ticks a second.
    pub hz: f64,
}

/// A surface to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Its name.
    pub name: String,
    /// Written after the name where there is room, such as the material.
    pub note: String,
    /// Shape and pose.
    pub surface: Surface,
    /// Whether the stylus passes through it: drawn dashed.
    pub soft: bool,
    /// Whether the stylus touched it: drawn stronger.
    pub touched: bool,
}

/// One tick of the path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// x and y in mm. A value that is not finite breaks the path.
    pub at_mm: [f32; 2],
    /// A bit for each active effect.
    pub effects: u16,
    /// Whether the stylus touches something. In the air the path is dotted.
    pub touches: bool,
    /// Whether the stylus was put here from elsewhere: no path leads from the place before.
    pub jumps: bool,
}

const LEFT: f64 = 64.0;
const RIGHT: f64 = 850.0;
const ASIDE: f64 = 884.0;
const END: f64 = 1100.0;
const HEADING: f64 = 30.0;
const BELOW: f64 = 50.0;
/// Least and greatest height of the map in pixels.
const HEIGHT: [f64; 2] = [200.0, 520.0];
const ROW: f64 = 19.0;
/// Height of a row of the strip over time, and of its bars.
const STRIP_ROW: f64 = 14.0;
const BAR: f64 = 9.0;
const GRID_SPACING: f64 = 70.0;
/// Most outlines that are drawn, those that were touched first, and most surfaces that are named.
const MOST_OUTLINES: usize = 4000;
const MOST_NAMES: usize = 40;
/// Font size of names, height of a line, and least room for a name in pixels, where its surface is narrower.
const NAME: f64 = 10.5;
const LINE: f64 = 14.0;
const LEAST: f64 = 60.0;
/// Least extent of the view in mm.
const LEAST_MM: f64 = 10.0;
/// Surfaces nearer than `NEAR` to the path are shown, up to `FAR` from it; both as parts of its extent.
const NEAR: f64 = 0.1;
const FAR: f64 = 0.5;

const GROUND: &str = "fill=\"#f4f7fa\"";
/// Style of surfaces that are not touched, and touched.
const OUTLINE: [&str; 2] = [
    "fill=\"#e9eff5\" fill-opacity=\"0.55\" stroke=\"#b9c6d2\"",
    "fill=\"#dfeaf3\" fill-opacity=\"0.6\" stroke=\"#7d9bb5\"",
];
const DASHED: &str = " stroke-dasharray=\"4 3\"";
const WAY: &str = "stroke=\"#323f4b\" stroke-width=\"1\" fill=\"none\" stroke-linejoin=\"round\"";
const LANE_STYLE: &str = "fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\"";
const AIR: &str = "stroke=\"#8795a1\" stroke-width=\"1.4\" stroke-dasharray=\"0.1 3.4\" \
                   stroke-linecap=\"round\" fill=\"none\"";
/// Colours of effects. Each pair is distinct also with red-green colour blindness; the tests check it.
const COLOURS: [&str; 11] = [
    "#52606d", "#a9c4ae", "#d1602a", "#0a6fb0", "#2f9268", "#4d9bff", "#4310a0", "#101820", "#e6b800",
    "#613410", "#e6a1dc",
];

/// A scene whose place on the page is known: millimetres over pixels.
pub(super) struct Laid<'a> {
    above: &'a SceneMap,
    panel: Panel,
    pieces: Vec<Piece>,
}

impl SceneMap {
    /// Lays the scene out below `top`.
    pub(super) fn laid(&self, top: f64) -> Laid<'_> {
        // An endless line has no extent.
        let outlines = self.surfaces.iter().filter_map(|seen| outline(&seen.surface).filter(|p| p.len() > 2));
        let path = bounds(self.moments.iter().filter_map(Moment::place));
        let [low, high] = view(path, outlines.filter_map(|points| bounds(points.into_iter())));
        let size = [high[0] - low[0], high[1] - low[1]];
        let room = RIGHT - LEFT;
        // At least as high as the legend beside it.
        let least = HEIGHT[0].max((self.active().len().max(1) as f64 + 3.0) * ROW + 36.0);
        let height = (size[1] * room / size[0]).clamp(least, HEIGHT[1].max(least));
        // Both axes have the same scale. Where one has room left, it shows more.
        let mm = (size[0] / room).max(size[1] / height);
        let axis = |k: usize, length: f64, pixels| {
            let (middle, half) = (0.5 * (low[k] + high[k]), 0.5 * mm * length);
            Axis::linear((middle - half, middle + half), pixels)
        };
        let top = top + HEADING;
        let panel = Panel { x: axis(0, room, [LEFT, RIGHT]), y: axis(1, height, [top + height, top]) };
        let pieces = pieces(&self.moments, |[x, y]| panel.at((x, y)));
        Laid { above: self, panel, pieces }
    }

    /// Effects that are ever active, each with its share of the time.
    fn active(&self) -> Vec<(usize, f64)> {
        let count = self.effects.len().min(COLOURS.len());
        let all = self.moments.len().max(1) as f64;
        let of = |bit: usize| self.moments.iter().filter(|m| m.effects >> bit & 1 == 1).count();
        (0..count).map(|bit| (bit, of(bit) as f64 / all)).filter(|(_, part)| *part > 0.0).collect()
    }

    /// Times from and to, in seconds, in which an effect with one of these names was active.
    pub fn times(&self, names: &[&str]) -> Vec<(f64, f64)> {
        let named = self.effects.iter().take(u16::BITS as usize).enumerate();
        let bits =
            named.filter(|(_, n)| names.contains(&n.as_str())).fold(0_u16, |all, (bit, _)| all | 1 << bit);
        let mut times: Vec<(f64, f64)> = Vec::new();
        let mut tick = 0;
        for run in self.moments.chunk_by(|a, b| (a.effects & bits == 0) == (b.effects & bits == 0)) {
            let end = tick + run.len();
            if run[0].effects & bits != 0 {
                times.push((tick as f64 / self.hz, end as f64 / self.hz));
            }
            tick = end;
        }
        times
    }

    /// Height of the strip over time in pixels; 0 where no effect is ever active.
    pub(crate) fn strip_height(&self) -> f64 {
        STRIP_ROW * self.active().len() as f64
    }

    /// Draws the strip: a row of bars for each effect, over the times when it was active.
    pub(crate) fn draw_strip(&self, svg: &mut Svg, panel: &Panel) {
        for (row, (bit, _)) in self.active().into_iter().enumerate() {
            let y = panel.y.pixels[1] + STRIP_ROW * (row as f64 + 0.5);
            let mut d = String::new();
            for [from, to] in self.bars(bit, &panel.x) {
                d += &format!("M{} {}H{}", num(from), num(y), num(to));
            }
            svg.path(&d, &format!("stroke=\"{}\" stroke-width=\"{BAR}\" fill=\"none\"", COLOURS[bit]));
            svg.text([panel.x.pixels[1] + 6.0, y + 4.0], "start", "small", &self.effects[bit]);
        }
    }

    /// Pixels from and to where an effect is active: bars of at least a pixel, at least a pixel apart.
    fn bars(&self, bit: usize, x: &Axis) -> Vec<[f64; 2]> {
        let mut bars: Vec<[f64; 2]> = Vec::new();
        let pixel = |tick: usize| x.at(tick as f64 / self.hz).clamp(x.pixels[0], x.pixels[1]);
        for tick in (0..self.moments.len()).filter(|tick| self.moments[*tick].effects >> bit & 1 == 1) {
            let (from, to) = (pixel(tick), pixel(tick + 1));
            match bars.last_mut() {
                Some(bar) if from - bar[1] < 1.0 => bar[1] = to.max(bar[1]),
                _ => bars.push([from, to.max(from + 1.0)]),
            }
        }
        bars
    }
}

impl Moment {
    fn place(&self) -> Option<Point> {
        let at = self.at_mm.map(f64::from);
        at.iter().all(|v| v.is_finite()).then_some(at)
    }
}

/// The view: the path and its surroundings.
fn view(path: Option<Bounds>, surfaces: impl Iterator<Item = Bounds>) -> Bounds {
    let join = |a: Bounds, b: Bounds| -> Bounds {
        [[0, 1].map(|k| a[0][k].min(b[0][k])), [0, 1].map(|k| a[1][k].max(b[1][k]))]
    };
    let wider = |[low, high]: Bounds, by: f64| [low.map(|v| v - by), high.map(|v| v + by)];
    let extent = |[low, high]: Bounds| (high[0] - low[0]).max(high[1] - low[1]).max(LEAST_MM);
    let shown = match path {
        Some(path) => {
            let least = 0.5 * (LEAST_MM - (path[1][0] - path[0][0]).max(path[1][1] - path[0][1]));
            let near = wider(path, least.max(NEAR * extent(path)));
            let far = wider(path, FAR * extent(path));
            let cut = |[low, high]: Bounds| -> Bounds {
                [[0, 1].map(|k| low[k].max(far[0][k])), [0, 1].map(|k| high[k].min(far[1][k]))]
            };
            surfaces.filter(|surface| meet(*surface, near)).map(cut).fold(near, join)
        }
        None => surfaces.reduce(join).unwrap_or([[-0.5 * LEAST_MM; 2], [0.5 * LEAST_MM; 2]]),
    };
    wider(shown, 0.02 * extent(shown))
}

impl Laid<'_> {
    pub(super) fn bottom(&self) -> f64 {
        self.panel.y.pixels[0] + BELOW
    }

    fn frame(&self) -> Bounds {
        let [bottom, top] = self.panel.y.pixels;
        [[LEFT, top], [RIGHT, bottom]]
    }

    pub(super) fn draw(&self, svg: &mut Svg) {
        let Panel { x, y } = &self.panel;
        let [[left, top], [right, bottom]] = self.frame();
        let view: Bounds = [[x.low, y.low], [x.high, y.high]];
        let all = self.above.surfaces.iter().map(|seen| (seen, outline(&seen.surface)));
        let is_seen = |points: &Vec<Point>| bounds(points.iter().copied()).is_some_and(|b| meet(b, view));
        let mut surfaces: Vec<_> = all.filter(|(_, points)| points.as_ref().is_none_or(is_seen)).collect();
        surfaces.sort_by_key(|(seen, _)| !seen.touched);
        let left_out = surfaces.len().saturating_sub(MOST_OUTLINES);
        surfaces.truncate(MOST_OUTLINES);
        if surfaces.iter().any(|(_, points)| points.is_none()) {
            svg.rect([left, top], [right - left, bottom - top], GROUND);
        }
        self.panel.x_grid(svg, GRID_SPACING);
        self.panel.x_labels(svg, GRID_SPACING, "");
        self.panel.y_grid(svg, &y.ticks(GRID_SPACING));
        let [l, r, t, b] = [x.pixels[0], x.pixels[1], top, bottom].map(num);
        let frame = format!("M{l} {t}H{r}V{b}H{l}z");
        svg.raw(format_args!("<clipPath id=\"above\"><path d=\"{frame}\"/></clipPath>\n"));
        svg.raw("<g clip-path=\"url(#above)\">\n");
        let areas = self.draw_surfaces(svg, &surfaces);
        self.draw_path(svg);
        let nameless = self.draw_names(svg, areas);
        svg.raw("</g>\n");
        svg.path(&frame, FRAME);
        let counted = |count: usize, one: &str, many: &str| match count {
            0 => String::new(),
            1 => format!("; 1 {one}"),
            n => format!("; {n} {many}"),
        };
        let about = counted(left_out, "more surface is not drawn", "more surfaces are not drawn");
        let names = counted(nameless, "name is left out", "names are left out");
        svg.heading([LEFT, top - 9.0], "From above", &format!("x and y, mm{about}{names}"));
        self.legend(svg);
    }

    /// Draws surfaces. Returns each with the bounds of its visible part.
    fn draw_surfaces<'s>(
        &self,
        svg: &mut Svg,
        surfaces: &[(&'s Seen, Option<Vec<Point>>)],
    ) -> Vec<(&'s Seen, Bounds)> {
        let frame = self.frame();
        // Cut a little outside the frame, so that cut edges are not seen.
        let wide = [frame[0].map(|v| v - 8.0), frame[1].map(|v| v + 8.0)];
        let (mut paths, mut areas) = ([const { String::new() }; 4], Vec::new());
        for (seen, points) in surfaces {
            let Some(points) = points else {
                areas.push((*seen, frame));
                continue;
            };
            let points: Vec<Point> = points.iter().map(|[x, y]| self.panel.at((*x, *y))).collect();
            areas.extend(bounds(clipped(&points, frame).into_iter()).map(|area| (*seen, area)));
            let (mut d, mut pen) = (String::new(), Pen::default());
            clipped(&points, wide).iter().for_each(|[x, y]| pen.to(&mut d, *x, *y));
            if !d.is_empty() {
                let style = usize::from(seen.touched) + 2 * usize::from(seen.soft);
                paths[style] += &format!("<path d=\"{d}z\"/>\n");
            }
        }
        for (i, paths) in paths.iter().enumerate().filter(|(_, paths)| !paths.is_empty()) {
            svg.raw(format_args!("<g {}{}>\n{paths}</g>\n", OUTLINE[i & 1], if i > 1 { DASHED } else { "" }));
        }
        areas
    }

    /// Writes names. Returns how many have no room. Of too many only those of touched surfaces stay, or none.
    fn draw_names(&self, svg: &mut Svg, mut areas: Vec<(&Seen, Bounds)>) -> usize {
        let all = areas.len();
        if all > MOST_NAMES {
            areas.retain(|(seen, _)| seen.touched);
        }
        if areas.len() > MOST_NAMES {
            areas.clear();
        }
        all - draw_names(svg, &areas, self.frame())
    }

    fn draw_path(&self, svg: &mut Svg) {
        for (bit, d) in lanes(&self.pieces, COLOURS.len()).iter().enumerate() {
            let name = self.above.effects.get(bit).map_or("", String::as_str);
            let stroke = format!("{LANE_STYLE} stroke=\"{}\" stroke-width=\"{LANE}\"", COLOURS[bit]);
            svg.titled_path(d, &stroke, name);
        }
        svg.path(&line(&self.pieces, false), AIR);
        svg.path(&line(&self.pieces, true), WAY);
        if let (Some(first), Some(last)) = (self.pieces.first(), self.pieces.last()) {
            dot(svg, first.from, false);
            dot(svg, last.to, true);
        }
    }

    fn legend(&self, svg: &mut Svg) {
        let mut y = self.panel.y.pixels[1] + 4.0;
        let row = |svg: &mut Svg, y: f64, stroke: &str, name: &str, share: f64| {
            svg.path(&format!("M{} {}h24", num(ASIDE), num(y - 4.0)), stroke);
            svg.text([ASIDE + 34.0, y], "start", "ink", name);
            svg.text([END, y], "end", "", &percent(share));
        };
        svg.text([ASIDE, y], "start", "head", "Effects along the way");
        y += 16.0;
        svg.text([ASIDE, y], "start", "small", "on its right, in this order");
        svg.text([END, y], "end", "small", "of the time");
        y += ROW + 3.0;
        let active = self.above.active();
        if active.is_empty() {
            svg.text([ASIDE, y], "start", "", "none");
            y += ROW;
        }
        for (bit, share) in active {
            let stroke = format!("stroke=\"{}\" stroke-width=\"4\"", COLOURS[bit]);
            row(svg, y, &stroke, &self.above.effects[bit], share);
            y += ROW;
        }
        y += 6.0;
        let count = self.above.moments.len().max(1) as f64;
        let touching = self.above.moments.iter().filter(|m| m.touches).count() as f64 / count;
        row(svg, y, WAY, "touching", touching);
        row(svg, y + ROW, AIR, "in the air", 1.0 - touching);
        y += 2.0 * ROW;
        dot(svg, [ASIDE + 5.0, y - 4.0], false);
        dot(svg, [ASIDE + 19.0, y - 4.0], true);
        svg.text([ASIDE + 34.0, y], "start", "ink", "beginning, end");
    }
}

/// Writes names within `frame`, off each other: at the upper edges of their areas, else some lines below or
/// above. Returns their number.
fn draw_names(svg: &mut Svg, areas: &[(&Seen, Bounds)], frame: Bounds) -> usize {
    // Length of a line in pixels, on the large side.
    let length = |line: &str| {
        let wide = line.chars().filter(|c| *c >= '\u{1100}').count() as f64;
        1.05 * text_width(line, NAME) + 0.5 * NAME * wide + 2.0
    };
    let mut taken: Vec<Bounds> = Vec::new();
    for (Seen { name, note, .. }, [low, high]) in areas {
        let room = (high[0] - low[0] - 6.0).max(LEAST);
        let both = format!("{name} \u{b7} {note}");
        let fits = !note.is_empty() && note != name && length(&both) <= room;
        // A name may reach beyond a narrow surface; where it would cover another, it moves down a line.
        let text = if fits { both } else { fitting(name, 1.5 * room, NAME) };
        let size = [length(&text), LINE];
        let first = [0.5 * (low[0] + high[0] - size[0]), low[1] + 3.0];
        let first: Point = [0, 1].map(|k| first[k].min(frame[1][k] - size[k]).max(frame[0][k]));
        let at = [0.0, 1.0, 2.0, -1.0, -2.0].map(|lines| {
            let corner = [first[0], first[1] + lines * LINE];
            [corner, [corner[0] + size[0], corner[1] + size[1]]]
        });
        let inside = |at: &Bounds| (0..2).all(|k| at[0][k] >= frame[0][k] && at[1][k] <= frame[1][k]);
        let apart = |a: &Bounds, b: &Bounds| (0..2).any(|k| a[0][k] >= b[1][k] || b[0][k] >= a[1][k]);
        if let Some(at) = at.into_iter().find(|at| inside(at) && taken.iter().all(|t| apart(t, at))) {
            svg.text([at[0][0] + 1.0, at[1][1] - 4.0], "start", "wire", &text);
            taken.push(at);
        }
    }
    taken.len()
}

/// The beginning of the path, or its end.
fn dot(svg: &mut Svg, at: Point, end: bool) {
    let fill = if end { "#323f4b" } else { "#fff" };
    svg.circle(at, 3.5, &format!("fill=\"{fill}\" stroke=\"#323f4b\" stroke-width=\"1.3\""));
}

/// A share of 1 in percent. Only 0 is written as 0.
fn percent(share: f64) -> String {
    match 100.0 * share {
        p if p <= 0.0 => "0 %".into(),
        p if p < 0.1 => "< 0.1 %".into(),
        p if p < 9.95 => format!("{p:.1} %"),
        p => format!("{p:.0} %"),
    }
}

#[cfg(test)]
mod tests;
