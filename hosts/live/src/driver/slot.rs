//! A value that two threads may take without waiting for each other.

use std::cell::UnsafeCell;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicBool, Ordering::*};

/// Holds a value for the thread that enters first.
#[derive(Debug)]
pub(crate) struct Slot<T> {
    taken: AtomicBool,
    cell: UnsafeCell<Option<T>>,
}

// SAFETY: a shared slot gives access to the cell only through an `Entered`, and only one exists at a time:
// `enter` makes it after it has changed `taken` from false to true, and only its drop sets `taken` back.
// The drop's Release and the next `enter`'s Acquire order all accesses. So the `T` moves between threads,
// which `Send` allows, and is never used by two.
unsafe impl<T: Send> Sync for Slot<T> {}

impl<T> Slot<T> {
    pub(crate) fn new(what: T) -> Self {
        Self { taken: AtomicBool::new(false), cell: UnsafeCell::new(Some(what)) }
    }

    /// Access to the value, until the result is dropped; `None` while another thread has access.
    pub(crate) fn enter(&self) -> Option<Entered<'_, T>> {
        (!self.taken.swap(true, Acquire)).then(|| Entered { slot: self, as_if: PhantomData })
    }
}

/// Sole access to a slot. Its drop, also by a panic, releases the slot.
pub(crate) struct Entered<'a, T> {
    slot: &'a Slot<T>,
    /// Stands for a mutable borrow. Without this, `Entered` would be `Sync` for a `T` that is only `Send`.
    as_if: PhantomData<&'a mut Option<T>>,
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// Has two candidates for `what` if the type is `Sync`; then naming it does not compile.
    trait NotSync<Which> {
        fn what() {}
    }
    impl<T: ?Sized> NotSync<()> for T {}
    impl<T: ?Sized + Sync> NotSync<u8> for T {}

    #[test]
    fn slot_access_is_send_but_not_sync() {
        <Entered<'static, Cell<u32>> as NotSync<_>>::what();
        fn crosses<T: Send>(_: &T) {}
        crosses(&Slot::new(Cell::new(0)).enter());
    }

    #[test]
    fn slot_admits_one_thread_at_a_time() {
        let slot = Slot::new(Cell::new(0_u64));
        let count = || {
            let mut entered = 0;
            while entered < 50_000 {
                if let Some(Some(cell)) = slot.enter().as_deref_mut() {
                    cell.set(cell.get() + 1);
                    entered += 1;
                }
            }
        };
        std::thread::scope(|s| {
            s.spawn(count);
            s.spawn(count);
        });
        assert_eq!(slot.enter().and_then(|mut e| e.take()).map(|c| c.get()), Some(100_000));
    }

    #[test]
    fn panic_inside_releases_the_slot() {
        let slot = Slot::new(1);
        let within = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let _entered = slot.enter().expect("it is free");
            assert!(slot.enter().is_none());
            std::panic::resume_unwind(Box::new(()));
        }));
        assert!(within.is_err() && slot.enter().is_some());
    }
}
