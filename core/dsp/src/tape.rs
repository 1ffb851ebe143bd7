//! Samples in a row that moves along.

use crate::Float;
use crate::float::keep_wide;
use asperity_state::State;
use std::ops::{Deref, DerefMut};

/// A number of samples in one piece. The first are dropped, and zeros follow.
#[derive(Debug)]
pub(crate) struct Tape<T> {
    /// Twice as many, so that they are moved to the front only once a length. Those behind are 0.
    cells: Vec<T>,
    head: usize,
}

impl<T: Float> Tape<T> {
    pub(crate) fn new(len: usize) -> Self {
        Self { cells: vec![T::zero(); 2 * len], head: 0 }
    }

    /// Drops the first `count` samples.
    pub(crate) fn advance(&mut self, count: usize) {
        let len = self.len();
        if count >= len {
            return self.clear();
        }
        self.head += count;
        if self.head > len {
            self.cells.copy_within(self.head.., 0);
            self.cells[2 * len - self.head..].fill(T::zero());
            self.head = 0;
        }
    }

    pub(crate) fn clear(&mut self) {
        self.cells.fill(T::zero());
    }

    /// Saves or restores all samples; they are finite.
    pub(crate) fn state(&mut self, state: &mut State<'_>) {
        keep_wide(self, state);
        state.require(!state.restores() || self.iter().all(|x| x.finite()));
    }
}

impl<T> Deref for Tape<T> {
    type Target = [T];
    #[inline]
    fn deref(&self) -> &[T] {
        &self.cells[self.head..][..self.cells.len() / 2]
    }
}

impl<T> DerefMut for Tape<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        let len = self.cells.len() / 2;
        &mut self.cells[self.head..][..len]
    }
}
