//! Handles: numbers that C carries as pointers, and that are never followed.
//!
//! A handle has the kind of its object, a place in a table, and the count of objects that the place had
//! before. So a handle that was freed, that belongs to another kind or that is no handle at all is refused.
//! No thread waits for another here, but the one that frees.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use parking_lot::{Mutex, RwLock};

use crate::status::{ASPERITY_BUSY, ASPERITY_INVALID, Answer, Refusal};

/// Bits of a kind, and of a place.
const KIND: u32 = 2;
const PLACE: u32 = 12;
/// Most objects of a kind at once.
const MOST: usize = 1 << PLACE;

/// Longest wait for calls of other threads when an object is freed.
const END: Duration = Duration::from_secs(2);

/// Another thread is in a call that the handle allows to one thread at a time.
pub(crate) const IN_USE: Refusal =
    Refusal::fixed(ASPERITY_BUSY, c"another thread is in a call with this handle: one may be at a time");

const NULL: Refusal = Refusal::fixed(ASPERITY_INVALID, c"the handle is NULL");
const WRONG: Refusal = Refusal::fixed(ASPERITY_INVALID, c"this is no such handle, or it was freed");
const ENDING: Refusal = Refusal::fixed(ASPERITY_BUSY, c"another thread frees this handle");

/// Objects of a kind.
pub(crate) struct Table<T> {
    kind: usize,
    slots: [OnceLock<Box<RwLock<Slot<T>>>>; MOST],
    free: Mutex<Free>,
}

struct Slot<T> {
    /// The handle of the object, or of the next one.
    handle: usize,
    object: Option<T>,
}

/// Places that are free: those from `next` on, and some before.
struct Free {
    next: usize,
    earlier: Vec<usize>,
}

impl<T> Table<T> {
    /// An empty table. Each kind has another number from 1 to 3.
    pub(crate) const fn new(kind: usize) -> Self {
        let free = Mutex::new(Free { next: 0, earlier: Vec::new() });
        Self { kind, slots: [const { OnceLock::new() }; MOST], free }
    }

    /// Keeps an object. Allocates.
    pub(crate) fn insert(&self, object: T) -> Answer<usize> {
        let mut free = self.free.lock();
        let place = match free.earlier.pop() {
            Some(place) => place,
            None if free.next < MOST => {
                free.next += 1;
                free.next - 1
            }
            None => return Err(Refusal::busy(&format!("there are {MOST} such handles: free some"))),
        };
        drop(free);
        // Counted from 1, so that no small number is a handle.
        let first = 1 << (KIND + PLACE) | place << KIND | self.kind;
        let fresh = || Box::new(RwLock::new(Slot { handle: first, object: None }));
        let mut slot = self.slots[place].get_or_init(fresh).write();
        slot.object = Some(object);
        Ok(slot.handle)
    }

    /// Uses an object. Several threads may do so at once. Never blocks or allocates.
    pub(crate) fn with<R>(&self, handle: usize, function: impl FnOnce(&T) -> Answer<R>) -> Answer<R> {
        let slot = self.slot(handle)?.try_read().ok_or(ENDING)?;
        match &slot.object {
            Some(object) if slot.handle == handle => function(object),
            _ => Err(WRONG),
        }
    }

    /// Frees an object, once no other thread uses it. Waits up to 2 s for that. NULL is nothing to free.
    pub(crate) fn free(&self, handle: usize) -> Answer {
        if handle == 0 {
            return Ok(());
        }
        let slot = self.slot(handle)?;
        let began = Instant::now();
        // Woken by nobody, so that an audio thread never has to wake it.
        let mut slot = loop {
            match slot.try_write() {
                Some(slot) => break slot,
                None if began.elapsed() > END => return Err(IN_USE),
                None => std::thread::sleep(Duration::from_micros(200)),
            }
        };
        if slot.handle != handle {
            return Err(WRONG);
        }
        let object = slot.object.take().ok_or(WRONG)?;
        slot.handle = slot.handle.wrapping_add(1 << (KIND + PLACE));
        drop(slot);
        // Outside of the lock: it may take long.
        drop(object);
        self.free.lock().earlier.push(handle >> KIND & (MOST - 1));
        Ok(())
    }

    fn slot(&self, handle: usize) -> Answer<&RwLock<Slot<T>>> {
        if handle == 0 {
            return Err(NULL);
        }
        let slot = self.slots[handle >> KIND & (MOST - 1)].get();
        slot.filter(|_| handle & ((1 << KIND) - 1) == self.kind).map(|slot| &**slot).ok_or(WRONG)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn freed_foreign_and_made_up_handles_are_refused() {
        static ONE: Table<u32> = Table::new(1);
        static TWO: Table<u32> = Table::new(2);
        let first = ONE.insert(7).expect("room");
        let second = ONE.insert(8).expect("room");
        let read = |handle| ONE.with(handle, |x| Ok(*x)).ok();
        assert_eq!((read(first), read(second)), (Some(7), Some(8)));
        assert!(TWO.with(first, |x| Ok(*x)).is_err());
        for made_up in [0, 1, usize::MAX, first + (1 << (KIND + PLACE)), second << KIND] {
            assert_eq!(read(made_up), None, "{made_up:#x}");
        }
        assert!(ONE.free(first).is_ok());
        assert!(read(first).is_none() && ONE.free(first).is_err() && ONE.free(0).is_ok());
        // The next one takes its place, and not its handle.
        let third = ONE.insert(9).expect("room");
        assert_eq!((read(first), read(third), third & (MOST - 1)), (None, Some(9), first & (MOST - 1)));
    }

    #[test]
    fn full_table_refuses_until_one_is_freed() {
        static FULL: Table<usize> = Table::new(3);
        let all: Vec<usize> = (0..MOST).map(|i| FULL.insert(i).expect("room")).collect();
        assert!(FULL.insert(0).is_err());
        assert!(FULL.free(all[77]).is_ok());
        assert!(FULL.insert(0).is_ok() && FULL.insert(0).is_err());
    }

    #[test]
    fn freeing_waits_for_a_call_under_way() {
        static BUSY: Table<u32> = Table::new(1);
        let handle = BUSY.insert(1).expect("room");
        std::thread::scope(|scope| {
            let (inside, told) = std::sync::mpsc::channel();
            scope.spawn(move || {
                BUSY.with(handle, |_| {
                    let _ = inside.send(());
                    std::thread::sleep(Duration::from_millis(30));
                    Ok(())
                })
            });
            told.recv().expect("it is inside");
            assert!(BUSY.with(handle, |_| Ok(())).is_ok());
            assert!(BUSY.free(handle).is_ok());
        });
        assert!(BUSY.with(handle, |_| Ok(())).is_err());
    }
}
