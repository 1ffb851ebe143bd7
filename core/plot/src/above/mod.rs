//! A scene from above, with the way of the stylus over it.
//!
//! x goes to the right and y up, on one scale in millimetres. Beside the way, on its right as one goes, run lanes: one for each kind of effect that is active there. What is
//! shown is the way and what lies about it.

mod cover;
mod names;
mod outline;
mod strip;
mod way;

use asperity_scene::space::Surface;

use super::axis::Axis;
use super::lines::Pen;
use super::svg::{Svg, num};
use cover::{CELL, Cover};
use names::{Name, Written, place};
use outline::{Bounds, Outline, Point, bounds, clipped, left_of, meet};
use way::{LANE, Piece, Stop, covered, lanes, line, pieces};

/// A scene from above.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Above {
    /// What can be touched.
    pub surfaces: Vec<Seen>,
    /// Names of the effects that [`Moment::effects`] has bits of, at most 11: each has its colour and its place in the order of the lanes.
    pub effects: Vec<String>,
    /// The way of the stylus, tick by tick.
    pub moments: Vec<Moment>,
    /// Ticks a second.
    pub hz: f64,
}

/// A surface to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Its name.
    pub name: String,
    /// What else is written beside the name where there is room, such as its material.
    pub note: String,
    /// What it is and where.
    pub surface: Surface,
    /// Whether one passes through it: drawn dashed.
    pub soft: bool,
    /// Whether the stylus was on it: drawn stronger.
    pub touched: bool,
}

/// A tick of the way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// x and y in mm; where one is not finite the way is broken.
    pub at_mm: [f32; 2],
    /// A bit for each effect that is active.
    pub effects: u16,
    /// Whether something is touched; in the air the way is dotted.
    pub touches: bool,
    /// Whether the stylus was put down here from elsewhere: there is no way from the place before.
    pub jumps: bool,
}

const LEFT: f64 = 64.0;
const RIGHT: f64 = 850.0;
const ASIDE: f64 = 884.0;
const END: f64 = 1100.0;
const HEADING: f64 = 30.0;
const BELOW: f64 = 50.0;
/// Heights of the map in pixels.
const HEIGHT: [f64; 2] = [200.0, 520.0];
const ROW: f64 = 19.0;
/// Outlines that are drawn at most, the nearest to the way, and with how many in sight none has its name.
const MOST_OUTLINES: usize = 4000;
const MOST_NAMES: usize = 40;
/// Least extent that is shown in mm.
const LEAST_MM: f64 = 10.0;
/// What lies so near to the way, as a part of its extent, is shown, up to so far from it.
const NEAR: f64 = 0.1;
const FAR: f64 = 0.5;
/// Radius in pixels from which only the part of a circle is drawn that is in sight.
const LARGE: f64 = 5000.0;

const GRID: &str = "stroke=\"#e4e9ee\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
const FRAME: &str = "stroke=\"#b8c2cc\" stroke-width=\"1\" fill=\"none\" shape-rendering=\"crispEdges\"";
const GROUND: &str = "fill=\"#f4f7fa\"";
/// Of surfaces: not touched, touched; what one passes through is dashed.
const OUTLINE: [&str; 2] = [
    "fill=\"#e9eff5\" fill-opacity=\"0.55\" stroke=\"#b9c6d2\"",
    "fill=\"#dfeaf3\" fill-opacity=\"0.6\" stroke=\"#7d9bb5\"",
];
const DASHED: &str = " stroke-dasharray=\"4 3\"";
const WAY: &str = "stroke=\"#323f4b\" stroke-width=\"1\" fill=\"none\" stroke-linejoin=\"round\"";
const AIR: &str = "stroke=\"#8795a1\" stroke-width=\"1.4\" stroke-dasharray=\"0.1 3.4\" stroke-linecap=\"round\" fill=\"none\"";
/// Told apart by pairs also by those who do not see red or green: see the tests.
const COLOURS: [&str; 11] = [
    "#52606d", "#a9c4ae", "#d1602a", "#0a6fb0", "#2f9268", "#4d9bff", "#4310a0", "#101820", "#e6b800",
    "#613410", "#e6a1dc",
];

/// A picture from above that has its place: millimetres over pixels.
pub(super) struct Laid<'a> {
    above: &'a Above,
    x: Axis,
    y: Axis,
    pieces: Vec<Piece>,
}

impl Above {
    /// Lays it out below `top`.
    pub(super) fn laid(&self, top: f64) -> Laid<'_> {
        let outlines = self.surfaces.iter().map(|seen| Outline::of(&seen.surface));
        let [low, high] = view(self.way(), outlines.filter_map(|outline| outline.bounds()));
        let size = [high[0] - low[0], high[1] - low[1]];
        let room = RIGHT - LEFT;
        // As high as what stands beside it.
        let least = HEIGHT[0].max(self.aside());
        let height = (size[1] * room / size[0]).clamp(least, HEIGHT[1].max(least));
        // The same scale on both axes: what is left over shows more of the one.
        let mm = (size[0] / room).max(size[1] / height);
        let axis = |k: usize, length: f64, pixels| {
            let (middle, half) = (0.5 * (low[k] + high[k]), 0.5 * mm * length);
            Axis { low: middle - half, high: middle + half, pixels }
        };
        let top = top + HEADING;
        let (x, y) = (axis(0, room, [LEFT, RIGHT]), axis(1, height, [top + height, top]));
        let stop = |moment: &Moment| Stop {
            at: moment.place().map(|[a, b]| [x.at(a), y.at(b)]),
            effects: moment.effects,
            touches: moment.touches,
            jumps: moment.jumps,
        };
        let pieces = pieces(self.moments.iter().map(stop));
        Laid { above: self, x, y, pieces }
    }

    /// The bounds of the way.
    fn way(&self) -> Option<Bounds> {
        bounds(self.moments.iter().filter_map(Moment::place))
    }

    /// Which effects are ever active, with the part of the time that they are.
    fn active(&self) -> Vec<(usize, f64)> {
        let count = self.effects.len().min(COLOURS.len());
        let all = self.moments.len().max(1) as f64;
        let of = |bit: usize| self.moments.iter().filter(|m| m.effects >> bit & 1 == 1).count();
        (0..count).map(|bit| (bit, of(bit) as f64 / all)).filter(|(_, part)| *part > 0.0).collect()
    }

    /// Height of what stands beside the map.
    fn aside(&self) -> f64 {
        (self.active().len().max(1) as f64 + 3.0) * ROW + 36.0
    }

    /// Times from and to, in seconds, in which an effect of one of these names was active.
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
}

impl Moment {
    fn place(&self) -> Option<Point> {
        let at = self.at_mm.map(f64::from);
        at.iter().all(|v| v.is_finite()).then_some(at)
    }
}

/// What is shown: the way, and what lies about it.
fn view(way: Option<Bounds>, surfaces: impl Iterator<Item = Bounds>) -> Bounds {
    let join = |a: Bounds, b: Bounds| -> Bounds {
        [std::array::from_fn(|k| a[0][k].min(b[0][k])), std::array::from_fn(|k| a[1][k].max(b[1][k]))]
    };
    let wider = |[low, high]: Bounds, by: f64| [low.map(|v| v - by), high.map(|v| v + by)];
    let extent = |[low, high]: Bounds| (high[0] - low[0]).max(high[1] - low[1]).max(LEAST_MM);
    let shown = match way {
        Some(way) => {
            let least = 0.5 * (LEAST_MM - (way[1][0] - way[0][0]).max(way[1][1] - way[0][1]));
            let near = wider(way, least.max(NEAR * extent(way)));
            let far = wider(way, FAR * extent(way));
            let cut = |[low, high]: Bounds| -> Bounds {
                [
                    std::array::from_fn(|k| low[k].max(far[0][k])),
                    std::array::from_fn(|k| high[k].min(far[1][k])),
                ]
            };
            surfaces.filter(|surface| meet(*surface, near)).map(cut).fold(near, join)
        }
        None => surfaces.reduce(join).unwrap_or([[-0.5 * LEAST_MM; 2], [0.5 * LEAST_MM; 2]]),
    };
    wider(shown, 0.02 * extent(shown))
}

impl Laid<'_> {
    /// Where it ends, its labels included.
    pub(super) fn bottom(&self) -> f64 {
        self.y.pixels[0] + BELOW
    }

    /// Draws it.
    pub(super) fn draw(&self, svg: &mut Svg) {
        let [bottom, top] = self.y.pixels;
        svg.raw(format_args!(
            "<clipPath id=\"above\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>\n",
            num(LEFT),
            num(top),
            num(RIGHT - LEFT),
            num(bottom - top)
        ));
        svg.raw("<g clip-path=\"url(#above)\">\n");
        let (names, left_out) = self.surfaces(svg);
        self.stroke(svg);
        let (written, nameless) = self.names(names);
        written.iter().for_each(|name| name.point(svg));
        written.iter().for_each(|name| name.draw(svg));
        svg.raw("</g>\n");
        let frame =
            format!("M{l} {t}H{r}V{b}H{l}z", l = num(LEFT), r = num(RIGHT), t = num(top), b = num(bottom));
        svg.path(&frame, FRAME);
        for (v, label) in self.x.ticks(70.0) {
            svg.text([self.x.at(v), bottom + 16.0], "middle", "small", &label);
        }
        for (v, label) in self.y.ticks(70.0) {
            svg.text([LEFT - 8.0, self.y.at(v) + 4.0], "end", "small", &label);
        }
        let mut about = "x and y, mm".to_owned();
        match left_out {
            0 => {}
            1 => about += "; 1 more surface is not drawn",
            n => about += &format!("; {n} more surfaces are not drawn"),
        }
        match nameless {
            0 => {}
            1 => about += "; 1 name is left out",
            n => about += &format!("; {n} names are left out"),
        }
        svg.heading([LEFT, top - 9.0], "From above", &about);
        self.legend(svg);
    }

    /// Names in their places, and how many have none.
    fn names(&self, mut names: Vec<(bool, Name)>) -> (Vec<Written>, usize) {
        let all = names.len();
        // Those that were touched at least.
        if names.len() > MOST_NAMES {
            names.retain(|(touched, _)| *touched);
        }
        if names.len() > MOST_NAMES {
            names.clear();
        }
        let left_out = all - names.len();
        let names: Vec<Name> = names.into_iter().map(|(_, name)| name).collect();
        let frame = [[LEFT, self.y.pixels[1]], [RIGHT, self.y.pixels[0]]];
        let cover = Cover::of(frame, |mark| {
            if names.is_empty() {
                return;
            }
            covered(&self.pieces, COLOURS.len(), CELL, mark);
            let ends =
                self.pieces.first().map(|p| p.from).into_iter().chain(self.pieces.last().map(|p| p.to));
            for [x, y] in ends {
                (0..9).for_each(|i| mark([x + 4.0 * f64::from(i % 3 - 1), y + 4.0 * f64::from(i / 3 - 1)]));
            }
        });
        let (written, nameless) = place(&names, frame, &cover);
        (written, left_out + nameless)
    }

    /// Draws the surfaces; answers what could be written where, with whether it was touched, and how many were left out.
    fn surfaces(&self, svg: &mut Svg) -> (Vec<(bool, Name)>, usize) {
        let [bottom, top] = self.y.pixels;
        let shown: Bounds = [[self.x.low, self.y.low], [self.x.high, self.y.high]];
        let frame = [[LEFT, top], [RIGHT, bottom]];
        let all = self.above.surfaces.iter().map(|seen| (seen, Outline::of(&seen.surface)));
        let mut all: Vec<(&Seen, Outline)> =
            all.filter(|(_, outline)| outline.bounds().is_none_or(|b| meet(b, shown))).collect();
        let left_out = all.len().saturating_sub(MOST_OUTLINES);
        if left_out > 0 {
            self.nearest_first(&mut all);
            all.truncate(MOST_OUTLINES);
        }
        if all.iter().any(|(_, outline)| *outline == Outline::Everywhere) {
            svg.rect(frame[0], [RIGHT - LEFT, bottom - top], GROUND);
        }
        let mut grid = String::new();
        for (v, _) in self.x.ticks(70.0) {
            grid += &format!("M{} {}V{}", num(self.x.at(v)), num(bottom), num(top));
        }
        for (v, _) in self.y.ticks(70.0) {
            grid += &format!("M{} {}H{}", num(LEFT), num(self.y.at(v)), num(RIGHT));
        }
        svg.path(&grid, GRID);
        let (mut paths, mut names) = ([const { String::new() }; 4], Vec::new());
        for (seen, outline) in &all {
            let (d, area) = self.shape(outline, frame);
            paths[usize::from(seen.touched) + 2 * usize::from(seen.soft)] += &d;
            names.push((seen.touched, Name { name: seen.name.clone(), note: seen.note.clone(), area }));
        }
        for (i, d) in paths.iter().enumerate() {
            svg.path(d, &format!("{}{}", OUTLINE[i & 1], if i > 1 { DASHED } else { "" }));
        }
        (names, left_out)
    }

    /// Sorts surfaces by their distance from the way.
    fn nearest_first(&self, all: &mut [(&Seen, Outline)]) {
        let every = self.pieces.len().div_ceil(256).max(1);
        let way: Vec<Point> = self.pieces.iter().step_by(every).map(|piece| piece.from).collect();
        all.sort_by_cached_key(|(seen, outline)| {
            let Some([low, high]) = outline.bounds() else { return (false, 0) };
            let at = [self.x.at(0.5 * (low[0] + high[0])), self.y.at(0.5 * (low[1] + high[1]))];
            let nearest = way.iter().map(|p| (p[0] - at[0]).hypot(p[1] - at[1])).fold(1e9, f64::min);
            (!seen.touched, nearest as u64)
        });
    }

    /// A path of an outline, clockwise on the screen as all of them, so that one leaves no hole in another; and the part of it in sight, in pixels.
    fn shape(&self, outline: &Outline, frame: Bounds) -> (String, Vec<Point>) {
        // A little more than what is in sight, so that edges that are cut are not seen.
        let wide = [frame[0].map(|v| v - 8.0), frame[1].map(|v| v + 8.0)];
        let pixel = |[x, y]: Point| [self.x.at(x), self.y.at(y)];
        let around = |points: &[Point]| {
            let (mut d, mut pen) = (String::new(), Pen::default());
            let mut points = clipped(points, wide);
            let turns = |w: &[Point]| left_of(points[0], w[0], w[1]);
            if points.windows(2).map(turns).sum::<f64>() < 0.0 {
                points.reverse();
            }
            points.into_iter().for_each(|[x, y]| pen.to(&mut d, x, y));
            // Nothing, or nothing but a point.
            if d.is_empty() || d.ends_with('l') { String::new() } else { d + "z" }
        };
        match outline {
            Outline::Everywhere => (
                String::new(),
                vec![frame[0], [frame[1][0], frame[0][1]], frame[1], [frame[0][0], frame[1][1]]],
            ),
            Outline::Edge(ends) => (around(&ends.map(pixel)), clipped(&ends.map(pixel), frame)),
            Outline::Polygon(points) => {
                let points: Vec<Point> = points.iter().copied().map(pixel).collect();
                (around(&points), clipped(&points, frame))
            }
            Outline::Circle { middle, radius } => {
                let ([x, y], r) = (pixel(*middle), self.x.at(*radius) - self.x.at(0.0));
                let corner = |count: usize| {
                    move |i: usize| {
                        let (sin, cos) = (std::f64::consts::TAU * i as f64 / count as f64).sin_cos();
                        [x + r * cos, y + r * sin]
                    }
                };
                let area: Vec<Point> = (0..24).map(corner(24)).collect();
                let d = if r < LARGE {
                    // Two halves, that meet for all rounding.
                    let r = (10.0 * r).round() / 10.0;
                    let half = format!("a{r} {r} 0 1 1", r = num(r));
                    format!("M{} {}{half} {w} 0{half}-{w} 0z", num(x - r), num(y), w = num(2.0 * r))
                } else {
                    // So many that none is off by more than half a pixel.
                    let count = (std::f64::consts::PI * r.sqrt()).min(16384.0) as usize;
                    around(&(0..count).map(corner(count)).collect::<Vec<_>>())
                };
                (d, clipped(&area, frame))
            }
        }
    }

    /// Draws the way and its lanes.
    fn stroke(&self, svg: &mut Svg) {
        for (bit, d) in lanes(&self.pieces, COLOURS.len()).iter().enumerate() {
            if d.is_empty() {
                continue;
            }
            let name = self.above.effects.get(bit).map_or("", String::as_str);
            svg.titled_path(
                d,
                &format!("fill=\"none\" stroke=\"{}\" stroke-width=\"{LANE}\"", COLOURS[bit]),
                name,
            );
        }
        svg.path(&line(&self.pieces, false), AIR);
        svg.path(&line(&self.pieces, true), WAY);
        if let (Some(first), Some(last)) = (self.pieces.first(), self.pieces.last()) {
            dot(svg, first.from, false);
            dot(svg, last.to, true);
        }
    }

    /// What the lanes and lines are.
    fn legend(&self, svg: &mut Svg) {
        let mut y = self.y.pixels[1] + 4.0;
        let row = |svg: &mut Svg, y: f64, line: &str, name: &str, part: Option<f64>| {
            svg.path(&format!("M{} {}h24", num(ASIDE), num(y - 4.0)), line);
            svg.text([ASIDE + 34.0, y], "start", "ink", name);
            svg.text([END, y], "end", "", &part.map(percent).unwrap_or_default());
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
        for (bit, part) in active {
            row(
                svg,
                y,
                &format!("stroke=\"{}\" stroke-width=\"4\"", COLOURS[bit]),
                &self.above.effects[bit],
                Some(part),
            );
            y += ROW;
        }
        y += 6.0;
        let count = self.above.moments.len().max(1) as f64;
        let touching = self.above.moments.iter().filter(|m| m.touches).count() as f64 / count;
        row(svg, y, WAY, "touching", Some(touching));
        row(svg, y + ROW, AIR, "in the air", Some(1.0 - touching));
        y += 2.0 * ROW;
        dot(svg, [ASIDE + 5.0, y - 4.0], false);
        dot(svg, [ASIDE + 19.0, y - 4.0], true);
        svg.text([ASIDE + 34.0, y], "start", "ink", "beginning, end");
    }
}

/// The beginning of the way, or its end.
fn dot(svg: &mut Svg, [x, y]: Point, end: bool) {
    let fill = if end { "#323f4b" } else { "#fff" };
    svg.raw(format_args!(
        "<circle cx=\"{}\" cy=\"{}\" r=\"3.5\" fill=\"{fill}\" stroke=\"#323f4b\" stroke-width=\"1.3\"/>\n",
        num(x),
        num(y)
    ));
}

/// A part of a whole; what is not nothing is not written as nothing.
fn percent(part: f64) -> String {
    let percent = 100.0 * part;
    match percent {
        p if p <= 0.0 => "0 %".into(),
        p if p < 0.1 => "< 0.1 %".into(),
        p if p < 9.95 => format!("{p:.1} %"),
        p => format!("{p:.0} %"),
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
