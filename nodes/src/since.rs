//! Time since the last valid position. Ticks may be lost, and positions may be invalid.

use crate::prelude::*;

/// Counts the runs of a node since the last valid position.
pub(crate) struct Since {
    every: u64,
    at: Option<u64>,
}

impl Since {
    /// For a node that runs every `every` ticks. There was no valid position yet.
    pub(crate) fn new(every: u32) -> Self {
        Self { every: u64::from(every), at: None }
    }

    /// Notes a valid position in this tick. Returns the runs since the last one: at least 1, and 1 for the
    /// first.
    pub(crate) fn runs(&mut self, tick: u64) -> u64 {
        let before = self.at.replace(tick);
        before.map_or(1, |at| (tick.saturating_sub(at) / self.every.max(1)).max(1))
    }

    /// Forgets the last valid position.
    pub(crate) fn reset(&mut self) {
        self.at = None;
    }

    /// Tick of the last valid position.
    pub(crate) fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_count_from_last_position_and_first_is_one_run() {
        let mut since = Since::new(2);
        assert_eq!([1000, 1002, 1004, 1024, 1024].map(|tick| since.runs(tick)), [1, 1, 1, 10, 1]);
        since.reset();
        assert_eq!([5000, 5006].map(|tick| since.runs(tick)), [1, 3]);
        let mut bytes = vec![0; State::measure(|s| since.state(s))];
        State::save(&mut bytes, |s| since.state(s)).unwrap();
        let mut other = Since::new(1);
        assert!(State::restore(&bytes, |s| other.state(s)));
        assert_eq!(other.runs(5010), 4);
    }
}
