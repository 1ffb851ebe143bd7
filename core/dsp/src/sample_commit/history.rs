//! The frames still in use.

use super::rescaled;
use crate::float::keep_wide;
use crate::{Float, Framing};
use asperity_state::State;

/// One frame of magnitudes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot<T> {
    /// First sample of the frame.
    pub(super) start: i64,
    /// Largest magnitude; 0 for silence.
    pub(super) peak: T,
}

/// Consecutive frames: the newest one and as many before it as there are slots.
#[derive(Debug)]
pub(super) struct History<T> {
    framing: Framing,
    slots: Vec<Slot<T>>,
    /// Magnitudes, slot by slot, on the kernel's internal scale.
    mags: Vec<T>,
    /// Number of the first frame, and of the one after the newest.
    first: u64,
    next: u64,
}

impl<T: Float> History<T> {
    pub(super) fn new(framing: Framing, slots: usize) -> Self {
        let slots = slots.max(1);
        Self {
            framing,
            slots: vec![Slot { start: 0, peak: T::zero() }; slots],
            mags: vec![T::zero(); slots * framing.bins],
            first: 0,
            next: 0,
        }
    }

    pub(super) fn clear(&mut self) {
        (self.first, self.next) = (0, 0);
    }

    /// Number of the next frame; none before the first.
    pub(super) fn expected(&self) -> Option<u64> {
        (self.next > self.first).then_some(self.next)
    }

    /// The frames from the newest back.
    pub(super) fn all(&self) -> impl Iterator<Item = (Slot<T>, &[T])> {
        let known = (self.next - self.first).min(self.slots.len() as u64);
        (0..known).map(|age| {
            let at = self.place(self.next - 1 - age);
            (self.slots[at], &self.mags[at * self.framing.bins..][..self.framing.bins])
        })
    }

    /// The frame `age` frames before the newest, if there is one.
    pub(super) fn get(&self, age: u64) -> Option<(Slot<T>, &[T])> {
        self.all().nth(age as usize)
    }

    /// Number of frames, from the newest back, that start after `sample`.
    pub(super) fn starting_after(&self, sample: i64) -> u64 {
        self.all().take_while(|(slot, _)| slot.start > sample).count() as u64
    }

    /// Adds silent frames before number `index`, for those that are missing.
    pub(super) fn miss_until(&mut self, index: u64) {
        // More frames than slots would overwrite each other.
        self.next = self.next.max(index.saturating_sub(self.slots.len() as u64));
        while self.next < index {
            self.add::<T>(&[], T::MAX, T::one());
        }
    }

    /// Adds the frame after the newest, or any frame after [`clear`](Self::clear), limited, times `factor`.
    pub(super) fn add_at<P: Float>(&mut self, index: u64, magnitudes: &[P], most: P, factor: T) {
        if self.next == self.first {
            (self.first, self.next) = (index, index);
        }
        self.add(magnitudes, most, factor);
    }

    fn add<P: Float>(&mut self, magnitudes: &[P], most: P, factor: T) {
        let at = self.place(self.next);
        let bins = self.framing.bins;
        let mags = &mut self.mags[at * bins..(at + 1) * bins];
        mags.fill(T::zero());
        for (to, &m) in mags.iter_mut().zip(magnitudes).filter(|(_, m)| usable(**m)) {
            let m = if m > most { most } else { m };
            *to = m.to::<T>() * factor;
        }
        let peak = largest(mags);
        self.slots[at] = Slot { start: self.start(self.next), peak };
        self.next += 1;
    }

    /// Largest magnitude of all frames.
    pub(super) fn peak(&self) -> T {
        self.all().fold(T::zero(), |peak, (slot, _)| if slot.peak > peak { slot.peak } else { peak })
    }

    pub(super) fn rescale(&mut self, factor: f64) {
        self.mags.iter_mut().for_each(|m| *m = rescaled(*m, factor));
        self.slots.iter_mut().for_each(|s| s.peak = rescaled(s.peak, factor));
    }

    /// Saves or restores magnitudes and numbers; starts and peaks follow from them.
    pub(super) fn state(&mut self, state: &mut State<'_>) {
        keep_wide(&mut self.mags, state);
        state.keep(&mut self.first).keep(&mut self.next);
        if !state.restores() {
            return;
        }
        if state.failed() || self.first > self.next || !self.mags.iter().all(|&m| usable(m)) {
            self.clear();
            return state.refuse();
        }
        let known = (self.next - self.first).min(self.slots.len() as u64);
        for index in self.next - known..self.next {
            let at = self.place(index);
            let start = self.start(index);
            let peak = largest(&self.mags[at * self.framing.bins..][..self.framing.bins]);
            self.slots[at] = Slot { start, peak };
        }
    }

    fn start(&self, index: u64) -> i64 {
        i64::try_from(self.framing.start(index)).unwrap_or(i64::MAX)
    }

    fn place(&self, index: u64) -> usize {
        (index % self.slots.len() as u64) as usize
    }
}

/// Largest usable magnitude.
pub(super) fn largest<T: Float>(magnitudes: &[T]) -> T {
    magnitudes.iter().fold(T::zero(), |a, &m| if m > a && usable(m) { m } else { a })
}

/// Whether a number is a magnitude: finite and not negative.
pub(super) fn usable<T: Float>(m: T) -> bool {
    m >= T::zero() && m <= T::MAX
}
