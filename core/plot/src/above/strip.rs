//! When effects were active: a row of bars for each.

use super::{Above, COLOURS};
use crate::axis::Axis;
use crate::svg::{Svg, num};

/// Height of a row, and of its bar.
const ROW: f64 = 14.0;
const BAR: f64 = 9.0;

impl Above {
    /// Height of the rows in pixels; 0 where nothing is ever active.
    pub(crate) fn strip_height(&self) -> f64 {
        ROW * self.active().len() as f64
    }

    /// Draws the rows from `top` downward, the first in the order of the lanes on top, over an axis of seconds.
    pub(crate) fn draw_strip(&self, svg: &mut Svg, x: &Axis, top: f64) {
        for (row, (bit, _)) in self.active().into_iter().enumerate() {
            let y = top + ROW * (row as f64 + 0.5);
            let mut d = String::new();
            for [from, to] in self.bars(bit, x) {
                d += &format!("M{} {}H{}", num(from), num(y), num(to));
            }
            svg.path(&d, &format!("stroke=\"{}\" stroke-width=\"{BAR}\" fill=\"none\"", COLOURS[bit]));
            svg.text([x.pixels[1] + 6.0, y + 4.0], "start", "small", &self.effects[bit]);
        }
    }

    /// From and to which pixel an effect is active: at least a pixel each, and with as much between them.
    pub(super) fn bars(&self, bit: usize, x: &Axis) -> Vec<[f64; 2]> {
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
