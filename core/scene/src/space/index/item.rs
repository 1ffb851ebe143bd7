//! Surfaces as a tree is made of them.

use super::super::shape::Form;
use super::super::vector::{Vector, dot, least, most, norm, sub};
use super::Entry;

/// A surface that is to go into a tree.
pub(super) struct Item {
    /// The entry's number.
    pub entry: u32,
    /// How far off it is felt.
    pub reach: f64,
    /// Which of the tree's frames is its own.
    pub frame: u32,
    /// Its axes as the world sees them.
    pub axes: [Vector; 3],
    /// The point its box is counted from; of an endless plane the one nearest to the middle of the scene.
    pub place: Vector,
    /// Where it is touched, in its own coordinates from `place` on.
    low: Vector,
    high: Vector,
    round: bool,
    /// How deep one can be in it.
    pub most: f64,
    /// Heights between which the top of a sheet lies, above `place`.
    pub top: [f64; 2],
    /// Radius of the ball around `place` that holds a solid.
    pub ball: f64,
    /// Half the longest edge of a solid.
    pub widest: f64,
}

impl Item {
    /// An entry by number, in a scene around a point.
    pub(super) fn new(number: usize, entry: &Entry, middle: Vector) -> Self {
        let pose = &entry.surface.pose;
        let endless = f64::INFINITY;
        let mut item = Self {
            entry: number as u32,
            reach: entry.reach_mm,
            frame: 0,
            axes: [0, 1, 2].map(|k| pose.axis(k)),
            place: pose.place_mm(),
            low: [0.0; 3],
            high: [0.0; 3],
            round: false,
            most: endless,
            top: [0.0; 2],
            ball: 0.0,
            widest: 0.0,
        };
        match entry.surface.shape.form() {
            Form::Plane => {
                let normal = item.axes[2];
                let off = dot(normal, sub(item.place, middle));
                item.place = std::array::from_fn(|k| middle[k] + off * normal[k]);
                (item.low, item.high) = ([-endless; 3], [endless, endless, 0.0]);
            }
            Form::Rectangle { size_mm: [x, y], thickness_mm } => {
                (item.low, item.high) = ([-0.5 * x, -0.5 * y, -thickness_mm], [0.5 * x, 0.5 * y, 0.0]);
                item.most = *thickness_mm;
            }
            Form::Relief(relief) => {
                let ([x, y], [low, high]) = (relief.size_mm(), relief.bounds_mm());
                item.most = relief.thickness_mm();
                (item.low, item.high) = ([-0.5 * x, -0.5 * y, low - item.most], [0.5 * x, 0.5 * y, high]);
                item.top = [low, high];
            }
            Form::Sphere { radius_mm } => {
                (item.low, item.high) = ([-radius_mm; 3], [*radius_mm; 3]);
                (item.most, item.ball, item.widest) = (*radius_mm, *radius_mm, *radius_mm);
                // However it is turned.
                item.round = true;
                item.axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            }
            Form::Box { size_mm } => {
                let half = size_mm.map(|s| 0.5 * s);
                (item.low, item.high) = (half.map(|h| -h), half);
                item.most = least(least(half[0], half[1]), half[2]);
                item.widest = most(most(half[0], half[1]), half[2]);
                item.ball = norm(half);
            }
        }
        item
    }

    /// Least and greatest coordinates in a frame, in which it lies at `place`, and which may be its own.
    pub(super) fn bounds(&self, frame: &[Vector; 3], place: Vector, own: bool) -> [Vector; 2] {
        if own || self.round {
            return [self.low, self.high].map(|corner| std::array::from_fn(|k| place[k] + corner[k]));
        }
        let (mut low, mut high) = (place, place);
        for k in 0..3 {
            for j in 0..3 {
                let along = dot(frame[k], self.axes[j]);
                // Nothing times endless is nothing.
                if along != 0.0 {
                    let (a, b) = (along * self.low[j], along * self.high[j]);
                    low[k] += least(a, b);
                    high[k] += most(a, b);
                }
            }
        }
        [low, high]
    }
}

/// An item by number, and what is known of it in the frame of those that it is with.
#[derive(Clone, Copy, Default)]
pub(super) struct Boxed {
    pub item: u32,
    pub place: Vector,
    pub low: Vector,
    pub high: Vector,
    /// Of a sheet: how far it lies above the midst of all, along its own normal.
    pub above: f64,
    /// By what it is sorted.
    pub key: f64,
}

/// What surfaces are sorted by.
#[derive(Clone, Copy)]
pub(super) enum Key {
    /// A least coordinate.
    Low(usize),
    /// A greatest coordinate.
    High(usize),
    /// A coordinate of the middle.
    Place(usize),
    /// The height of a sheet.
    Above,
    /// A coordinate of the normal.
    Normal(usize),
    /// Which frame.
    Turn,
    /// The longest edge.
    Size,
    /// The entry's number alone, which decides between all that are equal.
    Number,
}

impl Key {
    pub(super) fn of(self, item: &Item, boxed: &Boxed) -> f64 {
        match self {
            Self::Low(k) => boxed.low[k],
            Self::High(k) => boxed.high[k],
            Self::Place(k) => boxed.place[k],
            Self::Above => boxed.above,
            Self::Normal(k) => item.axes[2][k],
            Self::Turn => f64::from(item.frame),
            Self::Size => item.widest,
            Self::Number => 0.0,
        }
    }
}
