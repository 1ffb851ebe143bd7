//! A shape in its place.

use super::shape::Form;
use super::{Pose, Shape, Touch};

/// A point further than this from the world's middle along an axis touches nothing.
pub(super) const FAR_MM: f64 = 1e6;

/// A shape in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// What it is.
    pub shape: Shape,
    /// Where it is.
    pub pose: Pose,
}

impl Surface {
    /// How deep a point of the world is inside, as [`Shape::depth_mm`] says. Minus infinity for a point that is not finite or ten times as far as the world
    /// is large.
    pub fn depth_mm(&self, point_mm: [f64; 3]) -> f64 {
        if near(point_mm) { self.shape.depth_mm(self.pose.to_local(point_mm)) } else { f64::NEG_INFINITY }
    }

    /// [`depth_mm`](Self::depth_mm) of a point that is near, and outside perhaps minus infinity unless that is asked for.
    #[inline]
    pub(super) fn depth<const OUTSIDE: bool>(&self, point_mm: [f64; 3]) -> f64 {
        self.shape.depth::<OUTSIDE>(self.pose.to_local(point_mm))
    }

    /// Where and how a point of the world touches, as [`Shape::touch`] says, with directions of the world.
    pub fn touch(&self, point_mm: [f64; 3], last: Option<u8>, hysteresis_mm: f64) -> Option<Touch> {
        if !near(point_mm) {
            return None;
        }
        let touch = self.shape.touch(self.pose.to_local(point_mm), last, hysteresis_mm)?;
        Some(Touch {
            normal: self.pose.vector_to_world(touch.normal),
            tangents: touch.tangents.map(|t| self.pose.vector_to_world(t)),
            ..touch
        })
    }

    /// What two surfaces have in common that are touched alike everywhere.
    pub(super) fn key(&self) -> [u64; 20] {
        let mut key = [0; 20];
        let mut put = 0;
        let mut add = |bits: u64| {
            if let Some(to) = key.get_mut(put) {
                *to = bits;
            }
            put += 1;
        };
        self.pose.place_mm().iter().for_each(|x| add(x.to_bits()));
        self.pose.turn().iter().flatten().for_each(|x| add(x.to_bits()));
        match self.shape.form() {
            Form::Plane => add(1),
            Form::Sphere { radius_mm } => [2, radius_mm.to_bits()].into_iter().for_each(add),
            Form::Rectangle { size_mm: [x, y], thickness_mm: t } => {
                [3, x.to_bits(), y.to_bits(), t.to_bits()].into_iter().for_each(add);
            }
            Form::Box { size_mm: [x, y, z] } => {
                [4, x.to_bits(), y.to_bits(), z.to_bits()].into_iter().for_each(add);
            }
            Form::Relief(r) => {
                let ([x, y], grid) = (r.size_mm(), std::sync::Arc::as_ptr(r.grid()) as usize as u64);
                let all =
                    [5, grid, x.to_bits(), y.to_bits(), r.scale().to_bits(), r.thickness_mm().to_bits()];
                all.into_iter().for_each(add);
            }
        }
        key
    }
}

pub(super) fn near(point_mm: [f64; 3]) -> bool {
    point_mm.iter().all(|x| (-FAR_MM..=FAR_MM).contains(x))
}
