//! An allocator that counts what threads allocate and free, and the bytes that they hold. A program declares
//! it as its
//! `#[global_allocator]`.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};

/// The system's allocator; what it counts is told by [`look`].
pub struct Counting;

static EVERY_THREAD: AtomicBool = AtomicBool::new(false);
static BOUND_THREADS: AtomicBool = AtomicBool::new(false);
static TAKEN: AtomicU64 = AtomicU64::new(0);
static FREED: AtomicU64 = AtomicU64::new(0);

thread_local! {
    static BOUND: Cell<bool> = const { Cell::new(false) };
    /// Allocations and frees of the thread since it was bound.
    static OWN: Cell<(u64, u64)> = const { Cell::new((0, 0)) };
    /// Bytes that the thread took and did not free, and the most of them since [`held`] began.
    static BYTES: Cell<(i64, i64)> = const { Cell::new((0, 0)) };
}

/// Who is looked at.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Who {
    /// All threads of the program.
    Everyone,
    /// Those that said [`bind`].
    Bound,
    /// None.
    Nobody,
}

/// Looks at these threads from now on; counts from 0.
pub fn look(who: Who) {
    if who != Who::Nobody {
        TAKEN.store(0, SeqCst);
        FREED.store(0, SeqCst);
    }
    EVERY_THREAD.store(who == Who::Everyone, SeqCst);
    BOUND_THREADS.store(who == Who::Bound, SeqCst);
}

/// Says that this thread must not allocate from now on, or that it may again.
pub fn bind(bound: bool) {
    if bound {
        OWN.set((0, 0));
    }
    BOUND.set(bound);
}

/// Allocations and frees of this thread alone while it was bound, whoever is looked at.
pub fn own() -> (u64, u64) {
    OWN.get()
}

/// Allocations and frees since [`look`].
pub fn touched() -> (u64, u64) {
    (TAKEN.load(SeqCst), FREED.load(SeqCst))
}

/// Allocations and frees of some threads during something.
pub fn counted(who: Who, what: impl FnOnce()) -> u64 {
    look(who);
    what();
    look(Who::Nobody);
    let (taken, freed) = touched();
    taken + freed
}

/// Runs something; its answer, and how often this thread allocated and freed meanwhile.
///
/// # Panics
///
/// Where [`Counting`] is not the program's allocator.
pub fn allocations<T>(what: impl FnOnce() -> T) -> (T, u64) {
    bind(true);
    drop(std::hint::black_box(Box::new(1_u8)));
    assert_eq!(own(), (1, 1), "the program's allocator must be `Counting`");
    bind(true);
    let answer = what();
    bind(false);
    let (taken, freed) = own();
    (answer, taken + freed)
}

/// Panics where an allocation and a free of these threads, of which this is one, are not counted.
pub fn assert_it_counts(who: Who) {
    let seen = counted(who, || drop(std::hint::black_box(vec![1_u8; 64])));
    assert!(seen >= 2, "the instrument must see an allocation");
}

/// Bytes that this thread holds more than before: at most while something ran, and after it. What another
/// thread frees counts as held, so this is for what keeps to one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    pub most: i64,
    pub left: i64,
}

/// Runs something on this thread; what it answered, and what it held.
pub fn held<T>(what: impl FnOnce() -> T) -> (T, Held) {
    let (before, most_before) = BYTES.get();
    BYTES.set((before, before));
    let answer = what();
    let (after, most) = BYTES.get();
    BYTES.set((after, most.max(most_before)));
    (answer, Held { most: most - before, left: after - before })
}

fn hold(bytes: i64) {
    let (now, most) = BYTES.get();
    BYTES.set((now + bytes, most.max(now + bytes)));
}

fn note(taken: u64, freed: u64) {
    let bound = BOUND.get();
    if bound {
        let (t, f) = OWN.get();
        OWN.set((t + taken, f + freed));
    }
    if EVERY_THREAD.load(SeqCst) || (BOUND_THREADS.load(SeqCst) && bound) {
        TAKEN.fetch_add(taken, SeqCst);
        FREED.fetch_add(freed, SeqCst);
    }
}

/// A size as a number that can be taken away; no allocation is larger.
fn size(bytes: usize) -> i64 {
    i64::try_from(bytes).unwrap_or(i64::MAX)
}

// SAFETY: everything is the system's own; counting touches no memory but atomics and cells of the thread
// without a destructor.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note(1, 0);
        hold(size(layout.size()));
        // SAFETY: the caller's promise, here and below.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        note(1, 0);
        hold(size(layout.size()));
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, new: usize) -> *mut u8 {
        note(1, 1);
        hold(size(new) - size(layout.size()));
        // SAFETY: as above.
        unsafe { System.realloc(at, layout, new) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        note(0, 1);
        hold(-size(layout.size()));
        // SAFETY: as above.
        unsafe { System.dealloc(at, layout) }
    }
}
