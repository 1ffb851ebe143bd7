//! A shape at a pose.

use super::shape::Form;
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
        if near(point_mm) { self.shape.depth_mm(self.pose.to_local(point_mm)) } else { f64::NEG_INFINITY }
    }

    /// [`depth_mm`](Self::depth_mm) of a near point. Outside it may be minus infinity, unless `OUTSIDE`
    /// is set.
    #[inline]
    pub(super) fn depth<const OUTSIDE: bool>(&self, point_mm: [f64; 3]) -> f64 {
        self.shape.depth::<OUTSIDE>(self.pose.to_local(point_mm))
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

    /// Key that is equal for two surfaces that are touched alike everywhere.
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
