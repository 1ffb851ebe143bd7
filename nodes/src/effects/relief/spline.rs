use super::Jet;
use asperity_surfaces::topography::HeightField;

/// Points along a line that make a height.
const POINTS: usize = 6;
/// Of these, points before the place.
const BEFORE: i64 = 2;
/// Roots within the unit circle of z^2 + 26 z + 66 + 26 / z + 1 / z^2. Its coefficients are 120 times the
/// spline's values at the points.
const ROOTS: [f64; 2] = [-0.430_575_347_099_973_8, -0.043_096_288_203_264_65];

/// A [`HeightField`] between its points as a periodic spline of fifth degree (M. Unser, A. Aldroubi, M. Eden,
/// "B-spline signal processing", IEEE Transactions on Signal Processing 41, 1993). It goes through all
/// points, has four continuous derivatives and returns two of them.
///
/// Error of the second derivative, and level of its mirror image, for a wave of so many points:
///
/// | points | 16 | 8 | 5 | 4 | 3 |
/// |---|---|---|---|---|---|
/// | off, dB | 0.0000 | -0.0001 | -0.0023 | -0.013 | -0.14 |
/// | image, dB | < -90 | -67 | -48 | -38 | -24 |
///
/// A position takes 68 ns on a virtual AMD EPYC core; a field of 1024 x 1024 points is made in 50 ms.
#[derive(Clone, Debug)]
pub(crate) struct HeightSpline {
    side: usize,
    /// Points of a row with those of its beginning that stand again behind its end.
    stride: usize,
    step_mm: f64,
    coefficients: Vec<f32>,
}

impl HeightSpline {
    /// The spline through a field. Points that are not finite count as 0.
    pub(crate) fn new(field: &HeightField) -> Self {
        let side = field.side();
        let mut all: Vec<f64> =
            field.heights().iter().map(|h| if h.is_finite() { f64::from(*h) } else { 0.0 }).collect();
        all.resize(side * side, 0.0);
        let mut line = vec![0.0; side];
        all.chunks_exact_mut(side).for_each(prefilter);
        for column in 0..side {
            for (to, row) in line.iter_mut().zip(all.chunks_exact(side)) {
                *to = row[column];
            }
            prefilter(&mut line);
            for (from, row) in line.iter().zip(all.chunks_exact_mut(side)) {
                row[column] = *from;
            }
        }
        let stride = side + POINTS - 1;
        let rows = (0..stride).map(|row| &all[row % side * side..][..side]);
        let coefficients = rows.flat_map(|row| (0..stride).map(move |i| row[i % side] as f32)).collect();
        let step_mm = if field.step_mm() > 0.0 { field.step_mm() } else { 1.0 };
        Self { side, stride, step_mm, coefficients }
    }

    /// The first of the points about a place, in points, and how far the place is behind its third one.
    #[inline]
    fn about(&self, place: f64) -> (usize, f64) {
        let near = place as i64;
        let whole = near - i64::from(place < near as f64);
        let first = whole - BEFORE;
        // A division takes as long as much of the rest.
        let first = if self.side.is_power_of_two() {
            first as usize & (self.side - 1)
        } else {
            first.rem_euclid(self.side as i64) as usize
        };
        (first, (place - whole as f64).clamp(0.0, 1.0))
    }

    /// Height and derivatives at a position in mm.
    #[inline]
    pub(crate) fn jet(&self, x_mm: f64, y_mm: f64) -> Jet {
        let per_mm = 1.0 / self.step_mm;
        let ((column, u), (row, v)) = (self.about(x_mm * per_mm), self.about(y_mm * per_mm));
        let (along, across) = (weights(u), weights(v));
        // Of each row the height and its derivatives along it.
        let mut sums = [0.0; 6];
        let [w0, w1, w2] = &across;
        for (j, ((w, w1), w2)) in w0.iter().zip(w1).zip(w2).enumerate() {
            let start = (row + j) * self.stride + column;
            let Some(points) = self.coefficients.get(start..start + POINTS) else { continue };
            let mut line = [0.0; 3];
            for (i, point) in points.iter().enumerate() {
                let c = f64::from(*point);
                for (line, along) in line.iter_mut().zip(&along) {
                    *line += along[i] * c;
                }
            }
            sums[0] += w * line[0];
            sums[1] += w * line[1];
            sums[2] += w1 * line[0];
            sums[3] += w * line[2];
            sums[4] += w1 * line[1];
            sums[5] += w2 * line[0];
        }
        let [height_mm, x, y, xx, xy, yy] = sums;
        let square = per_mm * per_mm;
        Jet {
            height_mm,
            slope: [x * per_mm, y * per_mm],
            curve_per_mm: [xx * square, xy * square, yy * square],
        }
    }

    /// Distance of the points in mm.
    pub(crate) fn step_mm(&self) -> f64 {
        self.step_mm
    }
}

/// Weights of the points about a position `t` of 0 to 1 between the third and the fourth, and their first and
/// second derivatives. They follow from the recursion of de Boor and Cox, on points that are 1 apart.
#[inline]
fn weights(t: f64) -> [[f64; POINTS]; 3] {
    let mut w = [0.0; POINTS];
    w[0] = 1.0;
    let (mut third, mut fourth) = (w, w);
    for degree in 1..POINTS {
        if degree == 4 {
            third = w;
        } else if degree == 5 {
            fourth = w;
        }
        let (d, part, before) = (degree as f64, 1.0 / degree as f64, w);
        for (j, w) in w.iter_mut().enumerate().take(degree + 1) {
            let left = if j > 0 { before[j - 1] } else { 0.0 };
            *w = ((t + d - j as f64) * left + (1.0 - t + j as f64) * before[j]) * part;
        }
    }
    let left = |of: &[f64; POINTS], j: usize, by: usize| if j >= by { of[j - by] } else { 0.0 };
    [
        w,
        std::array::from_fn(|j| left(&fourth, j, 1) - fourth[j]),
        std::array::from_fn(|j| left(&third, j, 2) - 2.0 * left(&third, j, 1) + third[j]),
    ]
}

/// Turns a closed line of values into the coefficients of the spline through them.
fn prefilter(line: &mut [f64]) {
    let len = line.len();
    for z in ROOTS {
        let closed = 1.0 / (1.0 - z.powi(i32::try_from(len).unwrap_or(i32::MAX)));
        // Powers beyond this are below rounding.
        let reach = len.min(64);
        let mut state = (0..reach).rev().fold(0.0, |sum, k| z * sum + line[(len - k) % len]) * closed;
        let gain = (1.0 - z) * (1.0 - 1.0 / z);
        line[0] = state;
        for x in line.iter_mut().skip(1) {
            state = *x + z * state;
            *x = state;
        }
        let mut state =
            (0..reach).rev().fold(0.0, |sum, k| z * sum + line[(len - 1 + k) % len]) * -z * closed;
        line[len - 1] = state * gain;
        for x in line.iter_mut().rev().skip(1) {
            state = z * (state - *x);
            *x = state * gain;
        }
    }
}
