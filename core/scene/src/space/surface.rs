//! A shape at a pose.

use super::{Pose, Shape, Touch};

/// Distance from the world's middle along an axis beyond which a point touches nothing.
pub(super) const FAR_MM: f64 = 1e6;

/// A shape at a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// The shape.
    pub shape: Shape,
    /// Its pose.
    pub pose: Pose,
}

impl Surface {
    /// Depth of a point of the world inside the surface, as in [`Shape::depth_mm`]. Minus infinity for a
    /// point that is not finite, or ten times as far off as the world is large.
    pub fn depth_mm(&self, point_mm: [f64; 3]) -> f64 {
        if near(point_mm) { self.depth(point_mm) } else { f64::NEG_INFINITY }
    }

    /// [`depth_mm`](Self::depth_mm) of a near point.
    #[inline]
    pub(super) fn depth(&self, point_mm: [f64; 3]) -> f64 {
        self.shape.depth_mm(self.pose.to_local(point_mm))
    }

    /// Touch of a point of the world, as in [`Shape::touch`], with directions of the world.
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
}

pub(super) fn near(point_mm: [f64; 3]) -> bool {
    point_mm.iter().all(|x| (-FAR_MM..=FAR_MM).contains(x))
}
