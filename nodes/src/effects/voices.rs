//! Kernels for every slot. Those of one slot are on at a time.

use crate::prelude::*;

use super::pick;

/// A player of one setting of an effect.
pub(super) trait Voice: Clone {
    /// Starts anew.
    fn reset(&mut self);
    /// State of the voice, of one size for all voices of a node.
    fn state(&mut self, state: &mut State<'_>);
}

/// The voices of every slot. Those of a slot that comes on start anew, so that nothing depends on the time
/// before.
pub(super) struct Voices<V> {
    slots: Vec<Vec<V>>,
    on: Option<usize>,
    /// Largest number of voices of a slot, and a voice in place of those that a slot lacks. So all states are
    /// of one size.
    most: usize,
    spare: Option<V>,
}

impl<V: Voice> Voices<V> {
    pub(super) fn new(slots: Vec<Vec<V>>) -> Self {
        let most = slots.iter().map(Vec::len).max().unwrap_or(0);
        let spare = slots.iter().flatten().next().cloned();
        Self { slots, on: None, most, spare }
    }

    /// Switches to the slot that a number picks. Returns whether that is another slot than before.
    pub(super) fn turn(&mut self, slot: f64) -> bool {
        let on = pick(slot, self.slots.len());
        if on == self.on {
            return false;
        }
        self.on = on;
        self.on().iter_mut().for_each(V::reset);
        true
    }

    /// The voices that are on.
    pub(super) fn on(&mut self) -> &mut [V] {
        self.on.and_then(|slot| self.slots.get_mut(slot)).map_or(&mut [], Vec::as_mut_slice)
    }

    /// Number of slots.
    pub(super) fn count(&self) -> usize {
        self.slots.len()
    }

    /// Switches to no slot.
    pub(super) fn reset(&mut self) {
        self.on = None;
    }

    /// The slot that is on, and the state of its voices. A slot that does not exist is refused.
    pub(super) fn state(&mut self, state: &mut State<'_>) {
        let mut on = self.on;
        state.keep(&mut on);
        self.on = on.filter(|slot| *slot < self.slots.len());
        state.require(self.on == on);
        for i in 0..self.most {
            let on = self.on.and_then(|slot| self.slots.get_mut(slot)?.get_mut(i));
            if let Some(voice) = on.or(self.spare.as_mut()) {
                voice.state(state);
            }
        }
    }
}
