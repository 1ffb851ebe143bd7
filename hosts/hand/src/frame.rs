//! Axes of a device and of the graph.

use asperity_motion::AxisMap;

use crate::HandError;

/// Maps a device's positions to the graph's axes (z up, mm), and forces back.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame {
    axes: AxisMap,
    origin: [f64; 3],
}

impl Frame {
    /// `axes`: the device's axis for each of the graph's x, y, z, as for a trajectory: `x,-z,y` for a
    /// device whose vertical is y. `origin_mm`: the point, in the graph's axes, that becomes 0, 0, 0.
    ///
    /// # Errors
    /// Axes that are not x, y and z once each; an origin that is not finite.
    pub fn new(axes: &str, origin_mm: [f64; 3]) -> Result<Self, HandError> {
        let axes = AxisMap::parse(axes)
            .map_err(|e| HandError::option(e.message.clone(), e.help.unwrap_or_default()))?;
        if origin_mm.iter().any(|x| !x.is_finite()) {
            return Err(HandError::option(
                format!("the origin {origin_mm:?} is not finite"),
                "give three numbers in mm",
            ));
        }
        Ok(Self { axes, origin: origin_mm })
    }

    /// Position of the device in mm, in the graph's axes.
    pub fn position(&self, device_mm: [f64; 3]) -> [f64; 3] {
        let p = self.axes.apply(device_mm);
        [p[0] - self.origin[0], p[1] - self.origin[1], p[2] - self.origin[2]]
    }

    /// Force in the device's axes. The map permutes and flips axes only, so its inverse is its transpose.
    pub fn force(&self, graph: [f64; 3]) -> [f64; 3] {
        let unit = |i: usize| self.axes.apply([0, 1, 2].map(|k| if k == i { 1.0 } else { 0.0 }));
        [0, 1, 2].map(|i| {
            let column = unit(i);
            column[0] * graph[0] + column[1] * graph[1] + column[2] * graph[2]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertical_force_maps_to_the_device_vertical() {
        let frame = Frame::new("x,-z,y", [0.0, 0.0, 10.0]).unwrap();
        // 25 mm up the device's y, 3 mm toward the user.
        assert_eq!(frame.position([1.0, 25.0, 3.0]), [1.0, -3.0, 15.0]);
        assert_eq!(frame.force([0.0, 0.0, 2.0]), [0.0, 2.0, 0.0]);
        assert_eq!(frame.force([0.0, 1.0, 0.0]), [0.0, 0.0, -1.0]);
    }

    #[test]
    fn work_is_equal_in_both_frames() {
        for axes in ["x,y,z", "z,x,y", "-y,x,z", "x,-z,y", "-z,-y,-x"] {
            let frame = Frame::new(axes, [0.0; 3]).unwrap();
            let (move_, force) = ([0.3, -1.2, 2.5], [1.0, 4.0, -0.7]);
            let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let (there, here) = (dot(frame.force(force), move_), dot(force, frame.position(move_)));
            assert!((there - here).abs() < 1e-12, "{axes}: {there} against {here}");
        }
    }

    #[test]
    fn wrong_axes_error_names_valid_axes() {
        let e = Frame::new("x,y", [0.0; 3]).unwrap_err();
        assert!(e.to_string().contains("has 2") && e.help.contains("x,-z,y"), "{e}");
        assert!(Frame::new("x,y,z", [f64::NAN, 0.0, 0.0]).is_err());
    }
}
