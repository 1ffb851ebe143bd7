//! A scripted stroke: movements from rest to rest.

use super::{Sample, Tremor, minimum_jerk, quantise};

/// A minimum-jerk movement to a point. It is a pause if the point stays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// End in mm: x, y, z.
    pub to: [f64; 3],
    /// Time in seconds; not above 0 counts as 0.
    pub seconds: f64,
}

/// Minimum-jerk movements one after another, with tremor, rounded like a sensor. A function of time
/// alone: samples may be taken in any order. They have no force and no speed.
#[derive(Clone, Debug)]
pub struct Itinerary {
    /// End of each movement in seconds. There is one more point than movements.
    ends: Vec<f64>,
    points: Vec<[f64; 3]>,
    tremor: Tremor,
    quantum_mm: f64,
}

impl Itinerary {
    /// Movements from `start` (mm). Positions are rounded to multiples of `quantum_mm`, unless it is 0.
    pub fn new(start: [f64; 3], moves: &[Move], tremor: Tremor, quantum_mm: f64) -> Self {
        let mut end = 0.0;
        let ends = moves
            .iter()
            .map(|m| {
                end += m.seconds.max(0.0);
                end
            })
            .collect();
        let points = std::iter::once(start).chain(moves.iter().map(|m| m.to)).collect();
        Self { ends, points, tremor, quantum_mm }
    }

    /// Time until the last movement ends in seconds.
    pub fn duration_s(&self) -> f64 {
        self.ends.last().copied().unwrap_or(0.0)
    }

    /// The stylus at `t` seconds. Before 0 and after the end it rests, with tremor. Does not allocate.
    pub fn sample(&self, t: f64) -> Sample {
        let i = self.ends.partition_point(|end| *end <= t);
        let from = self.points[i];
        let tremor = self.tremor.at(t);
        let position = match (self.points.get(i + 1), self.ends.get(i)) {
            (Some(to), Some(end)) => {
                let begin = if i == 0 { 0.0 } else { self.ends[i - 1] };
                let part = minimum_jerk((t - begin) / (end - begin));
                [0, 1, 2].map(|k| from[k] + part * (to[k] - from[k]))
            }
            _ => from,
        };
        let position = [0, 1, 2].map(|k| quantise(position[k] + tremor[k], self.quantum_mm));
        Sample { position, ..Sample::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_met_on_time_and_the_ends_are_held() {
        let moves = [
            Move { to: [10.0, 0.0, 0.0], seconds: 1.0 },
            Move { to: [10.0, 0.0, 0.0], seconds: 0.5 },
            Move { to: [10.0, 4.0, -1.0], seconds: 0.0 },
            Move { to: [0.0, 4.0, -1.0], seconds: 2.0 },
        ];
        let it = Itinerary::new([0.0; 3], &moves, Tremor::new(0.0, 0), 0.0);
        assert_eq!(it.duration_s(), 3.5);
        for (t, want) in [
            (-1.0, [0.0, 0.0, 0.0]),
            (0.5, [5.0, 0.0, 0.0]),
            (1.2, [10.0, 0.0, 0.0]),
            (1.5, [10.0, 4.0, -1.0]),
            (2.5, [5.0, 4.0, -1.0]),
            (9.0, [0.0, 4.0, -1.0]),
        ] {
            assert_eq!(it.sample(t).position, want, "{t}");
        }
        assert_eq!(Itinerary::new([1.0; 3], &[], Tremor::new(0.0, 0), 0.0).sample(3.0).position, [1.0; 3]);
    }
}
