//! The grid on which frames are estimated. It is coarser than the signal's if only low bins are known.
//!
//! Frames of `bins` bins contain nothing above them. So the product of such a signal with a window
//! needs only a little more than twice as many samples a frame. A frame then need not start on a sample
//! of the grid: its window is shifted by the remaining fraction, and its phases are rotated by it.

use asperity_sdk::State;

/// A window of `length` samples as `size` samples of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    length: u32,
    size: u32,
}

/// Start of a frame: a sample of the grid, and `part / length` of one more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Sample of the grid.
    pub at: u64,
    /// The remainder, in `1 / length` samples of the grid.
    pub part: u32,
}

impl Grid {
    /// The grid for frames of `bins` bins of a transform of `length` samples.
    pub fn new(length: u32, bins: usize) -> Self {
        let length = length.max(1);
        // Synthesis and analysis window each widen a frame's band by two bins. A window shifted by a
        // fraction has its first sample at the wrong end, which must not weigh.
        let least = (2 * (bins as u64 + 4)).max(64);
        // A smaller gain is not worth it.
        if least * 5 / 4 >= u64::from(length) {
            return Self { length, size: length };
        }
        let size = (least as u32..length).find(|&n| n % 2 == 0 && smooth(n)).unwrap_or(length);
        Self { length, size }
    }

    /// Saves the parameters that identify a grid.
    pub fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.length).keep(&mut self.size);
    }

    /// Samples of the grid in a frame.
    pub fn size(self) -> usize {
        self.size as usize
    }

    /// Most samples of the grid between frames that start at most `hop` samples apart.
    pub fn span(self, hop: u64) -> usize {
        (u128::from(hop) * u128::from(self.size)).div_ceil(u128::from(self.length)) as usize + 1
    }

    /// Position of a frame that starts at sample `start` of the signal.
    pub fn place(self, start: u64) -> Place {
        let exact = u128::from(start) * u128::from(self.size);
        let length = u128::from(self.length);
        Place { at: (exact / length) as u64, part: (exact % length) as u32 }
    }

    /// Fraction of a sample of a position, in [0, 1).
    pub fn fraction(self, place: Place) -> f64 {
        f64::from(place.part) / f64::from(self.length)
    }
}

/// Whether a number has only the prime factors 2, 3 and 5, so that a transform of that length is fast.
fn smooth(n: u32) -> bool {
    let rest = [2, 3, 5].into_iter().fold(n, |mut n, p| {
        while n.is_multiple_of(p) {
            n /= p;
        }
        n
    });
    rest == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_is_coarse_for_few_bins_of_a_long_window() {
        assert_eq!(Grid::new(4800, 101).size(), 216);
        assert_eq!(Grid::new(4410, 101).size(), 216);
        assert_eq!(Grid::new(4410, 8).size(), 64);
        assert_eq!(Grid::new(250, 101).size(), 250);
        assert_eq!(Grid::new(50, 26).size(), 50);
        assert_eq!(Grid::new(4800, 2401).size(), 4800);
        assert_eq!(Grid::new(0, 0).size(), 1);
    }

    #[test]
    fn grid_positions_are_exact_far_out() {
        let grid = Grid::new(4410, 101);
        let far = u64::MAX / 4410 * 4410;
        assert_eq!(grid.place(far), Place { at: far / 4410 * 216, part: 0 });
        let place = grid.place(far + 89);
        assert_eq!((place.at - far / 4410 * 216, place.part), (4, 89 * 216 - 4 * 4410));
    }
}
