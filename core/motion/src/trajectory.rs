//! A recorded stroke, at any rate and also irregular.

use super::Sample;

/// Interpolation of positions between rows. Force and speed are always interpolated linearly.
///
/// The velocity downstream is a difference of positions. Straight lines make it a staircase at the
/// recording's rate. The 20 Hz filter passes that if the rate is the 20 to 50 Hz of a tablet or a
/// camera. The cubic's velocity is continuous. Unlike other splines it never leaves the range of its
/// two rows, so that a rounded or resting position grows no ripple.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Shape-preserving piecewise cubic (PCHIP).
    #[default]
    Cubic,
    /// Straight lines.
    Linear,
}

/// How the stylus goes from the end of a repeated stroke to its start: lift-off, way back, landing \[s\].
const BACK_S: [f64; 3] = [0.2, 0.5, 0.2];
/// Height of the way back above both ends \[mm\].
const BACK_MM: f64 = 10.0;

/// Row of the last sample, so that the next needs no search.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cursor(usize);

/// A recorded stroke: at least two rows with strictly rising time, all finite.
///
/// Time runs from 0 at the first row to [`duration_s`](Self::duration_s) at the last. Before and after,
/// the first and the last row hold. NaN counts as 0.
#[derive(Clone, Debug)]
pub struct Trajectory {
    /// Seconds after the first row.
    pub(super) time: Vec<f64>,
    pub(super) position: Vec<[f64; 3]>,
    /// Slopes in mm/s at the rows. Empty for linear interpolation.
    pub(super) slope: Vec<[f64; 3]>,
    pub(super) force: Option<Vec<f64>>,
    pub(super) speed: Option<Vec<f64>>,
    pub(super) stroke: Option<Vec<f64>>,
    /// Whether it begins again at its end.
    pub(super) repeats: bool,
    pub(super) ignored: Vec<String>,
}

impl Trajectory {
    /// Seconds from the first row to the last, above 0.
    pub fn duration_s(&self) -> f64 {
        self.time.last().copied().unwrap_or(0.0)
    }

    /// The stroke without an end. Where its ends differ, the stylus lifts off, moves back in the air with
    /// neither force nor speed, and lands at the start, so that nothing jumps.
    pub fn repeated(mut self) -> Self {
        let (first, last) = (self.position[0], self.position[self.rows() - 1]);
        self.repeats = true;
        let closes = |column: &Option<Vec<f64>>| column.as_ref().is_none_or(|c| c.first() == c.last());
        if first == last && closes(&self.force) && closes(&self.speed) {
            return self;
        }
        let top = first[2].max(last[2]) + BACK_MM;
        let way = [[last[0], last[1], top], [first[0], first[1], top], first];
        for (seconds, position) in BACK_S.into_iter().zip(way) {
            self.time.push(self.duration_s() + seconds);
            self.position.push(position);
        }
        for column in [&mut self.force, &mut self.speed].into_iter().flatten() {
            column.extend([0.0, 0.0, column[0]]);
        }
        if let Some(stroke) = &mut self.stroke {
            stroke.resize(self.time.len(), stroke[stroke.len() - 1]);
        }
        if !self.slope.is_empty() {
            self.slope = slopes(&self.time, &self.position);
        }
        self
    }

    /// Number of rows, 2 or more.
    pub fn rows(&self) -> usize {
        self.time.len()
    }

    /// Whether a normal force was recorded. Then every sample has one.
    pub fn has_force(&self) -> bool {
        self.force.is_some()
    }

    /// Whether a speed was recorded. Then every sample has one.
    pub fn has_speed(&self) -> bool {
        self.speed.is_some()
    }

    /// Whether the strokes were counted. Then every sample has the number of its stroke.
    pub fn has_strokes(&self) -> bool {
        self.stroke.is_some()
    }

    /// Columns of the file that nobody reads.
    pub fn ignored(&self) -> &[String] {
        &self.ignored
    }

    /// The stylus `t` seconds after the first row. Searches at every call; see
    /// [`sample_from`](Self::sample_from).
    pub fn sample(&self, t: f64) -> Sample {
        self.sample_from(&mut Cursor::default(), t)
    }

    /// The stylus `t` seconds after the first row, searched from `cursor`. Takes constant time if `t`
    /// moves by about a row, else logarithmic time. Does not allocate. The cursor never changes the
    /// result, and may come from another trajectory.
    pub fn sample_from(&self, cursor: &mut Cursor, t: f64) -> Sample {
        let last = self.time.len() - 2;
        let t = if t > 0.0 { t } else { 0.0 };
        let t = if self.repeats && t.is_finite() { t % self.duration_s() } else { t };
        let starts_after = |i: usize| self.time[i] > t;
        let mut row = cursor.0.min(last);
        if starts_after(row) || (row < last && !starts_after(row + 1)) {
            row += 1;
            if row > last || starts_after(row) || (row < last && !starts_after(row + 1)) {
                row = self.time.partition_point(|v| *v <= t).saturating_sub(1).min(last);
            }
        }
        cursor.0 = row;

        let step = self.time[row + 1] - self.time[row];
        let mut part = ((t - self.time[row]) / step).min(1.0);
        let stroke = self.stroke.as_ref().map(|number| {
            // Nothing lies between two strokes.
            if number[row] != number[row + 1] {
                part = part.floor();
            }
            number[if part < 1.0 { row } else { row + 1 }]
        });
        let (from, to) = (self.position[row], self.position[row + 1]);
        let line = |a: f64, b: f64| a + part * (b - a);
        let value = |column: &Option<Vec<f64>>| column.as_ref().map(|c| line(c[row], c[row + 1]));
        let position = if self.slope.is_empty() {
            [0, 1, 2].map(|k| line(from[k], to[k]))
        } else {
            let (d0, d1) = (self.slope[row], self.slope[row + 1]);
            [0, 1, 2].map(|k| hermite(from[k], to[k], d0[k], d1[k], step, part))
        };
        Sample { position, force: value(&self.force), speed: value(&self.speed), stroke }
    }
}

/// Slopes of every axis at the rows; see [`pchip_slopes`].
pub(super) fn slopes(time: &[f64], position: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let [x, y, z] = [0, 1, 2].map(|axis| {
        let values: Vec<f64> = position.iter().map(|p| p[axis]).collect();
        pchip_slopes(time, &values)
    });
    x.into_iter().zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect()
}

/// Slopes of the shape-preserving piecewise cubic (PCHIP) through `(x, y)`: F. N. Fritsch, J. Butland, "A
/// method for constructing local monotone piecewise cubic interpolants", SIAM J. Sci. Stat. Comput. 5, 1984,
/// with three-point ends limited as there. `x` rises strictly. Both have one length, 2 or more.
fn pchip_slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let step: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let secant: Vec<f64> = y.windows(2).zip(&step).map(|(w, h)| (w[1] - w[0]) / h).collect();
    let mut slope = vec![0.0; y.len()];
    let ends = secant.len();
    if ends <= 1 {
        slope.fill(secant.first().copied().unwrap_or(0.0));
        return slope;
    }
    for k in 1..ends {
        let (a, b) = (secant[k - 1], secant[k]);
        if a * b > 0.0 {
            let (wa, wb) = (2.0 * step[k] + step[k - 1], step[k] + 2.0 * step[k - 1]);
            slope[k] = (wa + wb) / (wa / a + wb / b);
        }
    }
    slope[0] = end_slope(step[0], step[1], secant[0], secant[1]);
    slope[ends] = end_slope(step[ends - 1], step[ends - 2], secant[ends - 1], secant[ends - 2]);
    slope
}

/// Slope at an end, from the two nearest steps and secants, nearest first.
fn end_slope(h0: f64, h1: f64, m0: f64, m1: f64) -> f64 {
    let d = ((2.0 * h0 + h1) * m0 - h0 * m1) / (h0 + h1);
    if d * m0 <= 0.0 {
        0.0
    } else if m0 * m1 <= 0.0 && d.abs() > 3.0 * m0.abs() {
        3.0 * m0
    } else {
        d
    }
}

/// The cubic with values `y0`, `y1` and slopes `d0`, `d1` over a step `h`, at the part `s` of it.
fn hermite(y0: f64, y1: f64, d0: f64, d1: f64, h: f64, s: f64) -> f64 {
    let rise = y1 - y0;
    let (a, b) = (h * d0 - rise, rise - h * d1);
    y0 + s * (rise + (1.0 - s) * ((1.0 - s) * a + s * b))
}

#[cfg(test)]
mod tests {
    use super::super::{TrajectoryOptions, minimum_jerk};
    use super::*;
    use asperity_diagnostics::Source;
    use asperity_numbers::random::uniform;

    fn made(text: &str, interpolation: Interpolation) -> Trajectory {
        let options = TrajectoryOptions { interpolation, max_gap_s: Some(10.0), ..Default::default() };
        Trajectory::parse(&Source::new("t.csv", text), &options).unwrap()
    }

    #[test]
    fn rows_are_met_and_ends_are_held() {
        let text = "t_s,x_mm,y_mm,z_mm,force_n,speed_mm_s\n5,1,2,3,0,10\n6,2,0,-1,1,20\n8,4,5,-1,3,0\n";
        for kind in [Interpolation::Cubic, Interpolation::Linear] {
            let t = made(text, kind);
            assert_eq!((t.duration_s(), t.rows()), (3.0, 3));
            for early in [-1.0, 0.0, f64::NAN, f64::NEG_INFINITY] {
                assert_eq!(t.sample(early).position, [1.0, 2.0, 3.0]);
            }
            assert_eq!(t.sample(1.0).position, [2.0, 0.0, -1.0]);
            for late in [3.0, 4.0, f64::INFINITY] {
                let s = t.sample(late);
                assert_eq!((s.position, s.force, s.speed), ([4.0, 5.0, -1.0], Some(3.0), Some(0.0)));
            }
            let s = t.sample(2.0);
            assert_eq!((s.position[0], s.force, s.speed), (3.0, Some(2.0), Some(10.0)));
        }
        assert_eq!(made(text, Interpolation::Linear).sample(2.0).position, [3.0, 2.5, -1.0]);
    }

    #[test]
    fn nothing_lies_between_two_strokes() {
        let text = "t_s,x_mm,y_mm,z_mm,stroke\n0,1,0,0,4\n1,2,0,0,4\n60,50,0,0,5\n61,52,0,0,5\n";
        let source = Source::new("t.csv", text);
        for interpolation in [Interpolation::Cubic, Interpolation::Linear] {
            let options = TrajectoryOptions { interpolation, max_gap_s: Some(2.0), ..Default::default() };
            let t = Trajectory::parse(&source, &options).unwrap();
            let told = |at: f64| (t.sample(at).position[0], t.sample(at).stroke);
            assert_eq!(told(59.99), (2.0, Some(4.0)), "the stylus waits, for longer than a gap may be");
            assert_eq!(told(60.0), (50.0, Some(5.0)));
            assert_eq!(told(61.0), (52.0, Some(5.0)));
            assert_eq!(t.repeated().sample(61.5).stroke, Some(5.0));
        }
    }

    #[test]
    fn repeated_stroke_begins_again_without_a_jump() {
        let text = "t_s,x_mm,y_mm,z_mm,force_n\n0,0,0,-1,1\n0.5,20,0,-2,2\n1,60,10,-1,3\n";
        for kind in [Interpolation::Cubic, Interpolation::Linear] {
            let (once, t) = (made(text, kind), made(text, kind).repeated());
            let lap = t.duration_s();
            assert!((lap - 1.9).abs() < 1e-12);
            for i in 0..100 {
                let at = f64::from(i) * 0.01;
                assert_eq!(t.sample(at).force, once.sample(at).force);
                let [a, b] = [t.sample(at), t.sample(at + 3.0 * lap)].map(|s| s.position);
                assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-9), "{a:?} {b:?}");
            }
            let before = t.sample(1.0 + BACK_S[0] + 0.5 * BACK_S[1]);
            assert!(before.position[2] == 9.0 && before.force == Some(0.0), "{before:?}");
            for i in 0..8000 {
                let [a, b] = [i, i + 1].map(|i| t.sample(f64::from(i) * 1e-3).position);
                assert!((0..3).all(|k| (a[k] - b[k]).abs() < 0.3), "{i}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn closed_stroke_repeats_without_a_lift() {
        let text = "t_s,x_mm,y_mm,z_mm\n0,0,0,-1\n1,9,0,-1\n2,0,0,-1\n";
        let t = made(text, Interpolation::Cubic).repeated();
        assert_eq!((t.duration_s(), t.rows()), (2.0, 3));
        assert_eq!(t.sample(7.0).position, [9.0, 0.0, -1.0]);
    }

    #[test]
    fn a_cursor_changes_nothing_but_the_time_taken() {
        let mut text = String::from("t_s,x_mm,y_mm,z_mm\n");
        let mut clock = 0.0;
        for i in 0..500 {
            clock += 0.001 + 0.05 * uniform(9, i);
            text += &format!("{clock},{},{},{}\n", uniform(1, i), uniform(2, i), uniform(3, i));
        }
        let t = made(&text, Interpolation::Cubic);
        let mut cursor = Cursor::default();
        for i in 0..20_000 {
            // Forward at 1 kHz, and now and then a jump anywhere.
            let at = if i % 97 == 0 { t.duration_s() * uniform(4, i) } else { i as f64 * 1e-3 };
            assert_eq!(t.sample_from(&mut cursor, at), t.sample(at));
        }
        assert_eq!(t.sample_from(&mut Cursor(usize::MAX), 0.3), t.sample(0.3));
    }

    /// No overshoot: positions stay between the two rows around them.
    #[test]
    fn the_cubic_stays_between_its_rows() {
        let mut text = String::from("t_s,x_mm,y_mm,z_mm\n");
        for i in 0..200 {
            text += &format!("{},{},0,0\n", i as f64 * 0.02, (uniform(7, i) * 40.0).round() * 0.055);
        }
        let t = made(&text, Interpolation::Cubic);
        for i in 0..199 {
            let (a, b) = (t.position[i][0], t.position[i + 1][0]);
            for k in 0..=10 {
                let v = t.sample((i as f64 + f64::from(k) / 10.0) * 0.02).position[0];
                assert!(v >= a.min(b) - 1e-12 && v <= a.max(b) + 1e-12);
            }
        }
    }

    /// Rms error in mm/s of the velocity at 500 Hz behind a 20 Hz low-pass, of a 60 mm, 0.6 s movement
    /// recorded at about 30 Hz. The reference is the true velocity behind the same filter.
    fn velocity_error(kind: Interpolation) -> f64 {
        let (way, time, start) = (60.0, 0.6, 0.2);
        let truth = |t: f64| way * minimum_jerk((t - start) / time);
        let mut text = String::from("t_s,x_mm,y_mm,z_mm\n");
        let (mut clock, mut n) = (0.0, 0);
        while clock < 1.2 {
            text += &format!("{clock},{},0,0\n", truth(clock));
            n += 1;
            clock += 0.020 + 0.027 * uniform(5, n);
        }
        let t = made(&text, kind);
        // Two poles at 20 Hz.
        let low_pass = |[v, w]: [f64; 2], x: f64| {
            let v = v + 0.22 * (x - v);
            [v, w + 0.22 * (v - w)]
        };
        let (mut recorded, mut true_, mut sum) = ([0.0; 2], [0.0; 2], 0.0);
        let mut before = truth(0.0);
        for i in 1..550 {
            let at = f64::from(i) * 0.002;
            let x = t.sample(at).position[0];
            recorded = low_pass(recorded, (x - before) / 0.002);
            true_ = low_pass(true_, (truth(at) - truth(at - 0.002)) / 0.002);
            before = x;
            sum += (recorded[1] - true_[1]).powi(2);
        }
        (sum / 549.0_f64).sqrt()
    }

    #[test]
    fn cubic_gives_better_velocity_from_slow_irregular_rows() {
        let (cubic, line) = (velocity_error(Interpolation::Cubic), velocity_error(Interpolation::Linear));
        println!("velocity error, mm/s rms: cubic {cubic:.3}, linear {line:.3}");
        assert!(cubic < 0.5 * line, "cubic {cubic}, linear {line}");
    }

    /// ```python
    /// from scipy.interpolate import PchipInterpolator as P
    /// x = [0, 0.021, 0.05, 0.062, 0.11, 0.14]; y = [0, 1.5, 2.0, 5.0, 4.0, 4.5]
    /// p = P(x, y); print(p.derivative()(x), p([0.01, 0.04, 0.055, 0.08, 0.12, 0.139]))
    /// ```
    #[test]
    fn slopes_and_values_are_those_of_scipy() {
        let x = [0.0, 0.021, 0.05, 0.062, 0.11, 0.14];
        let y = [0.0, 1.5, 2.0, 5.0, 4.0, 4.5];
        let d = pchip_slopes(&x, &y);
        for (got, want) in d.iter().zip(SCIPY_SLOPES) {
            assert!((got - want).abs() < 1e-9 * (1.0 + want.abs()), "{d:?}");
        }
        for (t, want) in [0.01, 0.04, 0.055, 0.08, 0.12, 0.139].into_iter().zip(SCIPY_VALUES) {
            let i = x.partition_point(|v| *v <= t) - 1;
            let h = x[i + 1] - x[i];
            let got = hermite(y[i], y[i + 1], d[i], d[i + 1], h, (t - x[i]) / h);
            assert!((got - want).abs() < 1e-9, "{t}: {got} {want}");
        }
    }

    const SCIPY_SLOPES: [f64; 6] =
        [94.18719211822662, 28.713629402756503, 36.67262969588551, 0.0, 0.0, 31.08974358974358];
    const SCIPY_VALUES: [f64; 6] = [
        0.883275209212878,
        1.7700956733457556,
        3.1908666269131376,
        4.68359375,
        4.060541310541311,
        4.469318732193732,
    ];
}
