//! Place and turn of a surface.

use asperity_diagnostics::Diagnostic;
use asperity_numbers::Elementary as _;

use super::vector::{Vector, dot, sub};

/// Size of the world in millimetres. No place may be further from its middle along an axis, and no thing
/// may be larger. Sums of such numbers are exact to 1e-10 mm.
pub const WORLD_MM: f64 = 1e5;

/// A place in millimetres and a turn.
///
/// The turn is given in degrees about x, then about y, then about z. These are the world's axes, which do
/// not turn: `R = R_z R_y R_x`. A positive turn about z takes x to y, one about x takes y to z, one about
/// y takes z to x. The pose stores the matrix. Its rows and columns are of length 1 and at right angles
/// within 1e-15. Quarter turns are exact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    place_mm: Vector,
    /// Matrix, row by row. It takes a vector from coordinates of the thing to those of the world.
    turn: [Vector; 3],
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Pose {
    /// Pose at the middle of the world, not turned.
    pub const IDENTITY: Self =
        Self { place_mm: [0.0; 3], turn: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

    /// Makes a pose from a place, and turns in degrees about x, then y, then z.
    ///
    /// # Errors
    /// The place is not within [`WORLD_MM`] of the middle along each axis. A turn is not a number, or
    /// beyond 3600 degrees.
    pub fn new(place_mm: [f64; 3], turn_deg: [f64; 3]) -> Result<Self, Diagnostic> {
        for (axis, (at, by)) in ["x", "y", "z"].into_iter().zip(place_mm.into_iter().zip(turn_deg)) {
            if !(-WORLD_MM..=WORLD_MM).contains(&at) {
                return Err(Diagnostic::new(format!("a place at {axis} = {at} mm"))
                    .help(format!("a number from -{WORLD_MM} to {WORLD_MM} mm")));
            }
            if !(-3600.0..=3600.0).contains(&by) {
                return Err(Diagnostic::new(format!("a turn of {by} degrees about {axis}"))
                    .help("degrees from -3600 to 3600, about x, then y, then z"));
            }
        }
        let [(sx, cx), (sy, cy), (sz, cz)] = turn_deg.map(sine_and_cosine);
        // Adding 0.0 turns -0 into 0.
        let turn = [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
        .map(|row| row.map(|x| x + 0.0));
        Ok(Self { place_mm, turn })
    }

    /// Place in millimetres.
    pub fn place_mm(&self) -> [f64; 3] {
        self.place_mm
    }

    /// Turn, row by row. Its columns are the thing's x, y and z in coordinates of the world.
    pub fn turn(&self) -> [[f64; 3]; 3] {
        self.turn
    }

    /// Converts a point of the world to coordinates of the thing.
    pub fn to_local(&self, point_mm: [f64; 3]) -> [f64; 3] {
        self.vector_to_local(sub(point_mm, self.place_mm))
    }

    /// Converts a point of the thing to coordinates of the world.
    pub fn to_world(&self, point_mm: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.vector_to_world(point_mm);
        [x + self.place_mm[0], y + self.place_mm[1], z + self.place_mm[2]]
    }

    /// Converts a direction, velocity or force of the world to coordinates of the thing.
    pub fn vector_to_local(&self, vector: [f64; 3]) -> [f64; 3] {
        let [a, b, c] = self.turn;
        let [x, y, z] = vector;
        [a[0] * x + b[0] * y + c[0] * z, a[1] * x + b[1] * y + c[1] * z, a[2] * x + b[2] * y + c[2] * z]
    }

    /// Converts a direction, velocity or force of the thing to coordinates of the world.
    pub fn vector_to_world(&self, vector: [f64; 3]) -> [f64; 3] {
        self.turn.map(|row| dot(row, vector))
    }

    /// Direction in the world of an axis of the thing: 0 for x, 1 for y, else z.
    pub(super) fn axis(&self, axis: usize) -> Vector {
        self.turn.map(|[x, y, z]| match axis {
            0 => x,
            1 => y,
            _ => z,
        })
    }
}

/// Sine and cosine of an angle in degrees. The angle is first reduced to within 45 degrees of a quarter
/// turn, so that quarter turns are exact.
fn sine_and_cosine(degrees: f64) -> (f64, f64) {
    let quarters = (degrees / 90.0).round();
    let (sin, cos) = (degrees - 90.0 * quarters).to_radians().sine_cosine();
    match (quarters as i64).rem_euclid(4) {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

#[cfg(test)]
impl Pose {
    /// The same pose, moved along the world's axes.
    pub(super) fn moved(self, by: Vector) -> Self {
        Self { place_mm: std::array::from_fn(|k| self.place_mm[k] + by[k]), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::vector::cross;
    use proptest::prelude::*;

    fn near(a: Vector, b: Vector) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn turns_about_x_y_z_match_hand_calculation() {
        // R_z(90) R_y(90) R_x(90): x -> x -> -z -> -z; y -> z -> x -> y; z -> -y -> -y -> x.
        let pose = Pose::new([1.0, 2.0, 3.0], [90.0, 90.0, 90.0]).unwrap();
        assert_eq!(pose.turn(), [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]);
        assert_eq!(pose.to_world([10.0, 20.0, 30.0]), [31.0, 22.0, -7.0]);
        // In the other order, z first, x would go to y, then z.
        assert_eq!(pose.vector_to_world([1.0, 0.0, 0.0]), [0.0, 0.0, -1.0]);

        // R_z(60) R_y(45) R_x(30) by hand, with r = sqrt(2), t = sqrt(3).
        let (r, t) = (2.0_f64.sqrt(), 3.0_f64.sqrt());
        let want = [
            [r / 4.0, r / 8.0 - 0.75, r * t / 8.0 + t / 4.0],
            [r * t / 4.0, r * t / 8.0 + t / 4.0, 3.0 * r / 8.0 - 0.25],
            [-r / 2.0, r / 4.0, r * t / 4.0],
        ];
        let found = Pose::new([0.0; 3], [30.0, 45.0, 60.0]).unwrap().turn();
        assert!((0..3).all(|i| near(found[i], want[i])), "{found:?}");
    }

    #[test]
    fn quarter_turns_are_exact_however_many() {
        for quarters in -40..=40 {
            let turn = Pose::new([0.0; 3], [0.0, 0.0, 90.0 * f64::from(quarters)]).unwrap().turn();
            let want: [f64; 2] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][(quarters & 3) as usize];
            assert_eq!([turn[0][0], turn[1][0]], want, "{quarters}");
        }
    }

    #[test]
    fn places_and_turns_out_of_range_are_refused_by_axis() {
        let place = |p| Pose::new(p, [0.0; 3]).unwrap_err().to_string();
        assert!(place([0.0, f64::NAN, 0.0]).starts_with("a place at y = NaN mm (a number from -100000"));
        assert!(place([0.0, 0.0, -1.1e5]).contains("z = -110000"));
        let turn = |t| Pose::new([0.0; 3], t).unwrap_err().to_string();
        assert!(turn([f64::INFINITY, 0.0, 0.0]).starts_with("a turn of inf degrees about x"));
        assert!(turn([0.0, 0.0, -3601.0]).contains("about z"));
    }

    proptest! {
        #[test]
        fn turn_is_a_rotation_and_coordinates_round_trip(
            place in proptest::array::uniform3(-1e3..1e3f64),
            turn in proptest::array::uniform3(-720.0..720.0f64),
            point in proptest::array::uniform3(-1e3..1e3f64),
        ) {
            let pose = Pose::new(place, turn).unwrap();
            let [a, b, c] = pose.turn();
            for (row, other) in [(a, b), (b, c), (c, a)] {
                prop_assert!((dot(row, row) - 1.0).abs() < 1e-14 && dot(row, other).abs() < 1e-14);
            }
            prop_assert!(near(cross(a, b), c), "a mirror");
            for axis in 0..3 {
                let mut one = [0.0; 3];
                one[axis] = 1.0;
                prop_assert_eq!(pose.axis(axis), pose.vector_to_world(one));
            }
            let (there, back) = (pose.to_local(point), pose.to_world(pose.to_local(point)));
            prop_assert!(back.iter().zip(point).all(|(a, b)| (a - b).abs() < 1e-11));
            let vector = sub(point, place);
            prop_assert!(near(pose.vector_to_local(vector), there));
        }
    }
}
