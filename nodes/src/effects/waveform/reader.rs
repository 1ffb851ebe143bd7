//! A texture that is recorded or drawn once and read by the distance travelled.
//!
//! # Reading
//!
//! The table holds values at equal distances and repeats. The distance is added up along the [`Path`], in
//! straight lines from sample to sample, forth and back alike. So it moves on smoothly between ticks. A sinc
//! of 16 values in a Kaiser window (beta 11) reads between the table's values. It reads from a copy with
//! twice as many values as are needed. Images and errors together are 99 dB below a wave at the edge of the
//! table's band, and 112 dB up to 0.86 of it.
//!
//! # Speed
//!
//! A faster stylus reads faster. Waves that pass half the audio rate would come back mirrored (aliasing). So
//! there are copies of the table of half, a quarter, .. of the band, each cut in frequency. One copy fades
//! into the next while the band's edge goes from 0.4 to 0.5 of the audio rate. At any speed, waves up to 0.16
//! of the audio rate are as in the table, and waves above half of it are left out. At speeds beyond the
//! coarsest copy, all waves are left out. The tables take four times the memory of the loop.
//!
//! # Level
//!
//! An [acceleration](WaveformQuantity::Acceleration) sounds as it was recorded at its reference speed, and at
//! others as `(v / reference)^exponent`. A [height](WaveformQuantity::Height) becomes the acceleration
//! `v^2 y''` with the second derivative along the path, from the table's spectrum. The part of the hand's own
//! acceleration, `y' v'`, is left out. In the level, speeds above 5 m/s count as 5 m/s.
//!
//! 96 samples take 3.6 us on a virtual AMD EPYC core; a table of 100 000 values is made in 25 ms.

use asperity_numbers::Elementary as _;
use std::sync::Arc;

use asperity_state::State;

use super::table::{WaveformQuantity, WaveformTable};
use crate::effects::bounds::length;
use crate::effects::gliding::Kernel;
use crate::effects::path::{Parts, Path};

/// Highest speed that counts for the level \[mm/s\].
const FASTEST_MM_S: f64 = 5000.0;
/// Speed below which the level of an exponent below 1 falls to nothing \[mm/s\].
const STILL_MM_S: f64 = 1.0;

/// A table that is read along a path.
#[derive(Clone, Debug)]
pub(crate) struct Reader {
    table: Arc<WaveformTable>,
    /// Position in the loop, in mm.
    distance_mm: f64,
    last: Option<[f64; 2]>,
}

impl Reader {
    /// A reader at the table's beginning.
    pub(crate) fn new(table: Arc<WaveformTable>) -> Self {
        Self { table, distance_mm: 0.0, last: None }
    }

    /// Factor of the table's values at a speed.
    #[inline]
    fn level(&self, speed_mm_s: f64) -> f64 {
        let speed = speed_mm_s.min(FASTEST_MM_S);
        match self.table.quantity() {
            // mm/s^2 to m/s^2
            WaveformQuantity::Height => 1e-3 * speed * speed,
            WaveformQuantity::Acceleration { reference_speed_mm_s, speed_exponent } => {
                let ratio = speed / reference_speed_mm_s;
                if speed_exponent == 1.0 {
                    ratio
                } else if speed_exponent == 2.0 {
                    ratio * ratio
                } else {
                    let still = if speed_exponent < 1.0 { (speed / STILL_MM_S).min(1.0) } else { 1.0 };
                    still * ratio.power(speed_exponent)
                }
            }
        }
    }
}

impl Kernel for Reader {
    /// Writes the samples of a tick in m/s^2, along the path that was [advanced](Path::advance) to it.
    fn process(&mut self, path: &Path, parts: &Parts, out: &mut [f64]) {
        let rate = parts.rate_hz();
        for (n, out) in out.iter_mut().enumerate() {
            let here = path.at(parts.at(n));
            let way_mm = match self.last {
                Some(last) => length(std::array::from_fn::<_, 2, _>(|i| here.position_mm[i] - last[i])),
                None => length(here.velocity_mm_s) / rate,
            };
            self.last = Some(here.position_mm);
            self.distance_mm += way_mm;
            let loop_mm = self.table.length_mm();
            if self.distance_mm >= loop_mm {
                self.distance_mm %= loop_mm;
            }
            *out = self.level(way_mm * rate) * self.table.read(self.distance_mm, way_mm);
        }
    }

    /// Forgets where the stylus was and goes on at the present position in the table. The stylus was put down
    /// elsewhere, so the distance between does not count.
    fn lift(&mut self) {
        self.last = None;
    }

    /// Goes back to the table's beginning.
    fn reset(&mut self) {
        (self.distance_mm, self.last) = (0.0, None);
    }

    /// Position in the table. Another table continues at the same distance.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.distance_mm).keep(&mut self.last);
        if state.restores() {
            let sound = (0.0..1e9).contains(&self.distance_mm)
                && self.last.is_none_or(|p| p.iter().all(|x| x.abs() < 1e12));
            if sound {
                self.distance_mm %= self.table.length_mm();
            } else {
                self.reset();
            }
            state.require(sound);
        }
    }
}

#[cfg(test)]
#[path = "reader_tests.rs"]
mod tests;
