//! Surfaces in the form from which a tree is built.

use super::super::shape::Form;
use super::super::vector::{Vector, dot, least, most, norm, sub};
use super::Entry;

/// A surface that goes into a tree.
pub(super) struct Item {
    /// Number of the entry.
    pub entry: u32,
    /// Distance from which it is felt.
    pub reach: f64,
    /// Number of its own frame among those of the tree.
    pub frame: u32,
    /// Its axes in coordinates of the world.
    pub axes: [Vector; 3],
    /// Origin of its box. For an endless plane it is the point nearest to the middle of the scene.
    pub place: Vector,
    /// Box in which it is touched, in its own coordinates from `place` on.
    low: Vector,
    high: Vector,
    round: bool,
    /// Largest depth inside.
    pub most: f64,
    /// Bounds of the heights of a sheet's top above `place`.
    pub top: [f64; 2],
    /// Radius of the ball around `place` that holds a solid.
    pub ball: f64,
    /// Half the longest edge of a solid.
    pub widest: f64,
}

impl Item {
    /// Makes an item from an entry and its number, in a scene around a point.
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
                // The same however it is turned.
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

    /// Least and greatest coordinates in a frame. The item lies at `place` in that frame. `own` says that
    /// the frame is its own.
    pub(super) fn bounds(&self, frame: &[Vector; 3], place: Vector, own: bool) -> [Vector; 2] {
        if own || self.round {
            return [self.low, self.high].map(|corner| std::array::from_fn(|k| place[k] + corner[k]));
        }
        let (mut low, mut high) = (place, place);
        for k in 0..3 {
            for j in 0..3 {
                let along = dot(frame[k], self.axes[j]);
                // 0 times infinity counts as 0.
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

/// Number of an item, and its figures in the frame of its group.
#[derive(Clone, Copy, Default)]
pub(super) struct Boxed {
    pub item: u32,
    pub place: Vector,
    pub low: Vector,
    pub high: Vector,
    /// For a sheet: height above the midst of all, along its own normal.
    pub above: f64,
    /// Value by which it is sorted.
    pub key: f64,
}

/// Key by which surfaces are sorted.
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
    /// Number of the frame.
    Turn,
    /// The longest edge.
    Size,
    /// Number of the entry alone, which decides between equals.
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
