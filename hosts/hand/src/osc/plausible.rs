//! Doubts about units: numbers that no hand has.

use super::arguments::Reading;

/// A hand is within this distance of its origin \[mm\].
const FAR_MM: f64 = 3000.0;
/// A hand presses with less \[N\].
const STRONG_N: f64 = 100.0;
/// A stylus whose places stay this near to the origin \[mm\] is one whose places are in m.
const NEAR_MM: f64 = 1.5;
/// Less motion than this \[mm\] is noise of a tracker at rest.
const STILL_MM: f64 = 0.02;
/// So many readings make a doubt of places that are too near: some seconds of any tracker.
const MANY: u32 = 1000;

/// Watches readings, and tells each doubt once.
#[derive(Debug, Default)]
pub(super) struct Plausible {
    told: [bool; 3],
    heard: u32,
    /// Least and largest of each axis \[mm\].
    range: [[f64; 2]; 3],
}

impl Plausible {
    /// The doubt that a reading raises, for a person.
    pub(super) fn doubt(&mut self, reading: &Reading) -> Option<String> {
        let far = reading.position.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        if far > FAR_MM && !std::mem::replace(&mut self.told[0], true) {
            return Some(format!(
                "a place {far:.0} mm from the origin came: is its unit right in `arguments`? \
                 `x_mm` is in mm, `x_m` in m"
            ));
        }
        if reading.force > STRONG_N && !std::mem::replace(&mut self.told[1], true) {
            return Some(format!(
                "a force of {:.0} N came: is its unit right in `arguments`? `force_n` is in N, `force_gf` \
                 in gram-force, and `pressure` goes from 0 to 1",
                reading.force
            ));
        }
        if self.told[2] {
            return None;
        }
        for (range, x) in self.range.iter_mut().zip(reading.position) {
            *range = if self.heard == 0 { [x, x] } else { [range[0].min(x), range[1].max(x)] };
        }
        if far > NEAR_MM {
            // It is far enough once and for all.
            self.told[2] = true;
            return None;
        }
        self.heard = self.heard.saturating_add(1);
        let moved = self.range.iter().fold(0.0_f64, |most, [low, high]| most.max(high - low));
        if self.heard < MANY || moved < STILL_MM {
            return None;
        }
        self.told[2] = true;
        Some(format!(
            "in {MANY} messages the stylus moved by {moved:.2} mm, near the origin: are its places in m? \
             Then write `x_m` in `arguments`, not `x_mm`"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doubts(readings: impl IntoIterator<Item = ([f64; 3], f64)>) -> Vec<String> {
        let mut plausible = Plausible::default();
        let reading = |(position, force)| Reading { position, force, ..Reading::default() };
        readings.into_iter().filter_map(|it| plausible.doubt(&reading(it))).collect()
    }

    /// A circle of so many mm around a place, for 2000 readings.
    fn circle(radius: f64, x: f64) -> impl Iterator<Item = ([f64; 3], f64)> {
        (0..2000).map(move |k| {
            let turn = 0.01 * f64::from(k);
            ([x + radius * turn.cos(), radius * turn.sin(), -0.001], 1.0)
        })
    }

    #[test]
    fn metres_taken_for_mm_are_doubted_once() {
        let all = doubts(circle(0.016, 0.1));
        assert!(all.len() == 1 && all[0].contains("are its places in m?"), "{all:?}");
    }

    #[test]
    fn mm_taken_for_metres_are_doubted_once() {
        let all = doubts(circle(16_000.0, 0.0));
        assert!(all.len() == 1 && all[0].contains("`x_mm` is in mm"), "{all:?}");
    }

    #[test]
    fn forces_beyond_100_n_are_doubted_once() {
        let all = doubts(circle(16.0, 0.0).map(|(place, _)| (place, 250.0)));
        assert!(all.len() == 1 && all[0].contains("a force of 250 N"), "{all:?}");
    }

    #[test]
    fn strokes_and_a_stylus_at_rest_are_not_doubted() {
        assert_eq!(doubts(circle(16.0, 0.0)), [""; 0]);
        assert_eq!(doubts(circle(16.0, 2000.0)), [""; 0]);
        assert_eq!(doubts(circle(0.3, 120.0)), [""; 0]);
        assert_eq!(doubts(circle(0.0, 0.0)), [""; 0]);
    }
}
