//! One thing that two threads may take, where neither ever waits for the other.

use std::cell::UnsafeCell;
use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicBool, Ordering::*};

/// Holds something for whoever comes first.
#[derive(Debug)]
pub(super) struct Slot<T> {
    taken: AtomicBool,
    cell: UnsafeCell<Option<T>>,
}

// SAFETY: the cell is reached through an `Entered` only, and `taken` lets one exist at a time; what is in it moves between threads.
unsafe impl<T: Send> Sync for Slot<T> {}

impl<T> Slot<T> {
    pub(super) fn new(what: T) -> Self {
        Self { taken: AtomicBool::new(false), cell: UnsafeCell::new(Some(what)) }
    }

    /// What is in the slot, until the answer is dropped; `None` where another thread has it at the moment.
    pub(super) fn enter(&self) -> Option<Entered<'_, T>> {
        (!self.taken.swap(true, Acquire)).then(|| Entered { slot: self })
    }
}

/// The sole access to a slot.
pub(super) struct Entered<'a, T> {
    slot: &'a Slot<T>,
}

impl<T> Deref for Entered<'_, T> {
    type Target = Option<T>;

    fn deref(&self) -> &Option<T> {
        // SAFETY: this is the only `Entered` of the slot, and it is borrowed.
        unsafe { &*self.slot.cell.get() }
    }
}

impl<T> DerefMut for Entered<'_, T> {
    fn deref_mut(&mut self) -> &mut Option<T> {
        // SAFETY: this is the only `Entered` of the slot, and it is borrowed mutably.
        unsafe { &mut *self.slot.cell.get() }
    }
}

impl<T> Drop for Entered<'_, T> {
    fn drop(&mut self) {
        self.slot.taken.store(false, Release);
    }
}
